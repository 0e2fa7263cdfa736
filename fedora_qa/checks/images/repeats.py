"""Frames that repeat an earlier frame."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, sqrt
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.protocol import Notice, Observation, WindowCheck
from fedora_qa.estimators.images.samples import steepness
from fedora_qa.estimators.images.values import digest_of, is_of_one_code
from fedora_qa.geometry.camera import RigidMotion, camera_motion
from fedora_qa.geometry.so3 import log
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import Pose, interval_at, motion_between, pose_of_frame, pose_track
from fedora_qa.views.frame_pairs import flow_rate_of, luma_on_flow_grid, seen_part, within
from fedora_qa.views.frames import luma_dn

Float64 = NDArray[np.float64]

FEWEST_FRAMES: Final = 2

HIDDEN_DN: Final = 2.0
"""Change by motion that rounding may hide, DN: twice 1 DN."""

STEEP_PERCENTILE: Final = 99.0
"""Percentile of the slopes for which a change is predicted: one pixel in a hundred is steeper."""

NOISE_SIGMAS: Final = 6.0
FARTHEST_M: Final = 30.0
"""Farthest depth where no range is declared, m: that of the paper."""

FEWEST_EVENTS: Final = 50
AS_MANY_AS_USUAL: Final = 0.5
"""Least ratio of the number of events since the frame before to its median over changing frames, for a change of the
image."""


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """Pose of a frame.

    Attributes
    ----------
    R_world_body
        (3, 3) orientation of the body.
    position_world_m
        (3,) position of the body, m.
    visible_motion_px
        Motion of the image that rounding does not hide, px.
    """

    R_world_body: Float64
    position_world_m: Float64
    visible_motion_px: float


@dataclass(frozen=True, slots=True)
class FrameDigest:
    """Digest of a frame, with the camera's motion before it.

    Attributes
    ----------
    frame
        Row of the frame.
    digest
        Hash of its pixels.
    blank
        Whether all pixels have one value.
    repeats
        Whether it equals the frame before it, bit for bit.
    moved
        Whether the camera moved since the frame before, by pose or flow; None where the file has neither.
    viewpoint
        Pose of the frame; None without poses.
    """

    frame: int
    digest: bytes
    blank: bool
    repeats: bool
    moved: bool | None
    viewpoint: Viewpoint | None


class ImagesRepeats(WindowCheck[tuple[FrameDigest, ...]]):
    """Does any frame repeat an earlier one although the image must have changed?

    The number of frames that repeat an earlier one bit for bit although the image must have changed in between.

    Why it matters
    --------------
    A buffer that is written again without being refreshed assigns old frames to new timestamps, events and poses. For
    training, a repeated frame is a pair with flow and without motion.

    How
    ---
    Frames are compared by their digests, each with all earlier ones. A repeat is a fault if another stream proves a
    change of the image. The fastest flow or the pose proves it if it moves steep gradients of the frame by more than
    rounding can hide. Events prove it if there are at least 50, and half as many as the median between frames that
    differ. A camera that returns to an earlier pose may take the same image again. Frames of one value throughout are
    tested by ``images.exposure``.

    Noise model
    -----------
    The count is exact: two different frames have the same digest with a probability of 5e-20. The change of the image
    is predicted for the steepest hundredth of its pixels (on a lattice of some 5000), which must change by 2 DN where
    rounding hides 1 DN. For noisy poses, six standard deviations are subtracted first.

    Cannot detect
    -------------
    Frames that repeat except for noise (``images.order`` and ``event_response.frames``). A camera at rest may repeat
    its frames: not_observable where frames repeat and the camera never moves. Where the file has neither flow nor pose
    nor events for a decision, repeats are noted.

    Sources
    -------
    First principles; FIPS 180-4 (SHA-256); ``fedora_qa/estimators/images/values.py``.
    """

    name = "images.repeats"
    needs = ("rgb",)

    def measure(self, window: Window) -> tuple[FrameDigest, ...]:
        """Take the digest of every frame that the window owns."""
        digests = []
        for frame in window.owned("rgb"):
            rgb = window.rgb(frame)
            digest = _digest(window, frame)
            repeats = frame > 0 and _digest(window, frame - 1) == digest
            # Only a repeat needs a proof that the image must have changed; for other frames a motion of a pixel counts.
            moved = None
            if repeats:
                moved = must_have_changed(window, frame)
            elif frame > 0:
                moved_px = _least_motion_px(window, frame)
                moved = None if moved_px is None else moved_px > 1.0
            blank = is_of_one_code(rgb)
            digests.append(FrameDigest(frame, digest, blank, repeats, moved, viewpoint_of(window, frame)))
        return tuple(digests)

    def conclude(self, state: Sequence[tuple[FrameDigest, ...]], facts: Facts) -> Observation:
        """Count repeats between which the image must have changed."""
        frames = sorted((digest for digests in state for digest in digests), key=lambda digest: digest.frame)
        coverage = Coverage(len(frames), facts.sizes.get("path/rgb", len(frames)), "frames")
        if sum(not digest.blank for digest in frames) < FEWEST_FRAMES:
            return Observation(coverage, unobservable=f"fewer than {FEWEST_FRAMES} frames have more than one value")
        repeats = repeated(frames)
        by_events = moved_by_events(facts, {frame for frame, _ in repeats})
        moved = {digest.frame: digest.moved or bool(by_events[digest.frame]) for digest in frames}
        viewpoints = {digest.frame: digest.viewpoint for digest in frames}
        motion_measured = "rgb_to_event" in facts.index_maps or any(digest.moved is not None for digest in frames)
        frozen = []
        for frame, first in repeats:
            if not any(moved.get(i) for i in range(first + 1, frame + 1)):
                continue
            # A camera that moves away and returns, by its pose, may take the same image again: no fault, unless both
            # viewpoints differ so much that the images must differ.
            later, earlier = viewpoints.get(frame), viewpoints.get(first)
            if frame - first > 1 and later is not None and earlier is not None:
                camera = facts.declared.cameras["rgb"]
                poses = earlier.R_world_body, earlier.position_world_m, later.R_world_body, later.position_world_m
                motion = camera_motion(*poses, camera.T_body_camera)
                if not _least_shift_px(motion, camera, facts) > later.visible_motion_px:
                    continue
            frozen.append((frame, first))
        if frozen:
            (first, original), last = frozen[0], frozen[-1][0]
            times_ns = facts.clocks["rgb"].times_ns
            repeated_frames = count_of_faults(
                "repeated_frames",
                len(frozen),
                "frames",
                statement=f"{len(frozen)} frames repeat an earlier one bit for bit while the camera moves; the first "
                f"is frame {first}, which repeats frame {original}.",
                code="images.repeats.frames",
                where=Where(
                    stream="rgb",
                    start_us=facts.to_file_us(int(times_ns[first])),
                    stop_us=facts.to_file_us(int(times_ns[last])),
                    index_start=first,
                    index_stop=last + 1,
                    frame=first,
                ),
            )
            return Observation(coverage, (repeated_frames,))
        if repeats and motion_measured and not any(moved.values()):
            at_rest = f"{len(repeats)} frames repeat an earlier one, and the camera is at rest: images need not differ"
            return Observation(coverage, unobservable=at_rest)
        notices: tuple[Notice, ...] = ()
        if repeats and not motion_measured:
            message = (
                f"{len(repeats)} frames repeat an earlier one bit for bit, the first is frame {repeats[0][0]}; "
                "pose, flow and events do not determine whether the camera moved."
            )
            where = Where(stream="rgb", frame=repeats[0][0])
            notices = (Notice("images.repeats.unexplained", message, where),)
        return Observation(coverage, (no_faults("repeated_frames", "frames", "images.repeats.frames"),), notices)


def repeated(frames: Sequence[FrameDigest]) -> list[tuple[int, int]]:
    """Return each frame that is not blank and repeats an earlier one.

    Parameters
    ----------
    frames
        Digests in the order of time.

    Returns
    -------
    list[tuple[int, int]]
        The frame, and the latest earlier frame that it equals.
    """
    latest: dict[bytes, int] = {}
    repeats = []
    for digest in frames:
        if not digest.blank:
            if digest.repeats:
                repeats.append((digest.frame, digest.frame - 1))
            elif digest.digest in latest:
                repeats.append((digest.frame, latest[digest.digest]))
            latest[digest.digest] = digest.frame
    return repeats


def _digest(window: Window, frame: int) -> bytes:
    """Return the digest of a frame, taken once for neighbouring windows."""
    return window.derived_image(_digest_of, frame).tobytes()


def _digest_of(window: Window, frame: int) -> NDArray[np.uint8]:
    return digest_of(window.rgb(frame))


def must_have_changed(window: Window, frame: int) -> bool | None:
    """Return whether flow or pose move the image so far since the frame before that it must have changed.

    Parameters
    ----------
    window
        The window that owns the frame.
    frame
        Row of the colour stream, 1 at least.

    Returns
    -------
    bool | None
        None where the file has neither flow nor pose of the time between both frames.
    """
    moved_px = _least_motion_px(window, frame)
    # Change by the motion of the pose along steep gradients, against the change that rounding may hide.
    changes = [] if moved_px is None else [moved_px * _steepness(window, frame) > 2 * HIDDEN_DN]
    # Change by the flow along the gradient, against the same.
    stream, times_ns = flow_rate_of(window), window.facts.clocks["rgb"].times_ns
    interval = None
    if stream is not None:
        row = int(np.searchsorted(window.facts.clocks[stream].times_ns, times_ns[frame - 1], "right")) - 1
        interval = interval_at(window.facts, stream, row) if row >= 0 else None
    # A field that ends before the frame does not cover the rest of the time between the frames.
    if stream is not None and interval is not None and interval.end_ns >= times_ns[frame]:
        interval_ratio = float(times_ns[frame] - times_ns[frame - 1]) / max(interval.length_ns, 1)
        # Slopes to the right and down, DN per px, of the smoothed image; none along an axis of one pixel.
        smoothed = np.asarray(cv2.GaussianBlur(luma_on_flow_grid(window, frame), (0, 0), 1.0), dtype=np.float32)
        right, down = (
            np.gradient(smoothed, axis=axis) if smoothed.shape[axis] > 1 else np.zeros_like(smoothed) for axis in (1, 0)
        )
        flow_px = within(seen_part(window), window.flow_px(stream, row))
        with np.errstate(invalid="ignore"):
            change_dn = np.abs(right * flow_px[..., 0] + down * flow_px[..., 1]) * np.float32(interval_ratio)
        finite_dn = change_dn[np.isfinite(change_dn)]
        changes.append(bool(len(finite_dn) and np.percentile(finite_dn, STEEP_PERCENTILE) > HIDDEN_DN))
    return any(changes) if changes else None


def viewpoint_of(window: Window, frame: int) -> Viewpoint | None:
    """Return the pose of a frame.

    Parameters
    ----------
    window
        The window that owns the frame.
    frame
        Row of the colour stream.

    Returns
    -------
    Viewpoint | None
        None where there is no pose.
    """
    camera = window.facts.declared.cameras.get("rgb")
    if camera is None or "pose" not in window.facts.streams:
        return None
    R_world_body, position_world_m = _pose_of(window, frame, camera)
    if not (np.isfinite(R_world_body).all() and np.isfinite(position_world_m).all()):
        return None
    return Viewpoint(R_world_body, position_world_m, 2 * HIDDEN_DN / max(_steepness(window, frame), 1e-9))


def moved_by_events(facts: Facts, repeats: set[int]) -> NDArray[np.bool_]:
    """Return whether events since the frame before indicate a change, for each frame.

    Parameters
    ----------
    repeats
        Rows of the colour stream that repeat an earlier frame.

    Returns
    -------
    NDArray[np.bool_]
        (n,) all False where the file has no index map from frames to events.
    """
    count = len(facts.clocks["rgb"].times_ns)
    index_map = facts.index_maps.get("rgb_to_event")
    if index_map is None or not count:
        return np.zeros(count, np.bool_)
    events = np.diff(index_map.expected_left, prepend=index_map.expected_left[:1])
    changing = np.setdiff1d(np.arange(1, count), np.array(sorted(repeats), dtype=np.int64))
    if not len(changing):
        return np.zeros(count, np.bool_)
    usual = float(np.median(events[changing]))
    is_moved: NDArray[np.bool_] = (events >= FEWEST_EVENTS) & (events >= AS_MANY_AS_USUAL * usual)
    return is_moved


def _steepness(window: Window, frame: int) -> float:
    """Return the ``STEEP_PERCENTILE`` of the slope of the image, DN per px."""
    return steepness(luma_dn(window, frame), STEEP_PERCENTILE)


def _least_motion_px(window: Window, frame: int) -> float | None:
    """Return the least motion of the image since the frame before, px; None where there is no pose."""
    facts, camera = window.facts, window.facts.declared.cameras.get("rgb")
    if camera is None or "pose" not in facts.streams:
        return None
    motion = motion_between(_pose_of(window, frame - 1, camera), _pose_of(window, frame, camera), camera)
    return None if motion is None else _least_shift_px(motion, camera, facts)


def _pose_of(window: Window, frame: int, camera: Camera) -> Pose:
    """Return the pose of the body at a frame; NaN where none covers it."""
    return pose_of_frame(window, pose_track(window, camera), "rgb", frame)


def _least_shift_px(motion: RigidMotion, camera: Camera, facts: Facts) -> float:
    """Return the least shift of the image by a motion, px: by its rotation, or by the parallax of the farthest points.

    Rotation about the optical axis keeps the middle of the image; half of the image is a quarter of its width or more
    away from it.
    """
    focal_px, noise = float(camera.K[0, 0]), facts.declared.pose
    farthest_m = facts.declared.depth_range_m[1] if facts.declared.depth_range_m else FARTHEST_M
    # Camera axes: X right, Y down, Z along the optical axis; at a quarter of the width the radius is W / 4 px.
    rotation_rad = log(motion.R) * [1.0, 1.0, camera.width / (4 * focal_px)]
    motion_rad = max(float(np.linalg.norm(rotation_rad)), float(np.linalg.norm(motion.t_m)) / farthest_m)
    # Two poses make a motion, so the variance doubles: the factor sqrt(2) below.
    noise_rad = 0.0 if noise is None else hypot(noise.rotation_sigma_rad, noise.position_sigma_m / farthest_m)
    return focal_px * (motion_rad - NOISE_SIGMAS * sqrt(2.0) * noise_rad)
