"""Materiality: from which size a deviation matters to those who publish a file or train on it.

A deviation is significant where it exceeds its limit, and material where it exceeds the limit by more than a size of
the table ``materiality.toml``. Significance follows from noise; the size follows from the use of the data.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from importlib import resources
from math import isfinite
from typing import Any, Final, Literal

import numpy as np

from fedora_qa.conventions import NS_PER_S
from fedora_qa.sequence.facts import Facts, has_place

Profile = Literal["release", "training", "strict"]

PROFILES: Final[tuple[Profile, ...]] = ("release", "training", "strict")


@dataclass(frozen=True, slots=True)
class MaterialityRow:
    """Sizes of one kind of deviation, or that every deviation of the kind matters.

    Attributes
    ----------
    codes
        Patterns of the codes of findings: ``*`` stands for any text.
    unit
        Of the sizes; empty where the row is exact.
    release, training
        Material sizes of the profiles: in ``unit``, as a share of the expected value where ``relative``, in ms over the
        whole file where ``drift``.
    release_px, training_px
        For parameters of the flow: the change of the flow, px, below which no deviation is material; None elsewhere.
    blind_from
        Detection limit in the unit of the measurement above which it is of no use; None: none.
    exact
        Whether every deviation matters.
    reason, source
        Why the sizes are not others, and from where they are taken.
    """

    codes: tuple[str, ...]
    reason: str
    unit: str = ""
    release: float = 0.0
    training: float = 0.0
    blind_from: float | None = None
    release_px: float | None = None
    training_px: float | None = None
    relative: bool = False
    drift: bool = False
    exact: bool = False
    source: str = ""

    def describes(self, code: str, unit: str) -> bool:
        """Return whether the row holds for measurements of a code in a unit."""
        if not self.exact and self.unit != unit:
            return False
        # Most patterns are codes. For each of the others fnmatch compiles a regular expression.
        return code in self.codes or any(fnmatchcase(code, pattern) for pattern in self.codes if "*" in pattern)


def _read_table() -> tuple[MaterialityRow, ...]:
    text = resources.files("fedora_qa.judgement").joinpath("materiality.toml").read_text(encoding="utf-8")
    rows: list[Mapping[str, Any]] = tomllib.loads(text)["row"]
    return tuple(MaterialityRow(**{**row, "codes": tuple(row["codes"])}) for row in rows)


MATERIALITY: Final = _read_table()


@cache
def materiality_row(code: str, unit: str) -> MaterialityRow | None:
    """Return the first row of the table for measurements of a code in a unit; None where there is none."""
    return next((row for row in MATERIALITY if row.describes(code, unit)), None)


@dataclass(frozen=True, slots=True)
class Materiality:
    """The material sizes of one file under a profile.

    Attributes
    ----------
    profile
        ``strict``: every significant deviation is material.
    duration_s
        From the first timestamp of the file to the last, s.
    """

    profile: Profile = "strict"
    duration_s: float = 0.0

    def size(self, code: str, unit: str, expected: float, effect_px: float | None = None) -> float:
        """Return the material size of a measurement.

        Parameters
        ----------
        code
            Of its finding.
        unit
            Of the measurement.
        expected
            The value that a correct file gives, in ``unit``.
        effect_px
            Root mean square change of the flow of the file by one unit of the measurement, px; None where the
            measurement is no parameter of the flow.

        Returns
        -------
        float
            In ``unit``; 0 where every deviation matters, as where the table has no row for the measurement.
        """
        row = materiality_row(code, unit)
        if self.profile == "strict" or row is None or row.exact:
            return 0.0
        size = row.release if self.profile == "release" else row.training
        if row.relative:
            return size * abs(expected) if isfinite(expected) else 0.0
        if row.drift:
            # A rate of 1 ppm adds up to 1e-3 ms within a second.
            return 1e3 * size / self.duration_s if self.duration_s > 0 else 0.0
        least_px = row.release_px if self.profile == "release" else row.training_px
        if least_px is not None and effect_px is not None and isfinite(effect_px) and effect_px > 0:
            # A parameter changes the flow by its size times the effect: 1% of 1 px is 0.01 px.
            return max(size, least_px / effect_px)
        return size


def materiality_of(profile: Profile, facts: Facts) -> Materiality:
    """Return the material sizes of a file under a profile."""
    # A timestamp without a place in time, such as NaN, makes no stream longer, and one stream makes no file longer.
    placed_ns = [clock.times_ns[has_place(clock.times_ns)] for clock in facts.clocks.values()]
    durations_ns = [float(np.ptp(times_ns)) for times_ns in placed_ns if len(times_ns)]
    if not durations_ns and facts.events is not None and facts.events.count:
        durations_ns = [float(facts.events.last_ns - facts.events.first_ns)]
    return Materiality(profile, float(np.median(durations_ns)) / NS_PER_S if durations_ns else 0.0)
