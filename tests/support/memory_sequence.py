"""A sequence in memory: a tenth of a second of every stream, random values on a smooth flight, for tests of views."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.binding import INVALID_POLARITY, Binding
from fedora_qa.layout.canonical import DATASETS, MS_TO_EVENT
from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Camera, Declared, EventModel, ImuModel, PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.scan import scan
from fedora_qa.sequence.sequence import SequenceRows

WIDTH, HEIGHT = 12, 9
EVENT_WIDTH, EVENT_HEIGHT = 10, 8
MS = 1_000_000
SECOND = 1000 * MS
FLOW_STRIDES = {"10hz": 5, "25hz": 2, "50hz": 1}

Arrays = dict[str, NDArray[Any]]


class MemorySequence:
    """Arrays by canonical key, in canonical units; they are not writable, so that no view can write into them."""

    def __init__(self, arrays: Arrays, declared: Declared, origin_ns: int = 0) -> None:
        self.arrays = {key: array.copy() for key, array in arrays.items()}
        for array in self.arrays.values():
            array.flags.writeable = False
        bindings = {key: Binding(key, key, len(array), array.shape, array.dtype) for key, array in arrays.items()}
        streams = frozenset(DATASETS[key].stream for key in arrays if key in DATASETS)
        self.layout = Layout("fedora", bindings, streams, {})
        self.declared = declared
        self.origin_ns = origin_ns

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows of an array, not copied."""
        return self.arrays[key][start:stop]

    def chunk_rows(self, key: str) -> int:
        """Return the number of rows that are read together."""
        return 16

    def altered(self, *, declared: Declared | None = None, **arrays: NDArray[Any]) -> "MemorySequence":
        """Return the sequence with other arrays; names are keys with ``__`` for ``/``."""
        changed = {name.replace("__", "/"): array for name, array in arrays.items()}
        assert changed.keys() <= self.arrays.keys()
        return MemorySequence({**self.arrays, **changed}, declared or self.declared, self.origin_ns)


SQUARE_MAP = (4, 4)
"""Rows and columns of the declared map that rectifies events; of a part of the sensor, as nothing reads it here."""


def facts_of(sequence: SequenceRows) -> Facts:
    """Facts of a sequence or of a view, from a scan."""
    return scan(sequence, SECOND).facts


def all_rows(sequence: SequenceRows) -> Arrays:
    """All rows of all datasets."""
    return {key: sequence.rows(key, 0, binding.rows) for key, binding in sequence.layout.bindings.items()}


@lru_cache(maxsize=16)
def memory_sequence(seed: int = 0, origin_ns: int = 0) -> MemorySequence:
    """Return a random sequence; depth and flow hold NaN, and some events lie outside or have no valid polarity."""
    random = np.random.default_rng(seed)
    frames_ns = np.arange(0, 101 * MS, 20 * MS)
    pose_ns, imu_ns = np.arange(0, 101 * MS, 5 * MS), np.arange(0, 100 * MS + 1, MS)
    images = (len(frames_ns), HEIGHT, WIDTH)
    depth_mm = random.uniform(1000, 20_000, images).astype(np.float32)
    depth_mm[random.random(images) < 0.1] = np.nan
    arrays: Arrays = {
        "path/rgb": random.integers(0, 256, (*images, 3), dtype=np.uint8),
        "path/rgb_ts": frames_ns,
        "path/depth": depth_mm,
        "path/depth_ts": frames_ns,
    }
    count = 400
    t = np.sort(random.integers(1, 100 * 1000, count)) * 1000
    t[100:104] = 20 * MS
    t[200:202] = t[199]
    t = np.sort(t)
    x = random.integers(0, EVENT_WIDTH, count).astype(np.uint16)
    y = random.integers(0, EVENT_HEIGHT, count).astype(np.uint16)
    x[::97], y[::89] = EVENT_WIDTH + 2, EVENT_HEIGHT + 1
    p = random.integers(0, 2, count).astype(np.uint8)
    p[::101] = INVALID_POLARITY
    arrays |= {"path/events/x": x, "path/events/y": y, "path/events/t": t, "path/events/p": p}
    attitudes = random.normal(0, 0.3, 3) + np.outer(pose_ns / SECOND, random.normal(0, 0.5, 3))
    positions = random.normal(0, 3, 3) + np.outer(pose_ns / SECOND, random.normal(0, 2, 3))
    arrays |= {
        "path/imu/angular_velocity": random.normal(0, 1, (len(imu_ns), 3)),
        "path/imu/linear_acceleration": random.normal([0, 0, 9.8], 1, (len(imu_ns), 3)),
        "path/imu/ts": imu_ns,
        "path/pose/position": positions,
        "path/pose/orientation": quaternions(attitudes),
        "path/pose/ts": pose_ns,
    }
    for rate, stride in FLOW_STRIDES.items():
        starts = frames_ns[:-stride:stride]
        intervals = np.column_stack([starts, starts + stride * 20 * MS])[: (len(frames_ns) - 1) // stride]
        flow = random.normal(0, 5, (len(intervals), HEIGHT, WIDTH, 2)).astype(np.float32)
        flow[np.isnan(depth_mm[:-stride:stride][: len(intervals)])] = np.nan
        arrays |= {f"path/flow/{rate}": flow, f"path/flow/{rate}_ts": intervals}
    index = np.array([np.count_nonzero(t < frame) for frame in frames_ns])
    arrays |= {"metadata/rgb_to_event": index, "metadata/depth_to_event": index}
    # Milliseconds count on the clock of the file.
    arrays[MS_TO_EVENT] = np.array([np.count_nonzero(t + origin_ns < k * MS) for k in range(101)])
    return MemorySequence(arrays, declared_model(), origin_ns)


def quaternions(rotation_vectors: NDArray[Any]) -> NDArray[Any]:
    """Return unit quaternions x, y, z, w of rotation vectors (n, 3), written out here."""
    angles = np.linalg.norm(rotation_vectors, axis=1, keepdims=True)
    return np.hstack([np.sin(angles / 2) * rotation_vectors / angles, np.cos(angles / 2)])


def declared_model() -> Declared:
    """Return declarations with cameras, sensor, noise and gravity."""

    def camera(width: int, height: int) -> Camera:
        focal = width / (2 * np.tan(np.pi / 6))
        T_body_camera = np.eye(4)
        T_body_camera[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
        T_body_camera[:3, 3] = 0.1, 0.02, -0.03
        K = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
        return Camera(width, height, K, T_body_camera)

    image = camera(WIDTH, HEIGHT)
    cameras = {"rgb": image, "depth": replace(image), "events": camera(EVENT_WIDTH, EVENT_HEIGHT)}
    return Declared(
        cameras=cameras,
        events=EventModel("log", 0.2, 0.25, packet_interval_us=200, leak_rate_hz=0.1, threshold_sigma=0.01),
        imu=ImuModel(1e-3, 2e-2, 1e-5, 1e-4, gravity=9.8066),
        pose=PoseModel(0.01, 0.002),
        flow_model="rigid",
        depth_range_m=(0.1, 30.0),
        rectify_map_px=np.random.default_rng(5).uniform(0, 9, (*SQUARE_MAP, 2)).astype(np.float32),
    )
