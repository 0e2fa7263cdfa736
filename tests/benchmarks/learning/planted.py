"""Data with one fault each, to train on.

Most faults are planted in copies of the files by the generator. Those that a file cannot hold apart from others, or
that the generator plants in one place only, are made where the arrays have been read.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.faults import plant_fault
from fedora_qa.geometry import so3
from tests.benchmarks.learning.flights import FlightDraw
from tests.benchmarks.learning.samples import Samples, joined, read_samples

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

PACKET_US: Final = 200
"""Packets of events of the paper: 5 kHz."""


@dataclass(frozen=True, slots=True)
class PlantedFault:
    """One fault in the data that are trained on.

    Attributes
    ----------
    text
        What is wrong, as a clause.
    cause
        ``stream:identifier`` as diagnoses name it.
    size, unit
        None and empty where the fault has no size.
    made
        Where it is made: in ``file`` copies by the generator, in the ``arrays`` that were read, or by ``generating``
        sequences anew.
    codes
        Codes of findings whose material size it is held against.
    """

    text: str
    cause: str
    size: float | None
    unit: str
    made: str
    codes: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of its runs."""
        size = "" if self.size is None else f"-{self.size:g}"
        return f"{self.cause.replace(':', '-').replace('/', '-')}{size}"


def _sizes(text: str, cause: str, sizes: Sequence[float], unit: str, made: str, *codes: str) -> list[PlantedFault]:
    return [PlantedFault(text, cause, size, unit, made, codes) for size in sizes]


PLANTED: Final[tuple[PlantedFault, ...]] = (
    *_sizes("events are late", "events:time_offset", (0.5, 2, 10), "ms", "file", "event_response.timing.offset"),
    *_sizes("flow is too large", "flow:flow_gain", (0.5, 2, 10), "percent", "file", "flow_photometric.residual.gain"),
    *_sizes("flow is of the interval before", "flow:flow_interval_shifted", (1,), "intervals", "file"),
    *_sizes(
        "index maps are off", "depth_to_event:index_off_by_one", (1, 10), "events", "file", "index_maps.depth.entry"
    ),
    PlantedFault(
        "polarity is inverted", "events:polarity_inverted", None, "", "file", ("event_response.orientation.other",)
    ),
    *_sizes(
        "thresholds are larger in half of the sequences",
        "events:threshold_misdeclared",
        (10,),
        "percent",
        "generating",
        "event_response.threshold.size",
    ),
    PlantedFault(
        "depth is the length of the ray", "depth:depth_ray_not_z", None, "", "file", ("depth.projection.ray",)
    ),
    *_sizes(
        "poses have noise, by axis; 5 deg of rotation for each m",
        "pose:noise_misdeclared",
        (0.01, 0.1),
        "m",
        "arrays",
        "pose.noise.position",
    ),
    *_sizes(
        "packets of 0.2 ms are missing, drawn at random",
        "events:dropped_samples",
        (10, 50),
        "percent",
        "arrays",
        "event_stream.gaps.silence",
    ),
    PlantedFault(
        "depth frames are of another sequence", "depth:other_sequence", None, "", "file", ("alignment.depth.shift",)
    ),
)

ROTATION_NOISE_RAD_PER_M: Final = np.radians(5.0)
"""0.01 m goes with 0.05 deg: the sizes of the training profile for both."""


def faulty_samples(
    fault: PlantedFault | None, draws: Sequence[FlightDraw], folder: Path, rate_hz: int, most: int | None = None
) -> Samples:
    """Return the samples of flights, with a fault in them.

    Parameters
    ----------
    fault
        None: correct data.
    draws
        The flights, whose correct files lie in ``folder``.
    folder
        Where files lie, and are generated where they are missing.
    rate_hz, most
        As for ``read_samples``.
    """
    if fault is not None and fault.made == "generating":
        gain = 1 + (fault.size or 0.0) / 100
        draws = [_with_thresholds(draw, gain) if draw.number % 2 else draw for draw in draws]
    for draw in draws:
        draw.write(folder / f"{draw.name}.h5")
    paths = [folder / f"{draw.name}.h5" for draw in draws]
    if fault is None or fault.made == "generating":
        return joined([read_samples(path, rate_hz, most) for path in paths])
    if fault.made == "arrays":
        edits = _array_edits(fault)
        return joined([read_samples(path, rate_hz, most, **edits(number)) for number, path in enumerate(paths)])
    stream, cause = fault.cause.split(":")
    with TemporaryDirectory(dir=folder) as copies:
        parts = []
        for number, path in enumerate(paths):
            faulty = Path(copies) / path.name
            donor = paths[(number + 1) % len(paths)] if cause == "other_sequence" else None
            plant_fault(path, faulty, cause, stream, fault.size, fault.unit or None, seed=number, donor=donor)
            parts.append(read_samples(faulty, rate_hz, most, by_index_map=cause == "index_off_by_one"))
            faulty.unlink()
    return joined(parts)


def drop_packets(share: float, seed: int, events: Int64) -> Int64:
    """Return events (n, 4) of x, y, t, p without a share of their packets, drawn at random."""
    packets = events[:, 2] // PACKET_US
    present = np.random.default_rng(seed).random(int(packets.max(initial=0)) + 1) >= share
    return events[present[packets]]


def add_pose_noise(
    position_sigma_m: float, rotation_sigma_rad: float, seed: int, positions_m: Float64, orientations_xyzw: Float64
) -> tuple[Float64, Float64]:
    """Return poses with independent normal noise on each axis, rotations in the body: q Exp(n)."""
    rng = np.random.default_rng(seed)
    rotations_xyzw = so3.exp_quaternion(rng.normal(0.0, rotation_sigma_rad, positions_m.shape))
    return positions_m + rng.normal(0.0, position_sigma_m, positions_m.shape), so3.compose(
        orientations_xyzw, rotations_xyzw
    )


def _with_thresholds(draw: FlightDraw, gain: float) -> FlightDraw:
    return FlightDraw(draw.kind, draw.split, draw.number, gain)


def _array_edits(fault: PlantedFault) -> Callable[[int], dict[str, Callable[..., object]]]:
    """Return the arguments of ``read_samples`` that make a fault, by the number of the flight, its seed."""
    size = fault.size or 0.0
    if fault.cause == "events:dropped_samples":
        return lambda number: {"edit_events": partial(drop_packets, size / 100, number)}
    return lambda number: {"edit_poses": partial(add_pose_noise, size, size * ROTATION_NOISE_RAD_PER_M, number)}
