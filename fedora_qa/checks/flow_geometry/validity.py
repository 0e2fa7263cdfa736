"""Pixels with and without values of flow, and the intervals of flow."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.flow_geometry.interval_timestamps import timestamp_statistics
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.flow.mask import compare_patterns, depth_range_m
from fedora_qa.features import Feature
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.lens import border_pixels
from fedora_qa.geometry.rigid_flow import moved_points
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import (
    Interval,
    PoseTrack,
    depths_plausible,
    frame_at,
    motion_over,
    owned_intervals,
    place,
    pose_track,
)
from fedora_qa.views.pixel_lattice import Region, static_depth_m, union_of

_SIGMAS: Final = 8.0
"""Distance from the camera's plane, in sigma of declared pose noise, within which a point counts as neither before nor
behind."""


@dataclass(frozen=True, slots=True)
class FieldPattern:
    """Wrong pixels of one field.

    Attributes
    ----------
    interval
        Of the field.
    frame
        Row of the depth frame at its start.
    unfounded, unfounded_zero, unfounded_fills, behind
        Numbers of values without a valid static point; of those that are zero; of those that are no displacement; and
        of those whose point is behind the camera.
    deep
        Whether the depths of the points behind the camera, or of all points where none are, are plausible.
    infinite, missing
        Numbers of infinite values, and of valid depths without a value.
    pixel
        (column, row) of the first wrong pixel.
    part
        Left, top, right, bottom, px, half-open, of the rectangle that holds the wrong pixels; None without any.
    """

    interval: Interval
    frame: int
    unfounded: int
    unfounded_zero: int
    unfounded_fills: int
    behind: int
    deep: bool
    infinite: int
    missing: int
    pixel: tuple[int, int] | None
    part: Region | None = None


@dataclass(frozen=True, slots=True)
class WrongFlowValues(Feature):
    """Pixels of all fields whose pattern is wrong.

    Attributes
    ----------
    streams
        Rates with pixels that the statistic counts.
    unfounded, missing
        Numbers of values without a valid point, and of valid depths without a value.
    fills, behind
        Numbers of unfounded values that are no displacement, because they equal their field's median or are longer than
        the diagonal of the image, and of those behind the camera.
    deep
        Whether the depths of the unfounded values are plausible in every field.
    part
        Left, top, right, bottom, px, half-open, of the rectangle that holds the wrong pixels of all fields.
    missing_with_depth
        Whether values are missing in the same pixels of every rate, and in others a frame later: the depth from which
        all rates were made had none there, and lies elsewhere as the camera moves. A border that flow leaves out stays.
    """

    streams: frozenset[str]
    unfounded: int
    missing: int
    fills: int
    behind: int
    deep: bool
    part: Region | None = None
    missing_with_depth: bool = False


class FlowGeometryValidity(WindowCheck[tuple[FieldPattern, ...]]):
    """Does flow have values exactly at the required pixels, over intervals from frame to frame?

    The number of pixels with flow and without depth, of pixels with depth and without flow, and of infinite values. The
    number of intervals that start or end on no depth frame, leave gaps, overlap, or have another length than the rate
    implies. Every number must be zero.

    Why it matters
    --------------
    Zero at a pixel without flow means that the pixel does not move. An interval whose timestamps are not those of its
    frames assigns each field to the wrong images, and a lost field shifts all later ones.

    How
    ---
    Every pixel of every field is tested. It must have a value where the depth at the interval's start is valid and the
    point stays in front of the camera, and be NaN elsewhere. Timestamps are compared as integers. Where they are not
    those of frames, a constant, a drift and a grid are fitted to the distances from the nearest frames; the share of
    the distance that each removes is its weight. Colour frames decide whether the timestamps of flow or of depth are
    wrong. Sorting separates gaps from rows in a wrong order.

    Noise model
    -----------
    None: counts of a correct file are zero. Two kinds of pixels are left out: points within eight standard deviations
    of declared pose noise from the camera's plane (two-sided probability 1e-15 each), and missing values of moving
    objects.

    Cannot detect
    -------------
    Intervals that are shifted by whole frames together with their timestamps (``flow_geometry.endpoint``). Offsets are
    measured modulo the frame step. Without poses, where no pose covers an interval, or where moving objects are not
    known, missing values are not counted.

    Sources
    -------
    First principles: format.md defines where flow is finite; ``checks/flow_geometry/interval_timestamps.py`` derives
    the patterns.
    """

    name = "flow_geometry.validity"
    needs = ("flow", "depth")

    def measure(self, window: Window) -> tuple[FieldPattern, ...] | None:
        """Compare patterns of every field that the window owns."""
        camera = window.facts.declared.cameras.get("depth")
        track = pose_track(window, camera) if camera and "pose" in window.facts.streams else None
        patterns = []
        for interval in (i for stream in window.facts.flow_streams for i in owned_intervals(window, stream)):
            frame = frame_at(window.facts.clocks["depth"], interval.start_ns)
            if frame is None:
                continue
            depth_m, flow_px = window.depth_m(frame), window.flow_px(interval.stream, interval.row)
            if depth_m.shape != flow_px.shape[:2]:
                continue
            static_m = static_depth_m(window, frame)
            may_pass = False
            if track is not None and static_m is not None:
                # Whether any static point may end behind the camera's plane, or too near to it to be certain.
                motion = motion_over(window, interval)
                range_m = window.derived(_range_of_depth_m, frame)
                may_pass = motion is None or (
                    range_m is not None and not _all_before(track, motion, depth_m.shape, range_m, window)
                )
            # Rows of interleaved u and v, contiguous float32: the layout that the kernel reads.
            lines = np.ascontiguousarray(flow_px, dtype=np.float32).reshape(len(flow_px), -1)
            unfounded, missing, infinite = compare_patterns(lines, depth_m, depth_m if static_m is None else static_m)
            are_missing = missing and track is not None and static_m is not None
            if may_pass or unfounded or infinite or are_missing:
                patterns.append(_count_wrong_pixels(window, track, interval, frame, static_m))
            else:
                # A field without any wrong pixel needs no count by kind.
                patterns.append(FieldPattern(interval, frame, 0, 0, 0, 0, deep=True, infinite=0, missing=0, pixel=None))
        return tuple(patterns)

    def conclude(self, state: Sequence[tuple[FieldPattern, ...]], facts: Facts) -> Observation:
        """State the numbers of wrong pixels by kind, and of wrong intervals."""
        patterns = [pattern for patterns in state for pattern in patterns]
        total = sum(facts.sizes.get(f"path/{stream}", 0) for stream in facts.flow_streams)
        coverage = Coverage(len(patterns), total, "flow fields")
        if not facts.clocks["depth"].usable:
            return Observation(coverage, unobservable="the timestamps of depth do not increase")
        unfounded = [pattern for pattern in patterns if pattern.unfounded]
        missing = [pattern for pattern in patterns if pattern.missing]
        infinite = [pattern for pattern in patterns if pattern.infinite]
        count = max(sum(p.unfounded for p in unfounded), 1)
        mostly_zero = 2 * sum(p.unfounded_zero for p in unfounded) > count
        mostly_behind = 2 * sum(p.behind for p in unfounded) > count
        text = "belong to points behind the camera" if mostly_behind else "lie where depth is invalid"
        statistics = []
        for name, rule, number, wrong, where_text in (
            ("values_without_depth", "unfounded", sum(p.unfounded for p in patterns), unfounded,
             text + (", most of them 0" if mostly_zero else "")),
            ("missing_values", "missing", sum(p.missing for p in patterns), missing, "are absent where depth is valid"),
            ("infinite_values", "infinite", sum(p.infinite for p in patterns), infinite, "are infinite"),
        ):  # fmt: skip
            where, features = Where(), tuple[Feature, ...]()
            if wrong:
                first, last = wrong[0], wrong[-1]
                where = place(facts, (first.interval, last.interval), frame=first.frame, pixel=first.pixel)
                values = WrongFlowValues(
                    streams=frozenset(pattern.interval.stream for pattern in wrong),
                    unfounded=sum(p.unfounded for p in unfounded),
                    missing=sum(p.missing for p in missing),
                    fills=sum(p.unfounded_fills for p in unfounded),
                    behind=sum(p.behind for p in unfounded),
                    deep=all(pattern.deep for pattern in unfounded),
                    part=union_of([pattern.part for pattern in patterns if pattern.part is not None]),
                    missing_with_depth=_miss_with_depth(missing),
                )
                features = (values,)
            statistics.append(
                Statistic(
                    name=name,
                    value=float(number),
                    unit="pixels",
                    standard_error=0.0,
                    resolution=1.0,
                    side="upper",
                    statement=f"{number} values of flow, in {len(wrong)} fields, {where_text}.",
                    code=f"flow_geometry.validity.{rule}",
                    where=where,
                    features=features,
                )
            )
        return Observation(coverage, (*statistics, *timestamp_statistics(facts)))


def _miss_with_depth(missing: Sequence[FieldPattern]) -> bool:
    """Whether most frames at which several rates begin lack the same values in all of them, and others than the next.

    Pixels are taken as the same by their number and the rectangle that holds them.
    """
    of_frame: dict[int, dict[str, tuple[int, Region | None]]] = {}
    for pattern in missing:
        of_frame.setdefault(pattern.frame, {})[pattern.interval.stream] = pattern.missing, pattern.part
    shared = [set(of_frame[frame].values()) for frame in sorted(of_frame) if len(of_frame[frame]) > 1]
    alike = sum(len(of_rates) == 1 for of_rates in shared)
    moves = sum(not earlier & later for earlier, later in pairwise(shared))
    return 2 * alike > len(shared) and 2 * moves > len(shared) - 1 > 0


def _range_of_depth_m(window: Window, frame: int) -> tuple[float, float] | None:
    static_m = static_depth_m(window, frame)
    return None if static_m is None else depth_range_m(window.depth_m(frame), static_m)


def _count_wrong_pixels(
    window: Window, track: PoseTrack | None, interval: Interval, frame: int, static_m: NDArray[np.float32] | None
) -> FieldPattern:
    """Count the wrong pixels of a field by their kind."""
    depth_m, flow_px = window.depth_m(frame), window.flow_px(interval.stream, interval.row)
    u, v = flow_px[..., 0], flow_px[..., 1]
    present = np.isfinite(u) & np.isfinite(v)
    valid = np.isfinite(depth_m) & (depth_m > 0)
    unfounded, missing = present & ~valid, valid & ~present
    behind = np.zeros_like(valid)
    # Pixels whose points certainly end in front of the camera's plane.
    before = np.zeros_like(valid)
    still = valid & np.isfinite(static_m) if track is not None and static_m is not None else before
    if track is not None and still.any():
        motion = motion_over(window, interval)
        range_m = float(depth_m[still].min()), float(depth_m[still].max())
        if motion is not None and _all_before(track, motion, depth_m.shape, range_m, window):
            before = still
        elif motion is not None:
            margin_m = _margin_m(window.facts.declared.pose, range_m[1])
            # (1, W) and (H, 1) broadcast, without a full grid of coordinates.
            columns = np.arange(depth_m.shape[1], dtype=np.float64)[None, :]
            rows = np.arange(depth_m.shape[0], dtype=np.float64)[:, None]
            Z1_m = moved_points(track.camera.K, motion, columns, rows, depth_m.astype(np.float64), track.camera.lens)[2]
            before, behind = still & (Z1_m > margin_m), still & (Z1_m < -margin_m)
    unfounded |= present & behind
    missing &= before
    # Most fills equal their median, which hardly any values of a flow do. Or they displace no point within the image,
    # as unknown flow in Middlebury's files.
    values_px, fills = flow_px[unfounded], 0
    if len(values_px):
        equal = np.all(values_px == np.median(values_px, axis=0), axis=1)
        # In float64: the square of 1e30 overflows float32.
        beyond = np.linalg.norm(values_px.astype(np.float64), axis=1) > np.hypot(*depth_m.shape)
        fills = int(np.count_nonzero(equal | beyond))
    wrong = unfounded | missing
    first, part = None, None
    if wrong.any():
        first = int(np.argmax(wrong))
        down, right = np.nonzero(wrong)
        part = int(right.min()), int(down.min()), int(right.max()) + 1, int(down.max()) + 1
    width = depth_m.shape[1]
    return FieldPattern(
        interval,
        frame,
        unfounded=int(np.count_nonzero(unfounded)),
        unfounded_zero=int(np.count_nonzero(unfounded & (u == 0) & (v == 0))),
        unfounded_fills=fills,
        behind=int(np.count_nonzero(present & behind)),
        deep=not valid.any() or depths_plausible(window.facts, depth_m[behind if behind.any() else valid]),
        infinite=int(np.count_nonzero(np.isinf(u) | np.isinf(v))),
        missing=int(np.count_nonzero(missing)),
        pixel=None if first is None else (first % width, first // width),
        part=part,
    )


def _all_before(
    track: PoseTrack, motion: RigidMotion, shape: tuple[int, ...], range_m: tuple[float, float], window: Window
) -> bool:
    """Whether all points of an image certainly end in front of the camera's plane, as the nearest in its corners."""
    height, width = shape
    corners = np.array([[0, 0], [width - 1, 0], [0, height - 1], [width - 1, height - 1]], dtype=np.float64)
    # Z1 = Z0 (R ray)_z + t_z: linear in the slopes of the ray, so that its least coefficient lies in a corner. With a
    # lens the rays of the image have bent borders, and it lies somewhere on these.
    lens = track.camera.lens
    columns, rows = corners.T if lens is None else border_pixels(width, height)
    ahead = moved_points(track.camera.K, motion, columns, rows, np.ones(len(columns)), lens)[2]
    per_metre = ahead - motion.t_m[2]
    margin_m = _margin_m(window.facts.declared.pose, range_m[1])
    return bool(per_metre.min() > 0 and range_m[0] * per_metre.min() + motion.t_m[2] > margin_m)


def _margin_m(noise: PoseModel | None, distance_m: float) -> float:
    """Return the largest error of a point's depth, m, by pose noise, or by rounding where the pose has no noise."""
    rounding_m = 1e-5 * distance_m
    if noise is None:
        # Noise that is not declared may have any size: for no point is the side of the plane certain.
        return distance_m
    # Noise of the position, and of the rotation at this distance, are independent.
    return _SIGMAS * float(np.hypot(noise.position_sigma_m, noise.rotation_sigma_rad * distance_m)) + rounding_m
