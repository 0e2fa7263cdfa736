"""What each stream, effect, wind and world costs: ``python -m tests.benchmarks.generation_costs``, some minutes.

Writes docs/costs.md and docs/costs.svg. Times are CPU times of one process, so that other work on the machine affects
them little. Each is a difference between two lengths, so that the time before the first frame is separate. Ratios
within one round of runs are compared.
"""

import os
import platform
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Final

from fedora_generator.choices import STREAMS
from fedora_generator.events.options import EventSensorOptions
from fedora_generator.flights.gusts import WindOptions
from fedora_generator.flights.kinds import HoverOptions
from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import Scene, load_scene
from tests.benchmarks.bar_chart import Bars, bar_chart

DOCS: Final = Path(__file__).parents[2] / "docs"
SIZE: Final = (270, 200)
SHORT_S: Final = 0.04
ROUNDS: Final = 5

ALL: Final = frozenset(STREAMS)
EVENTS: Final = frozenset({"events"})
INERTIAL: Final = frozenset({"imu", "pose"})


INTRODUCTION: Final = """\
# What a sequence costs, by its content

Written by `make bench-costs`. A stream that is left out is not rendered. An effect or a wind that is 0 costs nothing;
its row states what it adds if it is switched on. CPU seconds are those of one process with one thread, before the
first frame and for each generated second. The ratio compares the generated second with the first row of the table. It
is the median of the ratios of single rounds. Clock and caches are shared with other work on the machine, so that
ratios are reliable where seconds are not.

"""


@dataclass(frozen=True, slots=True)
class Case:
    """One thing to generate."""

    name: str
    scene: Scene
    streams: frozenset[str]

    @property
    def long_s(self) -> float:
        """Length of the longer run, seconds: enough for a second of it to be measured."""
        return 40.0 if self.streams <= INERTIAL else 0.54


@dataclass(frozen=True, slots=True)
class Group:
    """Cases that are compared with their first."""

    title: str
    explanation: str
    cases: tuple[Case, ...]


@dataclass(frozen=True, slots=True)
class Cost:
    """Medians over the rounds: CPU seconds before the first frame, CPU seconds a generated one, ratio to the base."""

    start_s: float
    second_s: float
    ratio: float


def groups() -> tuple[Group, ...]:
    """Return everything that is compared."""
    return (by_stream(), by_effect(), by_wind(), by_world())


def by_stream() -> Group:
    """Each stream alone, and all."""
    park = load_scene("park-day").with_size(*SIZE)
    alone = tuple(Case(name, park, frozenset({name})) for name in ("depth", "flow", "rgb", "events", "imu", "pose"))
    return Group("Streams", "`park-day`, one stream at a time, against depth alone.", (*alone, Case("all", park, ALL)))


def by_effect() -> Group:
    """Events alone, with each effect of the noisy scene, and with all."""
    clean, noisy = (load_scene(name).with_size(*SIZE) for name in ("park-day", "park-noisy"))
    effects = {
        "threshold mismatch": {"threshold_sigma": noisy.events.threshold_sigma},
        "leak": {"leak_rate_hz": noisy.events.leak_rate_hz},
        "shot noise": {"shot_rate_hz": noisy.events.shot_rate_hz},
        "bandwidth": {"bandwidth_hz": noisy.events.bandwidth_hz},
        "refractory period": {"refractory_us": noisy.events.refractory_us},
        "hot pixels": {name: getattr(noisy.events, name) for name in ("hot_pixel_count", "hot_pixel_rate_hz")},
        "packets of 200 us": {"packet_interval_us": 200},
        "first reference unknown": {"initial_phase": "uniform"},
    }

    def case(name: str, options: EventSensorOptions) -> Case:
        return Case(name, replace(clean, events=options), EVENTS)

    return Group(
        "Effects of the event camera",
        "Events of `park-day` alone, with one effect of `park-noisy` at a time. The second row repeats\n"
        "the first: its difference from 1 is the resolution of the other ratios. With a bandwidth the camera\n"
        "gets images instead of adaptive samples, which costs less and gives less accurate times.",
        (
            case("none", clean.events),
            case("none, again", clean.events),
            *(case(name, replace(clean.events, **options)) for name, options in effects.items()),  # type: ignore[arg-type]
            case("all of `park-noisy`", noisy.events),
        ),
    )


def by_wind() -> Group:
    """A hovering quadrotor without drag, with drag, and in a wind."""
    park = load_scene("park-day").with_size(*SIZE)
    calm = HoverOptions(position_m=(0.0, 0.0, 4.0), drag_per_s=0.3)
    windy = replace(calm, wind=WindOptions(speed_m_s=4.0))
    flights = {"calm": calm, "wind of 4 m/s": windy}
    return Group(
        "Wind",
        "IMU and pose of a hovering quadrotor, which follow from the flight alone.",
        tuple(Case(name, replace(park, flight=flight), INERTIAL) for name, flight in flights.items()),
    )


def by_world() -> Group:
    """The exact world and one of meshes, with the same streams."""
    named = {"`park-day` (exact)": "park-day", "`park-mesh-day` (OpenGL)": "park-mesh-day"}
    return Group(
        "Worlds",
        "RGB, depth and flow; OpenGL runs in software where there is no graphics card. A world is built and painted\n"
        "before its first frame.",
        tuple(
            Case(title, load_scene(name).with_size(*SIZE), frozenset({"rgb", "depth", "flow"}))
            for title, name in named.items()
        ),
    )


def cpu_s(case: Case, duration_s: float, folder: Path) -> float:
    """CPU seconds of one run, all threads."""
    started = time.process_time()
    request = Request(duration_s=duration_s, streams=case.streams, quality="draft")
    generate_sequence(case.scene, folder / "a.h5", request, overwrite=True)
    return time.process_time() - started


def measure(group: Group, folder: Path, rounds: int = ROUNDS) -> tuple[Cost, ...]:
    """Cost of each case; in a round each runs once, short and long."""
    for case in group.cases:
        cpu_s(case, SHORT_S, folder)  # compiles, and warms what is cached
    seconds: list[list[tuple[float, float]]] = [[] for _ in group.cases]
    for _ in range(rounds):
        for case, runs in zip(group.cases, seconds, strict=True):
            runs.append((cpu_s(case, SHORT_S, folder), cpu_s(case, case.long_s, folder)))
    a_second = [
        [(long - short) / (case.long_s - SHORT_S) for short, long in runs]
        for case, runs in zip(group.cases, seconds, strict=True)
    ]
    return tuple(
        Cost(
            start_s=median(short for short, _ in runs),
            second_s=median(costs),
            ratio=median(cost / base for cost, base in zip(costs, a_second[0], strict=True)),
        )
        for runs, costs in zip(seconds, a_second, strict=True)
    )


def main() -> None:
    """Measure, and write the page and its picture."""
    with TemporaryDirectory() as folder:
        measured = []
        for group in groups():
            print(group.title)
            measured.append((group, measure(group, Path(folder))))
    (DOCS / "costs.md").write_text("".join(page(measured)), encoding="utf-8")
    (DOCS / "costs.svg").write_text(picture(measured), encoding="utf-8")


def page(measured: list[tuple[Group, tuple[Cost, ...]]]) -> Iterator[str]:
    """Text of docs/costs.md."""
    load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
    yield INTRODUCTION
    yield (
        f"{time.strftime('%Y-%m-%d')}, {platform.machine()}, {os.cpu_count()} cores, Python "
        f"{platform.python_version()}; load averages at the end: {load}.\n{SIZE[0]}x{SIZE[1]}, "
        f"draft quality, medians over {ROUNDS} rounds.\n\n![CPU seconds for one generated second](costs.svg)\n"
    )
    for group, costs in measured:
        yield f"\n## {group.title}\n\n{group.explanation}\n\n"
        yield "| | before the first frame, CPU s | a generated second, CPU s | ratio |\n| --- | --- | --- | --- |\n"
        for case, cost in zip(group.cases, costs, strict=True):
            yield f"| {case.name} | {cost.start_s:.2f} | {cost.second_s:.3g} | {cost.ratio:.2f} |\n"


def picture(measured: list[tuple[Group, tuple[Cost, ...]]]) -> str:
    """Bars of every group."""
    return bar_chart(
        [
            Bars(
                title=group.title,
                names=[case.name.replace("`", "") for case in group.cases],
                values=[max(cost.second_s, 0.0) for cost in costs],
                labels=[f"{cost.second_s:.3g} s" for cost in costs],
            )
            for group, costs in measured
        ],
        alt="CPU seconds for one generated second",
    )


if __name__ == "__main__":
    main()
