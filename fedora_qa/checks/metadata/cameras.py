"""The declared cameras: whether their intrinsics and extrinsics are possible and fit the images."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic
from fedora_qa.features import Feature
from fedora_qa.geometry.lens import border_pixels, pixels_of_rays, rays_of_pixels
from fedora_qa.geometry.pinhole_fit import fit_pinhole
from fedora_qa.geometry.so3 import log
from fedora_qa.layout.metadata import rounding_of
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import Camera, Lens, StereoPair
from fedora_qa.sequence.facts import Facts

Float64 = NDArray[np.float64]

_RULE_QUANTILE: Final = 0.9
_RULE_RATIO: Final = 0.01
"""A rule is named if the distance of the entries from it, at nine tenths of the pixels, is a hundredth of that from the
declared cameras at most: the rule then explains 99% of the deviation."""

Rule = Literal[
    "exchanged_coordinates",
    "exchanged_pixels",
    "pixels_themselves",
    "without_lens",
    "other_view",
    "twice",
    "inverse",
    "other_pinhole",
    "none",
]

_IMAGES_OF: Final = {"rgb": "path/rgb", "depth": "path/depth"}
"""The images whose size a camera must have. Events have no images; ``event_stream.bounds`` checks their extent."""

_ROUNDING: Final = 1e-6
"""Rounding of matrices that were stored in float32: 2^-24 an entry, three products and a sum, with a margin of 4."""

_FARTHEST_MOUNT_M: Final = 10.0
"""Distance from the body's origin, m, above which the unit was probably millimetres."""

_PRINCIPAL_POINTS: Final = {0.5: "W/2, H/2", 1.0: "(W+1)/2, (H+1)/2"}
"""Conventions other than (W-1)/2, by the distance from it, px: integer coordinates are then no pixel centres."""


@dataclass(frozen=True, slots=True)
class RectificationRule(Feature):
    """The rule that gives the entries of a map that rectifies events.

    Attributes
    ----------
    rule
        ``none`` where no common rule does.
    """

    rule: Rule


@dataclass(frozen=True, slots=True)
class FocalLengths(Feature):
    """The declared focal lengths of a camera.

    Attributes
    ----------
    camera
        Name of the camera.
    fx_px, fy_px
        Focal lengths, px.
    """

    camera: str
    fx_px: float
    fy_px: float


@dataclass(frozen=True, slots=True)
class PrincipalPoint(Feature):
    """The declared principal point of a camera.

    Attributes
    ----------
    from_centre_px
        Its distance from the centre of the image, px.
    """

    from_centre_px: float


@dataclass(frozen=True, slots=True)
class StereoFocalLength(Feature):
    """The focal length of the depth camera against that by which disparity is read as depth.

    Attributes
    ----------
    longer_percent
        How much longer the camera's is.
    """

    longer_percent: float


class MetadataCameras(FactsCheck):
    """Are the declared cameras possible, and do they match the images?

    For each camera: the deviation of K from its form, the deviation of T_body_camera from a rigid motion, and the
    difference of the declared size from that of the images. The distance between the centres of the depth and event
    cameras. Where the file has a map that rectifies events: the largest distance (px) of its entries from the positions
    that follow from the cameras. Where depth is read from disparity: the differences of the focal length and of the
    baseline, by which it is, from those of the declared cameras.

    Why it matters
    --------------
    A transposed K or T_body_camera can still be multiplied. Flow, reprojection and odometry that use it are wrong
    everywhere; near the optical axis the errors are as small as noise.

    How
    ---
    K must be upper triangular without skew, with the last row 0 0 1 and positive focal lengths. Width and height must
    be those of the images. T_body_camera must be a rotation of determinant +1 with the last row 0 0 0 1. Depth and
    events must have one centre, as in the paper. A principal point outside of its image is that of a crop: the camera
    must then share directions of view with another camera with the same axes. A declared distortion must be one-to-one
    over the whole image: pixels on its border that no ray reaches are counted. An entry of ``rectify_map`` is the
    position of a pixel of the event camera in the view of the depth camera: its ray through the lens, rotated by
    ``R_view^T R_events`` and projected there. All entries are compared. Wrong ones are compared with common
    wrong maps: y before x, stored by x before y, the pixels themselves, without the distortion, to the view of ``rgb``,
    applied twice, from the view to the event camera, and the view of whatever pinhole camera fits best. A rule is named
    if it explains 99% of the deviation. The matrix Q by which disparity is read as depth, ``Z = f b / d``, has the
    focal length f of the depth camera, in whose view the disparity is, and the baseline b of the pair, which is the
    distance of the second camera where its mounting is declared. Noted as unusual are such a crop, principal
    points of another convention than (W-1)/2, pixels that are not square, cameras without any rotation, and cameras
    more than 10 m from the body.

    Noise model
    -----------
    Matrices may have been stored in float32: 2^-24 an entry, three products and a sum of R^T R, with a margin of four,
    give the bound of 1e-6. Entries of a map are rounded to float32. Focal lengths and baselines have half a unit of
    their last decimal place, and the rounding of float32. Everything else is exact.

    Cannot detect
    -------------
    Whether K and T_body_camera are those with which the images were made: ``flow_geometry``, ``flow_photometric``,
    ``depth.consistency`` and ``alignment`` measure that. Whether the distortion is that of the lens. Camera models
    other than the pinhole with radial-tangential or equidistant distortion. A map and a calibration with the same
    error. A matrix Q and a calibration with the same error; the principal point of Q, which no depth depends on.

    Sources
    -------
    The canonical layout, version 1.0 (Pixels, Extrinsics); R. Hartley, A. Zisserman, "Multiple View Geometry", 6.1.
    DSEC (dsec.ifi.uzh.ch/data-format; ``scripts/dataset/sequence.py`` of github.com/uzh-rpg/DSEC): the rectified
    position of an event at (x, y) is rectify_map[y, x].
    """

    name = "metadata.cameras"

    def not_applicable(self, facts: Facts) -> str:
        """Require a declared camera."""
        return "" if facts.declared.cameras else "the file declares no camera"

    def examine(self, facts: Facts) -> Observation:
        """Measure each camera, then the relations between cameras."""
        cameras = facts.declared.cameras
        statistics = [m for name, camera in cameras.items() for m in _of_camera(name, camera, facts)]
        outside_px = {name: _outside_px(camera) for name, camera in cameras.items()}
        for name, camera in cameras.items():
            # Cameras with the same axes, by which a principal point outside of its image can be judged.
            R = camera.T_body_camera[:3, :3]
            others = [
                other
                for other_name, other in cameras.items()
                if other_name != name and np.allclose(R, other.T_body_camera[:3, :3], rtol=0.0, atol=_ROUNDING)
            ]
            (cx, width), (cy, height) = _centre_and_size(camera)
            from_centre_px = float(np.hypot(cx - (width - 1) / 2, cy - (height - 1) / 2))
            is_crop = not others or any(_share_directions(camera, other) for other in others)
            statistics.append(
                _statistic(f"{name}.principal_point_outside", 0.0 if is_crop else outside_px[name], "px",
                           features=(PrincipalPoint(from_centre_px),),
                           text=f"the principal point of the {name} camera ({cx:.6g}, {cy:.6g}) is so far outside of "
                           f"its {width} x {height} image that no other camera with these axes shares its view")
            )  # fmt: skip
        if "depth" in cameras and "events" in cameras:
            depth, events = cameras["depth"].T_body_camera, cameras["events"].T_body_camera
            apart_m = float(np.linalg.norm(depth[:3, 3] - events[:3, 3]))
            statistics.append(
                _statistic("depth_to_events_centre", apart_m, "m", model_error_bound=_ROUNDING,
                           text=f"the centres of the depth and event cameras are {apart_m:.6g} m apart; they must be "
                           "one point, or depth cannot be assigned to events")
            )  # fmt: skip

        if facts.declared.rectify_map_px is not None and {"depth", "events"} <= cameras.keys():
            three = cameras["events"], cameras["depth"], cameras.get("rgb")
            statistics += _of_rectify_map(facts.declared.rectify_map_px, *three)

        if facts.declared.stereo is not None and "depth" in cameras and cameras["depth"].lens is None:
            statistics += _of_stereo(facts.declared.stereo, cameras["depth"])

        # What is legal but unusual.
        notices: list[Notice] = []
        for name, camera in cameras.items():
            where = Where(stream=name)
            if outside_px[name] > 0:
                message = (
                    f"the principal point of the {name} camera ({camera.K[0, 2]:.6g}, {camera.K[1, 2]:.6g}) is outside "
                    f"of its {camera.width} x {camera.height} image, as in a crop of a larger one"
                )
                notices.append(Notice("metadata.cameras.crop", message, where))
            if offset_px := convention_offset_px(camera):
                convention = _PRINCIPAL_POINTS[offset_px]
                message = f"the principal point of the {name} camera is {convention}: another convention than (W-1)/2"
                notices.append(Notice("metadata.cameras.principal_point", message, where))
            fx, fy = camera.K[0, 0], camera.K[1, 1]
            if fx > 0 and not np.isclose(fx, fy, rtol=1e-3):
                message = f"pixels of the {name} camera are not square: {fx:.6g}, {fy:.6g}"
                notices.append(Notice("metadata.cameras.aspect", message, where))
            # The optical axis is Z; unrotated it is the body's Z, which points up where that of the world does.
            if facts.declared.has_vertical and np.array_equal(camera.T_body_camera[:3, :3], np.eye(3)):
                message = (
                    f"the {name} camera is not rotated: it points upwards, unless optical axes were taken for those of "
                    "the body"
                )
                notices.append(Notice("metadata.cameras.unrotated", message, where))
            distance_m = float(np.linalg.norm(camera.T_body_camera[:3, 3]))
            if distance_m > _FARTHEST_MOUNT_M:
                message = f"the {name} camera lies {distance_m:.4g} m from the body; is T_body_camera in millimetres?"
                notices.append(Notice("metadata.cameras.far", message, where))
        return Observation(Coverage(len(cameras), len(cameras), "cameras"), tuple(statistics), tuple(notices))


def _of_camera(name: str, camera: Camera, facts: Facts) -> Iterator[Statistic]:
    """Yield the deviations of a camera's matrices from their forms, and of its size from that of the images."""
    K = camera.K
    # Skew is relative to the focal length, the last row absolute.
    scale = max(float(np.max(np.abs(K[:2, :2]))), 1.0)
    form = float(np.max(np.abs([K[0, 1] / scale, K[1, 0] / scale, K[2, 0], K[2, 1], K[2, 2] - 1.0])))
    yield _statistic(f"{name}.K_form", form, "1", model_error_bound=_ROUNDING,
                     text=f"K of the {name} camera is not [fx 0 cx; 0 fy cy; 0 0 1], by {form:.3g} of the focal "
                     "length or of 1; is it transposed, or has it skew?")  # fmt: skip
    fx, fy = float(K[0, 0]), float(K[1, 1])
    not_positive = float(sum(focal <= 0 for focal in (fx, fy)))
    width, height = camera.width, camera.height
    yield _statistic(f"{name}.focal_lengths_not_positive", not_positive, "focal lengths", resolution=1.0,
                     features=(FocalLengths(name, fx, fy),),
                     text=f"the focal lengths of the {name} camera are {fx:.6g} and {fy:.6g} px; a focal length is "
                     "positive")  # fmt: skip
    if camera.lens is not None:
        # A lens images rays up to its largest radius, so that pixels without a ray begin at the border.
        columns, rows = border_pixels(width, height)
        blind = int(np.count_nonzero(np.isnan(rays_of_pixels(K, camera.lens, columns, rows)[0])))
        yield _statistic(f"{name}.lens_blind", float(blind), "px", resolution=1.0,
                         text=f"{blind} of the {len(columns)} pixels on the border of the {name} camera have no "
                         f"ray, because the {camera.lens.model} distortion is not one-to-one; are the coefficients "
                         "in OpenCV's order, and of this K?")  # fmt: skip
    binding = facts.layout.bindings.get(_IMAGES_OF.get(name, ""))
    if binding is not None:
        stored_height, stored_width = binding.shape[1:3]
        off = abs(width - stored_width) + abs(height - stored_height)
        yield _statistic(f"{name}.size", float(off), "px", resolution=1.0,
                         text=f"the {name} camera is declared {width} x {height} px, its images are "
                         f"{stored_width} x {stored_height}")  # fmt: skip
    R, last_row = camera.T_body_camera[:3, :3], camera.T_body_camera[3]
    # Malformed matrices may overflow or hold NaN; the comparison fails them without a warning.
    with np.errstate(over="ignore", invalid="ignore"):
        handedness = float(np.sign(np.linalg.det(R)))
        gram = R.T @ R
    excess = max(float(np.max(np.abs(gram - np.eye(3)))), float(np.max(np.abs(last_row - [0, 0, 0, 1]))))
    yield _statistic(f"{name}.T_body_camera_rigid", excess, "1", model_error_bound=_ROUNDING,
                     text=f"T_body_camera of the {name} camera is not a rigid motion: R^T R or the last row is off by "
                     f"{excess:.3g}; is it transposed, or given in other units?")  # fmt: skip
    # A determinant's sign changes by 2.
    yield _statistic(f"{name}.T_body_camera_handedness", handedness, "1", expected=1.0, resolution=2.0,
                     text=f"T_body_camera of the {name} camera mirrors: its determinant is not +1")  # fmt: skip


def _of_rectify_map(
    map_px: NDArray[np.float32], events: Camera, view: Camera, other_view: Camera | None
) -> Iterator[Statistic]:
    """Yield the difference of a map of the event camera's pixels from the positions that follow from both cameras."""
    if events.model != "pinhole" or view.model != "pinhole":
        return
    error = _rectification_error(map_px, events, view, other_view)
    features = () if error.rule is None else (error.rule,)
    yield _statistic("events.rectify_map_defined", float(error.undefined), "px", resolution=1.0, features=features,
                     text=f"rectify_map and the declared cameras disagree for {error.undefined} of "
                     f"{error.distance_px.size} pixels of the event camera about whether they have a position in the "
                     "view of depth")  # fmt: skip
    row, column = (int(index) for index in np.unravel_index(np.argmax(error.distance_px), error.distance_px.shape))
    worst_px = float(error.distance_px[row, column])
    yield _statistic("events.rectify_map", worst_px, "px", model_error_bound=error.rounding_px, features=features,
                     text=f"rectify_map differs from the declared cameras by up to {worst_px:.4g} px, at column "
                     f"{column} and row {row}, and by {np.median(error.distance_px):.4g} px at half of the pixels: "
                     f"{error.text}")  # fmt: skip


def _of_stereo(stereo: StereoPair, view: Camera) -> Iterator[Statistic]:
    """Yield the differences of the matrix of disparity from the view that it is of, and from the second camera."""
    focal_px = float(view.K[0, 0])
    off_px = stereo.focal_px - focal_px
    yield _statistic("depth.disparity_focal", off_px, "px",
                     model_error_bound=stereo.focal_rounding_px + rounding_of(view.K, focal_px),
                     features=(StereoFocalLength(100 * (focal_px / stereo.focal_px - 1)),),
                     text=f"disparity is read as depth by a focal length of {stereo.focal_px:.7g} px, and the depth "
                     f"camera, in whose view it is, has {focal_px:.7g} px; they must be one")  # fmt: skip
    declared_m = stereo.declared_baseline_m
    if declared_m is not None:
        yield _statistic("depth.disparity_baseline", stereo.baseline_m - declared_m, "m",
                         model_error_bound=stereo.baseline_rounding_m + stereo.declared_rounding_m,
                         text=f"disparity is read as depth by a baseline of {stereo.baseline_m:.7g} m, the cameras of "
                         f"the pair are mounted {declared_m:.7g} m apart")  # fmt: skip


def convention_offset_px(camera: Camera) -> float:
    """Return how far right and down of (W-1)/2 a principal point lies by another convention, px; 0 if by none."""
    offsets_px = [c - (size - 1) / 2 for c, size in _centre_and_size(camera)]
    alike = (offset for offset in _PRINCIPAL_POINTS if np.allclose(offsets_px, offset, rtol=0.0, atol=1e-3))
    return next(alike, 0.0)


def _centre_and_size(camera: Camera) -> tuple[tuple[float, int], tuple[float, int]]:
    return (float(camera.K[0, 2]), camera.width), (float(camera.K[1, 2]), camera.height)


def _outside_px(camera: Camera) -> float:
    """Return how far the principal point lies outside of the image, px; its edges are at -1/2 and W - 1/2."""
    return max(max(-0.5 - c, c - (size - 0.5), 0.0) for c, size in _centre_and_size(camera))


def _share_directions(camera: Camera, other: Camera) -> bool:
    """Return whether two cameras with the same axes see directions in common, far away from both."""
    # The image covers the tangents (-1/2 - c) / f to (W - 1/2 - c) / f along each axis.
    edges = [
        [
            sorted(((-0.5 - c) / f, (size - 0.5 - c) / f))
            for (c, size), f in zip(_centre_and_size(a), focal_px, strict=True)
        ]
        for a, focal_px in ((camera, np.diag(camera.K)[:2]), (other, np.diag(other.K)[:2]))
    ]
    return all(max(mine[0], theirs[0]) < min(mine[1], theirs[1]) for mine, theirs in zip(*edges, strict=True))


def _statistic(
    name: str,
    value: float,
    unit: str,
    *,
    text: str,
    features: tuple[Feature, ...] = (),
    expected: float = 0.0,
    model_error_bound: float = 0.0,
    resolution: float = 0.0,
) -> Statistic:
    return Statistic(
        name=name,
        value=value,
        unit=unit,
        standard_error=0.0,
        statement=text,
        code=f"metadata.cameras.{name.rsplit('.', 1)[-1]}",
        where=Where(stream="metadata"),
        expected=expected,
        model_error_bound=model_error_bound,
        resolution=resolution,
        features=features,
    )


@dataclass(frozen=True, slots=True)
class _RectificationError:
    """The difference of a map from the positions that follow from the cameras.

    Attributes
    ----------
    undefined
        Pixels that have a position in one of both only.
    distance_px
        (H, W) distances; 0 where either has no position.
    rule, text
        The rule that gives the entries, and the same in words; None and empty where they are right to their rounding.
    rounding_px
        Of an entry, which is stored in float32.
    """

    undefined: int
    distance_px: Float64
    rounding_px: float
    rule: RectificationRule | None
    text: str


def _rectification_error(
    map_px: NDArray[np.float32], events: Camera, view: Camera, other_view: Camera | None
) -> _RectificationError:
    """Compare a map (H, W, 2), px, from pixels of the event camera to a view, with the declared cameras."""
    height, width = map_px.shape[:2]
    columns, rows = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    expected_px = _positions_px(events, events.lens, view, columns, rows)
    defined, expected = np.isfinite(map_px).all(axis=-1), np.isfinite(expected_px).all(axis=-1)
    both = defined & expected
    distance_px = np.where(both, _distance_px(map_px, expected_px), 0.0)
    # Both coordinates are rounded to float32, by half a unit in the last place each.
    rounding_px = float(np.spacing(np.abs(map_px[both]).max())) if np.any(both) else 0.0
    rule, text = None, ""
    if distance_px.max(initial=0.0) > rounding_px:
        rule, text = RectificationRule("none"), "no common rule gives these entries"
        most_px = _RULE_RATIO * float(np.quantile(distance_px[both], _RULE_QUANTILE))
        for name, words, positions_px in _wrong_maps(map_px, expected_px, events, view, other_view):
            compared = defined & np.isfinite(positions_px).all(axis=-1)
            # A rule that is defined for few pixels says nothing about the others.
            if np.count_nonzero(compared) < _RULE_QUANTILE * np.count_nonzero(defined):
                continue
            if np.quantile(_distance_px(map_px, positions_px)[compared], _RULE_QUANTILE) <= most_px:
                rule, text = RectificationRule(name), words
                break
    return _RectificationError(int(np.count_nonzero(defined != expected)), distance_px, rounding_px, rule, text)


def _wrong_maps(
    map_px: NDArray[np.float32], expected_px: Float64, events: Camera, view: Camera, other_view: Camera | None
) -> Iterator[tuple[Rule, str, Float64]]:
    """Yield rules, in words and as the entries (H, W, 2), px, that they give; those without a fit come first."""
    height, width = expected_px.shape[:2]
    columns, rows = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
    yield "exchanged_coordinates", "its entries are y before x", expected_px[..., ::-1]
    if height == width:
        yield "exchanged_pixels", "it is stored by x before y", expected_px.swapaxes(0, 1)
    yield "pixels_themselves", "its entries are the pixels themselves, not rectified", np.dstack((columns, rows))
    if events.lens is not None:
        without = _positions_px(events, None, view, columns, rows)
        yield "without_lens", "it leaves the distortion of the event camera out", without
    if other_view is not None:
        yield "other_view", "it leads to the view of rgb", _positions_px(events, events.lens, other_view, columns, rows)
    twice = _positions_px(events, events.lens, view, expected_px[..., 0], expected_px[..., 1])
    yield "twice", "the rectification is applied twice", twice
    inverse = _positions_px(view, view.lens, events, columns, rows)
    yield "inverse", "it leads from the view to the event camera", inverse
    x, y = rays_of_pixels(events.K, events.lens, columns, rows)
    fit = fit_pinhole(x, y, map_px.astype(np.float64), view.K)
    if fit is not None:
        R_view_events = view.T_body_camera[:3, :3].T @ events.T_body_camera[:3, :3]
        angle_deg = np.degrees(np.linalg.norm(log(fit.R @ R_view_events.T)))
        longer = 100 * (fit.K[0, 0] / view.K[0, 0] - 1)
        right_px, down_px = fit.K[:2, 2] - view.K[:2, 2]
        yield (
            "other_pinhole",
            f"it fits a view with {longer:+.3g}% of focal length, a principal point {right_px:+.3g}, {down_px:+.3g} px "
            f"away, turned by {angle_deg:.3g} degrees",
            fit.positions_px(x, y),
        )


def _positions_px(
    camera: Camera, lens: Lens | None, view: Camera, columns: NDArray[Any], rows: NDArray[Any]
) -> Float64:
    """Return where a view with the same centre images the rays of a camera's pixels, (..., 2) px; NaN where nowhere."""
    x, y = rays_of_pixels(camera.K, lens, columns, rows)
    # A direction of the camera in the axes of the view: R_view_camera = R_body_view^T R_body_camera.
    R_view_camera = view.T_body_camera[:3, :3].T @ camera.T_body_camera[:3, :3]
    ahead_x, ahead_y, ahead = R_view_camera @ np.stack([x, y, np.ones_like(x)]).reshape(3, -1)
    ahead[~(ahead > 0)] = np.nan
    positions_px = np.stack(pixels_of_rays(view.K, view.lens, ahead_x / ahead, ahead_y / ahead), axis=-1)
    return positions_px.reshape(*x.shape, 2)


def _distance_px(one_px: NDArray[Any], other_px: NDArray[Any]) -> Float64:
    return np.asarray(np.linalg.norm(one_px - other_px, axis=-1), dtype=np.float64)
