"""Errors of a trajectory: absolute (ATE), relative (RPE), and the normalised error of the paper (NAE).

ATE and RPE are those of evo 1.38 (``evo_ape``, ``evo_rpe``; M. Grupp, evo: Python package for the evaluation of
odometry and SLAM), which follow J. Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems (IROS 2012). NAE
is that of the paper (A. Joshi et al., FEDORA): average pose error / mean ground-truth pose. The definition leaves open
by which numbers a pose is represented; here they are positions in the world, and rotation vectors from its axes.
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.geometry import so3
from fedora_qa.scoring.error_sums import share
from fedora_qa.scoring.types import Alignment, Metric, NormalisedPoseError, Relation, TrajectoryError

Float64 = NDArray[np.float64]

_FLAT: Final = 1e-12
"""Variance across a line, relative to that along it, below which positions lie on the line, and no rotation about it
follows from them."""

Poses = tuple[Float64, Float64]
"""Positions (n, 3), m in the world, and orientations (n, 4), unit quaternions x, y, z, w, body to world."""


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
