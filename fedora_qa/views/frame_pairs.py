"""Pairs of colour frames that a window owns, with the flow between them where the file has any."""

from collections.abc import Iterator
from dataclasses import dataclass
from sys import maxsize
from typing import Final, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.images.samples import along_the_flow
from fedora_qa.layout.canonical import datasets_of
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import frame_at, owned_intervals
from fedora_qa.views.frames import is_large, luma_dn
from fedora_qa.views.warped_frames import Optics, optics_of

Float32 = NDArray[np.float32]
Box = tuple[int, int, int, int]
"""Left, top, right, bottom, px, half-open."""

_T = TypeVar("_T", bound=np.generic)

WHOLE: Final = (0, 0, maxsize, maxsize)
"""The rectangle that holds any image."""

_ON_PIXEL: Final = 1e-6
"""Distance from the centre of a pixel, px, that is rounding."""

_SAME_SCALE: Final = 0.01
"""Difference of the scales of two grids below which frames are not averaged: a hundredth of a pixel is no detail."""

_LEAST_VARIANCE_PX2: Final = 1e-2
"""Least s^2 - 1 along the axis of the smaller scale: OpenCV takes the other axis for one of no width."""

_FIRST_ROWS: Final = 1000
"""Frames and intervals that decide which flow leads from frame to frame: each window asks."""

SAMPLED_COLUMNS: Final = 160
"""Approximate number of columns of points that are compared: exposure is the same in all of the image."""

_FEWER_COLUMNS: Final = 100
"""Columns of points in large frames, unless all pixels are to be used (``exhaustive``).

In large frames each point costs one access to memory. With two fifths of the points in the same tiles the error of a
pair grows by a third. The detection limit of a jump in park-day, mostly from the motion of points, grows by 5%.
"""


@dataclass(frozen=True, slots=True)
class FrameTransition:
    """Two colour frames, and the flow between them.

    Attributes
    ----------
    before, after
        Rows of the earlier and of the later frame.
    flow_px
        (h, w, 2) flow (u right, v down) from the earlier to the later frame in the part of its grid that the colour
        camera sees (``seen_part``), px; None where the file has none.
    """

    before: int
    after: int
    flow_px: Float32 | None


def flow_rate_of(window: Window) -> str | None:
    """Return the fastest flow stream between colour frames on whose grid these can be compared; None without one.

    Mapped onto the grid of the flow, a colour frame must have the rows and columns of the stored flow.
    """
    return window.derived(_flow_rate_of)


def _flow_rate_of(window: Window) -> str | None:
    facts, optics = window.facts, _optics(window)
    if not facts.flow_streams or isinstance(optics, str):
        return None
    stream, bindings = _fastest_between_frames(facts), facts.layout.bindings
    image, *_ = (spec.key for spec in datasets_of(stream) if spec.is_image)
    if image not in bindings or "path/rgb" not in bindings:  # without sizes there is nothing to compare
        return stream
    # A colour frame, mapped onto the grid of the flow, must have its rows and columns.
    size = bindings["path/rgb"].shape[1:3]
    if optics.H_rgb_flow is not None:
        depth = facts.declared.cameras["depth"]  # whose grid frames are mapped to
        size = (depth.height, depth.width)
        left, top, right, bottom = seen_part(window)
        if min(right - left, bottom - top) < 1:
            return None
    return stream if bindings[image].shape[1:3] == size else None


def _fastest_between_frames(facts: Facts) -> str:
    """Return the fastest flow stream with an interval between colour frames among the first; else the fastest."""
    frames_ns = facts.clocks["rgb"].times_ns[:_FIRST_ROWS] if "rgb" in facts.clocks else np.empty(0, np.int64)
    for stream in reversed(facts.flow_streams):
        clock = facts.clocks[stream]
        stops_ns = clock.times_ns if clock.ends_ns is None else clock.ends_ns
        starts_on, stops_on = (np.isin(ns[:_FIRST_ROWS], frames_ns) for ns in (clock.times_ns, stops_ns))
        if np.any(starts_on & stops_on):
            return stream
    return facts.flow_streams[-1]


def _optics(window: Window) -> Optics | str:
    return window.derived(_optics_of_frames)


def _optics_of_frames(window: Window) -> Optics | str:
    return optics_of(window.facts)


def seen_part(window: Window) -> Box:
    """Return the rectangle of the flow's grid that the colour camera sees.

    Returns
    -------
    tuple of int
        Left, top, right, bottom, px of the flow's grid, half-open; without an area where the cameras see nothing in
        common. All of the grid where frames are not mapped.
    """
    return window.derived(_seen_part)


def _seen_part(window: Window) -> Box:
    optics, cameras = _optics(window), window.facts.declared.cameras
    if not isinstance(optics, Optics) or optics.H_rgb_flow is None:
        return WHOLE
    rgb, depth = cameras["rgb"], cameras["depth"]
    # Centres of the pixels in the corners of the colour frame, between which it can be interpolated.
    right, bottom = rgb.width - 1, rgb.height - 1
    corners = np.array([[0, 0, 1], [right, 0, 1], [0, bottom, 1], [right, bottom, 1]], dtype=np.float64).T
    mapped = np.linalg.inv(optics.H_rgb_flow) @ corners
    if not (mapped[2] > 0).all():
        return 0, 0, 0, 0
    # Between the second and the third corner along each axis lies a rectangle within a quadrilateral that is little
    # rotated.
    edges = np.sort(mapped[:2] / mapped[2], axis=1)[:, 1:3]
    first = np.maximum(np.ceil(edges[:, 0] - _ON_PIXEL), 0).astype(int)
    stop = np.minimum(np.floor(edges[:, 1] + _ON_PIXEL) + 1, [depth.width, depth.height]).astype(int)
    return int(first[0]), int(first[1]), max(int(stop[0]), int(first[0])), max(int(stop[1]), int(first[1]))


def within(box: Box, image: NDArray[_T]) -> NDArray[_T]:
    """Return the part of an image in a rectangle.

    Parameters
    ----------
    box
        Left, top, right, bottom, px, half-open.
    image
        (H, W, ...) of any values.

    Returns
    -------
    ndarray
        (h, w, ...) a view where that is all of the image, else a contiguous copy.
    """
    left, top, right, bottom = box
    if left <= 0 and top <= 0 and right >= image.shape[1] and bottom >= image.shape[0]:
        return image
    return np.ascontiguousarray(image[top:bottom, left:right])


def pairs_with_flow(window: Window) -> Iterator[FrameTransition]:
    """Yield the frames at both ends of each field of the fastest flow that the window owns."""
    stream = flow_rate_of(window)
    if stream is None:
        return
    clock = window.facts.clocks["rgb"]
    for interval in owned_intervals(window, stream):
        before, after = frame_at(clock, interval.start_ns), frame_at(clock, interval.end_ns)
        if before is not None and after is not None:
            yield FrameTransition(before, after, within(seen_part(window), window.flow_px(stream, interval.row)))


def neighbours(window: Window) -> Iterator[FrameTransition]:
    """Yield each frame that the window owns with the one before it, without flow."""
    for frame in window.owned("rgb"):
        if frame > 0:
            yield FrameTransition(frame - 1, frame, None)


def luma_on_flow_grid(window: Window, frame: int) -> Float32:
    """Return the luma of a colour frame on the part of the flow's grid that the colour camera sees.

    Parameters
    ----------
    frame
        Row of the colour frame.

    Returns
    -------
    ndarray of float32
        (h, w) linear luma, DN; the part is ``seen_part``.
    """
    optics = _optics(window)
    if not isinstance(optics, Optics) or optics.H_rgb_flow is None:
        return luma_dn(window, frame)
    return window.derived_image(_warped_luma_dn, frame)


def _warped_luma_dn(window: Window, frame: int) -> Float32:
    luma, optics, camera = luma_dn(window, frame), _optics(window), window.facts.declared.cameras["depth"]
    if not isinstance(optics, Optics) or optics.H_rgb_flow is None:
        return luma
    H_rgb_flow = optics.H_rgb_flow
    # H maps flow pixels to colour pixels, which is the inverse map that OpenCV reads with (WARP_INVERSE_MAP).
    size, flags = (camera.width, camera.height), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    # Colour pixels along each axis of a pixel of the flow's grid: columns of H, at the image's scale.
    scales = np.linalg.norm(H_rgb_flow[:2, :2] / H_rgb_flow[2, 2], axis=0)
    if scales.max() > 1 + _SAME_SCALE:
        # On a grid of every s-th pixel, detail finer than 2 s appears as coarser detail, which does not move as the
        # flow does (aliasing). A Gaussian of variance (s^2 - 1) / 4 px^2 leaves exp(-3 pi^2 / 8) = 2.5% of the finest
        # detail, of 2 px, at s = 2, and less at larger s.
        sigma_x, sigma_y = np.sqrt(np.maximum(scales**2 - 1, _LEAST_VARIANCE_PX2)) / 2
        luma = np.asarray(cv2.GaussianBlur(luma, (0, 0), sigmaX=sigma_x, sigmaY=sigma_y), dtype=np.float32)
    warped_dn = cv2.warpPerspective(luma, H_rgb_flow, size, flags=flags)
    return within(seen_part(window), np.asarray(warped_dn, dtype=np.float32))


def same_points(window: Window, pair: FrameTransition) -> tuple[Float32, Float32]:
    """Return the luma of both frames at points that both show, on a coarse grid.

    Without flow, the points are equal pixels of both frames, averaged over coarse ones.

    Parameters
    ----------
    pair
        Two colour frames, with the flow between them where the file has any.

    Returns
    -------
    before_dn
        (h, w) linear luma, DN.
    after_dn
        (h, w) linear luma, DN; NaN where the second frame does not show the point.
    """
    if pair.flow_px is None:
        return _coarse(luma_dn(window, pair.before)), _coarse(luma_dn(window, pair.after))
    before, after = (luma_on_flow_grid(window, frame) for frame in (pair.before, pair.after))
    step = max(1, before.shape[1] // (_FEWER_COLUMNS if is_large(before.size, window) else SAMPLED_COLUMNS))
    return along_the_flow(before, after, pair.flow_px, step)


def _coarse(luma: Float32) -> Float32:
    height, width = luma.shape
    size = (min(width, SAMPLED_COLUMNS // 4), min(height, max(1, SAMPLED_COLUMNS * height // (4 * width))))
    return np.asarray(cv2.resize(luma, size, interpolation=cv2.INTER_AREA), dtype=np.float32)
