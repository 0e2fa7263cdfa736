"""Inverse transforms of depth, camera, timestamps and poses, tried on a deviating pair of depth frames.

Each trial applies one transform to the pair and measures how much of the typical residual it removes.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, product
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M, NS_PER_S
from fedora_qa.estimators.depth.inverse_depth import DepthImage, depth_image
from fedora_qa.estimators.depth.pair_fit import Family, fit_depth, noise_directions
from fedora_qa.estimators.depth.warp import DepthModel, lattice_of, ray_lengths
from fedora_qa.features import Feature
from fedora_qa.views.depth_pairs import DepthPair, static_depth_of_frame_m, step_share
from fedora_qa.views.flow_conventions import from_north_east_down, other_mountings, reordered_quaternions
from fedora_qa.views.flow_intervals import PoseTrack

Depth = NDArray[np.float32]
Float64 = NDArray[np.float64]
Images = tuple[DepthImage, DepthImage]
Tile = tuple[int, int, int, int]
"""Left, top, right, bottom, px."""

Transform = Literal[
    "depth_scale", "ray_length", "mirrored", "image_shift", "focal_length", "frame_order", "clock_offset",
    "conjugate_quaternion", "scalar_first_quaternion", "exchanged_axes", "north_east_down", "mounting", "free_motion",
]  # fmt: skip
"""The transform that is undone. Parameters, where there are any: the factor by which depths are too large
(``depth_scale``); px to the right or down (``image_shift``); the share by which the focal length is too short
(``focal_length``); rows between the frames that are exchanged (``frame_order``); ms by which timestamps of depth are
too late (``clock_offset``); m by which the position between the two poses is corrected (``free_motion``)."""

Extent = Literal["all", "part"]
"""What was changed: all of the depth; or a part, which is one frame of the pair or one tile of both."""

_NEIGHBOURS: Final = (-2, -1, 1, 2)
_OFFSETS_MS: Final = (-80.0, -40.0, -20.0, -10.0, 0.0, 10.0, 20.0, 40.0, 80.0)
"""Clock offsets, ms, at which the fit starts: the fit converges where the motion changes little between start and
solution."""

_SHIFTS_PX: Final = (-4, -3, -2, -1, 1, 2, 3, 4)
"""Shifts of one frame against the other that are tried."""

_PIXELS: Final = 1000

_ANY_MOTION: Final = noise_directions(np.eye(6))


@dataclass(frozen=True, slots=True)
class DepthTrial:
    """One transform, tried on one pair of depth frames.

    Attributes
    ----------
    transform
        What was undone.
    extent
        The part of the depth in which it was undone.
    residual_reduction
        Share of the typical residual that undoing it removes, 0 to 1.
    parameter
        Its fitted or tried size in the unit of the transform; 0 where it has none.
    """

    transform: Transform
    extent: Extent
    residual_reduction: float
    parameter: float


@dataclass(frozen=True, slots=True)
class PairTrials(Feature):
    """All trials of one pair of depth frames.

    Attributes
    ----------
    first
        Row of the first frame.
    trials
        In the order in which they were made.
    """

    first: int
    trials: tuple[DepthTrial, ...]


@dataclass(frozen=True, slots=True)
class _Candidate:
    """A pair after one transform: its frames, and the family of models that relates them.

    The family has a free parameter where ``step`` is set; otherwise ``parameter`` is the size that is tried.
    ``possible`` decides whether a file can have the fitted parameter.
    """

    transform: Transform
    images: Images
    family: Family
    extent: Extent = "all"
    start: float = 0.0
    step: float | None = None
    parameter: float = 0.0
    noise: Float64 | None = None
    possible: Callable[[float], bool] = lambda _: True


def try_conventions(pair: DepthPair, residual_as_stored: float, tile: Tile | None = None) -> PairTrials:
    """Try every transform on one pair.

    Parameters
    ----------
    pair
        The frames, with all of their pixels.
    residual_as_stored
        Typical relative residual of the pair as stored; infinite where the frames could not be compared.
    tile
        Left, top, right, bottom, px, of the part of the first frame that is compared; the whole frame where None. In a
        tile only transforms of the depth are tried, on both frames: pose and camera are common to all pixels.

    Returns
    -------
    PairTrials
        One trial for each candidate. Candidates without a fit, or with an impossible parameter, are left out.
    """
    if tile is None:

        def with_focal_length(relative_change: float) -> DepthModel:
            factor = 1 + relative_change
            return replace(pair.model(), K=pair.model().K @ np.diag([factor, factor, 1.0]))

        focal_length = _Candidate("focal_length", pair.images, with_focal_length, step=1e-3)
        candidates = chain(_with_other_depth(pair), (focal_length,), _with_other_frames(pair), _with_other_motion(pair))
    else:
        # A part of the image is one in both frames: what begins between the frames is left out.
        of_both_frames = (c for c in chain(_with_other_depth(pair), _with_other_frames(pair)) if c.extent == "all")
        candidates = chain(replace(c, extent="part") for c in of_both_frames)
    trials = []
    for candidate in candidates:
        first, second = candidate.images
        if tile is not None:
            # Pixels outside of the tile count as near an edge, which lattices leave out.
            left, top, right, bottom = tile
            near_edge = np.ones_like(first.near_edge)
            near_edge[top:bottom, left:right] = first.near_edge[top:bottom, left:right]
            first = replace(first, near_edge=near_edge)
        noise = pair.noise if candidate.noise is None else candidate.noise
        fit = fit_depth(
            candidate.family, lattice_of(first, 1, _PIXELS), second, noise, start=candidate.start, step=candidate.step
        )
        if fit is None or not candidate.possible(fit.value):
            continue
        reduction = max(1.0 - fit.typical / residual_as_stored, 0.0)
        parameter = candidate.parameter if candidate.step is None else float(fit.value)
        if candidate.transform == "free_motion":
            parameter = float(np.linalg.norm(fit.twist[3:]))
        trials.append(DepthTrial(candidate.transform, candidate.extent, reduction, parameter))
    return PairTrials(pair.first, tuple(trials))


def _only(model: DepthModel) -> Family:
    return lambda _: model


def _with_other_depth(pair: DepthPair) -> Iterator[_Candidate]:
    """Suppose another unit, or lengths of rays, or images that were turned over or moved."""
    # The motion between the poses is in metres, and so determines the factor of the depths. No unit has a negative one.
    yield _Candidate("depth_scale", pair.images, pair.scaled, step=1e-3, possible=lambda factor: factor >= 0)
    other_units: tuple[tuple[float, Callable[[Depth], Depth]], ...] = (
        (1 / MM_PER_M, lambda depths_m: depths_m / np.float32(1 / MM_PER_M)),
        (MM_PER_M, lambda depths_m: depths_m / np.float32(MM_PER_M)),
    )
    for factor, divide in other_units:
        for images in _either(pair, _images(pair, divide)):
            yield _Candidate("depth_scale", images, _only(pair.model()), "part", parameter=factor)
    yield _Candidate("ray_length", pair.images, _only(pair.as_rays(1.0)))
    for images in _either(pair, _images(pair, lambda d: d / ray_lengths(pair.model().K, pair.model().lens, d.shape))):
        yield _Candidate("ray_length", images, _only(pair.model()), "part")
    # From right to left, from bottom to top, and both, as of a camera that hangs upside down.
    for flip in (lambda d: d[:, ::-1], lambda d: d[::-1], lambda d: d[::-1, ::-1]):
        flipped = _images(pair, flip)
        yield _Candidate("mirrored", flipped, _only(pair.model()))
        for images in _either(pair, flipped):
            yield _Candidate("mirrored", images, _only(pair.model()), "part")
    within_px = max(pair.images[0].depths_m.shape) / 2  # images that are shifted further share too little
    for axis in (0, 1):
        family = _principal_point_family(pair, axis)
        yield _Candidate(
            "image_shift", pair.images, family, step=0.01, possible=lambda shift_px: abs(shift_px) <= within_px
        )
    for axis, shift_px in product((0, 1), _SHIFTS_PX):
        back = tuple(image.moved(axis, -shift_px) for image in pair.images)
        for images in _either(pair, (back[0], back[1])):
            yield _Candidate("image_shift", images, _only(pair.model()), "part", parameter=float(shift_px))


def _with_other_frames(pair: DepthPair) -> Iterator[_Candidate]:
    """Suppose that either frame stands where a neighbour belongs."""
    last = pair.window.facts.sizes["path/depth"] - 1
    first, second = pair.first, pair.second
    orders = [((second, first), 1)]
    orders += [((first + distance, second), abs(distance)) for distance in _NEIGHBOURS]
    orders += [((first, second + distance), abs(distance)) for distance in _NEIGHBOURS]
    for rows, distance in orders:
        if min(rows) >= 0 and max(rows) <= last and rows[0] != rows[1]:
            images = _images(pair, rows=rows)
            yield _Candidate("frame_order", images, _only(pair.model()), parameter=float(distance))


def _with_other_motion(pair: DepthPair) -> Iterator[_Candidate]:
    """Suppose other timestamps of depth or poses, other conventions of poses or mounting, or a single wrong pose."""

    # Timestamps of depth that are too late, or of the pose that are too early.
    def with_clock_offset(offset_ms: float) -> DepthModel | None:
        offset_ns = round(offset_ms * NS_PER_S / 1e3)
        motion = pair.track.motion(pair.start_ns - offset_ns, pair.end_ns - offset_ns)
        return None if motion is None else replace(pair.model(), motion=motion)

    for start_ms in _OFFSETS_MS:
        yield _Candidate("clock_offset", pair.images, with_clock_offset, start=start_ms, step=0.1)
    exchanged_axes = pair.track.transformed(
        lambda poses: replace(poses, positions_world_m=poses.positions_world_m[:, [1, 0, 2]])
    )
    conventions: tuple[tuple[Transform, PoseTrack], ...] = (
        ("conjugate_quaternion", reordered_quaternions(pair.track, (0, 1, 2, 3), (-1, -1, -1, 1))),
        ("scalar_first_quaternion", reordered_quaternions(pair.track, (1, 2, 3, 0), (1, 1, 1, 1))),
        ("exchanged_axes", exchanged_axes),
        ("north_east_down", from_north_east_down(pair.track)),
    )
    for transform, track in conventions:
        # Both poses of the pair, or one where the convention changes between them.
        for first, last in ((track, track), (pair.track, track), (track, pair.track)):
            motion = first.motion_into(last, pair.start_ns, pair.end_ns)
            if motion is not None:
                yield _Candidate(transform, pair.images, _only(replace(pair.model(), motion=motion)))
    for T_body_camera in other_mountings(pair.track.camera.T_body_camera):
        motion = pair.track.mounted(T_body_camera).motion(pair.start_ns, pair.end_ns)
        if motion is not None:
            yield _Candidate("mounting", pair.images, _only(replace(pair.model(), motion=motion)))
    # Unit covariance (1 m, 1 rad) leaves the motion free: what only this removes is a wrong pose.
    yield _Candidate("free_motion", pair.images, _only(pair.model()), noise=_ANY_MOTION)


def _principal_point_family(pair: DepthPair, axis: int) -> Family:
    def family(shift_px: float) -> DepthModel:
        K = pair.model().K.copy()
        # An image that is shifted by s px is that of a camera whose principal point lies s px further.
        K[axis, 2] += shift_px
        return replace(pair.model(), K=K)

    return family


def _images(
    pair: DepthPair, change: Callable[[Depth], Depth] = lambda d: d, rows: tuple[int, int] | None = None
) -> Images:
    """Return both frames, or those of other rows, with changed depths."""
    quantum = step_share(pair.window)
    first, second = (
        depth_image(change(static_depth_of_frame_m(pair.window, row)), quantum)
        for row in rows or (pair.first, pair.second)
    )
    return first, second


def _either(pair: DepthPair, changed: Images) -> tuple[Images, ...]:
    """Return the pair with one frame or the other changed: where a fault begins, or ends, between them."""
    first, second = pair.images
    return (changed[0], second), (first, changed[1])
