"""Edges of colour frames, and of events, around the steps of depth in one window."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.depth.edge_profiles import difference_profiles, root_counts, tile_profiles
from fedora_qa.estimators.depth.inverse_depth import DepthSteps, depth_steps
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_mapping import outlines_in_camera, why_not_comparable
from fedora_qa.views.flow_intervals import frame_at
from fedora_qa.views.frames import is_large, luma_dn
from fedora_qa.views.sensor_events import sensor_shape

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

FRAMES: Final = 2
"""Depth frames of a window that are used, evenly spread: edges move little meanwhile."""

_SHORT_NS: Final = NS_PER_S // 10

_EVERY_NS: Final = NS_PER_S // 20
"""Windows shorter than 0.1 s use one frame for each point of a grid of 0.05 s.

Texture causes the standard errors; it differs from place to place and hardly over time. Over 1 s at 1440x1080, 20
frames give the standard errors of 41 frames within 1%. With 10 frames, as with windows of the usual length, standard
errors are 9 to 15% larger. Large frames use a grid of 0.1 s and half the lines: the limit to the right is 9% larger,
the limit down is the same.
"""

LINES: Final = 270
"""Least number of lines of pixels that are searched along each axis of a frame, evenly spread.

Large frames use half as many. An outline, and the texture beside it, changes little over a few pixels: at 1440x1080
every fourth line gives the same standard error as all of them, to 1%.
"""

VARIANTS: Final = ("as stored", "mirrored left to right", "mirrored top to bottom")
_MIRRORED: Final = ((False, False), (True, False), (False, True))

DARK_DN: Final = 8.0
"""Added before the logarithm: below it rounding to 8 bits is more than 6% of the signal."""

EVENTS_AROUND_NS: Final = 10_000_000
"""Events from 10 ms before to 10 ms after a frame lie on both sides of its edges equally often."""


@dataclass(frozen=True, slots=True)
class DepthEdges:
    """Sums of edge profiles (see ``edge_profiles``) over the frames of a window.

    Attributes
    ----------
    colour
        (3, 2, 2, tiles, 2 R + 1) by variant (as stored, and mirrored in two ways), by direction (right, down), by side
        (far, near), by tile and by distance in px.
    events
        (2, 2, tiles, 2 R + 1) of event counts, without the axis of variants; distances in px of the event camera.
    frames
        Number of depth frames that were summed.
    """

    colour: Float64
    events: Float64
    frames: int


def why_depth_and_colour_do_not_meet(facts: Facts) -> str:
    """Return why depth and colour frames cannot be compared; empty where they can."""
    return why_not_comparable(facts, "depth", "rgb")


def depth_edges(window: Window) -> DepthEdges | None:
    """Return the sums of edge profiles of a window, computed once for all checks.

    Returns
    -------
    DepthEdges or None
        None where no depth frame has the timestamp of a colour frame.
    """
    return window.derived(_measure)


def _measure(window: Window) -> DepthEdges | None:
    clocks = window.facts.clocks
    if not {"depth", "rgb"} <= clocks.keys() or why_depth_and_colour_do_not_meet(window.facts):
        return None
    rows = chosen_rows(window, lambda row: _colour_row(window.facts, row) is not None)
    chosen = [(row, rgb_row) for row in rows if (rgb_row := _colour_row(window.facts, row)) is not None]
    profiles = [of_frame for pair in chosen if (of_frame := _frame_profiles(window, *pair)) is not None]
    if not profiles:
        return None
    colour, events = (np.sum(of_frames, axis=0) for of_frames in zip(*profiles, strict=True))
    return DepthEdges(colour, events, len(profiles))


def chosen_rows(window: Window, is_usable: Callable[[int], bool] = lambda _: True) -> list[int]:
    """Return the depth frames of a window that are used, evenly spread.

    Parameters
    ----------
    is_usable
        Whether a row of the depth stream may be used, whatever the window.
    """
    usable = [row for row in window.owned("depth") if is_usable(row)]
    if window.span.stop_ns - window.span.start_ns >= _SHORT_NS:
        evenly = np.unique(np.linspace(0, len(usable) - 1, FRAMES).round().astype(int)) if usable else ()
        return [usable[int(i)] for i in evenly]
    # Short windows take the frames of a grid in time, which does not depend on how the file is cut: in each cell the
    # first usable depth frame.
    every_ns = 2 * _EVERY_NS if _is_large(window) else _EVERY_NS
    times_ns = window.facts.clocks["depth"].times_ns
    chosen = []
    for row in usable:
        cell, earlier = times_ns[row] // every_ns, row - 1
        while earlier >= 0 and times_ns[earlier] // every_ns == cell and not is_usable(earlier):
            earlier -= 1
        if earlier < 0 or times_ns[earlier] // every_ns != cell:
            chosen.append(row)
    return chosen


def _colour_row(facts: Facts, row: int) -> int | None:
    """Return the row of the colour frame with the timestamp of a depth frame."""
    return frame_at(facts.clocks["rgb"], int(facts.clocks["depth"].times_ns[row]))


def _is_large(window: Window) -> bool:
    camera = window.facts.declared.cameras["depth"]
    return is_large(camera.width * camera.height, window)


def steps_of_frame(window: Window, row: int, axis: int) -> DepthSteps:
    """Return the steps of a depth frame along an axis: 0 to the right, 1 down."""
    return window.derived(_steps_of_frame, row, axis)


def _steps_of_frame(window: Window, row: int, axis: int) -> DepthSteps:
    depth_m = window.depth_m(row)
    lines = LINES // 2 if _is_large(window) else LINES
    every = max(1, min(depth_m.shape) // lines)
    return depth_steps(depth_m, axis, farthest_m=window.derived(_farthest_m, row), every=every)


def _farthest_m(window: Window, row: int) -> float:
    """Return the distance beyond which depth is missing: as declared, or else the farthest in a frame, m."""
    if window.facts.declared.depth_range_m is not None:
        return window.facts.declared.depth_range_m[1]
    depth_m = window.depth_m(row)
    finite_m = depth_m[np.isfinite(depth_m)]
    return float(finite_m.max()) if len(finite_m) and finite_m.max() > 0 else 1.0


def _frame_profiles(window: Window, row: int, rgb_row: int) -> tuple[Float64, Float64] | None:
    """Return the edge profiles of one depth frame against colour and events, as in ``DepthEdges``."""
    try:
        steps_of_axes = [steps_of_frame(window, row, axis) for axis in (0, 1)]
        luma = luma_dn(window, rgb_row)
    except UnreadableRowsError:
        return None
    facts, cameras = window.facts, window.facts.declared.cameras
    # The logarithm is taken in place: frames are large.
    # Differences of the logarithm are contrasts, which do not depend on how brightly an edge is lit.
    log_luma = luma + np.float32(DARK_DN)
    np.log(log_luma, out=log_luma)
    # Events of each pixel around the frame, as the square root, which makes the variance of counts constant.
    counts: Float32 | None = None
    if "events" in facts.streams and not why_not_comparable(facts, "depth", "events"):
        height, width = sensor_shape(facts.declared)
        stored, time_ns = window.events(EVENTS_AROUND_NS, EVENTS_AROUND_NS), int(facts.clocks["depth"].times_ns[row])
        start, stop = np.searchsorted(stored.times_ns, [time_ns - EVENTS_AROUND_NS, time_ns + EVENTS_AROUND_NS])
        x, y = (coordinates[start:stop].astype(np.int64) for coordinates in (stored.x, stored.y))
        counts = np.asarray(root_counts(x, y, height, width))
    colour, events = [], []
    for axis, steps in enumerate(steps_of_axes):
        positions = outlines_in_camera(cameras["depth"], cameras["rgb"], steps)
        colour.append([difference_profiles(log_luma, steps, axis, positions, mirrored) for mirrored in _MIRRORED])
        if counts is None:
            events.append(np.zeros_like(colour[-1][0]))
        else:
            positions = outlines_in_camera(cameras["depth"], cameras["events"], steps)
            events.append(tile_profiles(counts, steps, axis, positions, first_px=0.0))
    return np.swapaxes(np.array(colour), 0, 1), np.array(events)
