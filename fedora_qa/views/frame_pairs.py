"""Pairs of colour frames that a window owns, with the flow between them where the file has any."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.images.samples import along_the_flow
from fedora_qa.layout.canonical import datasets_of
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import frame_at, owned_intervals
from fedora_qa.views.large_frames import is_large
from fedora_qa.views.luma import luma_dn
from fedora_qa.views.warped_frames import Optics, optics_of

Float32 = NDArray[np.float32]

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
        (H, W, 2) flow (u right, v down) from the earlier to the later frame, px; None where the file has none.
    """

    before: int
    after: int
    flow_px: Float32 | None


def flow_rate_of(window: Window) -> str | None:
    """Return the fastest flow stream on whose grid frames can be compared; None where there is none.

    Mapped onto the grid of the flow, a colour frame must have the rows and columns of the stored flow.
    """
    facts, optics = window.facts, _optics(window)
    if not facts.flow_streams or isinstance(optics, str):
        return None
    stream, bindings = facts.flow_streams[-1], facts.layout.bindings
    image, *_ = (spec.key for spec in datasets_of(stream) if spec.is_image)
    if image not in bindings or "path/rgb" not in bindings:  # without sizes there is nothing to compare
        return stream
    # A colour frame, mapped onto the grid of the flow, must have its rows and columns.
    size = bindings["path/rgb"].shape[1:3]
    if optics.H_rgb_flow is not None:
        depth = facts.declared.cameras["depth"]  # whose grid frames are mapped to
        size = (depth.height, depth.width)
    return stream if bindings[image].shape[1:3] == size else None


def _optics(window: Window) -> Optics | str:
    return window.once("optics of frames", lambda: optics_of(window.facts))


def pairs_with_flow(window: Window) -> Iterator[FrameTransition]:
    """Yield the frames at both ends of each field of the fastest flow that the window owns."""
    stream = flow_rate_of(window)
    if stream is None:
        return
    clock = window.facts.clocks["rgb"]
    for interval in owned_intervals(window, stream):
        before, after = frame_at(clock, interval.start_ns), frame_at(clock, interval.end_ns)
        if before is not None and after is not None:
            yield FrameTransition(before, after, window.flow_px(stream, interval.row))


def neighbours(window: Window) -> Iterator[FrameTransition]:
    """Yield each frame that the window owns with the one before it, without flow."""
    for frame in window.owned("rgb"):
        if frame > 0:
            yield FrameTransition(frame - 1, frame, None)


def luma_on_flow_grid(window: Window, frame: int) -> Float32:
    """Return the luma of a colour frame on the grid of the flow.

    Parameters
    ----------
    window
        A window of the sequence.
    frame
        Row of the colour frame.

    Returns
    -------
    ndarray of float32
        (H, W) linear luma, DN.
    """
    optics = _optics(window)
    if not isinstance(optics, Optics) or optics.H_rgb_flow is None:
        return luma_dn(window, frame)
    H_rgb_flow, camera = optics.H_rgb_flow, window.facts.declared.cameras["depth"]
    # H maps flow pixels to colour pixels, which is the inverse map that OpenCV reads with (WARP_INVERSE_MAP).
    size, flags = (camera.width, camera.height), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP

    def warped() -> Float32:
        warped_dn = cv2.warpPerspective(luma_dn(window, frame), H_rgb_flow, size, flags=flags)
        return np.asarray(warped_dn, dtype=np.float32)

    return window.of_image("luma on the flow's grid", frame, warped)


def same_points(window: Window, pair: FrameTransition) -> tuple[Float32, Float32]:
    """Return the luma of both frames at points that both show, on a coarse grid.

    Without flow, the points are equal pixels of both frames, averaged over coarse ones.

    Parameters
    ----------
    window
        A window of the sequence.
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
