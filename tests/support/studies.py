"""Trials of imaginary corpora: what was planted, and what a check with a known limit would say of it."""

from collections.abc import Sequence
from math import erf, log, sqrt

import numpy as np

from fedora_qa.config import CheckConfig
from fedora_qa.power.manifest import CorpusItem, PlantedFault
from fedora_qa.power.study import CheckedFile, MeasuredDeviation, NamedCause, Trial
from fedora_qa.power.tables import Origin

CHECK = "event_response.timing"
CLEAN = "clean/day.h5"
ORIGIN = Origin(corpus="corpus", started="2024-05-01T12:00:00+00:00", config=CheckConfig())


def measurement(
    deviation: float = 0.0, least: float | None = 1.0, name: str = "offset", unit: str = "ms"
) -> MeasuredDeviation:
    """A measurement of ``CHECK`` that exceeds its limit where it deviates at all."""
    return MeasuredDeviation(CHECK, name, unit, "both", deviation, 0.0, least)


def clean(
    file: str = CLEAN, *, failed: Sequence[str] = (), stated: Sequence[MeasuredDeviation] = (measurement(),)
) -> Trial:
    """A clean file, which states that it would have seen a fault of 1 ms."""
    return Trial(CorpusItem(file), CheckedFile("0" * 64, tuple(failed), (), tuple(failed), tuple(stated), ()))


def faulty(
    number: int,
    *faults: PlantedFault,
    found: bool = True,
    material: bool = True,
    measurements: Sequence[MeasuredDeviation] = (),
    diagnoses: Sequence[NamedCause] = (),
) -> Trial:
    """A copy of the clean file with faults, of which ``CHECK`` says something where they are found."""
    item = CorpusItem(f"single/{number}.h5", base=CLEAN, faults=faults)
    failed = (CHECK,) if found else ()
    return Trial(
        item, CheckedFile("1" * 64, failed, (), failed if material else (), tuple(measurements), tuple(diagnoses))
    )


def late(number: int, size_ms: float, *, found: bool, named: str = "events:time_offset") -> Trial:
    """A file whose events are late, measured without error and named as said where that is found."""
    fault = PlantedFault("time_offset", "events", size_ms, "ms")
    verdict = NamedCause(named, size_ms, "ms", 0.1)
    return faulty(
        number,
        fault,
        found=found,
        measurements=(measurement(size_ms),) if found else (),
        diagnoses=(verdict,) if found else (),
    )


def study(limit_ms: float = 1.0, trials: int = 60, slope: float = 3.0) -> tuple[Trial, ...]:
    """A clean file and late ones of 0.1 to 10 ms, 95% of which are found at ``limit_ms``; the same every time."""
    rng = np.random.default_rng(7)
    sizes_ms = np.exp(rng.uniform(log(0.1), log(10.0), trials))
    half_ms = limit_ms / np.exp(1.645 / slope)
    chances = [(1 + erf(slope * log(size / half_ms) / sqrt(2))) / 2 for size in sizes_ms]
    answers = rng.random(trials) < chances
    return clean(), *(late(k, float(size), found=bool(answers[k])) for k, size in enumerate(sizes_ms))
