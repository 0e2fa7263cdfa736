"""The yardstick of a folder: every image decoded once by OpenCV, every dataset by plain h5py, in one thread."""

import time
from pathlib import Path
from statistics import median

import cv2

from tests.benchmarks.full_size.plain_reading import decode

_TURNS = 3


def decode_folder(folder: Path) -> int:
    """Decode every PNG and every HDF5 file below a folder, and return how many bytes that gave."""
    decoded = 0
    for path in sorted(folder.rglob("*.png")):
        image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if image is None:
            raise RuntimeError(f"Expected an image that OpenCV decodes, got {path}")
        decoded += image.nbytes
    return decoded + sum(decode(path) for path in sorted(folder.rglob("*.h5")))


def reading_s(folder: Path) -> float:
    """Return the median time of decoding a folder, s. It is read once before: that brings it into memory."""
    cv2.setNumThreads(1)
    decode_folder(folder)
    times_s = []
    for _ in range(_TURNS):
        began = time.perf_counter()
        decode_folder(folder)
        times_s.append(time.perf_counter() - began)
    return median(times_s)
