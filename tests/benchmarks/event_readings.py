"""How many events are used, against time and limits: ``make bench-readings`` writes docs/event-readings.md.

Each bound is set below and above its present value, with the others unchanged, and one clean file is checked by what
compares events with light. Seconds are processor time without decoding, as a ratio to the present bounds.
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
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.plan import WINDOW_NS
from fedora_qa.engine.tasks import check_file
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
    description: str
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
        "events used for timing, a window",
        (3_750, 7_500, 15_000, 30_000, 60_000),
    ),
    Bound(levels, "MOST_EVENTS", "events used for thresholds, a window", (12_500, 25_000, 50_000, 400_000)),
    Bound(levels, "MOST_PAIRS", "pairs of samples used for thresholds, a window", (1_250, 5_000, 20_000)),
)

HEAD: Final = """\
# How many events are used

Checks that compare events with frames use a limited number of events in a window of 0.2 s. Above this bound they use
every second, third, ... pixel. `make bench-readings` measures the cost of each bound and its effect on the detection
limits. The file is {scene} of {width}x{height}, {duration:g} s, with a mean of {events:.0f} events a window, at the
density of `full`. Times are processor time without decoding, of `{timing}` and `{threshold}` together, as a ratio to
the time with the present bounds (**bold**). Limits are the `least_detectable` that both checks state.

| bound | value | time | {limits} |
| --- | --- | --- |{rules}
"""

TAIL: Final = """
A window with fewer events than a bound uses all of them. For timing, more events are worth their time: with a quarter
of them, limits are a third larger for three fifths of the time. So this bound is the number of events in windows of
usual density. For thresholds, the frames limit the accuracy, and not the number of pairs. Their events cost almost
nothing. Those two bounds exist for windows of millions of events. The numbers of events alone decide which pixels are
left out, so that records are reproducible.
"""


@dataclass(frozen=True, slots=True)
class Measurement:
    """What checking took, and the limits that were stated, in the order of ``LIMITS``."""

    seconds: float
    limits: tuple[float | None, ...]


def page(measurements: Mapping[tuple[str, int], Measurement], events_a_window: float) -> Iterator[str]:
    """Yield the page: a row for each value of each bound."""
    limits = " | ".join(f"{name.replace('_', ' ')}, {unit}" for _, name, unit in LIMITS)
    yield HEAD.format(
        scene=SCENE, width=SIZE[0], height=SIZE[1], duration=DURATION_S, events=events_a_window, timing=TIMING,
        threshold=THRESHOLD, limits=limits, rules=" --- |" * len(LIMITS),
    )  # fmt: skip
    for bound in BOUNDS:
        whole = measurements[bound.name, bound.chosen].seconds
        for value in bound.tried:
            measurement = measurements[bound.name, value]
            shown = f"**{value}**" if value == bound.chosen else f"{value}"
            stated = " | ".join("-" if limit is None else f"{limit:.3g}" for limit in measurement.limits)
            yield f"| {bound.description} | {shown} | {measurement.seconds / whole:.2f} | {stated} |\n"
    yield TAIL


def measure_file(path: Path) -> Measurement:
    """Check a file by what compares events with light: the fastest of some runs, and the limits that are stated."""
    seconds = min(sum(cost_of(path).by_check_s[name] for name in (TIMING, THRESHOLD)) for _ in range(REPEATS))
    results = check_file(path, CheckOptions(evidence=None, select=(TIMING, THRESHOLD))).record.results
    stated = {(result.check, value.name): value.least_detectable for result in results for value in result.measurements}
    return Measurement(seconds, tuple(stated.get((check, name)) for check, name, _ in LIMITS))


def main() -> None:
    """Generate a sequence, try the bounds, and write the page."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"{SCENE}.h5"
        generate_sequence(load_scene(SCENE).with_size(*SIZE), path, Request(duration_s=DURATION_S, quality="draft"))
        measurements = {}
        for bound in BOUNDS:
            for value in bound.tried:
                with patch.object(bound.module, bound.name, value):
                    measurements[bound.name, value] = measure_file(path)
        events = cost_of(path).events
    TARGET.write_text("".join(page(measurements, events * WINDOW_NS / NS_PER_S / DURATION_S)), encoding="utf-8")


if __name__ == "__main__":
    main()
