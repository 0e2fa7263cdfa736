"""Fit the camera's motion to a flow field, and fit small changes of parameters to what remains.

The flow comes from the noise-free pose while the file holds a noisy one. So each field may correct the relative pose by
a twist whose covariance follows from the declared noise; what remains must be rounding, and the twist itself must be
as large as the noise.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.rigid_flow import moved_points, rigid_flow, twist_jacobian

Float64 = NDArray[np.float64]

_ITERATIONS: Final = 6
_CONCENTRATIONS: Final = 10
_CONVERGED_PX: Final = 1e-6
"""A step that moves all pixels together by less than this is the last: quadratic convergence leaves nothing."""

_LARGEST_TURN_RAD: Final = 0.3
"""Beyond it the linearisation does not hold: such a field is not off by an error of the motion."""


@dataclass(frozen=True, slots=True)
class FlowSample:
    """Pixels of one field: columns, rows, z-depth in metres at the interval's start, flow in px, each finite.

    Shapes (n,), (n,), (n,), (n, 2); ``sigma_px`` is the rounding level by which residuals are weighted.
    """

    columns: Float64
    rows: Float64
    depths_m: Float64
    flow_px: Float64
    sigma_px: float

    def chosen(self, pixels: NDArray[np.intp]) -> "FlowSample":
        """Return some of the pixels, by index."""
        return replace(
            self,
            columns=self.columns[pixels],
            rows=self.rows[pixels],
            depths_m=self.depths_m[pixels],
            flow_px=self.flow_px[pixels],
        )


@dataclass(frozen=True, slots=True)
class MotionFit:
    """The relative pose that fits a field best.

    Attributes
    ----------
    motion
        The corrected motion.
    twist
        (6,) correction of the given motion, rad and metres.
    information
        (6, 6) of the twist, from the flow alone.
    residual_px
        (n, 2) stored minus recomputed flow after the correction; NaN where the point falls behind the camera.
    """

    motion: RigidMotion
    twist: Float64
    information: Float64
    residual_px: Float64


def fit_motion(K: Float64, motion: RigidMotion, sample: FlowSample) -> MotionFit | None:
    """Correct the motion by Gauss-Newton until the flow fits best.

    Directions that the sample does not determine (far or few points) are left as they are.

    Parameters
    ----------
    K
        (3, 3) camera matrix.
    motion
        Of points in the camera's frame, from the start of the interval to its end, to start from.

    Returns
    -------
    None where the steps do not stay within the linearisation, or where most points end behind the camera.
    """
    fitted = motion
    for _ in range(_ITERATIONS):
        residual, jacobian = _linearised(K, fitted, sample)
        # Gauss-Newton: (J^T J) step = J^T r, with J the derivative of the flow by the twist.
        information = np.einsum("nki,nkj->ij", jacobian, jacobian)
        scale = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
        gradient = np.einsum("nki,nk->i", jacobian, residual)
        # Columns are scaled to unit norm before the solution: radians and metres are then conditioned alike.
        step: Float64 = np.linalg.lstsq(information / np.outer(scale, scale), gradient / scale, rcond=1e-12)[0] / scale
        if not np.all(np.isfinite(step)) or np.linalg.norm(step[:3]) > _LARGEST_TURN_RAD:
            return None
        fitted = fitted.corrected(step)
        if float(np.abs(step) @ scale) < _CONVERGED_PX:
            break
    twist = fitted.twist_from(motion)
    if np.linalg.norm(twist[:3]) > _LARGEST_TURN_RAD:
        return None
    residual_px = sample.flow_px - rigid_flow(K, fitted, sample.columns, sample.rows, sample.depths_m)
    if 2 * np.count_nonzero(np.isfinite(residual_px[:, 0])) < len(residual_px):
        return None
    return MotionFit(fitted, twist, information / sample.sigma_px**2, residual_px)


def fit_most(K: Float64, motion: RigidMotion, sample: FlowSample, fit: MotionFit) -> MotionFit:
    """Fit the motion to the half of the sample that it fits best: what a part of the image is off by does not count.

    Concentration steps of least trimmed squares (P. J. Rousseeuw, K. Van Driessen, Data Min. Knowl. Discov. 12 (2006)
    29), none of which makes the half's squares larger, from a fit to the whole sample and from each half of the image:
    a part of a quarter leaves two of these whole.

    Parameters
    ----------
    fit
        Of the whole sample, from ``fit_motion``.

    Returns
    -------
    The best fit, with the residuals of the whole sample.
    """
    starts = [fit]
    for coordinates in (sample.columns, sample.rows):
        middle = float(np.median(coordinates))
        halves = (np.flatnonzero(coordinates <= middle), np.flatnonzero(coordinates > middle))
        starts += [start for half in halves if (start := _fit_part(K, motion, sample, half)) is not None]
    concentrated = []
    for start in starts:
        best = start
        for _ in range(_CONCENTRATIONS):
            half = np.argsort(_squares(best))[: len(sample.columns) // 2]
            better = _fit_part(K, motion, sample, half)
            if better is None or not _trimmed_squares(better) < _trimmed_squares(best):
                break
            best = better
        concentrated.append(best)
    return min(concentrated, key=_trimmed_squares)


def _fit_part(K: Float64, motion: RigidMotion, sample: FlowSample, part: NDArray[np.intp]) -> MotionFit | None:
    fit = fit_motion(K, motion, sample.chosen(part)) if len(part) else None
    if fit is None:
        return None
    residual_px = sample.flow_px - rigid_flow(K, fit.motion, sample.columns, sample.rows, sample.depths_m)
    return replace(fit, residual_px=residual_px)


def _squares(fit: MotionFit) -> Float64:
    squares = np.sum(fit.residual_px**2, axis=1)
    return np.where(np.isfinite(squares), squares, np.inf)


def _trimmed_squares(fit: MotionFit) -> float:
    """Return the sum of the smaller half of the squared residuals, px^2."""
    return float(np.sum(np.sort(_squares(fit))[: len(fit.residual_px) // 2]))


def _linearised(K: Float64, motion: RigidMotion, sample: FlowSample) -> tuple[Float64, Float64]:
    """Return the residual (n, 2) and its Jacobian by twist (n, 2, 6); zero where a point falls behind the camera."""
    points1_m = np.stack(moved_points(K, motion, sample.columns, sample.rows, sample.depths_m), axis=-1)
    residual = sample.flow_px - rigid_flow(K, motion, sample.columns, sample.rows, sample.depths_m)
    in_front = np.logical_and(*np.isfinite(residual).T)
    # Any depth before the camera keeps the Jacobian finite until it is multiplied by 0.
    points1_m[~in_front] = (0.0, 0.0, 1.0)
    jacobian = twist_jacobian(K, points1_m) * in_front[:, None, None]
    residual[~in_front] = 0.0
    return residual, jacobian


@dataclass(frozen=True, slots=True)
class Evidence:
    """Normal equations of templates against the residuals of fields, the pose correction eliminated.

    Additive over fields.

    Attributes
    ----------
    matrix, vector
        (m, m) and (m,), for m templates, weighted.
    total, count
        The weighted squares of the residuals that are to be explained, and how many these are.
    """

    matrix: Float64
    vector: Float64
    total: float
    count: int

    def __add__(self, other: "Evidence") -> "Evidence":
        return Evidence(
            self.matrix + other.matrix, self.vector + other.vector, self.total + other.total, self.count + other.count
        )

    def along(self, direction: Float64) -> "Evidence":
        """Return the evidence for one template that is made of so much (m,) of each."""
        matrix, vector = direction @ self.matrix @ direction, direction @ self.vector
        return Evidence(np.array([[matrix]]), np.array([vector]), self.total, self.count)

    def explained_by(self, columns: slice) -> tuple[Float64, float]:
        """Return the fitted sizes of some templates taken alone, and the share of the squares that they explain."""
        matrix, vector = self.matrix[columns, columns], self.vector[columns]
        sizes: Float64 = np.asarray(np.linalg.lstsq(matrix, vector, rcond=1e-9)[0], dtype=np.float64)
        share = float(vector @ sizes) / self.total if self.total > 0 else 0.0
        return sizes, share

    def fit(self, columns: slice) -> "TemplateFit":
        """Fit some templates alone; their error is larger where much of the residuals remains."""
        sizes, share = self.explained_by(columns)
        remaining = float(np.clip(1.0 - share, 0.0, 1.0))
        information = np.diag(self.matrix[columns, columns])
        by_rounding = float(np.max(1.0 / np.sqrt(np.maximum(information, 1e-300))))
        # Residuals beyond the stated sigma enlarge the error; smaller ones do not reduce it.
        error = by_rounding * max(1.0, float(np.sqrt(remaining * self.total / self.count)))
        # The rms falls with the square root of the share of the squares that remains.
        return TemplateFit(sizes, 1.0 - float(np.sqrt(remaining)), error)


class TemplateFit(NamedTuple):
    """Fitted sizes (m,), the share of the rms residual that they remove, 0 to 1, and the largest standard error."""

    sizes: Float64
    removed_share: float
    standard_error: float


def sum_of(evidences: Sequence[Evidence]) -> Evidence:
    """Return the evidence of all fields together; there is at least one."""
    total = evidences[0]
    for evidence in evidences[1:]:
        total = total + evidence
    return total


def weigh_templates(
    K: Float64,
    motion: RigidMotion,
    sample: FlowSample,
    templates: Float64,
    fit: MotionFit | None,
    twist_covariance: Float64 | None,
) -> Evidence:
    """Set up the normal equations of templates for one field.

    Parameters
    ----------
    templates
        (n, 2, m) px per unit of each; NaN where the point falls behind the camera.
    fit
        Of the same sample, from ``fit_motion``; None where the motion is not corrected.
    twist_covariance
        (6, 6) prior covariance of the motion's twist, rad and metres; None where the motion is exact.

    Notes
    -----
    Without ``twist_covariance`` the pose is exact and nothing is eliminated. With it, the twist x of prior covariance
    S is: minimising ``|e - J x - G a|^2 / sigma^2 + x^T S^-1 x`` over x leaves normal equations in a (Schur's
    complement). The residual e is linearised about the fitted motion, whose second-order terms are then rounding.
    """
    if twist_covariance is None or fit is None:
        return _normal_equations(_linearised(K, motion, sample)[0], templates, sample.sigma_px)
    residual, jacobian = _linearised(K, fit.motion, sample)
    residual = residual + jacobian @ fit.twist  # about the given motion: the prior's mean
    plain = _normal_equations(residual, templates, sample.sigma_px)
    weight = 1.0 / sample.sigma_px**2
    cross = weight * np.einsum("nki,nkm->im", jacobian, np.nan_to_num(templates))
    pull = weight * np.einsum("nki,nk->i", jacobian, residual)
    # Schur's complement: (J^T J / sigma^2 + S^-1)^-1, with S possibly singular, applied to both right-hand sides.
    solved = parallel_sum(twist_covariance, fit.information) @ np.column_stack((cross, pull))
    return Evidence(
        plain.matrix - cross.T @ solved[:, :-1],
        plain.vector - cross.T @ solved[:, -1],
        max(plain.total - float(pull @ solved[:, -1]), 0.0),
        plain.count,
    )


def parallel_sum(covariance: Float64, information: Float64) -> Float64:
    """Return ``(covariance^-1 + information)^-1`` of symmetric matrices without negative eigenvalues.

    Either may be singular. With ``covariance = L L^T`` it is ``L (1 + L^T information L)^-1 L^T``. The eigenvalues are
    taken apart: however large they are, none of what is inverted is less than 1.
    """
    eigenvalues, directions = np.linalg.eigh(covariance)
    L = directions * np.sqrt(np.maximum(eigenvalues, 0.0))
    gains, rotation = np.linalg.eigh(L.T @ information @ L)
    rotated = L @ rotation
    combined: Float64 = (rotated / (1.0 + np.maximum(gains, 0.0))) @ rotated.T
    return combined


def twist_statistic(fit: MotionFit, twist_covariance: Float64) -> tuple[float, float]:
    """Return ``x^T (S + A^-1)^-1 x`` of the fitted twist x, and its expectation under the prior covariance S (6, 6).

    A is the information of the fit. The expectation, ``trace((S + A^-1)^-1 S)``, counts the determined directions:
    under the prior the statistic is chi-square with about so many degrees of freedom.
    """
    weight = parallel_sum(fit.information, twist_covariance)  # (S + A^-1)^-1
    return float(fit.twist @ weight @ fit.twist), float(np.trace(weight @ twist_covariance))


def _normal_equations(residual: Float64, templates: Float64, sigma_px: float) -> Evidence:
    weight = 1.0 / sigma_px**2
    flat = np.nan_to_num(templates.reshape(residual.size, -1))
    r = residual.reshape(-1)
    return Evidence(weight * flat.T @ flat, weight * flat.T @ r, weight * float(r @ r), len(r))
