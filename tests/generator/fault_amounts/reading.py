"""What faulty sequences hold, read without the code that wrote it."""

from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

EVENTS = [f"path/events/{name}" for name in "xytp"]


def read(path: Path, key: str) -> NDArray[Any]:
    """A dataset, or an attribute written as ``owner@name``."""
    owner, _, attribute = key.partition("@")
    with h5py.File(path) as file:
        return np.asarray(file[owner].attrs[attribute] if attribute else file[owner][...])


def events(path: Path) -> NDArray[np.int64]:
    """All events (n, 4): x, y, t, p."""
    return np.stack([read(path, key).astype(np.int64) for key in EVENTS], axis=-1)


def true_maps(path: Path) -> bool:
    """Whether both index maps are what the stamps of the file say."""
    t = read(path, "path/events/t")
    frames = ("rgb", "depth")
    return all(
        np.array_equal(read(path, f"metadata/{each}_to_event"), np.searchsorted(t, read(path, f"path/{each}_ts")))
        for each in frames
    )
