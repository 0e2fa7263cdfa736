"""What IMU against pose can tell: ``python -m tests.benchmarks.inertial_limits``, some minutes on one core.

Closed-form flights with the noise of a good MEMS unit. Least detectable faults are those that a check states of a file
of 112 s; spreads are those of values over their standard errors, over many shorter files without a fault.
"""

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from fedora_qa.conventions import MM_PER_M
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.estimators.fitting.grouped_fit import group_of
from fedora_qa.estimators.imu.samples import InertialNoise
from fedora_qa.estimators.imu.sequence_fit import ROTATION, TRANSLATION, fit_inertial
from tests.support.motion_world import NOISY, Motion, MotionFile, sample_motion

TARGET: Final = Path(__file__).parents[2] / "docs" / "inertial-limits.md"
CHECKS: Final = ("imu.rotation", "imu.translation", "imu.timing")
DURATION_S: Final = 112.0
DRAWS, DRAW_S = 30, 8.0

SLOW: Final = Motion((0.35, 0.06, 0.08, 0.8, 0.8, 0.3), (0.12, 0.41, 0.33, 0.08, 0.11, 0.17))
FAST: Final = Motion((0.9, 0.20, 0.25, 0.9, 0.9, 0.4), (0.35, 0.62, 0.71, 0.31, 0.27, 0.44))
EXACT_POSES: Final = replace(NOISY, position_sigma_m=0.0, rotation_sigma_rad=0.0)
FLIGHTS: Final = {"slow": SLOW, "fast": FAST}
POSES: Final = {"exact": EXACT_POSES, "5 mm, 0.2 deg": NOISY}

QUANTITIES: Final = {
    "time offset [ms]": ("time_offset",),
    "IMU clock [ppm]": ("clock_rate",),
    "gyro axes [deg]": ("tilt_x", "tilt_y", "tilt_z"),
    "lever arm [mm]": ("lever_x", "lever_y", "lever_z"),
    "gravity [m/s^2]": ("gravity",),
}
"""Rows of the table, and the measurements of which each is the worst."""

REACHED: Final = {
    "time offset [ms]": ("0.05 / 0.014", "0.46 / 0.12"),
    "IMU clock [ppm]": ("1.7 / 0.4", "14 / 2.6"),
    "gyro axes [deg]": ("0.02 / 0.004", "0.09 / 0.06"),
    "lever arm [mm]": ("7 / 0.3", ""),
    "gravity [m/s^2]": ("0.04 / 0.006", ""),
}
"""The analytic test bed that this is to be held against (slow / fast, of other flights): exact and noisy poses."""

HEAD: Final = """\
# What the comparison of IMU and pose can detect

Written by `make bench-imu`. Gyro {gyro:g} rad/s/sqrt(Hz), accelerometer {accel:g} m/s^2/sqrt(Hz), random walks of the
biases {gyro_walk:g} and {accel_walk:g} a root second; 1000 samples/s, poses at 200/s. The slow flight turns with
{slow:.2f} rad/s rms and accelerates by {slow_a:.2f} m/s^2 rms, the fast flight with {fast:.2f} rad/s and {fast_a:.2f}
m/s^2.

## Detection limits, {duration:g} s

The fault that would have been detected with 95% probability, at one false alarm in 10 000 files for all comparisons
of the three checks together. Of three axes the table has the worst. Each cell is: slow / fast flight. The figures of
the test bed are from its own flights.

| | exact poses | test bed | poses with 5 mm, 0.2 deg | test bed |
| --- | --- | --- | --- | --- |
"""

SPREADS: Final = """
## Are standard errors right?

Root mean square of value over standard error, over {draws} files of {seconds:g} s without a fault. It is 1 where
standard errors are right. The axes and both flights are taken together. A group has at least {values} values, so that
{interval:.2f} is two standard errors. With exact poses it may lie below 1: the noise model assumes timestamps that
are rounded to a microsecond, but in these files they are exact.

| | {columns} |
| --- | --- | --- |
"""


def main() -> None:
    """Write docs/inertial-limits.md and print it."""
    text = "".join([_head(), *_limits(), *_spreads()])
    TARGET.write_text(text, encoding="utf-8")
    print(text)


def _head() -> str:
    times_s = np.arange(0.0, DURATION_S, 0.01)

    def rms(values: np.ndarray) -> float:
        return float(np.sqrt(np.mean(np.sum(np.square(values), axis=1))))

    turns = {name: rms(flight.angular_velocities(times_s)) for name, flight in FLIGHTS.items()}
    pushes = {name: rms(flight.accelerations_m_s2(times_s)) for name, flight in FLIGHTS.items()}
    return HEAD.format(
        gyro=NOISY.gyro_density, accel=NOISY.accel_density, gyro_walk=NOISY.gyro_walk, accel_walk=NOISY.accel_walk,
        duration=DURATION_S, **turns, **{f"{name}_a": push for name, push in pushes.items()},
    )  # fmt: skip


def _limits() -> Iterator[str]:
    found = {
        (name, poses): limits_of(flight, noise) for name, flight in FLIGHTS.items() for poses, noise in POSES.items()
    }
    for quantity, reached in REACHED.items():
        cells = []
        for poses, bed in zip(POSES, reached, strict=True):
            cells += [" / ".join(f"{found[name, poses][quantity]:.2g}" for name in FLIGHTS), bed]
        yield f"| {quantity} | {' | '.join(cells)} |\n"


def limits_of(flight: Motion, noise: InertialNoise, duration_s: float = DURATION_S) -> Mapping[str, float]:
    """Check a file without a fault and return, by quantity, the least fault that it would have shown."""
    with tempfile.TemporaryDirectory() as folder:
        path = MotionFile(sample_motion(flight, noise, duration_s=duration_s), noise).write(Path(folder) / "flight.h5")
        results = check_file(path, CheckOptions(select=CHECKS, evidence=None)).record.results
    least = {one.name: one.least_detectable or np.inf for result in results for one in result.measurements}
    return {
        quantity: (MM_PER_M if "mm" in quantity else 1.0) * max(least[name] for name in names)
        for quantity, names in QUANTITIES.items()
    }


def _spreads() -> Iterator[str]:
    columns = {poses: spreads_of(noise) for poses, noise in POSES.items()}
    values = 2 * DRAWS
    yield SPREADS.format(
        draws=2 * DRAWS, seconds=DRAW_S, values=values, interval=2 / np.sqrt(2 * values),
        columns=" | ".join(f"poses {name}" for name in columns),
    )  # fmt: skip
    for row in next(iter(columns.values())):
        yield f"| {row} | {' | '.join(f'{column[row]:.2f}' for column in columns.values())} |\n"


def spreads_of(noise: InertialNoise, draws: int = DRAWS, duration_s: float = DRAW_S) -> Mapping[str, float]:
    """Return the rms of value over standard error of each group of parameters, over draws of both flights."""
    deviations: dict[str, list[float]] = {}
    for flight in FLIGHTS.values():
        for seed in range(draws):
            samples = sample_motion(flight, noise, duration_s=duration_s, seed=seed)
            for kind, comparison, walk in (
                ("rotation", ROTATION, noise.gyro_walk),
                ("translation", TRANSLATION, noise.accel_walk),
            ):
                fit = fit_inertial(samples, noise, comparison, bias_walk=walk)
                if fit is None:
                    raise RuntimeError(f"Expected a fit of {duration_s:g} s, got too few rows; make it longer")
                for name, one in fit.parameters.items():
                    deviations.setdefault(f"{kind}: {group_of(name)}", []).append(one.value / one.standard_error)
    return {group: float(np.sqrt(np.mean(np.square(found)))) for group, found in deviations.items()}


if __name__ == "__main__":
    main()
