"""Pictures as data URIs, so that a report is one file."""

import base64
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from fedora_reports import colour_maps

_LONGEST: Final = 720
"""Pixels of the longest side: the report displays no picture with more."""

_LOSSLESS: Final = 101
"""OpenCV writes WebP without loss above quality 100."""

_QUALITIES: Final = (85, 60)
_MOST_BYTES: Final = 13_000
"""Of one picture. About 225 of them (41 snapshots of 5, and some maps) make 3.9 MB of a report of at most 6."""

_LEAST_STEP: Final = 0.9
"""A picture of too many bytes is made smaller by at least this factor at a time."""


@dataclass(frozen=True, slots=True)
class Image:
    """An encoded picture, and its content in words."""

    uri: str
    width: int
    height: int
    alt: str


def photograph(picture: colour_maps.Picture, alt: str) -> Image:
    """Encode a camera's picture (h, w, 3) uint8 RGB; ``alt`` is its content in words."""
    return _image(picture, alt, _QUALITIES)


def drawing(picture: colour_maps.Picture, alt: str) -> Image:
    """Encode a picture (h, w, 3) uint8 RGB whose colours are values: without loss, where that is not too large."""
    return _image(picture, alt, (_LOSSLESS, *_QUALITIES))


def png_uri(png: bytes) -> str:
    """Return a PNG file as a data URI."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


def _image(picture: colour_maps.Picture, alt: str, qualities: tuple[int, ...]) -> Image:
    """Encode with the first of the qualities that keeps the picture small; where none does, make it smaller."""
    scale = min(_LONGEST / max(picture.shape[:2]), 1.0)
    while True:
        resized = picture
        if scale < 1.0:
            height, width = (max(round(side * scale), 1) for side in picture.shape[:2])
            resized = np.asarray(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)
        for quality in qualities:
            done, buffer = cv2.imencode(".webp", resized[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, quality])
            if not done:
                raise RuntimeError("Expected OpenCV to write WebP, got none; install opencv-contrib-python-headless")
            encoded = buffer.tobytes()
            if len(encoded) <= _MOST_BYTES or max(resized.shape[:2]) <= 1:
                uri = "data:image/webp;base64," + base64.b64encode(encoded).decode("ascii")
                return Image(uri, resized.shape[1], resized.shape[0], alt)
        # The number of bytes is nearly proportional to the number of pixels.
        scale *= min((_MOST_BYTES / len(encoded)) ** 0.5, _LEAST_STEP)
        qualities = qualities[-1:]
