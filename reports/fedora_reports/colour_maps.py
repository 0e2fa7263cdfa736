"""Numbers as colours: depth, flow, events, and maps. Pictures are (h, w, 3) uint8 RGB.

A pixel without a value is grey. Colour-blind readers can read every picture: depth and maps by lightness (viridis; blue
to red through white for signed values), events by red and blue of different lightness. The direction of flow is a hue
(Baker et al., "A database and evaluation methodology for optical flow", 2011), so the drawings add arrows.
"""

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
