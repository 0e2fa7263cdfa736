"""Errors of flow, depth and trajectories, and their sums, which depend on no order.

Sums are stated apart for near and far pixels, beside edges of depth, and on moving objects. A stereo pair of baseline B
sees the disparity f B / Z in px. So the normalised error of 1 / Z is that of a disparity in px as well. The definition
of NAE leaves open by which numbers a pose is represented; here they are positions in the world, and rotation vectors
from its axes.

Sources
-------
Endpoint error and average (AEE): M. Otte, H.-H. Nagel, Optical flow estimation: advances and comparisons (ECCV 1994);
    S. Baker et al., A database and evaluation methodology for optical flow (IJCV 92, 2011).
Normalised errors (NAEE of flow, NADE of disparity, NAE = average pose error / mean ground-truth pose): A. Joshi et al.,
    FEDORA: A Flying Event Dataset fOr Reactive behAvior.
Share above N px: M. Gehrig et al., E-RAFT: Dense optical flow from event cameras (3DV 2021), as the DSEC benchmark.
Share above 3 px and 5%: M. Menze, A. Geiger, Object scene flow for autonomous vehicles (CVPR 2015), KITTI's ``Fl``.
Angular error: J. L. Barron, D. J. Fleet, S. S. Beauchemin, Performance of optical flow techniques (IJCV 12, 1994).
AbsRel, RMSE, log RMSE and the share within a factor of 1.25: D. Eigen, C. Puhrsch, R. Fergus, Depth map prediction from
    a single image using a multi-scale deep network (NeurIPS 2014).
ATE, RPE: those of evo 1.38 (``evo_ape``, ``evo_rpe``; M. Grupp, evo: Python package for the evaluation of odometry and
    SLAM), which follow J. Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems (IROS 2012).
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import prod
from typing import Any, Final, get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.depth.inverse_depth import depth_steps
from fedora_qa.geometry import so3
from fedora_qa.scoring.types import (
    Alignment,
    DepthAccuracy,
    FlowAccuracy,
    Metric,
    NormalisedPoseError,
    Relation,
    Split,
    TrajectoryError,
)

Float64 = NDArray[np.float64]

PartKey = tuple[Split, str]

Poses = tuple[Float64, Float64]
"""Positions (n, 3), m in the world, and orientations (n, 4), unit quaternions x, y, z, w, body to world."""

_SPLITS: Final = get_args(Split)

DEPTH_EDGES_M: Final = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""Depths that divide near from far, m: octaves, as flow and disparity are proportional to 1 / Z."""

_DEPTH_PARTS: Final = (
    "below 1 m",
    *(f"{near:g} to {far:g} m" for near, far in pairwise(DEPTH_EDGES_M)),
    "32 m and beyond",
)

NEAR_EDGE_PX: Final = 10.0
"""A pixel closer than this to a step of depth is near an edge: the distance that MPI-Sintel has for boundaries of
occlusion (D. Butler et al., A naturalistic open source movie for optical flow evaluation, ECCV 2012)."""

OUTLIER_PX: Final = 3.0
OUTLIER_SHARE: Final = 0.05
"""KITTI's outlier errs by more than 3 px and by more than 5% of the true flow."""

WITHIN_FACTOR: Final = 1.25

_FLAT: Final = 1e-12
"""Variance across a line, relative to that along it, below which positions lie on the line, and no rotation about it
follows from them."""


@dataclass(frozen=True, slots=True)
class Partition:
    """Pixels divided into parts.

    Attributes
    ----------
    split
        By what.
    parts
        Names of the parts.
    labels
        (H, W) index of the part of each pixel; negative: of none.
    """

    split: Split
    parts: tuple[str, ...]
    labels: NDArray[np.int8]


def whole_image(height: int, width: int) -> Partition:
    """Return all pixels as one part."""
    return Partition("all", ("all",), np.zeros((height, width), np.int8))


def by_depth(depth_m: NDArray[Any]) -> Partition:
    """Divide pixels by z-depth (H, W), m; those without a depth are of no part."""
    labels = np.digitize(depth_m, DEPTH_EDGES_M)
    return Partition("depth", _DEPTH_PARTS, np.where(depth_m > 0, labels, -1).astype(np.int8))


def near_edges(depth_m: NDArray[np.float32], farthest_m: float) -> Partition:
    """Divide pixels into those near an edge of depth, and the others.

    Parameters
    ----------
    depth_m
        (H, W) z-depth, m; NaN where it is farther than ``farthest_m``.
    farthest_m
        End of the range of depth, m.
    """
    apart = np.ones(depth_m.shape, np.uint8)
    for axis in (0, 1):
        steps = depth_steps(depth_m, axis, farthest_m=farthest_m)
        # A step lies between two pixels: both are at the edge.
        for side in (np.floor, np.ceil):
            apart[side(steps.rows).astype(int), side(steps.columns).astype(int)] = 0
    if apart.all():
        distances_px = np.full(depth_m.shape, np.inf)
    else:
        distances_px = cv2.distanceTransform(apart, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    labels = np.where(distances_px < NEAR_EDGE_PX, 0, 1).astype(np.int8)
    return Partition("edges", ("near an edge of depth", "away from edges"), labels)


def by_motion(moving: NDArray[Any]) -> Partition:
    """Divide pixels by a mask (H, W) that is not 0 on objects that move by themselves."""
    labels = np.where(moving != 0, 0, 1).astype(np.int8)
    return Partition("motion", ("moving objects", "static world"), labels)


class ErrorSums:
    """Sums of several quantities over the pixels of each part, of every field apart.

    Totals add the sums of all fields with one rounding (``math.fsum``). So they do not depend on the order of the
    fields.
    """

    def __init__(self) -> None:
        self._fields: dict[PartKey, list[tuple[float, ...]]] = {}
        self._quantities: tuple[str, ...] = ()

    def add(self, values: Mapping[str, Float64], valid: NDArray[np.bool_], partitions: Sequence[Partition]) -> None:
        """Add a field.

        Parameters
        ----------
        values
            Of each quantity (n,), of the valid pixels in their order; the same quantities in every call.
        valid
            (H, W) which pixels these are.
        partitions
            Ways to divide the pixels, each by another split.
        """
        self._quantities = tuple(values)
        # One cell for each combination of parts; along each axis the first cells are of what is of no part. Every
        # quantity is summed once over the cells, and the cells then along each axis.
        cells = tuple(len(partition.parts) + 1 for partition in partitions)
        places = np.ravel_multi_index([partition.labels[valid].clip(-1) + 1 for partition in partitions], cells)
        counts = np.bincount(places, minlength=prod(cells)).reshape(cells)
        sums = np.stack([np.bincount(places, value, prod(cells)).reshape(cells) for value in values.values()], axis=-1)
        for axis, partition in enumerate(partitions):
            others = tuple(other for other in range(len(cells)) if other != axis)
            part_counts, part_sums = counts.sum(axis=others)[1:], sums.sum(axis=others)[1:]
            for part, count, totals in zip(partition.parts, part_counts, part_sums, strict=True):
                # Also of a part without pixels, so that parts keep their order.
                fields = self._fields.setdefault((partition.split, part), [])
                if count:
                    fields.append(tuple(totals.tolist()))

    def totals(self) -> dict[PartKey, dict[str, float]]:
        """Return the total of each quantity by part, ``all`` first; a part without a valid pixel has none."""
        return {
            key: dict(zip(self._quantities, map(math.fsum, zip(*fields, strict=True)), strict=True))
            for key, fields in sorted(self._fields.items(), key=lambda entry: _SPLITS.index(entry[0][0]))
            if fields
        }


def share(part: float, whole: float) -> float | None:
    """Return a part of a whole; None where the whole is 0."""
    return part / whole if whole else None


def flow_errors(truth_px: NDArray[Any], predicted_px: NDArray[Any]) -> tuple[dict[str, Float64], NDArray[np.bool_]]:
    """Return the errors of a flow field, to be summed.

    Parameters
    ----------
    truth_px, predicted_px
        (H, W, 2) displacement, px, (u right, v down). A pixel is valid where the truth is finite, and scored where the
        prediction is as well.

    Returns
    -------
    values
        (n,) by quantity, of the valid pixels; 0 where there is no prediction, but for ``valid``.
    valid
        (H, W) the valid pixels.
    """
    valid = np.isfinite(truth_px).all(axis=-1)
    u, v = np.moveaxis(truth_px[valid].astype(np.float64), -1, 0)
    u_predicted, v_predicted = np.moveaxis(predicted_px[valid].astype(np.float64), -1, 0)
    scored = np.isfinite(u_predicted) & np.isfinite(v_predicted)
    # What is not scored counts nowhere: truth and prediction are 0 there.
    u, v, u_predicted, v_predicted = (np.where(scored, part, 0.0) for part in (u, v, u_predicted, v_predicted))
    length_px = np.sqrt(u**2 + v**2)
    # EE = |f_predicted - f|
    error_px = np.sqrt((u_predicted - u) ** 2 + (v_predicted - v) ** 2)
    # AE is the angle between (u, v, 1) and (u_predicted, v_predicted, 1). Its arctangent keeps small angles exact,
    # which the usual arccosine of the normalised product loses.
    cross = np.sqrt(error_px**2 + (u * v_predicted - v * u_predicted) ** 2)
    angle_deg = np.degrees(np.arctan2(cross, u * u_predicted + v * v_predicted + 1.0))
    values = {
        "valid": np.ones(len(u)),
        "scored": scored.astype(np.float64),
        "error_px": error_px,
        "length_px": length_px,
        "predicted_length_px": np.sqrt(u_predicted**2 + v_predicted**2),
        "above_1px": (error_px > 1).astype(np.float64),
        "above_2px": (error_px > 2).astype(np.float64),
        "above_3px": (error_px > 3).astype(np.float64),
        "outliers": ((error_px > OUTLIER_PX) & (error_px > OUTLIER_SHARE * length_px)).astype(np.float64),
        "angle_deg": angle_deg,
    }
    return values, valid


def flow_accuracy(key: PartKey, totals: Mapping[str, float]) -> FlowAccuracy:
    """Return the accuracy over a part of the pixels from the totals of ``flow_errors``."""
    scored = totals["scored"]
    return FlowAccuracy(
        split=key[0],
        part=key[1],
        valid_pixels=round(totals["valid"]),
        scored_pixels=round(scored),
        coverage=share(scored, totals["valid"]),
        aee_px=share(totals["error_px"], scored),
        mean_flow_px=share(totals["length_px"], scored),
        mean_predicted_flow_px=share(totals["predicted_length_px"], scored),
        # NAEE = AEE / mean |f|, both over the scored pixels
        naee=share(totals["error_px"], totals["length_px"]),
        above_1px=share(totals["above_1px"], scored),
        above_2px=share(totals["above_2px"], scored),
        above_3px=share(totals["above_3px"], scored),
        outliers=share(totals["outliers"], scored),
        angular_error_deg=share(totals["angle_deg"], scored),
    )


def depth_errors(truth_m: NDArray[Any], predicted_m: NDArray[Any]) -> tuple[dict[str, Float64], NDArray[np.bool_]]:
    """Return the errors of a depth frame, to be summed.

    Parameters
    ----------
    truth_m, predicted_m
        (H, W) z-depth, m. A pixel is valid where the truth is finite and above 0, and scored where the prediction is as
        well.

    Returns
    -------
    values
        (n,) by quantity, of the valid pixels; 0 where there is no prediction, but for ``valid``.
    valid
        (H, W) the valid pixels.
    """
    valid = _is_depth(truth_m)
    truth, predicted = truth_m[valid].astype(np.float64), predicted_m[valid].astype(np.float64)
    scored = _is_depth(predicted)
    # What is not scored counts nowhere: the prediction is the truth there, and the truth's own sum leaves it out.
    predicted = np.where(scored, predicted, truth)
    log_error = np.log(predicted / truth)
    values = {
        "valid": np.ones(len(truth)),
        "scored": scored.astype(np.float64),
        "disparity_error_per_m": np.abs(1.0 / predicted - 1.0 / truth),
        "disparity_per_m": np.where(scored, 1.0 / truth, 0.0),
        "relative_error": np.abs(predicted - truth) / truth,
        "squared_error_m2": (predicted - truth) ** 2,
        "log_error": log_error,
        "squared_log_error": log_error**2,
        # The ratio is max(Z_predicted / Z, Z / Z_predicted).
        "within_factor": (scored & (np.maximum(predicted / truth, truth / predicted) < WITHIN_FACTOR)).astype(
            np.float64
        ),
    }
    return values, valid


def depth_accuracy(key: PartKey, totals: Mapping[str, float]) -> DepthAccuracy:
    """Return the accuracy over a part of the pixels from the totals of ``depth_errors``."""
    scored = totals["scored"]
    return DepthAccuracy(
        split=key[0],
        part=key[1],
        valid_pixels=round(totals["valid"]),
        scored_pixels=round(scored),
        coverage=share(scored, totals["valid"]),
        ade_per_m=share(totals["disparity_error_per_m"], scored),
        mean_disparity_per_m=share(totals["disparity_per_m"], scored),
        # NADE = ADE / mean (1 / Z), both over the scored pixels
        nade=share(totals["disparity_error_per_m"], totals["disparity_per_m"]),
        abs_rel=share(totals["relative_error"], scored),
        rmse_m=_root(share(totals["squared_error_m2"], scored)),
        log_rmse=_root(share(totals["squared_log_error"], scored)),
        mean_log_error=share(totals["log_error"], scored),
        within_1_25=share(totals["within_factor"], scored),
    )


def _is_depth(depth: NDArray[Any]) -> NDArray[np.bool_]:
    """Return where depth is finite and above 0."""
    return np.asarray(np.isfinite(depth) & (depth > 0))


def _root(mean_square: float | None) -> float | None:
    return None if mean_square is None else math.sqrt(mean_square)


def aligned(truth: Poses, predicted: Poses, *, with_scale: bool) -> Poses | None:
    """Move predicted poses onto the true ones as a whole, so that the squared distances of positions are least.

    Returns
    -------
    Poses or None
        None where the positions do not determine a rotation: fewer than three, or all on a line.

    Notes
    -----
    S. Umeyama, Least-squares estimation of transformation parameters between two point patterns (PAMI 13, 1991).
    """
    positions, true_positions = predicted[0], truth[0]
    centre, true_centre = positions.mean(axis=0), true_positions.mean(axis=0)
    offsets = positions - centre
    # eq. 38: covariance of both patterns
    U, D, Vt = np.linalg.svd((true_positions - true_centre).T @ offsets / len(offsets))
    if not D[1] > _FLAT * D[0]:
        return None
    # eq. 43: a reflection is no rotation
    S = np.array([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])
    # eq. 40 and 42
    R = (U * S) @ Vt
    scale = float((D * S).sum() / np.mean(np.sum(offsets**2, axis=1))) if with_scale else 1.0
    rotation_xyzw = so3.quaternions_from_matrices(R)
    return scale * offsets @ R.T + true_centre, so3.compose(rotation_xyzw, predicted[1])


def absolute_errors(truth: Poses, predicted: Poses, alignment: Alignment) -> Iterator[TrajectoryError]:
    """Yield the absolute errors of position and rotation of n poses; nothing where the alignment is not determined."""
    placed: Poses | None = predicted
    if alignment != "none":
        placed = aligned(truth, predicted, with_scale=alignment == "similarity")
    if placed is not None:
        distances_m = np.linalg.norm(placed[0] - truth[0], axis=1)
        yield _statistics("ATE", "translation", alignment, None, distances_m)
        yield _statistics("ATE", "rotation", alignment, None, _angles_deg(truth[1], placed[1]))


def relative_errors(truth: Poses, predicted: Poses, delta: int) -> Iterator[TrajectoryError]:
    """Yield the errors of the motion from each pose to the one ``delta`` poses later; nothing for fewer poses."""
    if len(truth[0]) <= delta:
        return
    true_steps, predicted_steps = (_motions(poses, delta) for poses in (truth, predicted))
    # E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j): the length of its translation is that of the difference of both translations.
    distances_m = np.linalg.norm(predicted_steps[0] - true_steps[0], axis=1)
    yield _statistics("RPE", "translation", "none", delta, distances_m)
    yield _statistics("RPE", "rotation", "none", delta, _angles_deg(true_steps[1], predicted_steps[1]))


def normalised_errors(truth: Poses, predicted: Poses) -> Iterator[NormalisedPoseError]:
    """Yield NAE = average error / mean truth: of poses, and of the motion from each pose to the next.

    That of poses depends on where the world has its origin and axes. That of motions does not.
    """
    pairs = [("pose", truth, predicted)]
    if len(truth[0]) > 1:
        pairs.append(("motion", _motions(truth, 1), _motions(predicted, 1)))
    for of, (true_positions, true_xyzw), (positions, xyzw) in pairs:
        errors_m, lengths_m = (np.linalg.norm(v, axis=1) for v in (positions - true_positions, true_positions))
        errors_rad = np.radians(_angles_deg(true_xyzw, xyzw))
        # The geodesic length |Log(R^T R_predicted)| against |Log(R)|.
        angles_rad = np.linalg.norm(so3.log_quaternion(true_xyzw), axis=1)
        for quantity, unit, errors, sizes in (
            ("position", "m", errors_m, lengths_m),
            ("orientation", "rad", errors_rad, angles_rad),
        ):
            error, size = float(errors.mean()), float(sizes.mean())
            yield NormalisedPoseError(f"{of} {quantity}", unit, error, size, share(error, size))


def _motions(poses: Poses, delta: int) -> Poses:
    """Return T_i^-1 T_j of all poses i with j = i + delta, as translations and rotations."""
    positions, xyzw = poses
    backwards = so3.inverse(xyzw[:-delta])
    steps_world_m = positions[delta:] - positions[:-delta]
    steps_body_m = np.einsum("nij,nj->ni", so3.matrices_from_quaternions(backwards), steps_world_m)
    return steps_body_m, so3.compose(backwards, xyzw[delta:])


def _angles_deg(truth_xyzw: Float64, predicted_xyzw: Float64) -> Float64:
    vectors_rad = so3.log_quaternion(so3.compose(so3.inverse(truth_xyzw), predicted_xyzw))
    return np.asarray(np.degrees(np.linalg.norm(vectors_rad, axis=1)))


def _statistics(
    metric: Metric, relation: Relation, alignment: Alignment, delta: int | None, errors: Float64
) -> TrajectoryError:
    return TrajectoryError(
        metric=metric,
        relation=relation,
        unit="m" if relation == "translation" else "deg",
        alignment=alignment,
        delta_poses=delta,
        count=len(errors),
        rmse=float(np.sqrt(np.mean(errors**2))),
        mean=float(errors.mean()),
        median=float(np.median(errors)),
        std=float(errors.std()),
        min=float(errors.min()),
        max=float(errors.max()),
    )
