"""Inverse transforms, tried one by one on a deviating field, and the share of its deviation that each removes."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import copysign, hypot, inf
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M, MS_PER_S, R_BODY_OPTICAL
from fedora_qa.estimators.flow.motion_fit import FlowSample, fit_motion
from fedora_qa.estimators.flow.parameter_templates import weigh_templates
from fedora_qa.features import Feature
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.lens import rays_of_pixels
from fedora_qa.geometry.rigid_flow import depths_by_flow
from fedora_qa.geometry.so3 import compose, log
from fedora_qa.sequence.facts import Clock
from fedora_qa.sequence.window import PoseSamples, Window
from fedora_qa.views.flow_axes import FLOW_AXES
from fedora_qa.views.flow_comparison import field_covariance, is_noisy
from fedora_qa.views.flow_intervals import Interval, PoseTrack, depths_plausible, frame_at, interval_at
from fedora_qa.views.pixel_lattice import FEWEST_PIXELS, Region, lattice_of, sample_field, thinned

Float64 = NDArray[np.float64]

_SHIFTS_PX: Final = (-8, -4, -3, -2, -1, 1, 2, 3, 4, 8)
_MOST_STEPS: Final = 6
"""Steps to the factor of depths. Each leaves the square of the error: 3% become less than rounding in three."""

_LARGEST_SHIFT_PX: Final = 16
"""Steps of a pixel that a search for a shift takes at most."""

_ANOTHER_GAIN: Final = 0.02
"""Gains whose ratio to a change of unit differs from 1 by less are taken as that change of unit."""

_ANOTHER_CONVENTION_RAD: Final = 0.7
"""Mountings within this angle of straight ahead are taken as turned, not as written in another convention."""

_LEAST_MOTION: Final = 1e-3
"""Least rotation of the body in an interval, rad, least translation, m, and least sine of the angle between both, from
which a mounting is computed. The value is not derived: with less, a trial of the mounting shows what it is worth."""

_FAR_TURN_RAD: Final = 0.26
"""Rotation, 15 deg, up to which the fit of an error of the mounting holds, which is linear; more are computed."""

_SAME_MOTION: Final = 0.02
"""Largest relative difference of the lengths of two motions that are one, seen by two frames. Not derived, likewise."""

_MS_PER_NS: Final = 1e-6
_FRAME_SHIFTS: Final = (-2, -1, 1, 2)
_INTERVAL_SHIFTS: Final = (-1, 1, -2, 2, -3, 3)


@dataclass(frozen=True, slots=True)
class ConventionTrial(Feature):
    """An inverse transform of the data, tried on one deviating field.

    Attributes
    ----------
    rate
        Stream of the field, ``flow/<rate>hz``, or ``flow`` or ``depth`` where the trial covers a stream as a whole.
    transform
        What was done to the data: ``mirrored``, ``transposed_axes``, ...
    stream
        The stream that was transformed.
    removed_share
        Share of the field's deviation that the transform removes, 0 (none) to 1 (all).
    magnitude
        Size of the fault that the transform would undo, in the unit of that fault; None where it has no size.
    components
        Of a size along columns and along rows; empty where it has one number.
    """

    rate: str
    transform: str
    stream: str
    removed_share: float
    magnitude: float | None = None
    components: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class _TransformedField:
    """The sample of a field and the camera's motion after a transform; None where too few pixels or no pose remain.

    The motion is known where the rest of the image states it, so that no noise of the poses corrects it.
    """

    transform: str
    stream: str
    sample: FlowSample | None
    motion: RigidMotion | None
    magnitude: float | None = None
    components: tuple[float, ...] = ()
    is_known: bool = False


def try_inverse_transforms(
    window: Window, track: PoseTrack, interval: Interval, frame: int, region: Region | None = None
) -> list[ConventionTrial]:
    """Try every inverse transform on one field, or on its deviating part.

    The rest of the image states the motion of a deviating part: the declared noise of the poses, which may correct the
    motion of a whole field, would let the correction follow the fault.

    The remaining deviation is divided by a reference: the deviation as stored, or the length of either flow where that
    is smaller. So a transform explains nothing if it only makes arbitrary flow small, or recomputes it from arbitrary
    data.

    Parameters
    ----------
    track
        Poses, with the depth camera.
    interval
        Of the field.
    frame
        Row of the depth frame at the start of the interval.
    region
        Left, top, right, bottom, px, of the compared part of the image; the whole image if None.

    Returns
    -------
    list[ConventionTrial]
        The best trial of each transform and stream; empty where too few pixels are valid or no pose covers the
        interval.
    """
    sample = sample_field(window, interval, frame, region)
    motion = track.motion(interval.start_ns, interval.end_ns)
    if sample is None or motion is None:
        return []
    beside: RigidMotion | None = None
    if region is not None and is_noisy(window.facts.declared.pose):
        beside = _motion_beside(window, track, interval, region)
    declared, motion, is_known = motion, beside or motion, beside is not None
    as_stored = _deviation(track, interval, sample, motion, window, is_known=is_known)
    still = replace(sample, flow_px=np.zeros_like(sample.flow_px))
    stored_px = float(np.sqrt(np.mean(np.sum(sample.flow_px**2, axis=1))))
    of_still = _deviation(track, interval, still, motion, window, is_known=is_known)
    reference = min(as_stored, of_still, stored_px or np.inf)
    if not 0 < reference < np.inf:
        reference = stored_px
    best: dict[tuple[str, str], ConventionTrial] = {}
    for field in (
        *_with_other_flow(window, track, interval, sample, motion, frame, region, is_known=is_known),
        *_with_other_depth(window, track, interval, sample, motion, frame, is_known=is_known),
        # Poses are common to all pixels.
        *(_with_other_poses(window, track, interval, sample) if region is None else ()),
        *((_TransformedField("as_posed", "flow", sample, declared, is_known=True),) if is_known else ()),
    ):
        residual = _deviation_of(field, track, interval, window)
        if residual is None:
            continue
        key, removed_share = (field.transform, field.stream), max(1.0 - residual / reference, 0.0)
        if key not in best or best[key].removed_share < removed_share:
            best[key] = ConventionTrial(interval.stream, *key, removed_share, field.magnitude, field.components)
    return list(best.values())


def _deviation_of(field: _TransformedField, track: PoseTrack, interval: Interval, window: Window) -> float | None:
    """Return the deviation that a transform leaves, px; None where too few pixels or no pose remain."""
    if field.sample is None or field.motion is None:
        return None
    return _deviation(track, interval, field.sample, field.motion, window, is_known=field.is_known)


def _motion_beside(window: Window, track: PoseTrack, interval: Interval, region: Region) -> RigidMotion | None:
    """Return the motion over an interval by its field beside a region; None without a field, or where it fits none."""
    row = frame_at(window.facts.clocks[interval.stream], interval.start_ns)
    frame = frame_at(window.facts.clocks["depth"], interval.start_ns)
    motion = track.motion(interval.start_ns, interval.end_ns)
    if row is None or frame is None or motion is None:
        return None
    own = interval_at(window.facts, interval.stream, row)
    lattice = lattice_of(window, own, frame) if own.end_ns == interval.end_ns else None
    sample = None if lattice is None else thinned(lattice.beside(region))
    fit = None if sample is None else fit_motion(track.camera.K, motion, sample)
    return None if fit is None else fit.motion


def _best_shift(
    shifted: Callable[[int, int], _TransformedField], deviation: Callable[[_TransformedField], float | None]
) -> _TransformedField:
    """Return the field under the shift that leaves least: the best of a coarse set, then pixel by pixel from there."""
    left: dict[tuple[int, int], tuple[float, _TransformedField]] = {}

    def left_by(dx: int, dy: int) -> float:
        if (dx, dy) not in left:
            field = shifted(dx, dy)
            residual = deviation(field)
            left[dx, dy] = inf if residual is None else residual, field
        return left[dx, dy][0]

    coarse = [step for shift in _SHIFTS_PX for step in ((shift, 0), (0, shift), (shift, shift))]
    best = min(coarse, key=lambda shift: left_by(*shift))
    for _ in range(_LARGEST_SHIFT_PX):
        x, y = best
        around = [(x + dx, y + dy) for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)) if (x + dx, y + dy) != (0, 0)]
        nearer = min(around, key=lambda shift: left_by(*shift))
        if left_by(*nearer) >= left_by(*best):
            break
        best = nearer
    return left[best][1]


def _shift_px(dx: int, dy: int) -> float:
    """Return the larger component of a shift."""
    return float(dx if abs(dx) >= abs(dy) else dy)


def _with_other_flow(
    window: Window,
    track: PoseTrack,
    interval: Interval,
    sample: FlowSample,
    motion: RigidMotion,
    frame: int,
    region: Region | None,
    *,
    is_known: bool,
) -> Iterator[_TransformedField]:
    """Transform the stored flow or its grid, or assign the flow to another interval."""
    flow, seconds = sample.flow_px, interval.duration_s
    stored = window.flow_px(interval.stream, interval.row)
    height, width = stored.shape[:2]
    column, row = sample.columns.astype(int), sample.rows.astype(int)

    def transformed(name: str, values: NDArray[np.floating], magnitude: float | None = None) -> _TransformedField:
        return _TransformedField(name, "flow", _with_flow(sample, values), motion, magnitude, is_known=is_known)

    turned = {name: axes.of(flow) for name, axes in FLOW_AXES.items()}
    for name, values in turned.items():
        yield transformed(name, values)
    # Interval as a factor of values in px/s, px s and px/ms. One of a second, or of a millisecond, changes nothing.
    times = (seconds, 1 / seconds, MS_PER_S * seconds) if seconds > 0 else ()
    of_time = [factor for factor in times if abs(factor - 1) > _ANOTHER_GAIN]
    # Shares of the image, or of halves of it, and the plane at z = 1.
    focal_px = np.abs(np.diag(track.camera.K)[:2])
    lengths_px = ((width, height), (width / 2, height / 2), (float(focal_px[0]), float(focal_px[1])))
    # Each with the factor of values that are in that unit.
    for unit, factor in (
        *((np.array([time_s, time_s]), 1 / time_s) for time_s in of_time),
        *((np.array(length_px), 1 / length_px[0]) for length_px in lengths_px),
    ):
        yield transformed("another_unit", flow * unit, factor)
        # Of two conventions at once neither alone removes much.
        for name, values in turned.items():
            yield transformed(f"{name}_in_another_unit", values * unit, factor)
    # The factor that fits best, by least squares of stored = factor * recomputed.
    recomputed = sample.rigid_flow(track.camera.K, motion)
    ratio = float(np.nansum(flow * recomputed) / max(float(np.nansum(recomputed**2)), 1e-300))
    of_length = (1 / length_px for along_axes_px in lengths_px for length_px in along_axes_px)
    units = (*(1 / time_s for time_s in of_time), *of_length)
    for factor in (ratio, 2.0, 0.5):
        if factor > 0 and all(abs(factor / unit - 1) > _ANOTHER_GAIN for unit in units):
            yield transformed("scaled", flow / factor, 100 * (factor - 1))
    # One factor for each axis.
    by_axis = np.nansum(flow * recomputed, axis=0) / np.maximum(np.nansum(recomputed**2, axis=0), 1e-300)
    if np.all(by_axis > 0) and abs(by_axis[0] / by_axis[1] - 1) > _ANOTHER_GAIN:
        along_columns, along_rows = (100 * (float(factor) - 1) for factor in by_axis)
        larger = max(along_columns, along_rows, key=abs)
        of_axes = transformed("scaled_by_axis", flow / by_axis, larger)
        yield replace(of_axes, components=(along_columns, along_rows))
    # A factor for what turning moves, and one for what the way moves.
    turning = sample.rigid_flow(track.camera.K, replace(motion, t_m=np.zeros(3)))
    parts = np.stack([turning, recomputed - turning], axis=-1)
    valid = np.isfinite(parts).all(axis=(1, 2)) & np.isfinite(flow).all(axis=1)
    # A flow of zeros is both by a factor of 0.
    if np.any(flow[valid]):
        factors = np.linalg.lstsq(parts[valid].reshape(-1, 2), flow[valid].reshape(-1), rcond=None)[0]
        yield transformed("parts_of_motion", flow - parts @ (factors - 1))
    for columns, rows, signs_of_vectors in (
        (width - 1 - column, row, (-1, 1)),
        (column, height - 1 - row, (1, -1)),
        (width - 1 - column, height - 1 - row, (-1, -1)),
    ):
        depths_m = _depths_at(window.depth_m(frame), columns, rows)
        # The vectors stay as they are, or are mirrored with the image.
        for signs in ((1, 1), signs_of_vectors):
            mirror = replace(
                sample, columns=columns.astype(np.float64), rows=rows.astype(np.float64), depths_m=depths_m
            )
            mirrored = _with_flow(mirror, flow * np.array(signs))
            yield _TransformedField("mirrored", "flow", mirrored, motion, is_known=is_known)

    def moved_back(dx: int, dy: int) -> _TransformedField:
        moved = stored[np.clip(row + dy, 0, height - 1), np.clip(column + dx, 0, width - 1)]
        return transformed("shifted_pixels", moved, _shift_px(dx, dy))

    yield _best_shift(moved_back, lambda field: _deviation_of(field, track, interval, window))

    # A neighbouring interval, one that begins some depth frames before or after, or one of another rate.
    def moved_to(other: Interval, name: str, magnitude: float | None = None) -> _TransformedField:
        depth_frame = frame_at(window.facts.clocks["depth"], other.start_ns)
        field = None if depth_frame is None else sample_field(window, interval, depth_frame, region)
        of_poses = track.motion(other.start_ns, other.end_ns)
        other_motion = _motion_beside(window, track, other, region) if is_known and region is not None else of_poses
        return _TransformedField(name, "flow", field, other_motion, magnitude, is_known=is_known)

    for intervals in _INTERVAL_SHIFTS:
        yield moved_to(interval.shifted(intervals), "neighbouring_interval", float(-intervals))
    step_ns = _step_ns(window.facts.clocks["depth"])
    for frames in _FRAME_SHIFTS:
        yield moved_to(interval.moved(round(frames * step_ns)), "delayed", -frames * step_ns * _MS_PER_NS)
    for stream in window.facts.flow_streams:
        starts_ns = window.facts.clocks[stream].times_ns
        if stream == interval.stream or not len(starts_ns):
            continue
        latest = max(int(np.searchsorted(starts_ns, interval.start_ns, "right")) - 1, 0)
        for other_row in {latest, min(interval.row, len(starts_ns) - 1)}:
            other = interval_at(window.facts, stream, other_row)
            yield moved_to(other, "field_of_another_rate")
            same_start = replace(other, start_ns=interval.start_ns, end_ns=interval.start_ns + other.length_ns)
            yield moved_to(same_start, "field_of_another_rate")


def _with_other_depth(
    window: Window,
    track: PoseTrack,
    interval: Interval,
    sample: FlowSample,
    motion: RigidMotion,
    frame: int,
    *,
    is_known: bool,
) -> Iterator[_TransformedField]:
    """Transform the depth."""

    def transformed(name: str, depths_m: Float64, magnitude: float | None = None) -> _TransformedField:
        changed = replace(sample, depths_m=depths_m)
        return _TransformedField(name, "depth", changed, motion, magnitude, is_known=is_known)

    K = track.camera.K
    slopes = rays_of_pixels(K, sample.lens, sample.columns, sample.rows)
    # Ray length = z sqrt(1 + x^2 + y^2) with the slopes of the ray.
    ray_length = np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2)
    yield transformed("ray_lengths", sample.depths_m / ray_length)
    # Depth was z already, and was taken for the length of the ray.
    yield transformed("ray_lengths", sample.depths_m * ray_length)
    if not depths_plausible(window.facts, sample.depths_m):
        yield transformed("metric_unit", sample.depths_m * MM_PER_M, 1 / MM_PER_M)
        yield transformed("metric_unit", sample.depths_m / MM_PER_M, MM_PER_M)
    if (factor := _depth_factor(track, sample, motion)) is not None:
        yield transformed("metric_unit", sample.depths_m / factor, factor)
    by_flow_m = depths_by_flow(K, motion, sample.columns, sample.rows, sample.flow_px, sample.lens)
    yield transformed("triangulated_depth", np.where(by_flow_m > 0, by_flow_m, np.nan))
    column, row = sample.columns.astype(int), sample.rows.astype(int)
    stored = window.depth_m(frame)
    height, width = stored.shape
    for columns, rows in (
        (width - 1 - column, row),
        (column, height - 1 - row),
        (width - 1 - column, height - 1 - row),
    ):
        yield transformed("mirrored", _depths_at(stored, columns, rows))
    yield _best_shift(
        lambda dx, dy: transformed("shifted_pixels", _depths_at(stored, column + dx, row + dy), _shift_px(dx, dy)),
        lambda field: _deviation_of(field, track, interval, window),
    )
    step_ns = _step_ns(window.facts.clocks["depth"])
    for frames in _FRAME_SHIFTS:
        if 0 <= frame + frames < window.facts.sizes["path/depth"]:
            depths_m = _depths_at(window.depth_m(frame + frames), column, row)
            yield transformed("delayed", depths_m, frames * step_ns * _MS_PER_NS)
            yield transformed("neighbouring_frame", depths_m, float(abs(frames)))


def _depth_factor(track: PoseTrack, sample: FlowSample, motion: RigidMotion) -> float | None:
    """Return how many times too large depths are, by the flow that is due to the way; None if none or a known unit.

    Flow of the way is nearly inverse to the depth, and that of turning does not depend on it: the factor solves
    flow less flow of turning = factor * recomputed flow of the way by least squares, repeated with depths over it.
    """
    turning = sample.rigid_flow(track.camera.K, replace(motion, t_m=np.zeros(3)))
    stored = sample.flow_px - turning
    factor = 1.0
    for _ in range(_MOST_STEPS):
        of_way = replace(sample, depths_m=sample.depths_m / factor).rigid_flow(track.camera.K, motion) - turning
        finite = np.isfinite(of_way).all(axis=1) & np.isfinite(stored).all(axis=1)
        squares = float(np.sum(of_way[finite] ** 2))
        step = float(np.sum(stored[finite] * of_way[finite])) / squares if squares > 0 else 0.0
        if step <= 0:
            return None
        factor *= step
    of_units = (1.0, MM_PER_M, 1 / MM_PER_M)
    return factor if all(abs(factor / unit - 1) > _ANOTHER_GAIN for unit in of_units) else None


def _with_other_poses(
    window: Window, track: PoseTrack, interval: Interval, sample: FlowSample
) -> Iterator[_TransformedField]:
    """Transform the pose, at both ends of the interval or at one, and the camera's mounting."""

    def with_axes(change: Float64) -> PoseTrack:
        return track.transformed(lambda poses: replace(poses, positions_world_m=poses.positions_world_m @ change))

    if (turned := _turned_mounting(track, interval, sample)) is not None:
        motion = turned.motion(interval.start_ns, interval.end_ns)
        # Declared = true Exp(error), in the axes of the camera.
        error_rad = log(turned.camera.T_body_camera[:3, :3].T @ track.camera.T_body_camera[:3, :3])
        x_deg, y_deg, z_deg = (float(angle) for angle in np.rad2deg(error_rad))
        size_deg = copysign(hypot(x_deg, y_deg, z_deg), max((x_deg, y_deg, z_deg), key=abs))
        yield _TransformedField("turned_mounting", "metadata", sample, motion, size_deg, (x_deg, y_deg, z_deg))
    mountings = [track.mounted(T_body_camera) for T_body_camera in other_mountings(track.camera.T_body_camera)]
    # Flow fixes the ratio of depths and positions: only plausible depths leave the unit to the positions.
    for name, stream, corrected, magnitude in (
        ("conjugated_quaternion", "pose", reordered_quaternions(track, (0, 1, 2, 3), (-1, -1, -1, 1)), None),
        ("reordered_quaternion", "pose", reordered_quaternions(track, (1, 2, 3, 0), (1, 1, 1, 1)), None),
        (
            "metric_unit",
            "pose",
            with_axes(np.eye(3) / MM_PER_M) if depths_plausible(window.facts, sample.depths_m) else None,
            MM_PER_M,
        ),
        ("transposed_axes", "pose", with_axes(np.eye(3)[[1, 0, 2]]), None),
        ("north_east_down", "pose", from_north_east_down(track), None),
        *(("other_mounting", "metadata", mounted, None) for mounted in mountings),
    ):
        if corrected is None:
            continue
        ends = ((corrected, corrected), (track, corrected), (corrected, track))
        for first, last in ends[:1] if stream == "metadata" else ends:
            motion = first.motion_into(last, interval.start_ns, interval.end_ns)
            yield _TransformedField(name, stream, sample, motion, magnitude)


def _turned_mounting(track: PoseTrack, interval: Interval, sample: FlowSample) -> PoseTrack | None:
    """Return the track with a mounting turned far, under which the body moves as flow and depth show; None without one.

    With the rotation R from camera to body, the motion of points in the camera is R^T times that in a frame at the same
    place with the axes of the body: of the rotation vector and of the translation. The two directions state R
    (G. Wahba, SIAM Rev. 7 (1965) 409), and their lengths, and the angle between them, do not depend on it.
    """
    in_body = np.eye(4)
    in_body[:3, 3] = track.camera.T_body_camera[:3, 3]
    of_body = track.mounted(in_body).motion(interval.start_ns, interval.end_ns)
    still = RigidMotion(np.eye(3), np.zeros(3))
    fit = fit_motion(track.camera.K, still, sample)
    if of_body is None or fit is None:
        return None
    # Of the body, then of the camera: (2, 2, 3) rotation vector and translation, and their (2, 2) lengths.
    vectors = np.array([(log(motion.R), motion.t_m) for motion in (of_body, fit.motion)])
    lengths = np.linalg.norm(vectors, axis=-1)
    if lengths.min() < _LEAST_MOTION or np.any(np.abs(lengths[1] / lengths[0] - 1.0) > _SAME_MOTION):
        return None
    body, camera = vectors / lengths[..., None]
    if np.linalg.norm(np.cross(*body)) < _LEAST_MOTION or abs(body[0] @ body[1] - camera[0] @ camera[1]) > _SAME_MOTION:
        return None
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - seldom needed, and loads all of scipy.spatial

    R_body_camera, _ = Rotation.align_vectors(body, camera)
    T_body_camera = in_body.copy()
    T_body_camera[:3, :3] = R_body_camera.as_matrix()
    turn_rad = np.linalg.norm(log(T_body_camera[:3, :3].T @ track.camera.T_body_camera[:3, :3]))
    return track.mounted(T_body_camera) if turn_rad > _FAR_TURN_RAD else None


def other_mountings(T_body_camera: Float64) -> list[Float64]:
    """Return ``T_body_camera`` (4, 4) under other conventions: its inverse, and straight ahead at the same place.

    Straight ahead is left out where the declared camera is turned from it by less than ``_ANOTHER_CONVENTION_RAD``.
    """
    straight = np.eye(4)
    straight[:3, :3], straight[:3, 3] = R_BODY_OPTICAL, T_body_camera[:3, 3]
    inverse = np.asarray(np.linalg.inv(T_body_camera), dtype=np.float64)
    # The norm of the rotation vector is the angle between the two mountings, rad.
    turned_far = np.linalg.norm(log(straight[:3, :3].T @ T_body_camera[:3, :3])) > _ANOTHER_CONVENTION_RAD
    return [inverse, straight] if turned_far else [inverse]


def reordered_quaternions(track: PoseTrack, order: tuple[int, ...], signs: tuple[int, ...]) -> PoseTrack:
    """Return the track of quaternions whose components stand in another order or have other signs.

    Parameters
    ----------
    track
        Poses as stored.
    order
        (4,) index of the stored component (x, y, z, w) that becomes x, y, z, w.
    signs
        (4,) factor on each component after reordering.

    Returns
    -------
    PoseTrack
        The track with the changed orientations.
    """
    return track.transformed(lambda poses: replace(poses, orientations_xyzw=poses.orientations_xyzw[:, order] * signs))


def from_north_east_down(track: PoseTrack) -> PoseTrack:
    """Convert poses that were written for a world and a body with Z down.

    Parameters
    ----------
    track
        Poses of a body (forward, right, down) in a world (north, east, down).

    Returns
    -------
    PoseTrack
        Poses of a body (forward, left, up) in a world (east, north, up).
    """
    # q_enu_ned maps NED to ENU axes (x and y exchanged, z reversed); q_frd_flu is half a turn about X forward.
    q_enu_ned, q_frd_flu = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])

    def change(poses: PoseSamples) -> PoseSamples:
        orientations_xyzw = compose(compose(q_enu_ned, poses.orientations_xyzw), q_frd_flu)
        return replace(
            poses,
            positions_world_m=poses.positions_world_m[:, [1, 0, 2]] * (1.0, 1.0, -1.0),
            orientations_xyzw=orientations_xyzw,
        )

    return track.transformed(change)


def _step_ns(clock: Clock) -> float:
    times_ns: NDArray[np.int64] = np.compress(clock.advancing, clock.times_ns)
    return float(np.median(np.diff(times_ns))) if len(times_ns) > 1 else 0.0


def _depths_at(depth_m: NDArray[np.float32], columns: NDArray[np.int_], rows: NDArray[np.int_]) -> Float64:
    """Return depths at pixels, NaN where invalid or outside."""
    height, width = depth_m.shape
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    values = depth_m[np.where(inside, rows, 0), np.where(inside, columns, 0)].astype(np.float64)
    return np.where(inside & (values > 0), values, np.nan)


def _deviation(
    track: PoseTrack, interval: Interval, sample: FlowSample, motion: RigidMotion, window: Window, *, is_known: bool
) -> float:
    """Return the root mean square deviation that the declared pose noise does not explain, px.

    A motion that is known has no noise. Points behind the camera do not count; infinite where more than half of the
    points are behind it.
    """
    recomputed = sample.rigid_flow(track.camera.K, motion)
    in_front = np.logical_and(*np.isfinite(recomputed).T)
    if 2 * np.count_nonzero(in_front) < len(in_front):
        return float("inf")
    covariance = None if is_known else field_covariance(track, interval, window.facts.declared.pose)
    fit = None if covariance is None else fit_motion(track.camera.K, motion, sample)
    if covariance is not None and fit is None:
        return float("inf")
    no_templates = np.zeros((len(sample.columns), 2, 0))
    evidence = weigh_templates(track.camera.K, motion, sample, no_templates, fit, covariance)
    return float(np.sqrt(evidence.total / np.count_nonzero(in_front)) * sample.sigma_px)


def _with_flow(sample: FlowSample, values: NDArray[np.floating]) -> FlowSample | None:
    """Return the sample with other flow, where that and the depth are finite; None where too little is."""
    finite = np.isfinite(values).all(axis=-1) & np.isfinite(sample.depths_m)
    if np.count_nonzero(finite) < FEWEST_PIXELS:
        return None
    return replace(sample, flow_px=values.astype(np.float64)).chosen(np.flatnonzero(finite))
