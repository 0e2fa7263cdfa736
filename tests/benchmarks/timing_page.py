"""Tables and plot of event timing: what each quality and bound costs, and what it leaves."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import matplotlib.pyplot as plt
import numpy as np

from fedora_generator.sampling import FIDELITY, Fidelity
from tests.benchmarks import scene_timing
from tests.benchmarks.event_timing import Recording, TimingError, Truth, at_fixed_rate, followed, timing_error, truth_of
from tests.benchmarks.timing_scenes import TEXTURES, TimingScene

DURATION_US: Final = 100_000
FIXED_STEPS_US: Final = (4000, 2000, 1000, 500, 200, 100, 50, 20)
LADDER: Final = (
    Fidelity(motion_px=2.0, caution=4.0, tolerance_us=1000.0),
    FIDELITY["draft"],
    Fidelity(motion_px=1.0, caution=32.0, tolerance_us=20.0),
    Fidelity(motion_px=0.5, caution=4.0, tolerance_us=20.0),
    FIDELITY["standard"],
    Fidelity(motion_px=0.5, caution=32.0, tolerance_us=2.0),
    FIDELITY["reference"],
)
SCENES: Final = ("park-day", "racetrack", "fast-turn")
SCENE_NS: Final = 100_000_000

WALLS: Final = """\
## Event timing

Timestamps on the internal clock are compared with float64 bisection of the closed form, for 0.1 s of a wall that
sways before a camera of 40x30 pixels. 48 pixels are compared, less those with a turning point within 1e-9 of a
threshold. A wrong pixel has another sequence of polarities; the errors are those of all other pixels. *Rendered* is
the mean number of renders of a pixel. *Fixed* interpolates linearly between images at equal steps, as other
simulators do. `Fidelity` in `sampling.py` defines the bounds, and `adaptive/README.md` describes the sampling; both
are in `generator/fedora_generator`.

| scene | sampling | motion, px | caution | tolerance, us | rendered | s | wrong pixels | RMS, us | largest, us |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""

SCENES_HEAD: Final = """\

Whole scenes have what the walls lack: edges of objects, corners, planes at grazing angles. Their events have no
closed form. The reference is the same algorithm with a bound of 0.125 px, caution 128 and a tolerance of 0.5 us.
Frames have {width}x{height} pixels; 0.1 s, C = 0.2, timestamps in whole microseconds. A sequence of polarities can be
right although a turning point was missed, if another turning point was reached milliseconds away. These few pixels
determine the RMS.

| scene | sampling | motion, px | caution | rendered | events | wrong pixels | of | RMS, us | largest, us |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |
"""


def walls(plot: Path) -> Iterator[str]:
    """Write the table of the walls, and their plot to a file."""
    yield WALLS
    figure, axes = plt.subplots(1, len(TEXTURES), figsize=(9, 3.6), sharey=True, layout="constrained")
    notes = []
    for axis, texture in zip(axes, TEXTURES, strict=True):
        scene = TimingScene.named(texture)
        truth = truth_of(scene, DURATION_US)
        followed(scene, FIDELITY["draft"], DURATION_US)  # compiles
        ours = [_measured(followed(scene, fidelity, DURATION_US), truth) for fidelity in LADDER]
        fixed = [_measured(at_fixed_rate(scene, step_us, DURATION_US), truth) for step_us in FIXED_STEPS_US]
        for fidelity, (recording, error) in zip(LADDER, ours, strict=True):
            bounds = f"{fidelity.motion_px:g} | {fidelity.caution:g} | {fidelity.tolerance_us:g}"
            yield f"| {texture} | {_name(fidelity)} | {bounds} | {_row(recording, error)}"
        for step_us, (recording, error) in zip(FIXED_STEPS_US, fixed, strict=True):
            yield f"| {texture} | fixed, {step_us} us | | | | {_row(recording, error)}"
        notes.append(
            f"{_times_fewer(ours[LADDER.index(FIDELITY['standard'])], fixed):.0f} times fewer pixels ({texture})"
        )
        _draw(axis, texture, ours, fixed)
    axes[0].set_ylabel("RMS error of timestamps, us")
    figure.savefig(plot, metadata={"Date": None})
    plt.close(figure)
    yield f"\nFor the timing error of `standard`, a fixed rate would have to render {' and '.join(notes)}.\n".replace(
        "times fewer pixels", "times the pixels"
    )
    yield f"\n![RMS error of timestamps against pixels rendered]({plot.name})\n"


def scenes() -> Iterator[str]:
    """Write the table of whole scenes."""
    width, height = scene_timing.SIZE
    yield SCENES_HEAD.format(width=width, height=height)
    for name in SCENES:
        finest = scene_timing.record(name, scene_timing.FINEST, SCENE_NS)
        for fidelity in LADDER:
            recording = scene_timing.record(name, fidelity, SCENE_NS)
            wrong, rms_us, largest_us = scene_timing.difference(recording, finest)
            yield (
                f"| {name} | {_name(fidelity)} | {fidelity.motion_px:g} | {fidelity.caution:g} "
                f"| {recording.rendered:.1f} | {recording.events} | {wrong} | {len(finest.sequences)} "
                f"| {rms_us:.3g} | {largest_us:.0f} |\n"
            )


def _measured(recording: Recording, truth: Truth) -> tuple[Recording, TimingError]:
    return recording, timing_error(recording, truth)


def _name(fidelity: Fidelity) -> str:
    return next((f"**{name}**" for name, known in FIDELITY.items() if known == fidelity), "")


def _row(recording: Recording, error: TimingError) -> str:
    return (
        f"{recording.rendered:.1f} | {recording.seconds:.2f} | {error.wrong_pixels} of {error.pixels} "
        f"| {error.rms_us:.3g} | {error.largest_us:.3g} |\n"
    )


def _times_fewer(ours: tuple[Recording, TimingError], fixed: list[tuple[Recording, TimingError]]) -> float:
    """How many times more pixels a fixed rate renders for the same RMS, along the line through its two finest steps."""
    (coarse, coarse_error), (fine, fine_error) = fixed[-2:]
    slope = np.log(fine_error.rms_us / coarse_error.rms_us) / np.log(fine.rendered / coarse.rendered)
    needed = np.log(fine.rendered) + np.log(ours[1].rms_us / fine_error.rms_us) / slope
    return float(np.exp(needed) / ours[0].rendered)


def _draw(
    axis: plt.Axes,
    texture: str,
    ours: list[tuple[Recording, TimingError]],
    fixed: list[tuple[Recording, TimingError]],
) -> None:
    for label, marker, points in (("fixed rate", "s--", fixed), ("light followed", "o-", ours)):
        rendered, rms_us = zip(*sorted((r.rendered, e.rms_us) for r, e in points), strict=True)
        axis.loglog(rendered, rms_us, marker, label=label, markersize=4)
    for name, fidelity in FIDELITY.items():
        recording, error = ours[LADDER.index(fidelity)]
        axis.annotate(name, (recording.rendered, error.rms_us), textcoords="offset points", xytext=(6, 4), fontsize=8)
    axis.set_title(f"{texture} wall, 0.1 s", fontsize=10)
    axis.set_xlabel("renders of each pixel")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=8)
