"""Edges of events around the steps of depth in one window, through the lenses of both cameras."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.depth.edge_profiles import root_counts, tile_profiles
from fedora_qa.estimators.events.tracked_level import DelaySums
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_mapping import outlines_in_camera, why_not_comparable, why_not_one_view
from fedora_qa.views.depth_edges import EVENTS_AROUND_NS, chosen_rows, steps_of_frame
from fedora_qa.views.event_delays import event_delay_sums

Float64 = NDArray[np.float64]

CORNER_PX: Final = (0.0, *(sign * 8.0 * 2 ** (step / 2) for step in range(7) for sign in (-1, 1)))
"""Displacements of the corners of the image, px, outwards positive, by distortions that are tried; first as declared.

A distortion of the third order displaces a point by the cube of its distance from the centre, over the image by 0.22 of
the displacement of the corners on average. The smallest displaces by 1.8 px: it fits better than the lens as declared
only where events lie 0.9 px outwards or inwards, farther than texture and lag move them. Smaller distortions move the
mean of all events, which is measured. Between two of these distortions the nearer one misplaces points at half of the
distance of a corner by up to 1/40 of the displacement of the corner, 1.2 px at 48 px: edges still overlap. The largest
is about that of k1 = -0.37 and k2 = 0.16 at 640x480 and a focal length of 554 px.
"""


@dataclass(frozen=True, slots=True)
class EventDepthEdges:
    """Sums over the depth frames of a window.

    Attributes
    ----------
    profiles
        (distortions, 2, 2, tiles, 2 R + 1) of event counts (see ``edge_profiles``), by distortion of ``CORNER_PX``, by
        direction (right, down), by side, by tile and by distance in px of the event camera.
    outward
        (2, tiles, 2 R + 1) of both directions together, with distances away from the principal point.
    lags
        (2, 2) by direction: sum over steps of depth with events of the largest lag of their events behind the edge,
        px, and number of these steps.
    frames
        Number of depth frames.
    delays
        Sums for the delay of events against colour; none where no frame has colour and flow.
    """

    profiles: Float64
    outward: Float64
    lags: Float64
    frames: int
    delays: tuple[DelaySums, ...] = ()


def only_depth_locates_events(facts: Facts) -> bool:
    """Whether colour cannot be compared with events pixel by pixel, and depth can be projected into their camera."""
    return (
        "depth" in facts.clocks
        and bool(why_not_one_view(facts, "events", "rgb", rotated=True))
        and not why_not_comparable(facts, "depth", "events")
    )


def event_depth_edges(window: Window) -> EventDepthEdges | None:
    """Return the sums of edge profiles of a window; None where no depth frame lies in it."""
    sums = [of_frame for row in chosen_rows(window) if (of_frame := _of_frame(window, row)) is not None]
    if not sums:
        return None
    profiles, outward, lags = (np.sum(of_frames, axis=0) for of_frames in zip(*sums, strict=True))
    return EventDepthEdges(profiles, outward, lags, len(sums), event_delay_sums(window))


def _of_frame(window: Window, row: int) -> tuple[Float64, Float64, Float64] | None:
    try:
        steps_of_axes = [steps_of_frame(window, row, axis) for axis in (0, 1)]
    except UnreadableRowsError:
        return None
    facts, time_ns = window.facts, int(window.facts.clocks["depth"].times_ns[row])
    depth_camera, camera = facts.declared.cameras["depth"], facts.declared.cameras["events"]
    stored = window.events(EVENTS_AROUND_NS, EVENTS_AROUND_NS)
    near = slice(*np.searchsorted(stored.times_ns, [time_ns - EVENTS_AROUND_NS, time_ns + EVENTS_AROUND_NS]))
    x, y, p = (column[near].astype(np.int64) for column in (stored.x, stored.y, stored.p))
    roots = np.asarray(root_counts(x, y, camera.height, camera.width))
    on_sensor = (x >= 0) & (x < camera.width) & (y >= 0) & (y < camera.height)
    net = np.zeros(roots.shape, np.int64)
    np.add.at(net, (y[on_sensor], x[on_sensor]), np.where(p[on_sensor] > 0, 1, -1))
    profiles, outward, lags = [], [], []
    for axis, steps in enumerate(steps_of_axes):
        positions = outlines_in_camera(depth_camera, camera, steps)
        profiles.append(
            [
                tile_profiles(roots, steps, axis, _displaced(positions, camera, corner_px), first_px=0.0)
                for corner_px in CORNER_PX
            ]
        )
        # Left of (above) the principal point, outwards is to the left (up), which exchanges both sides of a step.
        beyond = positions[axis] > camera.K[axis, 2]
        right, left = (
            tile_profiles(roots, steps.chosen(each), axis, (positions[0][each], positions[1][each]), first_px=0.0)
            for each in (beyond, ~beyond)
        )
        outward.append(right + left[::-1, :, ::-1])
        lags.append(_lags(positions, axis, roots, net))
    return np.swapaxes(np.array(profiles), 0, 1), np.sum(outward, axis=0), np.array(lags)


def _displaced(positions: tuple[Float64, Float64], camera: Camera, corner_px: float) -> tuple[Float64, Float64]:
    """Return positions (n,) that are displaced from the principal point by the cube of their distance from it."""
    if not corner_px:
        return positions
    offsets = positions[0] - camera.K[0, 2], positions[1] - camera.K[1, 2]
    # The corner, at half the diagonal R, is displaced by corner_px: u' = c + (u - c) (1 + corner_px r^2 / R^3).
    corner = 0.5 * np.hypot(camera.width, camera.height)
    gain = corner_px / corner**3 * (offsets[0] ** 2 + offsets[1] ** 2)
    return positions[0] + gain * offsets[0], positions[1] + gain * offsets[1]


def _lags(positions: tuple[Float64, Float64], axis: int, roots: NDArray[np.float32], net: NDArray[np.int64]) -> Float64:
    """Return the sum of the largest lags of events behind the edges at positions, px, and the number of lags.

    A pixel whose events add up to k of one polarity has crossed k thresholds C of the edge that passes it, within 1 px.
    A rising level is above its reference by C/2 on average, so that events lag by at most 1 / (2 k) of a pixel. The
    pixels beside it see the same edge.
    """
    columns, rows = (np.rint(coordinates) for coordinates in positions)
    inside = (columns >= 1) & (columns < roots.shape[1] - 1) & (rows >= 1) & (rows < roots.shape[0] - 1)
    x, y = columns[inside].astype(np.int64), rows[inside].astype(np.int64)
    beside = [(y, x + i) if axis == 0 else (y + i, x) for i in (-1, 0, 1)]
    crossed = np.max([np.abs(net[each]) for each in beside], axis=0)[roots[y, x] > 0]
    return np.array([float(np.sum(0.5 / np.maximum(crossed, 1))), float(len(crossed))])
