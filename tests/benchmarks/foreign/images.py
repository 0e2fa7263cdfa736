"""Colour as cameras and their codecs give it."""

from typing import Final

import cv2
import h5py
import numpy as np

from tests.benchmarks.foreign.rows import replace_values

COLOUR: Final = "path/rgb"


def jpeg_95(file: h5py.File) -> None:
    """Compress and decompress every frame with a JPEG codec at quality 95."""
    frames = file[COLOUR][...]
    for frame in frames:
        # OpenCV's order of channels is blue, green, red.
        _, code = cv2.imencode(".jpg", frame[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 95])
        frame[...] = cv2.imdecode(code, cv2.IMREAD_COLOR)[..., ::-1]
    replace_values(file, COLOUR, frames)


def read_noise(file: h5py.File) -> None:
    """Add normal noise of 1 DN to every channel, and round to whole DN again."""
    frames = file[COLOUR][...]
    rng = np.random.default_rng(0)
    for frame in frames:
        frame[...] = np.clip(np.rint(frame + rng.standard_normal(frame.shape)), 0, 255)
    replace_values(file, COLOUR, frames)
