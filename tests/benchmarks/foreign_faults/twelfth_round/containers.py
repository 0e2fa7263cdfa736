"""Index maps, declarations and datasets as the container holds them."""

from typing import Final

import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values
from tests.benchmarks.foreign_faults.kind import Plan, Plant
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP, MAPS
from tests.benchmarks.foreign_faults.twelfth_round.events import read_events, write_events

RADIAL_SHARE: Final = 0.3
"""Of the square of the first radial coefficient, the second one, as in many calibrations."""

PACKETS_US: Final = (200, 500, 1_000)
"""Times between packets of events."""

DAMAGED_BYTES: Final = 64
"""In sequence, in the middle of a chunk."""


def maps_too_large(file: h5py.File, plan: Plan) -> None:
    """All indices of both maps are too large by so many events."""
    for key in MAPS:
        indices = file[key][...]
        replace_values(file, key, indices + indices.dtype.type(plan.size))


def behind_equal_times(file: h5py.File, plan: Plan) -> None:
    """Events come in packets, which is declared, and indices of depth frames count all that are not after the frame.

    Frames lie on ticks of packets, so that events of equal time are there.
    """
    packet_us = plan.random.choice(PACKETS_US)
    events = read_events(file)
    first_us = file["path/depth_ts"][0]
    # A packet has the first tick that is not before its events.
    write_events(file, events | {"t": first_us - (first_us - events["t"]) // packet_us * packet_us})
    file["metadata/events"].attrs["packet_interval_us"] = np.int64(packet_us)
    indices = np.searchsorted(file["path/events/t"][...], file["path/depth_ts"][...], side="right")
    replace_values(file, DEPTH_MAP, indices.astype(np.int64))


def depth_map_ends_early(file: h5py.File, plan: Plan) -> None:
    """The last so many percent of the indices of depth frames are absent."""
    indices = file[DEPTH_MAP][...]
    replace_values(file, DEPTH_MAP, indices[: len(indices) - max(1, round(plan.size / 100 * len(indices)))])


def colour_map_as_a_column(file: h5py.File, plan: Plan) -> None:
    """The indices of colour frames are a matrix (N, 1)."""
    replace_values(file, COLOUR_MAP, file[COLOUR_MAP][...][:, None])


def chunks_of_depth_damaged(file: h5py.File, plan: Plan) -> None:
    """Bytes in the middle of so many stored frames of depth in sequence are replaced by others."""
    dataset = file["path/depth"]
    count = min(int(plan.size), len(dataset) - 1)
    first = round(plan.begin * (len(dataset) - count))
    for row in range(first, first + count):
        place = (row - row % dataset.chunks[0], *(0 for _ in dataset.shape[1:]))
        mask, stored = dataset.id.read_direct_chunk(place)
        damaged = np.frombuffer(stored, dtype=np.uint8).copy()
        middle = slice(len(damaged) // 2, len(damaged) // 2 + DAMAGED_BYTES)
        # No byte stays as it was.
        damaged[middle] += plan.random.integers(1, 256, len(damaged[middle]), dtype=np.uint8)
        dataset.id.write_direct_chunk(place, damaged.tobytes(), mask)


def without_poses(file: h5py.File, plan: Plan) -> None:
    """The group of poses is absent; the noise of poses is declared."""
    del file["path/pose"]


def lens_of_rectified_events(file: h5py.File, plan: Plan) -> None:
    """A lens is declared for events, radial and tangential, although they are those of a pinhole."""
    k1 = -plan.size
    p1, p2 = plan.random.normal(0.0, 0.001, 2)
    attributes = file[CAMERA + "events"].attrs
    attributes["distortion_model"] = "radtan"
    attributes["distortion"] = np.array([k1, RADIAL_SHARE * k1**2, p1, p2])


def focal_length_declared(camera: str) -> Plant:
    """Declared focal lengths of a camera are too large by so many percent."""

    def plant(file: h5py.File, plan: Plan) -> None:
        attributes = file[CAMERA + camera].attrs
        K = np.array(attributes["K"])
        K[[0, 1], [0, 1]] *= 1 + plan.size / 100
        attributes["K"] = K

    return plant


def centre_declared(camera: str) -> Plant:
    """The declared principal point of a camera lies so many px from the right one, in any direction."""

    def plant(file: h5py.File, plan: Plan) -> None:
        attributes = file[CAMERA + camera].attrs
        K = np.array(attributes["K"])
        angle = plan.random.uniform(0, 2 * np.pi)
        K[:2, 2] += plan.size * np.array([np.cos(angle), np.sin(angle)])
        attributes["K"] = K

    return plant
