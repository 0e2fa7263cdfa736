"""How many events are read, against time and limits: ``make bench-readings`` writes docs/event-readings.md.

Each bound is set to less and to more than it is, the others left as they are, and one clean file is checked by what
reads events against light. Seconds are of the processor, decoding apart, all as a ratio to those of the bounds as set.
"""

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from unittest.mock import patch

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from fedora_qa.conventions import NS_PER_S
from fedora_qa.engine.plan import WINDOW_NS
from fedora_qa.engine.run import CheckOptions, check_file
from fedora_qa.estimators.events import frame_interpolation, levels
from tests.benchmarks.event_checks import cost_of

TARGET: Final = Path(__file__).parents[2] / "docs" / "event-readings.md"
SCENE, SIZE, DURATION_S = "park-day", (540, 405), 4.0
REPEATS: Final = 3

TIMING: Final = "event_response.timing"
THRESHOLD: Final = "event_response.threshold"
LIMITS: Final = ((TIMING, "time_offset", "ms"), (TIMING, "clock_rate", "ppm"), (THRESHOLD, "threshold_on", "%"))


@dataclass(frozen=True, slots=True)
class Bound:
    """A bound of an estimator, and the values it is tried with."""

    module: object
    name: str
    said: str
    tried: tuple[int, ...]

    @property
    def chosen(self) -> int:
        """The value as it is set."""
        value: int = getattr(self.module, self.name)
        return value


BOUNDS: Final = (
    Bound(
        frame_interpolation,
        "MOST_INTERPOLATED",
        "events read for timing, a window",
        (3_750, 7_500, 15_000, 30_000, 60_000),
    ),
    Bound(levels, "MOST_EVENTS", "events followed for thresholds, a window", (12_500, 25_000, 50_000, 400_000)),
    Bound(levels, "MOST_PAIRS", "pairs of readings taken for thresholds, a window", (1_250, 5_000, 20_000)),
)

HEAD: Final = """\
# How many events are read

What compares events with frames reads a bounded number of them in a window of 0.2 s: beyond it, every second, third,
... pixel. `make bench-readings` measures what each bound costs and what it leaves to be seen: {scene} of
{width}x{height}, {duration:g} s, {events:.0f} events a window in the mean, the density of `full`. Times are of the
processor, decoding apart, of `{timing}` and `{threshold}` together, in units of what they
take with the bounds as they are set (**bold**); limits are the `least_detectable` that they state.

| bound | value | time | {limits} |
| --- | --- | --- |{rules}
"""

TAIL: Final = """
Of a window that holds fewer events than a bound all are read. Readings for timing pay for what they cost: with a
quarter of them, limits are a third larger for three fifths of the time; so their bound lies where windows of usual
density end. Pairs for thresholds are bounded by frames, not by chance, and events followed for them cost next to
nothing: those bounds are there for windows of millions of events. Which pixels are left out follows from numbers of
events alone, so that records stay the same.
"""


@dataclass(frozen=True, slots=True)
class Told:
    """What checking took, and the limits that were stated, in the order of ``LIMITS``."""

    seconds: float
    limits: tuple[float | None, ...]


def page(told: Mapping[tuple[str, int], Told], events_a_window: float) -> Iterator[str]:
    """Yield the page: a row for each value of each bound."""
    limits = " | ".join(f"{name.replace('_', ' ')}, {unit}" for _, name, unit in LIMITS)
    yield HEAD.format(
        scene=SCENE, width=SIZE[0], height=SIZE[1], duration=DURATION_S, events=events_a_window, timing=TIMING,
        threshold=THRESHOLD, limits=limits, rules=" --- |" * len(LIMITS),
    )  # fmt: skip
    for bound in BOUNDS:
        whole = told[bound.name, bound.chosen].seconds
        for value in bound.tried:
            one = told[bound.name, value]
            shown = f"**{value}**" if value == bound.chosen else f"{value}"
            stated = " | ".join("-" if limit is None else f"{limit:.3g}" for limit in one.limits)
            yield f"| {bound.said} | {shown} | {one.seconds / whole:.2f} | {stated} |\n"
    yield TAIL


def told_by(path: Path) -> Told:
    """Check a file by what reads events against light: the fastest of some runs, and the limits that are stated."""
    seconds = min(sum(cost_of(path).by_check_s[name] for name in (TIMING, THRESHOLD)) for _ in range(REPEATS))
    results = check_file(path, CheckOptions(evidence=None, select=(TIMING, THRESHOLD))).record.results
    stated = {(result.check, one.name): one.least_detectable for result in results for one in result.measurements}
    return Told(seconds, tuple(stated.get((check, name)) for check, name, _ in LIMITS))


def main() -> None:
    """Generate a sequence, try the bounds, and write the page."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{SCENE}.h5"
        generate_sequence(load_scene(SCENE).with_size(*SIZE), path, Request(duration_s=DURATION_S, quality="draft"))
        told = {}
        for bound in BOUNDS:
            for value in bound.tried:
                with patch.object(bound.module, bound.name, value):
                    told[bound.name, value] = told_by(path)
        events = cost_of(path).events
    TARGET.write_text("".join(page(told, events * WINDOW_NS / NS_PER_S / DURATION_S)), encoding="utf-8")


if __name__ == "__main__":
    main()
