"""Pictures as data URIs, so that a report is one file."""

import base64
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from fedora_reports import colour_maps

_LONGEST: Final = 720
"""Pixels of the longest side: more is not seen at the widths at which the report shows a picture."""

_PHOTO_QUALITY: Final = 85
_LOSSLESS: Final = 101
"""OpenCV writes WebP without loss above quality 100."""


@dataclass(frozen=True, slots=True)
class Image:
    """An encoded picture, with what it shows in words."""

    uri: str
    width: int
    height: int
    alt: str


def photograph(picture: colour_maps.Picture, alt: str) -> Image:
    """Encode a camera's picture (h, w, 3) uint8 RGB."""
    return _encoded(picture, alt, _PHOTO_QUALITY)


def drawing(picture: colour_maps.Picture, alt: str) -> Image:
    """Encode a picture (h, w, 3) uint8 RGB whose colours are values: without loss."""
    return _encoded(picture, alt, _LOSSLESS)


def png_uri(png: bytes) -> str:
    """Return a picture that is PNG already as a data URI."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


def _encoded(picture: colour_maps.Picture, alt: str, quality: int) -> Image:
    height, width = picture.shape[:2]
    scale = _LONGEST / max(height, width)
    if scale < 1.0:
        width, height = max(round(width * scale), 1), max(round(height * scale), 1)
        picture = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA).astype(np.uint8)
    done, encoded = cv2.imencode(".webp", picture[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, quality])
    if not done:
        raise RuntimeError("Expected OpenCV to write WebP, got none; install opencv-contrib-python-headless")
    uri = "data:image/webp;base64," + base64.b64encode(encoded.tobytes()).decode("ascii")
    return Image(uri, width, height, alt)
