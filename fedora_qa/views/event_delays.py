"""Sums for the delay of events against colour frames of another centre, which depth carries into the view of depth."""

from collections.abc import Callable
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.events.tracked_level import COLUMNS, DELAYS_MS, THRESHOLDS, DelaySums, columns_of_levels
from fedora_qa.estimators.flow.warp import read_between, smooth
from fedora_qa.geometry.lens import pixels_of_rays, rays_of_pixels
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_mapping import why_not_comparable, why_not_one_centre
from fedora_qa.views.depth_edges import DARK_DN, chosen_rows
from fedora_qa.views.flow_intervals import interval_at
from fedora_qa.views.frames import smoothed_luma_dn

Bool = NDArray[np.bool_]
Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

TILES: Final = 3
"""Parts of the image in each direction, whose sums are separate."""

_FARTHEST_NS: Final = DELAYS_MS[-1] * NS_PER_MS
"""Longest delay that is tried, and largest difference of the timestamps of frame, depth and flow that belong together:
one of these streams may be late as well."""

_MOTION_PX: Final = 2.0
"""Motion of the median pixel from the frame to either end of its interval. Most edges then pass a pixel at its begin or
its end only, which is where a delay changes the sum of events. The value is not derived: with 1 and with 3 px the
delay in park-day is the same within its error."""

_SHORTEST_S, _LONGEST_S = 0.005, 0.05
"""Bounds on half of an interval. Velocities are those of fields of 0.1 s, which do not hold for longer."""

_STEPS: Final = 8
"""Instants in half of an interval at which the level is read."""

_BEFORE: Final = 3
"""Halves of an interval before the frame at which the level is first read: the reference of a pixel depends on what
the pixel has seen before."""

_MOST_PIXELS: Final = 8_000
"""Pixels of a frame, evenly spread, that are used. Neighbours have the same errors: in six sequences of 1 s the
standard errors with 16 000 pixels are 0.89 to 1.45 of these."""

_SIGMA_PX: Final = 0.6
"""Standard deviation of the smoothing of frames, px of the view: that of the spline is 0.58. The value is not
derived: with 0.3 to 0.7 px the delay in park-day is the same within its error."""

_STEP: Final = 0.1
"""Least relative difference of the inverse depths of neighbours at an outline. The value is not derived."""

_OCCLUDED: Final = 0.03
"""Relative difference of depths from which the nearer point hides the farther one. The value is not derived."""

_MARGIN_PX: Final = 1.5
"""Distance of pixels that are used from outlines, beyond the motion: the reach of the spline."""


def event_delay_sums(window: Window) -> tuple[DelaySums, ...]:
    """Return the sums of some depth frames of a window that have a colour frame and flow, by frame.

    The level of a pixel of the event camera is read from a colour frame that depth has carried into the view of the
    depth camera: there, each point moves with the velocity of the flow.
    """
    facts = window.facts
    if not facts.flow_streams or not {"depth", "rgb"} <= facts.clocks.keys():
        return ()
    if why_not_one_centre(facts, "depth", "events") or why_not_comparable(facts, "depth", "rgb"):
        return ()
    rows = chosen_rows(window, lambda row: _has_colour_and_flow(facts, row))
    return tuple(each for row in rows if (each := _of_frame(window, row)) is not None)


def _has_colour_and_flow(facts: Facts, row: int) -> bool:
    frame = _nearest(facts.clocks["rgb"].times_ns, int(facts.clocks["depth"].times_ns[row]))
    if frame is None:
        return False
    clock, time_ns = facts.clocks[facts.flow_streams[-1]], int(facts.clocks["rgb"].times_ns[frame])
    ends_ns = clock.times_ns if clock.ends_ns is None else clock.ends_ns
    return any(_nearest(each, time_ns) is not None for each in (clock.times_ns, ends_ns))


def _of_frame(window: Window, row: int) -> DelaySums | None:
    facts = window.facts
    depth_ns = int(facts.clocks["depth"].times_ns[row])
    frame = _nearest(facts.clocks["rgb"].times_ns, depth_ns)
    if frame is None or facts.events is None:
        return None
    time_ns = int(facts.clocks["rgb"].times_ns[frame])
    try:
        velocity_px_s = _velocity_px_s(window, time_ns)
        colour = None if velocity_px_s is None else _colour_in_view(window, row, frame)
    except UnreadableRowsError:
        return None
    if velocity_px_s is None or colour is None or velocity_px_s.shape[:2] != colour[0].shape:
        return None
    luma, usable = colour
    usable &= np.isfinite(velocity_px_s).all(axis=-1)
    if not usable.any():
        return None
    speeds_px_s = np.hypot(velocity_px_s[..., 0], velocity_px_s[..., 1])[usable]
    half_s = float(np.clip(_MOTION_PX / max(float(np.median(speeds_px_s)), 1e-9), _SHORTEST_S, _LONGEST_S))
    half_ns = round(half_s * NS_PER_S)
    # All delays have the same pixels, and events throughout.
    reach_ns = half_ns + _FARTHEST_NS
    if time_ns - reach_ns < facts.events.first_ns or time_ns + reach_ns > facts.events.last_ns:
        return None

    # What passes a pixel in the interval must lie on one surface.
    reach_px = int(np.ceil(float(np.quantile(speeds_px_s, 0.9)) * half_s + _MARGIN_PX))
    square = np.ones((2 * reach_px + 1, 2 * reach_px + 1), np.uint8)
    inner = cv2.erode(usable.astype(np.uint8), square, borderType=cv2.BORDER_CONSTANT, borderValue=(0.0,)) > 0
    columns, rows = window.derived_image(_pixels_in_view, 0)
    x, y = _chosen(columns, rows, inner)
    if not len(x):
        return None
    at = columns[y, x], rows[y, x]
    nearest = np.rint(at[1]).astype(np.int64), np.rint(at[0]).astype(np.int64)
    velocities = velocity_px_s[nearest].T
    counts = _signed_counts(window, time_ns, half_ns, (y, x))
    camera = facts.declared.cameras["events"]
    parts = (y * TILES // camera.height) * TILES + x * TILES // camera.width
    dark = luma + np.float32(DARK_DN)
    # The response is unknown: of the logarithm, or of the luma itself, in units of its mean.
    responses = np.log(dark), luma / np.float32(max(float(luma[usable].mean()), 1.0))
    return _sums(responses, at, velocities, half_s, counts, parts)


def _sums(
    responses: tuple[Float32, Float32], at: tuple[Float64, Float64], velocities: Float64, half_s: float,
    counts: Float64, parts: NDArray[np.int64],
) -> DelaySums:  # fmt: skip
    """Return the normal equations of n pixels, by response (an image (H, W) in the view of depth).

    Pixels have columns and rows ``at`` (n,), px, in that view, velocities (2, n), px/s, counts (delays, n) of positive
    less negative events, and parts (n,) of the image. ``half_s`` is half of the interval.
    """
    members = [np.flatnonzero(parts == part) for part in range(TILES**2)]
    products = np.zeros((2, len(THRESHOLDS), TILES**2, COLUMNS, COLUMNS))
    projections = np.zeros((2, len(THRESHOLDS), TILES**2, len(DELAYS_MS), COLUMNS))
    step_s = half_s / _STEPS
    for k, response in enumerate(responses):
        smoothed = smooth(response, _SIGMA_PX)

        def level(time_s: float, right_px: float = 0.0, down_px: float = 0.0, image: Float32 = smoothed) -> Float32:
            """Return the level of all pixels some time after the frame: that of the point that is there by then."""
            columns, rows = at[0] - velocities[0] * time_s + right_px, at[1] - velocities[1] * time_s + down_px
            return np.asarray(read_between(image, columns.astype(np.float32)[None], rows.astype(np.float32)[None])[0])

        def change(right_px: float, down_px: float, level: Callable[..., Float32] = level) -> Float32:
            return level(half_s, right_px, down_px) - level(-half_s, right_px, down_px)

        levels = np.stack([level(i * step_s) for i in range(-_BEFORE * _STEPS, _STEPS + 2)])
        begin, end = (_BEFORE - 1) * _STEPS, (_BEFORE + 1) * _STEPS
        # Of a shift s of the events: dM/ds = -(M(x + 1/2) - M(x - 1/2)).
        shifts = np.stack([
            change(-right / 2, -down / 2) - change(right / 2, down / 2) for right, down in ((1.0, 0.0), (0.0, 1.0))
        ])  # fmt: skip
        for j, threshold in enumerate(THRESHOLDS):
            design = columns_of_levels(levels, shifts, threshold, 1000 * step_s, (begin, end))
            for part, inside in enumerate(members):
                products[k, j, part] = design[:, inside] @ design[:, inside].T
                projections[k, j, part] = counts[:, inside] @ design[:, inside].T
    squares = np.array([np.sum(counts[:, inside] ** 2, axis=1) for inside in members])
    return DelaySums(*(each.astype(np.float32) for each in (products, projections, squares)))


def _nearest(times_ns: NDArray[np.int64], time_ns: int) -> int | None:
    """Return the row of the timestamp nearest to a time; None where it is farther than ``_FARTHEST_NS``."""
    if not len(times_ns):
        return None
    row = int(np.argmin(np.abs(times_ns - time_ns)))
    return row if abs(int(times_ns[row]) - time_ns) <= _FARTHEST_NS else None


def _velocity_px_s(window: Window, time_ns: int) -> Float64 | None:
    """Return the velocity (H, W, 2) of the view's pixels, px/s: the mean over the fields before and after a time.

    The field that ends at the time belongs to pixels of its begin: point x + u has come from x.
    """
    # The shortest intervals have the velocity of the time.
    stream = window.facts.flow_streams[-1]
    clock = window.facts.clocks[stream]
    if clock.ends_ns is None:
        return None
    velocities = []
    following, preceding = _nearest(clock.times_ns, time_ns), _nearest(clock.ends_ns, time_ns)
    if following is not None:
        flow_px = window.flow_px(stream, following).astype(np.float64)
        velocities.append(flow_px / interval_at(window.facts, stream, following).duration_s)
    if preceding is not None:
        flow_px = window.flow_px(stream, preceding).astype(np.float64)
        height, width = flow_px.shape[:2]
        columns, rows = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        origin: tuple[Float64, Float64] = columns, rows
        # Four steps of a fixed point: flow differs little over the error of a step.
        for _ in range(4):
            there = _read_nearest(flow_px, *origin)
            origin = columns - there[..., 0], rows - there[..., 1]
        velocities.append(_read_nearest(flow_px, *origin) / interval_at(window.facts, stream, preceding).duration_s)
    return np.asarray(np.mean(velocities, axis=0)) if velocities else None


def _read_nearest(image: NDArray[np.floating], columns: NDArray[np.floating], rows: NDArray[np.floating]) -> Float64:
    """Return the values of the nearest pixels, NaN beyond the image."""
    height, width = image.shape[:2]
    with np.errstate(invalid="ignore"):
        inside = (columns > -0.5) & (columns < width - 0.5) & (rows > -0.5) & (rows < height - 0.5)
    x, y = (np.rint(np.where(inside, each, 0)).astype(np.int64) for each in (columns, rows))
    values = image[y, x].astype(np.float64)
    values[~inside] = np.nan
    return values


def _colour_in_view(window: Window, row: int, frame: int) -> tuple[Float32, Bool]:
    """Return the luma (H, W) of a colour frame in the view of a depth frame, DN, and which pixels have one."""
    cameras = window.facts.declared.cameras
    columns, rows, usable = colour_positions(window.depth_m(row), cameras["depth"], cameras["rgb"])
    sigma_px = _SIGMA_PX * max(1.0, cameras["rgb"].K[0, 0] / cameras["depth"].K[0, 0])
    smoothed = smoothed_luma_dn(window, frame, sigma_px)
    return read_between(smoothed, columns, rows), usable


def colour_positions(depth_m: Float32, depth: Camera, rgb: Camera) -> tuple[Float32, Float32, Bool]:
    """Return where the points of a depth frame lie in a colour frame.

    Parameters
    ----------
    depth_m
        (H, W) z of each pixel, m, not finite where there is none. The point z r lies in the colour frame where both
        lenses, the rotation and the distance of the centres put it.
    depth, rgb
        The cameras.

    Returns
    -------
    columns, rows
        (H, W) px of the colour frame; 0 where there is no position.
    usable
        (H, W) False beyond the frame, at outlines, and where a nearer point hides this one from the colour camera.
    """
    height, width = depth_m.shape
    slopes = rays_of_pixels(depth.K, depth.lens, *np.meshgrid(np.arange(width), np.arange(height)))
    T_rgb_depth = np.linalg.inv(rgb.T_body_camera) @ depth.T_body_camera
    points_m = np.stack([slopes[0] * depth_m, slopes[1] * depth_m, depth_m])
    points_m = np.einsum("ij,jhw->ihw", T_rgb_depth[:3, :3], points_m) + T_rgb_depth[:3, 3][:, None, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        x, y = pixels_of_rays(rgb.K, rgb.lens, points_m[0] / points_m[2], points_m[1] / points_m[2])
        usable = (points_m[2] > 0) & (x >= 1) & (x <= rgb.width - 2) & (y >= 1) & (y <= rgb.height - 2)
    at = np.rint(y[usable]).astype(np.int64), np.rint(x[usable]).astype(np.int64)
    nearest_m: NDArray[Any] = np.full((rgb.height, rgb.width), np.inf, np.float32)
    np.minimum.at(nearest_m, at, points_m[2][usable].astype(np.float32))
    # The pixels of the view are up to a pixel of their own apart in the colour frame.
    reach = 2 * int(np.ceil(rgb.K[0, 0] / depth.K[0, 0])) + 1
    nearest_m = cv2.erode(nearest_m, np.ones((reach, reach), np.uint8))
    hidden = usable.copy()
    hidden[usable] = nearest_m[at] < (1 - _OCCLUDED) * points_m[2][usable]
    inverse = np.zeros((height, width), np.float32)
    np.divide(1, depth_m, out=inverse, where=np.isfinite(depth_m) & (depth_m > 0))
    square = np.ones((3, 3), np.uint8)
    largest, smallest = cv2.dilate(inverse, square), cv2.erode(inverse, square)
    usable &= ~hidden & (largest - smallest <= _STEP * largest)
    columns, rows = (np.where(np.isfinite(each), each, 0.0).astype(np.float32) for each in (x, y))
    return columns, rows, usable


def _pixels_in_view(window: Window, _: int) -> Float64:
    """Return columns and rows (2, h, w) of the event camera's pixels in the view of depth, px; NaN beyond it."""
    cameras = window.facts.declared.cameras
    events, depth = cameras["events"], cameras["depth"]
    x, y = rays_of_pixels(events.K, events.lens, *np.meshgrid(np.arange(events.width), np.arange(events.height)))
    rotation = depth.T_body_camera[:3, :3].T @ events.T_body_camera[:3, :3]
    rays = np.einsum("ij,jhw->ihw", rotation, np.stack([x, y, np.ones_like(x)]))
    with np.errstate(invalid="ignore", divide="ignore"):
        ahead = np.where(rays[2] > 0, rays[:2] / rays[2], np.nan)
    return np.stack(pixels_of_rays(depth.K, depth.lens, *ahead))


def _chosen(columns: Float64, rows: Float64, inner: Bool) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return columns and rows (n,) of event pixels on usable pixels of the view, evenly spread."""
    y, x = np.nonzero(_read_nearest(inner.astype(np.float32), columns, rows) > 0)
    every = -(-len(x) // _MOST_PIXELS) if len(x) else 1
    return x[::every], y[::every]


def _signed_counts(window: Window, time_ns: int, half_ns: int, pixels: tuple[NDArray[np.int64], ...]) -> Float64:
    """Return positive less negative events (delays, n) of pixels in an interval that is moved by each delay."""
    # The colour frame may be as far from the depth frame, which the window owns, as the longest delay.
    margin_ns = 2 * _FARTHEST_NS + round(_LONGEST_S * NS_PER_S)
    events = window.events(margin_ns, margin_ns)
    camera = window.facts.declared.cameras["events"]
    counts = []
    for delay_ms in DELAYS_MS:
        centre_ns = time_ns + delay_ms * NS_PER_MS
        inside = slice(*np.searchsorted(events.times_ns, [centre_ns - half_ns, centre_ns + half_ns]))
        x, y = events.x[inside].astype(np.int64), events.y[inside].astype(np.int64)
        on_sensor = (x < camera.width) & (y < camera.height)
        signs = np.where(events.p[inside][on_sensor] > 0, 1.0, -1.0)
        flat = y[on_sensor] * camera.width + x[on_sensor]
        image = np.bincount(flat, weights=signs, minlength=camera.width * camera.height)
        counts.append(image.reshape(camera.height, camera.width)[pixels])
    return np.array(counts)
