"""Frames of a window at the pixels of the event camera, with the events between them."""

from dataclasses import dataclass
from functools import partial
from typing import Any, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.events.block_means import LEAST_LIGHT
from fedora_qa.estimators.events.footprint import FootprintAxis, Footprints, footprint_axis
from fedora_qa.estimators.events.lin_log import logarithmic_light, logarithmic_light_error
from fedora_qa.estimators.events.pixels import count_between_frames
from fedora_qa.sequence.declared import Camera, EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_axes import (
    AXES_AGREE,
    CENTRES_AGREE_M,
    differ_by_quarters,
    is_identity,
    look_apart,
    turned_colour_camera,
    turned_frame,
    why_not_one_lens,
)
from fedora_qa.views.frames import clipped, luma_dn
from fedora_qa.views.sensor_events import frames_due, sensor_events, sensor_shape

ROUNDING_DN: Final = {"linear": 0.5, "srgb": 0.5 * 2.4 / 1.055, "gamma2.2": 0.5 * 2.2}
"""Half a step of the 8-bit code in linear DN, at white where it is largest."""

WINDOW_NS: Final = NS_PER_S // 5
"""The usual window; those of large images are shorter."""


@dataclass(frozen=True, slots=True)
class ResampledFrames:
    """The frames of a window and the one after it, at the pixels of the event camera.

    Attributes
    ----------
    frames, times_ns
        (n,) rows and timestamps, ns from the file's origin.
    edge_aware_dn, uniform_dn
        (n, h, w) luma by the two reconstructions of ``footprint``, in single precision: 1e-4 DN. Of a lin-log sensor,
        the light whose logarithm is its response (``logarithmic_light``).
    error_dn
        (n, h, w) bound of the error of ``uniform_dn``, DN; infinite where a pixel is saturated or outside the frame.
    counts
        (n - 1, 2, h, w) numbers of darker and brighter events between the frames.
    """

    frames: NDArray[np.int64]
    times_ns: NDArray[np.int64]
    edge_aware_dn: NDArray[Any]
    uniform_dn: NDArray[Any]
    error_dn: NDArray[Any]
    counts: NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.frames)


def starts_at_first_frame(facts: Facts) -> bool:
    """Whether the signal at the first frame is declared to be the first reference of all pixels."""
    times_ns, declared = facts.clocks["rgb"].times_ns, facts.declared.events
    if declared is None or facts.events is None or not len(times_ns):
        return False
    # It is not where an event comes before that frame.
    return declared.initial_phase == "zero" and facts.events.first_ns > int(times_ns[0])


def resampled_frames(window: Window) -> ResampledFrames:
    """Return the frames that a window owns and the next one, and the events between them."""
    return window.derived(_resampled_frames)


def event_footprints(window: Window, shape_frame: tuple[int, int], *, at_corners: bool = False) -> Footprints:
    """Return the footprints of the event camera's pixels in colour frames, computed once a file.

    Parameters
    ----------
    window
        A window of the sequence. It keeps both axes for the file.
    shape_frame
        Rows and columns of the colour frames.
    at_corners
        Of squares of a pixel's size around the corners of the pixels, half a pixel to the right and down.

    Returns
    -------
    Footprints
        One footprint for each pixel of the event camera, from row and column axes.
    """
    return window.derived(_event_footprints, shape_frame, at_corners=at_corners)


def _event_footprints(window: Window, shape_frame: tuple[int, int], *, at_corners: bool) -> Footprints:
    rows, columns = (
        FootprintAxis.unpacked(window.derived_image(_footprint_axis, 0, axis, shape_frame, at_corners=at_corners))
        for axis in (0, 1)
    )
    return Footprints(rows, columns)


def _footprint_axis(
    window: Window, row: int, axis: int, shape_frame: tuple[int, int], *, at_corners: bool
) -> NDArray[Any]:
    """Return the packed axis of the footprints along rows (0) or columns (1), which is that of every frame."""
    K_frame, K_event = turned_colour_camera(window.facts.declared).K, window.facts.declared.cameras["events"].K.copy()
    if at_corners:
        # A ray at u + 1/2 is at u once the principal point is moved by -1/2.
        K_event[:2, 2] -= 0.5
    return footprint_axis(K_frame, shape_frame, K_event, sensor_shape(window.facts.declared), axis).packed()


def intervals_due(window: Window, resampled: ResampledFrames, per_window: int) -> int:
    """Return how many intervals of two frames or more are due, ``per_window`` in a window of the usual length.

    Much shorter windows follow a grid in time with ``per_window`` points in each ``WINDOW_NS``: an interval is due for
    each point between the frame before the window and its second to last frame. Most such windows have none.

    Parameters
    ----------
    resampled
        The window's frames, two or more.
    per_window
        Intervals of a window of the usual length.

    Returns
    -------
    int
        Number of intervals, 0 or more.
    """
    length_ns = window.span.stop_ns - window.span.start_ns
    if 2 * length_ns >= WINDOW_NS:
        return round(per_window * length_ns / WINDOW_NS)
    # Points of the grid in (before, second to last frame] are due.
    earlier = np.flatnonzero(window.facts.clocks["rgb"].advancing[: resampled.frames[0]])
    before_ns = window.facts.clocks["rgb"].times_ns[earlier[-1]] if len(earlier) else window.span.start_ns - 1
    return int(resampled.times_ns[-2]) * per_window // WINDOW_NS - int(before_ns) * per_window // WINDOW_NS


def signal(resampled: ResampledFrames, declared: EventModel) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the signal of the declared model, and where pixels are lit.

    A pixel is lit where the error of its luma is below half of the luma.

    Parameters
    ----------
    resampled
        Luma in linear DN at the pixels of the event camera.
    declared
        The model, ``log`` or ``linear``.

    Returns
    -------
    levels
        (n, h, w): natural logarithm of luma + log_eps (model ``log``), or luma in linear DN (model ``linear``).
    lit
        (n, h, w).
    """
    levels, lit = np.empty(resampled.uniform_dn.shape, np.float32), np.empty(resampled.uniform_dn.shape, np.bool_)
    for frame in range(len(resampled)):
        levels[frame], lit[frame] = signal_of(resampled, declared, frame)
    return levels, lit


def signal_of(
    resampled: ResampledFrames, declared: EventModel, frame: int, stride: int = 1
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return ``signal`` of one frame (h, w), or of every ``stride``-th pixel along both axes.

    Parameters
    ----------
    resampled
        Luma in linear DN at the pixels of the event camera.
    declared
        The model, ``log`` or ``linear``.
    frame
        Number of the frame among those of the window, 0 to n - 1.
    stride
        Distance of the pixels, px.

    Returns
    -------
    levels
        (h, w), as of ``signal``.
    lit
        (h, w).
    """
    uniform_dn, error_dn = (dn[frame, ::stride, ::stride] for dn in (resampled.uniform_dn, resampled.error_dn))
    return _levels(uniform_dn, declared), np.greater(uniform_dn, 2 * error_dn)


def lattice_signals(
    window: Window, resampled: ResampledFrames, declared: EventModel, frame: int
) -> tuple[tuple[NDArray[np.float32], NDArray[np.bool_]], tuple[NDArray[np.float32], NDArray[np.bool_]]]:
    """Return the signal of a frame at the centres of the pixels, and at their corners half a pixel right and down.

    A pixel is usable where all of its light is known and exceeds twice the rounding of the frame. A mask by the error
    of its luma, which contrast dominates, leaves out the dark sides of edges and so moves what is left.

    Parameters
    ----------
    resampled
        The window's frames.
    declared
        The model, ``log`` or ``linear``.
    frame
        Number of the frame among those of the window, 0 to n - 1.

    Returns
    -------
    centres, corners
        Levels (h, w), as of ``signal``, and mask (h, w) of usable pixels.
    """
    images = np.empty((3, *resampled.uniform_dn.shape[1:]), np.float32)
    _, *corners = _resample_into(images, window, int(resampled.frames[frame]), at_corners=True)
    least_dn = 2 * ROUNDING_DN[window.facts.declared.transfer]
    centres, corners_signal = (
        (_levels(uniform_dn, declared), np.isfinite(error_dn) & (uniform_dn > least_dn))
        for uniform_dn, error_dn in ((resampled.uniform_dn[frame], resampled.error_dn[frame]), corners)
    )
    return centres, corners_signal


def _levels(uniform_dn: NDArray[np.float32], declared: EventModel) -> NDArray[np.float32]:
    if declared.model == "linear":
        return uniform_dn
    # Log model: L = ln(light + log_eps), of 1e-3 DN at least.
    level = uniform_dn + np.float32(declared.log_eps_dn)
    np.log(np.maximum(level, np.float32(LEAST_LIGHT), out=level), out=level)
    return level


Axes = Literal["equal", "near", "any"]
"""Which difference between the axes of colour and event camera a check allows."""


def why_frames_and_events_do_not_meet(facts: Facts, *, axes: Axes = "equal", needs_response: bool = True) -> str:
    """Return why frames cannot be resampled to the event camera's pixels; empty where they can.

    Parameters
    ----------
    facts
        With the declared cameras and the event sensor.
    axes
        ``equal``: the axes agree up to quarter turns about the optical axis, as of a sensor that is mounted in
        portrait, which exchange rows and columns and change no value. Cameras with a lens may not be turned. ``near``:
        those of cameras without a lens may differ by 10 deg. Frames are then interpolated, which moves no edge, but
        blurs them: for checks of positions. ``any``: neither axes nor centres need to agree, and frames are resampled
        as if they did (``look_apart``).
    needs_response
        Whether the response of the event sensor must be declared.

    Returns
    -------
    str
        A sentence, or an empty string.
    """
    cameras, events = facts.declared.cameras, facts.declared.events
    if "rgb" not in cameras or "events" not in cameras:
        return "the cameras rgb and events are not both declared in /metadata/cameras"
    rgb, event = cameras["rgb"], cameras["events"]
    if rgb.model != "pinhole" or event.model != "pinhole":
        return f"Expected pinhole cameras, got {rgb.model} (rgb) and {event.model} (events)"
    if not (_is_without_skew(rgb) and _is_without_skew(event)):
        return "K of the cameras rgb and events is not that of pinhole cameras without skew"
    if axes != "any":
        difference = np.abs(rgb.T_body_camera - event.T_body_camera)
        if not difference[:3, 3].max() <= CENTRES_AGREE_M:
            return (
                "the cameras rgb and events do not share one centre: parallax displaces each pixel by its depth, and "
                "the check does not reproject frames through depth"
            )
        turned = rgb.lens is event.lens is None and differ_by_quarters(rgb, event, about=axes == "near")
        if not difference[:3, :3].max() <= AXES_AGREE and not turned:
            return "the optical axes of the cameras rgb and events differ"
    # One lens images a ray at one point of both image planes, so that footprints need K alone.
    if reason := why_not_one_lens(rgb, event, ("rgb", "events")):
        return reason
    if needs_response and (events is None or not min(events.threshold_on, events.threshold_off) > 0):
        return "the event sensor is not declared with positive thresholds in /metadata/events"
    return ""


def _is_without_skew(camera: Camera) -> bool:
    K = camera.K
    return bool(np.all(np.isfinite(K)) and K[0, 0] > 0 and K[1, 1] > 0 and K[0, 1] == 0 and K[1, 0] == 0)


def _resampled_frames(window: Window) -> ResampledFrames:
    """Resample the frames. The first is the last of the window before."""
    shape, due = sensor_shape(window.facts.declared), frames_due(window)
    images = np.empty((3, len(due), *shape), np.float32)
    readable: list[int] = []
    for frame in due:
        target = images[:, len(readable)]
        try:
            resampled = window.of_image("resampled_frame", frame, partial(_resample_into, target, window, frame))
        except UnreadableRowsError:
            continue
        # The window may have kept the frame from an earlier call.
        if resampled is not target:
            target[:] = resampled
        readable.append(frame)
    frames, count = np.array(readable, dtype=np.int64), len(readable)
    times_ns = window.facts.clocks["rgb"].times_ns[frames]
    counts = np.zeros((max(count - 1, 0), 2, *shape), np.int32)
    if count > 1:
        events = sensor_events(window)
        count_between_frames(events.x, events.y, events.times_ns, events.p, times_ns, counts)
    edge_aware_dn, uniform_dn, error_dn = images[:, :count]
    return ResampledFrames(frames, times_ns, edge_aware_dn, uniform_dn, error_dn, counts)


def _resample_into(
    target: NDArray[np.float32], window: Window, frame: int, *, at_corners: bool = False
) -> NDArray[np.float32]:
    """Write both reconstructions of a frame and the bound of the uniform one's error to an array (3, h, w).

    Each colour is rounded by at most half a step of its code, so luma is as well.
    """
    luma, clipped_px = _in_axes_of_events(window, luma_dn(window, frame), clipped(window, frame))
    footprints = event_footprints(window, (luma.shape[0], luma.shape[1]), at_corners=at_corners)
    edge_aware, uniform, error = target
    rounding_dn = ROUNDING_DN[window.facts.declared.transfer]
    footprints.resample(luma, clipped_px, rounding_dn, edge_aware=edge_aware, uniform=uniform, error=error)
    response = window.facts.declared.events
    if response is not None and response.is_lin_log:
        # From here on the sensor is a logarithmic one, of ln(light + log_eps).
        eps_dn, below_dn = response.log_eps_dn, response.linear_below_dn
        error[:] = logarithmic_light_error(uniform + eps_dn, error, below_dn)
        for light in (edge_aware, uniform):
            light[:] = logarithmic_light(light + eps_dn, below_dn) - eps_dn
    return target


def _in_axes_of_events(
    window: Window, luma: NDArray[np.float32], clipped_px: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return a frame as a colour camera with the axes of the event camera would see it.

    Quarter turns change no value. Pixels between others are interpolated linearly; those that no pixel of the frame
    sees count as clipped. Of cameras that look apart, the frame is returned as if they did not.
    """
    rgb, events = turned_colour_camera(window.facts.declared), window.facts.declared.cameras["events"]
    luma, clipped_px = turned_frame(window, luma), turned_frame(window, clipped_px)
    R_rgb_events = rgb.T_body_camera[:3, :3].T @ events.T_body_camera[:3, :3]
    if is_identity(R_rgb_events) or look_apart(window.facts.declared):
        return luma, clipped_px
    # u_rgb ~ K R_rgb_events K^-1 u (Hartley and Zisserman 2004, section 8.4).
    homography = rgb.K @ R_rgb_events @ np.linalg.inv(rgb.K)
    shape, flags = (luma.shape[1], luma.shape[0]), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    rotated = cv2.warpPerspective(luma, homography, shape, flags=flags)
    unseen = cv2.warpPerspective(clipped_px.astype(np.float32), homography, shape, flags=flags, borderValue=1.0)
    return np.asarray(rotated, np.float32), np.asarray(unseen > 0)
