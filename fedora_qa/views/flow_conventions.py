"""Gross faults, tried one by one on a field that is off: undo each and see whether the field then agrees."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M, R_BODY_OPTICAL
from fedora_qa.estimators.flow.motion_fit import FlowSample, fit_motion, weigh_templates
from fedora_qa.features import Feature
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.rigid_flow import depths_by_flow, rigid_flow
from fedora_qa.geometry.so3 import compose, log
from fedora_qa.sequence.facts import Clock
from fedora_qa.sequence.window import PoseSamples, Window
from fedora_qa.views.flow_comparison import field_covariance
from fedora_qa.views.flow_intervals import Interval, PoseTrack, depths_plausible, frame_at, interval_at
from fedora_qa.views.pixel_lattice import FEWEST_PIXELS, Region, sample_field

Float64 = NDArray[np.float64]

_SHIFTS_PX: Final = (-8, -4, -3, -2, -1, 1, 2, 3, 4, 8)
_ANOTHER_GAIN: Final = 0.02
"""Gains that lie closer to a change of unit are one."""

_ANOTHER_CONVENTION_RAD: Final = 0.7
"""Mountings that lie closer to straight ahead are turned, not written in another convention."""

_FREE: Final = 0.8
"""Depths of any value fit more than those of one fault do: that is meant first where it fits as well."""

_MS_PER_NS: Final = 1e-6
_NEIGHBOURS: Final = (-2, -1, 1, 2)
_NEARBY: Final = (-1, 1, -2, 2, -3, 3)


@dataclass(frozen=True, slots=True)
class ConventionTrial(Feature):
    """An inverse transform of the data, tried on one field that is off.

    Attributes
    ----------
    rate
        The rate of the field that it was tried on, or what else the trial was made on as a whole (``flow``, ``depth``).
    transform
        What was done to the data: "mirrored", "transposed_axes", ...
    stream
        The stream that was transformed.
    removed_share
        Share of the field's deviation that the transform removes, 0 (none) to 1 (all).
    magnitude
        Size of the fault that the transform would undo, in the unit of that fault; None where it has no size.
    """

    rate: str
    transform: str
    stream: str
    removed_share: float
    magnitude: float | None = None


@dataclass(frozen=True, slots=True)
class Weighed:
    """A gross fault and the share of one field's deviation (in px) that undoing it removes, 0 to 1."""

    rate: str
    cause: str
    stream: str
    weight: float
    magnitude: float | None = None


@dataclass(frozen=True, slots=True)
class _Hypothesis:
    """What the field and its ingredients would be without the fault."""

    cause: str
    stream: str
    sample: FlowSample | None
    motion: RigidMotion | None
    magnitude: float | None = None
    likeliness: float = 1.0


def weigh_hypotheses(
    window: Window, track: PoseTrack, interval: Interval, frame: int, region: Region | None = None
) -> list[Weighed]:
    """Weigh every gross fault against one field, or against the part of it that is off.

    What a hypothesis leaves is compared with the deviation as stored, or with either flow itself where that is smaller,
    so that dividing a field of garbage, or recomputing it from other garbage, explains nothing.
    """
    sample = sample_field(window, interval, frame, region)
    motion = track.motion(interval.start_ns, interval.end_ns)
    if sample is None or motion is None:
        return []
    as_stored = _deviation(track, interval, sample, motion, window)
    still = replace(sample, flow_px=np.zeros_like(sample.flow_px))
    stored_px = float(np.sqrt(np.mean(np.sum(sample.flow_px**2, axis=1))))
    reference = min(as_stored, _deviation(track, interval, still, motion, window), stored_px or np.inf)
    if not 0 < reference < np.inf:
        reference = stored_px
    best: dict[tuple[str, str], Weighed] = {}
    for hypothesis in _hypotheses(window, track, interval, sample, motion, frame, region):
        if hypothesis.sample is None or hypothesis.motion is None:
            continue
        left = _deviation(track, interval, hypothesis.sample, hypothesis.motion, window)
        key, weight = (hypothesis.cause, hypothesis.stream), hypothesis.likeliness * max(1.0 - left / reference, 0.0)
        if key not in best or best[key].weight < weight:
            best[key] = Weighed(interval.stream, *key, weight, hypothesis.magnitude)
    return list(best.values())


def _hypotheses(
    window: Window,
    track: PoseTrack,
    interval: Interval,
    sample: FlowSample,
    motion: RigidMotion,
    frame: int,
    region: Region | None,
) -> Iterator[_Hypothesis]:
    yield from _of_the_values(window, track, interval, sample, motion, frame)
    yield from _of_the_interval(window, track, interval, region)
    yield from _of_the_depth(window, track, sample, motion, frame)
    yield from _of_the_pose(window, track, interval, sample)


def _of_the_values(
    window: Window, track: PoseTrack, interval: Interval, sample: FlowSample, motion: RigidMotion, frame: int
) -> Iterator[_Hypothesis]:
    """Undo what may have happened to the stored numbers, and to the grid that they lie on."""
    flow, seconds = sample.flow_px, interval.duration_s
    stored = window.flow_px(interval.stream, interval.row)
    height, width = stored.shape[:2]
    column, row = sample.columns.astype(int), sample.rows.astype(int)

    def undone(cause: str, values: NDArray[np.floating], magnitude: float | None = None) -> _Hypothesis:
        return _Hypothesis(cause, "flow", _with_flow(sample, values), motion, magnitude)

    yield undone("flow_sign", -flow)
    yield undone("axes_swapped", flow[:, ::-1])
    yield undone("frame_convention", flow * (1, -1))
    if seconds > 0:
        yield undone("flow_unit", flow * seconds, 1 / seconds)
        yield undone("flow_unit", flow / seconds, seconds)
    yield undone("flow_unit", flow * (width, height), 1 / width)
    recomputed = rigid_flow(track.camera.K, motion, sample.columns, sample.rows, sample.depths_m)
    ratio = float(np.nansum(flow * recomputed) / max(float(np.nansum(recomputed**2)), 1e-300))
    units = (seconds, 1 / seconds) if seconds > 0 else ()
    for factor in (ratio, 2.0, 0.5):
        if factor > 0 and all(abs(factor / unit - 1) > _ANOTHER_GAIN for unit in units):
            yield undone("flow_gain", flow / factor, 100 * (factor - 1))
    for columns, rows in ((width - 1 - column, row), (column, height - 1 - row)):
        depths_m = _at(window.depth_m(frame), columns, rows)
        for signs in ((1, 1), (-1, 1), (1, -1)):
            there = FlowSample(columns.astype(np.float64), rows.astype(np.float64), depths_m, flow, sample.sigma_px)
            yield _Hypothesis("mirrored", "flow", _with_flow(there, flow * np.array(signs)), motion)
    for shift in _SHIFTS_PX:
        for dx, dy in ((shift, 0), (0, shift), (shift, shift)):
            moved = stored[np.clip(row + dy, 0, height - 1), np.clip(column + dx, 0, width - 1)]
            yield undone("spatial_offset", moved, float(shift))


def _of_the_interval(
    window: Window, track: PoseTrack, interval: Interval, region: Region | None
) -> Iterator[_Hypothesis]:
    """Suppose that the field belongs to a neighbouring interval, or to another rate."""

    def belonging(other: Interval, cause: str, magnitude: float | None = None) -> _Hypothesis:
        frame = frame_at(window.facts.clocks["depth"], other.start_ns)
        sample = None if frame is None else sample_field(window, interval, frame, region)
        return _Hypothesis(cause, "flow", sample, track.motion(other.start_ns, other.end_ns), magnitude)

    for intervals in _NEARBY:
        neighbour = interval.shifted(intervals)
        yield belonging(neighbour, "flow_interval_shifted", float(-intervals))
        yield belonging(neighbour, "swapped_frames", float(abs(intervals)))
    step_ns = _step_ns(window.facts.clocks["depth"])
    for frames in _NEIGHBOURS:
        yield belonging(interval.moved(round(frames * step_ns)), "time_offset", -frames * step_ns * _MS_PER_NS)
    for stream in window.facts.flow_streams:
        starts_ns = window.facts.clocks[stream].times_ns
        if stream == interval.stream or not len(starts_ns):
            continue
        latest = max(int(np.searchsorted(starts_ns, interval.start_ns, "right")) - 1, 0)
        for row in {latest, min(interval.row, len(starts_ns) - 1)}:
            other = interval_at(window.facts, stream, row)
            yield belonging(other, "flow_rate_mixed")
            from_here = replace(other, start_ns=interval.start_ns, end_ns=interval.start_ns + other.length_ns)
            yield belonging(from_here, "flow_rate_mixed")


def _of_the_depth(
    window: Window, track: PoseTrack, sample: FlowSample, motion: RigidMotion, frame: int
) -> Iterator[_Hypothesis]:
    """Undo what may have happened to the depth."""

    def undone(cause: str, depths_m: Float64, magnitude: float | None = None) -> _Hypothesis:
        likeliness = _FREE if cause == "other_sequence" else 1.0
        return _Hypothesis(cause, "depth", replace(sample, depths_m=depths_m), motion, magnitude, likeliness)

    K = track.camera.K
    slopes = ((sample.columns - K[0, 2]) / K[0, 0], (sample.rows - K[1, 2]) / K[1, 1])
    yield undone("depth_ray_not_z", sample.depths_m / np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2))
    if not depths_plausible(window.facts, sample.depths_m):
        yield undone("unit_mm_m", sample.depths_m * MM_PER_M, 1 / MM_PER_M)
        yield undone("unit_mm_m", sample.depths_m / MM_PER_M, MM_PER_M)
    by_flow_m = depths_by_flow(K, motion, sample.columns, sample.rows, sample.flow_px)
    yield undone("other_sequence", np.where(by_flow_m > 0, by_flow_m, np.nan))
    column, row = sample.columns.astype(int), sample.rows.astype(int)
    stored = window.depth_m(frame)
    width = stored.shape[1]
    yield undone("mirrored", _at(stored, width - 1 - column, row))
    for shift in _SHIFTS_PX:
        for dx, dy in ((shift, 0), (0, shift), (shift, shift)):
            yield undone("spatial_offset", _at(stored, column + dx, row + dy), float(shift))
    step_ns = _step_ns(window.facts.clocks["depth"])
    for frames in _NEIGHBOURS:
        if 0 <= frame + frames < window.facts.sizes["path/depth"]:
            depths_m = _at(window.depth_m(frame + frames), column, row)
            yield undone("time_offset", depths_m, frames * step_ns * _MS_PER_NS)
            yield undone("swapped_frames", depths_m, float(abs(frames)))


def _of_the_pose(window: Window, track: PoseTrack, interval: Interval, sample: FlowSample) -> Iterator[_Hypothesis]:
    """Undo what may have happened to the pose, at both ends of the interval or at one, and to the camera's mounting."""

    def turned(order: tuple[int, ...], signs: tuple[int, ...]) -> PoseTrack:
        return track.transformed(
            lambda poses: replace(poses, orientations_xyzw=poses.orientations_xyzw[:, order] * signs)
        )

    def moved(change: Float64) -> PoseTrack:
        return track.transformed(lambda poses: replace(poses, positions_world_m=poses.positions_world_m @ change))

    mountings = [track.mounted(T_body_camera) for T_body_camera in other_mountings(track.camera.T_body_camera)]
    for cause, stream, corrected, magnitude in (
        ("quaternion_inverted", "pose", turned((0, 1, 2, 3), (-1, -1, -1, 1)), None),
        ("quaternion_order", "pose", turned((1, 2, 3, 0), (1, 1, 1, 1)), None),
        (
            "unit_mm_m",
            "pose",
            moved(np.eye(3) / MM_PER_M) if depths_plausible(window.facts, sample.depths_m) else None,
            MM_PER_M,
        ),
        ("axes_swapped", "pose", moved(np.eye(3)[[1, 0, 2]]), None),
        ("frame_convention", "pose", _from_north_east_down(track), None),
        *(("frame_convention", "metadata", mounted, None) for mounted in mountings),
    ):
        if corrected is None:
            continue
        ends = ((corrected, corrected), (track, corrected), (corrected, track))
        for first, last in ends[:1] if stream == "metadata" else ends:
            motion = first.motion_into(last, interval.start_ns, interval.end_ns)
            yield _Hypothesis(cause, stream, sample, motion, magnitude)


def other_mountings(T_body_camera: Float64) -> list[Float64]:
    """Return what T_body_camera (4, 4) may be if declared in another convention: its inverse, or straight ahead."""
    straight = np.eye(4)
    straight[:3, :3], straight[:3, 3] = R_BODY_OPTICAL, T_body_camera[:3, 3]
    inverse = np.asarray(np.linalg.inv(T_body_camera), dtype=np.float64)
    turned_far = np.linalg.norm(log(straight[:3, :3].T @ T_body_camera[:3, :3])) > _ANOTHER_CONVENTION_RAD
    return [inverse, straight] if turned_far else [inverse]


def _from_north_east_down(track: PoseTrack) -> PoseTrack:
    """Return the track of poses that were written for a world and a body with Z down."""
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


def _at(depth_m: NDArray[np.float32], columns: NDArray[np.int_], rows: NDArray[np.int_]) -> Float64:
    """Return depths at pixels, NaN where invalid or outside."""
    height, width = depth_m.shape
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    values = depth_m[np.where(inside, rows, 0), np.where(inside, columns, 0)].astype(np.float64)
    return np.where(inside & (values > 0), values, np.nan)


def _deviation(track: PoseTrack, interval: Interval, sample: FlowSample, motion: RigidMotion, window: Window) -> float:
    """Return the root mean square deviation that the declared pose noise cannot take up, px.

    Pixels whose points fall behind the camera do not count; infinite where they are the most.
    """
    recomputed = rigid_flow(track.camera.K, motion, sample.columns, sample.rows, sample.depths_m)
    seen = np.logical_and(*np.isfinite(recomputed).T)
    if 2 * np.count_nonzero(seen) < len(seen):
        return float("inf")
    noise = window.facts.declared.pose
    covariance = field_covariance(track, interval, noise)
    fit = None if covariance is None else fit_motion(track.camera.K, motion, sample)
    if covariance is not None and fit is None:
        return float("inf")
    nothing = np.zeros((len(sample.columns), 2, 0))
    evidence = weigh_templates(track.camera.K, motion, sample, nothing, fit, covariance)
    return float(np.sqrt(evidence.total / np.count_nonzero(seen)) * sample.sigma_px)


def _with_flow(sample: FlowSample, values: NDArray[np.floating]) -> FlowSample | None:
    """Return the sample with other flow, where that and the depth are finite; None where too little is."""
    finite = np.isfinite(values).all(axis=-1) & np.isfinite(sample.depths_m)
    if np.count_nonzero(finite) < FEWEST_PIXELS:
        return None
    return FlowSample(
        sample.columns[finite], sample.rows[finite], sample.depths_m[finite],
        values[finite].astype(np.float64), sample.sigma_px,
    )  # fmt: skip
