"""Gross faults, tried one by one on a pair of depth frames that is off: undo each and see whether they then agree."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M, NS_PER_S
from fedora_qa.estimators.depth.inverse_depth import DepthImage, depth_image
from fedora_qa.estimators.depth.pair_fit import Family, fit_depth, noise_directions
from fedora_qa.estimators.depth.warp import DepthModel, Lattice, lattice_of, ray_lengths
from fedora_qa.geometry.so3 import compose
from fedora_qa.views.depth_pairs import DepthPair, standing_m, step_share
from fedora_qa.views.flow_conventions import ConventionTrial, other_mountings
from fedora_qa.views.flow_intervals import PoseTrack

Depth = NDArray[np.float32]
Float64 = NDArray[np.float64]
Tile = tuple[int, int, int, int]
"""Left, top, right, bottom, px."""

_NEIGHBOURS: Final = (-2, -1, 1, 2)
_DELAYS_MS: Final = (-80.0, -40.0, -20.0, -10.0, 0.0, 10.0, 20.0, 40.0, 80.0)
"""Offsets of the stamps that the fit starts from: it converges from where the motion still is about the same."""

_SHIFTS_PX: Final = (-4, -3, -2, -1, 1, 2, 3, 4)
"""Shifts of one frame against the other that are tried."""

_PIXELS: Final = 1000

_LESS_LIKELY: Final = 0.95
"""Where two causes have the same effect on depth, the one that other streams would show is named second."""

DEPTH: Final = "depth"
PART: Final = "part of the depth"
"""What was changed: all of the depth, or a part: one frame of the pair, where a fault begins or ends between the two,
or one tile of both."""

_FREE_TWIST: Final = noise_directions(np.eye(6))


@dataclass(frozen=True, slots=True)
class _Hypothesis:
    """The frames and how they hang together without the fault; ``family`` has a free parameter where ``step`` is set.

    ``blames`` are the causes and streams that would have this effect, each with its likeliness and the size of the
    fault for a value of the parameter. ``possible`` says which values a fault can have.
    """

    blames: tuple[tuple[str, str, float, Callable[[float], float | None]], ...]
    images: tuple[DepthImage, DepthImage]
    family: Family
    start: float = 0.0
    step: float | None = None
    noise: Float64 | None = None
    of: str = DEPTH
    possible: Callable[[float], bool] = lambda _: True


def weigh_hypotheses(pair: DepthPair, as_stored: float, tile: Tile | None = None) -> list[ConventionTrial]:
    """Weigh every gross fault against one pair: the share of the typical residual that undoing it removes.

    ``as_stored`` is that residual, infinite where the frames could not be compared as they stand. Only the pixels of
    the tile are looked at, where one is given.
    """
    best: dict[tuple[str, str, str], ConventionTrial] = {}
    for hypothesis in _hypotheses(pair) if tile is None else _hypotheses_of_a_tile(pair):
        noise = pair.noise if hypothesis.noise is None else hypothesis.noise
        fit = fit_depth(
            hypothesis.family, _lattice(hypothesis.images[0], tile), hypothesis.images[1], noise,
            start=hypothesis.start, step=hypothesis.step,
        )  # fmt: skip
        if fit is None or not hypothesis.possible(fit.value):
            continue
        for cause, stream, likeliness, size in hypothesis.blames:
            weight = likeliness * max(1.0 - fit.typical / as_stored, 0.0)
            key = (hypothesis.of, cause, stream)
            if key not in best or best[key].removed_share < weight:
                best[key] = ConventionTrial(hypothesis.of, cause, stream, weight, size(float(fit.value)))
    return list(best.values())


def _lattice(image: DepthImage, tile: Tile | None) -> Lattice:
    if tile is None:
        return lattice_of(image, 1, _PIXELS)
    left, top, right, bottom = tile
    near_edge = np.ones_like(image.near_edge)
    near_edge[top:bottom, left:right] = image.near_edge[top:bottom, left:right]
    return lattice_of(replace(image, near_edge=near_edge), 1, _PIXELS)


def _hypotheses(pair: DepthPair) -> Iterator[_Hypothesis]:
    yield from _of_the_values(pair)
    yield from _of_the_grid(pair)
    yield from _of_the_frames(pair)
    yield from _of_the_timestamps(pair)
    yield from _of_the_pose(pair)


def _hypotheses_of_a_tile(pair: DepthPair) -> Iterator[_Hypothesis]:
    """Suppose what can befall a part of the image: there in both frames, and no fault of pose or camera."""
    for hypothesis in (*_of_the_values(pair), *_of_the_grid(pair), *_of_the_frames(pair)):
        blames = tuple(blame for blame in hypothesis.blames if blame[1] == DEPTH)
        if hypothesis.of == DEPTH and blames:
            yield replace(hypothesis, blames=blames, of=PART)


def _sizeless(_: float) -> None:
    return None


def _always(size: float) -> Callable[[float], float]:
    return lambda _: size


def _only(model: DepthModel) -> Family:
    return lambda _: model


def _reciprocal(factor: float) -> float | None:
    return 1 / factor if factor else None


def _of_the_values(pair: DepthPair) -> Iterator[_Hypothesis]:
    """Suppose another unit, or lengths of rays."""
    longer = (("unit_mm_m", "depth", 1.0, float), ("unit_mm_m", "pose", _LESS_LIKELY, _reciprocal))
    yield _Hypothesis(longer, pair.images, pair.scaled, step=1e-3, possible=lambda factor: factor >= 0)
    for factor in (1 / MM_PER_M, MM_PER_M):
        unit = (("unit_mm_m", "depth", 1.0, _always(factor)),)
        for images in _either(pair, _changed(pair, _divided_by(factor))):
            yield _Hypothesis(unit, images, _only(pair.model()), of=PART)
    rays = (("depth_ray_not_z", "depth", 1.0, _sizeless),)
    yield _Hypothesis(rays, pair.images, _only(pair.as_rays(1.0)))
    for images in _either(pair, _changed(pair, lambda d: d / ray_lengths(pair.model().K, d.shape))):
        yield _Hypothesis(rays, images, _only(pair.model()), of=PART)


def _of_the_grid(pair: DepthPair) -> Iterator[_Hypothesis]:
    """Turn the images over, or move them: what moves all images alike is a principal point."""
    for turn in (lambda d: d[:, ::-1], lambda d: d[::-1]):
        mirrored, turned = (("mirrored", "depth", 1.0, _sizeless),), _changed(pair, turn)
        yield _Hypothesis(mirrored, turned, _only(pair.model()))
        for images in _either(pair, turned):
            yield _Hypothesis(mirrored, images, _only(pair.model()), of=PART)
    within_px = max(pair.images[0].depths_m.shape) / 2  # images that are shifted further share too little
    for axis in (0, 1):
        moved = (
            ("spatial_offset", "depth", 1.0, float),
            ("intrinsics_centre", "metadata", _LESS_LIKELY, lambda shift_px: -shift_px),
        )
        family = _family_of_centre(pair, axis)
        yield _Hypothesis(moved, pair.images, family, step=0.01, possible=lambda px: abs(px) <= within_px)
    for axis, shift_px in product((0, 1), _SHIFTS_PX):
        shifted = (("spatial_offset", "depth", 1.0, _always(float(shift_px))),)
        back = tuple(image.moved(axis, -shift_px) for image in pair.images)
        for images in _either(pair, (back[0], back[1])):
            yield _Hypothesis(shifted, images, _only(pair.model()), of=PART)
    longer = (("intrinsics_focal", "metadata", 1.0, lambda share: -100 * share),)
    yield _Hypothesis(longer, pair.images, _family_of_focal(pair), step=1e-3)


def _of_the_frames(pair: DepthPair) -> Iterator[_Hypothesis]:
    """Suppose that either frame stands where a neighbour belongs."""
    last = pair.window.facts.sizes["path/depth"] - 1
    first, second = pair.first, pair.second
    stored = [((second, first), 1)]
    stored += [((first + distance, second), abs(distance)) for distance in _NEIGHBOURS]
    stored += [((first, second + distance), abs(distance)) for distance in _NEIGHBOURS]
    for rows, distance in stored:
        if min(rows) >= 0 and max(rows) <= last and rows[0] != rows[1]:
            exchanged = (("swapped_frames", "depth", 1.0, _always(float(distance))),)
            yield _Hypothesis(exchanged, _images_of(pair, *rows), _only(pair.model()))


def _of_the_timestamps(pair: DepthPair) -> Iterator[_Hypothesis]:
    """Suppose that depth is stamped too late, or the pose too early."""
    late = (("time_offset", "depth", 1.0, float), ("time_offset", "pose", _LESS_LIKELY, lambda late_ms: -late_ms))

    def family(late_ms: float) -> DepthModel | None:
        late_ns = round(late_ms * NS_PER_S / 1e3)
        motion = pair.track.motion(pair.start_ns - late_ns, pair.end_ns - late_ns)
        return None if motion is None else replace(pair.model(), motion=motion)

    for start_ms in _DELAYS_MS:
        yield _Hypothesis(late, pair.images, family, start=start_ms, step=0.1)


def _of_the_pose(pair: DepthPair) -> Iterator[_Hypothesis]:
    """Suppose other conventions of the pose, of both or of either, or of the mounting, or one wrong pose."""
    for cause, change in (
        ("quaternion_inverted", _turned((0, 1, 2, 3), (-1, -1, -1, 1))),
        ("quaternion_order", _turned((1, 2, 3, 0), (1, 1, 1, 1))),
        ("axes_swapped", _moved((1, 0, 2), (1, 1, 1))),
        ("frame_convention", _from_north_east_down),
    ):
        track = change(pair.track)
        for first, last in ((track, track), (pair.track, track), (track, pair.track)):
            motion = first.motion_into(last, pair.start_ns, pair.end_ns)
            if motion is not None:
                model = replace(pair.model(), motion=motion)
                yield _Hypothesis(((cause, "pose", 1.0, _sizeless),), pair.images, _only(model))
    for T_body_camera in other_mountings(pair.track.camera.T_body_camera):
        motion = pair.track.mounted(T_body_camera).motion(pair.start_ns, pair.end_ns)
        if motion is not None:
            model = replace(pair.model(), motion=motion)
            yield _Hypothesis((("frame_convention", "metadata", 1.0, _sizeless),), pair.images, _only(model))
    any_pose = (("teleport", "pose", _LESS_LIKELY, _sizeless), ("frozen_frames", "pose", 0.9, _sizeless))
    yield _Hypothesis(any_pose, pair.images, _only(pair.model()), noise=_FREE_TWIST)


def _family_of_centre(pair: DepthPair, axis: int) -> Family:
    def family(shift_px: float) -> DepthModel:
        K = pair.model().K.copy()
        K[axis, 2] += shift_px
        return replace(pair.model(), K=K)

    return family


def _family_of_focal(pair: DepthPair) -> Family:
    def family(share: float) -> DepthModel:
        return replace(pair.model(), K=pair.model().K @ np.diag([1 + share, 1 + share, 1.0]))

    return family


def _changed(pair: DepthPair, change: Callable[[Depth], Depth]) -> tuple[DepthImage, DepthImage]:
    share = step_share(pair.window)
    first, second = (depth_image(change(standing_m(pair.window, row)), share) for row in (pair.first, pair.second))
    return first, second


def _either(pair: DepthPair, changed: tuple[DepthImage, DepthImage]) -> tuple[tuple[DepthImage, DepthImage], ...]:
    """Return the pair with one frame or the other changed: where a fault begins, or ends, between them."""
    first, second = pair.images
    return (changed[0], second), (first, changed[1])


def _divided_by(factor: float) -> Callable[[Depth], Depth]:
    return lambda depths_m: depths_m / np.float32(factor)


def _images_of(pair: DepthPair, *rows: int) -> tuple[DepthImage, DepthImage]:
    share = step_share(pair.window)
    first, second = (depth_image(standing_m(pair.window, row), share) for row in rows)
    return first, second


def _turned(order: tuple[int, ...], signs: tuple[int, ...]) -> Callable[[PoseTrack], PoseTrack]:
    return lambda track: track.transformed(
        lambda poses: replace(poses, orientations_xyzw=poses.orientations_xyzw[:, order] * signs)
    )


def _moved(order: tuple[int, ...], signs: tuple[int, ...]) -> Callable[[PoseTrack], PoseTrack]:
    return lambda track: track.transformed(
        lambda poses: replace(poses, positions_world_m=poses.positions_world_m[:, order] * signs)
    )


def _from_north_east_down(track: PoseTrack) -> PoseTrack:
    """Return the track of poses that were written for a world and a body with Z down."""
    q_enu_ned, q_frd_flu = np.array([np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0]), np.array([1.0, 0.0, 0.0, 0.0])
    return _moved((1, 0, 2), (1, 1, -1))(track).transformed(
        lambda poses: replace(poses, orientations_xyzw=compose(compose(q_enu_ned, poses.orientations_xyzw), q_frd_flu))
    )
