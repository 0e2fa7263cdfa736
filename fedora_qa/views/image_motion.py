"""Whether an image must have changed between two frames: by flow, poses or the number of events."""

from dataclasses import dataclass
from math import hypot, sqrt
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.images.samples import steepness
from fedora_qa.geometry.camera import RigidMotion, camera_motion
from fedora_qa.geometry.so3 import log
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import Pose, interval_at, motion_between, pose_track
from fedora_qa.views.frame_pairs import flow_rate_of, luma_on_flow_grid
from fedora_qa.views.frame_poses import pose_of_frame
from fedora_qa.views.luma import luma_dn

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

HIDDEN_DN: Final = 2.0
"""Rounding hides changes of up to 1 DN; twice that must show."""

STEEP_PERCENTILE: Final = 99.0
"""One pixel in a hundred is as steep as the places at which a change is looked for."""

NOISE_SIGMAS: Final = 6.0
FARTHEST_M: Final = 30.0
"""Where no range of depth is declared: that of the paper."""

FEWEST_EVENTS: Final = 50
AS_MANY_AS_USUAL: Final = 0.5
"""Events since the frame before are as many as while frames change if they are half of the median there."""


def must_have_changed(window: Window, frame: int) -> bool | None:
    """Whether flow or pose move the image since the frame before so far that it must have changed.

    None where the file has neither.
    """
    moved_px = _least_motion_px(window, frame)
    # What the pose moves the image by, along steep gradients, against what rounding hides.
    by_pose = None if moved_px is None else moved_px * _steepness(window, frame) > 2 * HIDDEN_DN
    changes = [change for change in (_by_flow(window, frame), by_pose) if change is not None]
    return any(changes) if changes else None


def moved_by_pose(window: Window, frame: int) -> bool | None:
    """Whether the pose moves the image by a pixel or more since the frame before; None where there is no pose."""
    moved_px = _least_motion_px(window, frame)
    return None if moved_px is None else moved_px > 1.0


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """From where a frame was taken, and by how much the image must move for that to be visible."""

    R_world_body: Float64
    position_world_m: Float64
    visible_motion_px: float


def viewpoint_of(window: Window, frame: int) -> Viewpoint | None:
    """Return from where a frame was taken; None where there is no pose."""
    camera = window.facts.declared.cameras.get("rgb")
    if camera is None or "pose" not in window.facts.streams:
        return None
    R_world_body, position_world_m = _pose_of(window, frame, camera)
    if not (np.isfinite(R_world_body).all() and np.isfinite(position_world_m).all()):
        return None
    return Viewpoint(R_world_body, position_world_m, 2 * HIDDEN_DN / max(_steepness(window, frame), 1e-9))


def is_elsewhere(viewpoint: Viewpoint, earlier: Viewpoint, facts: Facts) -> bool:
    """Whether two viewpoints differ by so much that their images must; a camera that returns may take the same one."""
    camera = facts.declared.cameras["rgb"]
    poses = earlier.R_world_body, earlier.position_world_m, viewpoint.R_world_body, viewpoint.position_world_m
    motion = camera_motion(*poses, camera.T_body_camera)
    return _least_shift_px(motion, camera, facts) > viewpoint.visible_motion_px


def moved_by_events(facts: Facts, repeats: set[int]) -> NDArray[np.bool_]:
    """Return for each frame (n,) whether events since the frame before it are as many as while frames change."""
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


def _by_flow(window: Window, frame: int) -> bool | None:
    """Compare the flow along the gradient with what rounding hides."""
    stream, times_ns = flow_rate_of(window), window.facts.clocks["rgb"].times_ns
    if stream is None:
        return None
    starts_ns = window.facts.clocks[stream].times_ns
    row = int(np.searchsorted(starts_ns, times_ns[frame - 1], "right")) - 1
    # A field that ends before the frame states nothing of the rest of the time between the frames.
    if row < 0 or interval_at(window.facts, stream, row).end_ns < times_ns[frame]:
        return None
    interval = interval_at(window.facts, stream, row)
    interval_ratio = float(times_ns[frame] - times_ns[frame - 1]) / max(interval.length_ns, 1)
    # Slopes to the right and down, DN per px, of the smoothed image; none along an axis of one pixel.
    smoothed = np.asarray(cv2.GaussianBlur(luma_on_flow_grid(window, frame), (0, 0), 1.0), dtype=np.float32)
    right, down = (
        np.gradient(smoothed, axis=axis) if smoothed.shape[axis] > 1 else np.zeros_like(smoothed) for axis in (1, 0)
    )
    flow_px = window.flow_px(stream, row)
    with np.errstate(invalid="ignore"):
        change_dn = np.abs(right * flow_px[..., 0] + down * flow_px[..., 1]) * np.float32(interval_ratio)
    finite_dn = change_dn[np.isfinite(change_dn)]
    return bool(len(finite_dn) and np.percentile(finite_dn, STEEP_PERCENTILE) > HIDDEN_DN)


def _steepness(window: Window, frame: int) -> float:
    """Return the slope of the image at its steep places, DN per px."""
    return steepness(luma_dn(window, frame), STEEP_PERCENTILE)


def _least_motion_px(window: Window, frame: int) -> float | None:
    """Return by how much the image moves at least since the frame before; None where there is no pose."""
    facts, camera = window.facts, window.facts.declared.cameras.get("rgb")
    if camera is None or "pose" not in facts.streams:
        return None
    motion = motion_between(_pose_of(window, frame - 1, camera), _pose_of(window, frame, camera), camera)
    return None if motion is None else _least_shift_px(motion, camera, facts)


def _pose_of(window: Window, frame: int, camera: Camera) -> Pose:
    """Return the pose of the body at a frame; NaN where none covers it."""
    return pose_of_frame(window, pose_track(window, camera), "rgb", frame)


def _least_shift_px(motion: RigidMotion, camera: Camera, facts: Facts) -> float:
    """Return by how much a motion shifts the image at least, by its rotation or by the parallax of the farthest points.

    Rotation about the optical axis leaves the middle of the image; half of it moves by a quarter of its width or more.
    """
    focal_px, noise = float(camera.K[0, 0]), facts.declared.pose
    farthest_m = facts.declared.depth_range_m[1] if facts.declared.depth_range_m else FARTHEST_M
    # Camera axes: X right, Y down, Z along the optical axis; at a quarter of the width the radius is W / 4 px.
    rotation_rad = log(motion.R) * [1.0, 1.0, camera.width / (4 * focal_px)]
    motion_rad = max(float(np.linalg.norm(rotation_rad)), float(np.linalg.norm(motion.t_m)) / farthest_m)
    # Two poses make a motion, so the variance doubles: the factor sqrt(2) below.
    noise_rad = 0.0 if noise is None else hypot(noise.rotation_sigma_rad, noise.position_sigma_m / farthest_m)
    return focal_px * (motion_rad - NOISE_SIGMAS * sqrt(2.0) * noise_rad)
