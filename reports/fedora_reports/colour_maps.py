"""Numbers as colours, and pictures as data URIs.

A pixel without a value is grey. Colour-blind readers can read every picture: depth and maps by lightness (viridis; blue
to red through white for signed values), events by red and blue of different lightness. The direction of flow is a hue
(Baker et al., "A database and evaluation methodology for optical flow", 2011), so the drawings add arrows.
"""

import base64
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]

NO_VALUE: Final = (136, 136, 136)
"""Grey where there is no value."""

BRIGHTER: Final = (196, 38, 29)
DARKER: Final = (22, 92, 180)
NO_EVENT: Final = (250, 250, 247)

_FADED: Final = 0.4
"""Share of its contrast that a frame keeps under events."""


SEQUENTIAL: Final[Picture] = np.ascontiguousarray(
    cv2.applyColorMap(np.arange(256, dtype=np.uint8)[:, None], cv2.COLORMAP_VIRIDIS)[:, 0, ::-1]
)
"""(256, 3) from dark violet to bright yellow, even in lightness: viridis."""

_ANCHORS: Final = np.array(
    [(20, 60, 130), (90, 150, 205), (245, 245, 242), (230, 130, 95), (140, 20, 35)], dtype=np.float64
)
DIVERGING: Final[Picture] = np.rint(
    np.stack(
        [np.interp(np.linspace(0.0, 1.0, 256), np.linspace(0.0, 1.0, len(_ANCHORS)), _ANCHORS[:, k]) for k in range(3)],
        axis=1,
    )
).astype(np.uint8)
"""(256, 3) from blue through white (128) to red, interpolated between anchors."""


def by_table(shares: NDArray[np.float64], table: Picture) -> Picture:
    """Colour shares of a scale.

    Parameters
    ----------
    shares
        Any shape, 0 to 1; values beyond are clipped, NaN is grey.
    table
        (256, 3), the colours from 0 to 1.
    """
    is_finite = np.isfinite(shares)
    steps = np.rint(np.where(is_finite, np.clip(shares, 0.0, 1.0), 0.0) * 255).astype(np.intp)
    picture: Picture = table[steps]
    picture[~is_finite] = NO_VALUE
    return picture


def flow_colours(flow_px: NDArray[Any], full_px: float) -> Picture:
    """Colour flow: hue is its direction, red to the right; saturation is its length.

    Parameters
    ----------
    flow_px
        (h, w, 2), u right and v down.
    full_px
        Length that has the full saturation. Longer flow has the same; no flow is white, NaN is grey.
    """
    u, v = (np.asarray(flow_px[..., k], dtype=np.float64) for k in (0, 1))
    is_finite = np.isfinite(u) & np.isfinite(v)
    u, v = np.where(is_finite, u, 0.0), np.where(is_finite, v, 0.0)
    length = np.hypot(u, v) / full_px if full_px > 0 else np.zeros_like(u)
    hue_deg = np.degrees(np.arctan2(v, u)) % 360.0
    hsv = np.stack([hue_deg, np.clip(length, 0.0, 1.0), np.ones_like(u)], axis=-1).astype(np.float32)
    picture: Picture = np.rint(cv2.cvtColor(hsv, cv2.COLOR_HSV2RGB) * 255).astype(np.uint8)
    picture[~is_finite] = NO_VALUE
    return picture


def flow_wheel(size: int) -> Picture:
    """Return the legend of ``flow_colours``: each direction in its colour, full at the rim, white outside it."""
    across = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    u, v = np.meshgrid(across, across)
    outside = np.hypot(u, v) > 1.0
    picture = flow_colours(np.stack([u, v], axis=-1), 1.0)
    picture[outside] = 255
    return picture


def faded(picture: Picture) -> Picture:
    """Return a picture in pale grey, on which a drawing over it stands out."""
    luma = picture.astype(np.float64) @ np.array([0.299, 0.587, 0.114])
    pale = np.rint(255.0 - _FADED * (255.0 - luma))
    return np.repeat(pale[..., None], 3, axis=2).astype(np.uint8)


def event_colours(brighter: NDArray[Any], darker: NDArray[Any], full: float, ground: Picture | None = None) -> Picture:
    """Colour counts of events: red brighter, blue darker, purple both.

    Parameters
    ----------
    brighter, darker
        (h, w), events of each polarity by pixel.
    full
        Events a pixel that are opaque; more are too.
    ground
        (h, w, 3), the picture that they are drawn over; an empty page where it is None.
    """
    under = np.array(NO_EVENT, np.float64) if ground is None else ground.astype(np.float64)
    on, off = (np.asarray(counts, dtype=np.float64) for counts in (brighter, darker))
    total = on + off
    share_on = np.divide(on, total, out=np.zeros_like(on), where=total > 0)[..., None]
    # A single event must be visible beside `full` of them: opacity starts at a half.
    opacity = np.where(total > 0, 0.5 + 0.5 * np.clip((total - 1) / max(full - 1, 1.0), 0.0, 1.0), 0.0)[..., None]
    ink = share_on * np.array(BRIGHTER) + (1 - share_on) * np.array(DARKER)
    return np.asarray(np.rint(opacity * ink + (1 - opacity) * under), dtype=np.uint8)


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


def photograph(picture: Picture, alt: str) -> Image:
    """Encode a camera's picture (h, w, 3) uint8 RGB; ``alt`` is its content in words."""
    return _image(picture, alt, _QUALITIES)


def drawing(picture: Picture, alt: str) -> Image:
    """Encode a picture (h, w, 3) uint8 RGB whose colours are values: without loss, where that is not too large."""
    return _image(picture, alt, (_LOSSLESS, *_QUALITIES))


def png_uri(png: bytes) -> str:
    """Return a PNG file as a data URI."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


def _image(picture: Picture, alt: str, qualities: tuple[int, ...]) -> Image:
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
