"""The rates of flow against each other: short fields compose to long ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

from fedora_qa.checks.flow_rates.rates_suspects import Pair, rates_suspects, weigh_hypotheses
from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_chains import segments
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_rate_agreement import MOST_LOST, Deviation, RateAgreement, compare

_CLOSER_LOOKS: Final = 4

_MATTERS_PX: Final = 0.1
"""An endpoint error that no use of the flow would notice."""


@dataclass(frozen=True, slots=True)
class WindowComposition:
    """The common intervals that begin in a window, those that could not be compared, and what a closer look showed."""

    window: int
    segments: tuple[RateAgreement, ...] = ()
    not_compared: int = 0
    weighed: tuple[ConventionTrial, ...] = ()


class FlowRatesComposition(WindowCheck[WindowComposition]):
    """Do the fields of a faster rate compose to those of a slower one?

    Each pixel is followed along the fields of either rate, from the start of an interval that both cover to its end:
    five fields of 50 Hz lead where one of 10 Hz leads, two where one of 25 Hz does, five of 25 Hz where two of 10 Hz
    do. The distance of the two endpoints is the error in px: its median over the worst interval, its median over the
    worst of 48 tiles, and the share of pixels that only one of the rates carries out of the image.

    Why it matters
    --------------
    It needs neither depth nor pose nor frames, and it tells which of three rates is wrong: the two others agree. A
    rate stored under another's name, or one field out of place, shows at once.

    How
    ---
    Flow is read bilinearly between pixels of a lattice whose density the effort states. Paths within 4 px of breaks of
    the flow are left out, and those that get midway to a place where another surface leads, too, and hides them or is
    hidden: every fourth pixel of a field (from 880,000 pixels on every eighth) tells which flows lead where, and flows
    that differ by more than 0.5 px, and than the flow's slope makes of their distance, are of two surfaces. After an
    alarm the rate that disagrees with the others is named, and faults are undone on it (sign, axes, mirrors, unit,
    gain, neighbouring intervals, fields of another rate, repeated fields), on the pixels that are off where these are
    few.

    Noise model
    -----------
    Bounds, not spreads: each path has, of each field around the place where it is read, a quarter of the second
    differences (twice the bilinear error of a smooth surface) and half of the third (the step where two surfaces meet),
    and single-precision rounding of each field, all grown by the flow's slope from field to field. Medians must not
    exceed the bounds' medians.

    Cannot see
    ----------
    A fault that all rates share and that composes, such as a turned camera; which of only two rates is wrong; pixels
    that are hidden midway; faults of stamps, which change which fields are compared and nothing else.

    Sources
    -------
    First principles: Lagrange's remainder for the reading, `geometry/rigid_flow.py` for the rounding; the derivation
    stands in `estimators/flow/path_kernels.py`.
    """

    name = "flow_rates.composition"
    needs = ("flow",)

    def not_applicable(self, facts: Facts) -> str:
        """Say that there is nothing to compare with."""
        return "" if len(facts.flow_streams) > 1 else "there is one rate of flow only"

    def measure(self, window: Window) -> WindowComposition | None:
        """Compare every pair of rates over the intervals that begin in the window."""
        found, not_compared = [], 0
        for slow, fast in combinations(window.facts.flow_streams, 2):
            for segment in segments(window, slow, fast):
                if segment.slow.rows[0] % window.sampling.field_stride:
                    continue
                agreement = compare(window, segment)
                found += [agreement] if agreement else []
                not_compared += agreement is None
        return WindowComposition(window.span.index, tuple(found), not_compared)

    def follow_up_windows(self, state: list[WindowComposition], facts: Facts) -> tuple[int, ...]:
        """Ask for the windows of the worst intervals."""
        worst = sorted((-max((s.suspicion for s in one.segments), default=0.0), one.window) for one in state)
        return tuple(window for suspicion, window in worst[:_CLOSER_LOOKS] if suspicion < -1)

    def follow_up(self, state: list[WindowComposition], window: Window) -> None:
        """Undo faults on the window's worst interval of each pair of rates."""
        of_window = [s for one in state if one.window == window.span.index for s in one.segments]
        weighed: list[ConventionTrial] = []
        for group in _by_pair(of_window).values():
            worst = max(group, key=lambda one: one.suspicion)
            if worst.suspicion > 1:
                weighed += weigh_hypotheses(window, worst.segment)
        state.append(WindowComposition(window.span.index, weighed=tuple(weighed)))

    def conclude(self, state: Sequence[WindowComposition], facts: Facts) -> Observation:
        """State the endpoint error of each pair of rates."""
        pairs = _by_pair([segment for one in state for segment in one.segments])
        count = sum(len(group) for group in pairs.values())
        left_out = sum(one.not_compared for one in state)
        coverage = Coverage(count, count + left_out, "common intervals")
        if not pairs:
            return Observation(coverage, unobservable="no two rates cover a common interval by whole fields")
        weighed = [one for each in state for one in each.weighed]
        off = {pair: sum(one.suspicion > 1 for one in group) / len(group) for pair, group in pairs.items()}
        measured: list[Statistic] = []
        for pair, group in pairs.items():
            suspects = rates_suspects(pair, off, weighed) if off[pair] else ()
            measured += _measured(pair, group, facts, suspects)
        return Observation(coverage, tuple(measured))


def _by_pair(found: Sequence[RateAgreement]) -> Mapping[Pair, list[RateAgreement]]:
    pairs: dict[Pair, list[RateAgreement]] = {}
    for one in sorted(found, key=lambda one: one.segment.start_ns):
        pairs.setdefault((one.segment.slow.stream, one.segment.fast.stream), []).append(one)
    return pairs


def _measured(
    pair: Pair, group: Sequence[RateAgreement], facts: Facts, suspects: tuple[Suspect, ...]
) -> list[Statistic]:
    name = f"{pair[0]} by {pair[1].removeprefix('flow/')}"
    lost = max(group, key=lambda one: one.lost)
    measured = [
        Statistic(
            name=f"{name} leaving",
            value=lost.lost,
            unit="share",
            standard_error=0.0,
            model_error_bound=MOST_LOST,
            side="upper",
            statement=f"{lost.lost:.0%} of the pixels leave the image by {pair[0]} or by {pair[1]}, but not by both.",
            code="flow_rates.composition.leaving",
            where=_where([one for one in group if one.lost > MOST_LOST] or [lost], facts),
            suspects=suspects,
        )
    ]
    compared = [(one, one.whole, one.worst_tile) for one in group if one.whole and one.worst_tile]
    if compared:
        whole = max(compared, key=lambda each: each[1].suspicion)
        tile = max(compared, key=lambda each: each[2].suspicion)
        off = [one for one, deviation, _ in compared if deviation.suspicion > 1]
        off_tile = [one for one, _, deviation in compared if deviation.suspicion > 1]
        said = f"{len(off)} of {len(compared)} intervals are off"
        measured += [
            _error(f"{name} error", pair, whole[1], said, "error", _where(off or [whole[0]], facts), suspects),
            _error(f"{name} worst_tile", pair, tile[2], "in the worst tile", "tile",
                   replace(_where(off_tile or [tile[0]], facts), tile=tile[0].tile), suspects),
        ]  # fmt: skip
    return measured


def _error(
    name: str, pair: Pair, deviation: Deviation, said: str, rule: str, where: Where, suspects: tuple[Suspect, ...]
) -> Statistic:
    return Statistic(
        name=name,
        value=deviation.typical_px,
        unit="px",
        standard_error=0.0,
        model_error_bound=deviation.bound_px,
        side="upper",
        material=_MATTERS_PX,
        statement=f"{pair[0]} leads {deviation.typical_px:.3g} px away from where fields of {pair[1]} lead together, "
        f"and interpolation explains {deviation.bound_px:.1g} px; {said}.",
        code=f"flow_rates.composition.{rule}",
        where=where,
        suspects=suspects,
    )


def _where(group: Sequence[RateAgreement], facts: Facts) -> Where:
    first, last = group[0].segment, group[-1].segment
    return Where(
        stream=first.slow.stream,
        start_us=facts.to_file_us(first.start_ns),
        stop_us=facts.to_file_us(last.end_ns),
        index_start=first.slow.rows[0],
        index_stop=last.slow.rows[-1] + 1,
    )
