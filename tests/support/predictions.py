"""A still camera's sequence with exact truth, and predictions of it, written with bare h5py."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

HEIGHT, WIDTH, FIELDS = 24, 32, 4
STEP_US = 20_000
POSE_STEP_US = 5_000
POSES = FIELDS * STEP_US // POSE_STEP_US + 1
Array = np.ndarray[Any, Any]


def truth() -> dict[str, Array]:
    """Flow at 50 Hz of multiples of 1/8 px, depth with a step at a column, and poses on a curve.

    Flow and depth have no truth in the first rows. A block of pixels moves by itself.
    """
    random = np.random.default_rng(1)
    flow_px = random.integers(-40, 41, (FIELDS, HEIGHT, WIDTH, 2)).astype(np.float32) / 8
    depth_mm = np.full((FIELDS + 1, HEIGHT, WIDTH), 16_000, np.float32)
    depth_mm[:, :, : WIDTH // 4] = 4_000
    flow_px[:, :2], depth_mm[:, :2] = np.nan, np.nan
    moving = np.zeros((FIELDS, HEIGHT, WIDTH), np.uint8)
    moving[:, 10:14, 20:30] = 1
    starts_us = STEP_US * np.arange(FIELDS)
    angles = np.linspace(0, 1, POSES)
    return {
        "path/flow/50hz": flow_px,
        "path/flow/50hz_ts": np.column_stack([starts_us, starts_us + STEP_US]),
        "path/flow/50hz_moving": moving,
        "path/depth": depth_mm,
        "path/depth_ts": STEP_US * np.arange(FIELDS + 1),
        "path/pose/position": np.column_stack([np.cos(angles), np.sin(angles), angles**2]),
        "path/pose/orientation": Rotation.from_euler("ZYX", np.outer(angles, [1.0, 0.3, -0.2])).as_quat(),
        "path/pose/ts": POSE_STEP_US * np.arange(POSES),
    }


def write_truth(path: Path, *without: str, **changed: Array) -> Path:
    """Write the sequence, without some datasets."""
    with h5py.File(path, "w") as file:
        file.attrs.update({"format": "fedora", "format_version": "1.0"})
        for key, values in {**truth(), **changed}.items():
            if key not in without:
                file[key] = values
        file["metadata/depth_range"] = np.array([0.1, 30.0])
    return path


def write_predictions(path: Path, datasets: Mapping[str, Array]) -> Path:
    """Write datasets as a learner does: no metadata, no units."""
    with h5py.File(path, "w") as file:
        for key, values in datasets.items():
            file[key] = values
    return path


def of_stream(stream: str, **changed: Array) -> dict[str, Array]:
    """The datasets of a stream of the truth, some of them changed, by the last part of their key."""
    datasets = {key: values for key, values in truth().items() if key.startswith(f"path/{stream}")}
    datasets.pop(f"path/{stream}_moving", None)
    return datasets | {next(key for key in datasets if key.endswith(name)): values for name, values in changed.items()}
