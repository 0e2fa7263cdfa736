"""Templates of small changes of parameters: what flow differs by where one of them is wrong, and which is.

A wrong focal length, mounting or clock changes the recomputed flow by a template times the size of its error. Templates
are fitted to the residuals of fields, while each field may correct its motion within the declared noise of the poses.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.motion_fit import FlowSample, MotionFit, linearised, parallel_sum, sample_pixels
from fedora_qa.geometry.camera import RigidMotion

Float64 = NDArray[np.float64]

_PERCENT, _DEG, _MS = 0.01, np.pi / 180, 1e-3


@dataclass(frozen=True, slots=True)
class Evidence:
    """Normal equations of templates against the residuals of fields, with the pose correction eliminated.

    Evidence of several fields is added.

    Attributes
    ----------
    matrix, vector
        (m, m) and (m,) for m templates, weighted by the inverse variance of the residuals.
    total
        Weighted sum of squares of the residuals.
    count
        Number of the residuals, two for each pixel or tile.
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
        """Return the evidence for the one template that is the sum of all templates times ``direction`` (m,)."""
        matrix, vector = direction @ self.matrix @ direction, direction @ self.vector
        return Evidence(np.array([[matrix]]), np.array([vector]), self.total, self.count)

    def explained_by(self, columns: slice) -> tuple[Float64, float]:
        """Return the sizes (k,) of some templates fitted alone, and the share of the squares that they explain."""
        matrix, vector = self.matrix[columns, columns], self.vector[columns]
        sizes: Float64 = np.asarray(np.linalg.lstsq(matrix, vector, rcond=1e-9)[0], dtype=np.float64)
        share = float(vector @ sizes) / self.total if self.total > 0 else 0.0
        return sizes, share

    def fit(self, columns: slice) -> "TemplateFit":
        """Return the fit of some templates alone; its error is larger where much of the residuals remains."""
        sizes, share = self.explained_by(columns)
        remaining = float(np.clip(1.0 - share, 0.0, 1.0))
        information = np.diag(self.matrix[columns, columns])
        by_rounding = float(np.max(1.0 / np.sqrt(np.maximum(information, 1e-300))))
        # Residuals beyond the stated sigma enlarge the error; smaller ones do not reduce it.
        error = by_rounding * max(1.0, float(np.sqrt(remaining * self.total / self.count)))
        # The rms falls with the square root of the share of the squares that remains.
        return TemplateFit(sizes, 1.0 - float(np.sqrt(remaining)), error)


class TemplateFit(NamedTuple):
    """Templates fitted to residuals.

    Attributes
    ----------
    sizes
        (m,) in the units of the templates.
    removed_share
        Share of the rms residual that the templates remove, 0 to 1.
    standard_error
        The largest standard error of a size.
    """

    sizes: Float64
    removed_share: float
    standard_error: float


def sum_of(evidences: Sequence[Evidence]) -> Evidence:
    """Return the sum of the evidence of all fields, of which there is at least one."""
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
    """Return the normal equations of templates for one field.

    Parameters
    ----------
    K
        (3, 3) intrinsics, px.
    motion
        Given motion of points, from the camera frame at the start of the interval to that at its end.
    sample
        Pixels of the field.
    templates
        (n, 2, m) px per unit of each; NaN where the point lies behind the camera.
    fit
        Of the same sample, from ``fit_motion``; None where the motion is not corrected.
    twist_covariance
        (6, 6) prior covariance of the twist of the motion, rad and m; None where the motion is exact.

    Returns
    -------
    Evidence
        With 2 n residuals.

    Notes
    -----
    Without ``twist_covariance`` the pose is exact and nothing is eliminated. With it, the twist x of prior covariance S
    is eliminated: the minimum of ``|e - J x - G a|^2 / sigma^2 + x^T S^-1 x`` over x leaves normal equations in a
    (Schur's complement). The residual ``e = r + J t`` is linearised about the fitted motion of twist t, where its
    second-order terms are below rounding. There r is small, and nothing of the size of J t, which may be a million
    times larger, is subtracted from another: with A = J^T J / sigma^2, the remaining squares are
    ``|r|^2 / sigma^2 + t^T (A^-1 + S)^-1 t`` and terms in J^T r, which is zero where the steps have converged.
    """
    pixels = sample_pixels(K, sample)
    columns = np.nan_to_num(templates.reshape(len(templates) * 2, -1))
    if twist_covariance is None or fit is None:
        return _normal_equations(linearised(K, motion, pixels)[0], columns, sample.sigma_px)
    residual, jacobian = linearised(K, fit.motion, pixels)
    plain = _normal_equations(residual, columns, sample.sigma_px)
    weight = 1.0 / sample.sigma_px**2
    information = weight * jacobian.T @ jacobian
    cross, gradient = weight * jacobian.T @ columns, weight * jacobian.T @ residual
    # Schur's complement: (A + S^-1)^-1, with S possibly singular.
    eliminated = parallel_sum(twist_covariance, information)
    left = fit.twist - eliminated @ (information @ fit.twist)
    by_prior = fit.twist @ parallel_sum(information, twist_covariance) @ fit.twist
    return Evidence(
        plain.matrix - cross.T @ eliminated @ cross,
        plain.vector + cross.T @ (left - eliminated @ gradient),
        max(plain.total + float(2 * gradient @ left - gradient @ eliminated @ gradient + by_prior), 0.0),
        plain.count,
    )


def _normal_equations(residual: Float64, columns: Float64, sigma_px: float) -> Evidence:
    """Return the evidence for templates, columns of (2 n, m), in a residual (2 n,), px."""
    weight = 1.0 / sigma_px**2
    return Evidence(
        weight * columns.T @ columns, weight * columns.T @ residual, weight * float(residual @ residual), len(residual)
    )


@dataclass(frozen=True, slots=True)
class ParameterTemplate:
    """A parameter of the recomputed flow and the columns of its templates.

    Attributes
    ----------
    parameter, unit
        Its name, and the unit of its error.
    columns
        Of ``parameter_templates``.
    largest
        Error, in that unit, above which the template, a derivative, no longer approximates the change of the flow.
    """

    parameter: str
    unit: str
    columns: slice
    largest: float

    def size(self, fitted: Float64) -> float:
        """Return the norm of an error (k,) of several components, with the sign of the largest one."""
        return float(np.copysign(np.linalg.norm(fitted), fitted[np.argmax(np.abs(fitted))]))


FLOW_GAIN: Final = ParameterTemplate("flow_gain", "percent", slice(0, 1), np.inf)
FOCAL: Final = ParameterTemplate("intrinsics_focal", "percent", slice(1, 2), 30.0)
CENTRE: Final = ParameterTemplate("intrinsics_centre", "px", slice(2, 4), 100.0)
MOUNTING: Final = ParameterTemplate("extrinsic_rotation", "deg", slice(4, 7), 15.0)
LEVER_ARM: Final = ParameterTemplate("lever_arm", "m", slice(7, 10), 3.0)
TIME_OFFSET: Final = ParameterTemplate("time_offset", "ms", slice(10, 11), 50.0)

PARAMETER_TEMPLATES: Final = (FLOW_GAIN, FOCAL, CENTRE, MOUNTING, LEVER_ARM, TIME_OFFSET)


def parameter_templates(
    K: Float64,
    motion: RigidMotion,
    sample: FlowSample,
    remounted: Callable[[Float64, Float64], RigidMotion],
    delayed: Callable[[float], RigidMotion | None],
) -> Float64:
    """Return the templates of all parameters: stored minus recomputed flow per unit of each error.

    Parameters
    ----------
    K, motion
        (3, 3) intrinsics, px, and motion of points between the camera frames, as declared.
    sample
        Pixels of the field.
    remounted
        Gives the motion if the true mounting is ``R_body_camera Exp(-rotation)`` and the true centre of the camera
        lies ``shift`` less along the axes of the body, for a rotation vector (3,), rad, and a shift (3,), m.
    delayed
        Gives the motion if the timestamps of the poses are too late by a number of seconds; None where no pose
        covers it.

    Returns
    -------
    ndarray of float64
        (n, 2, 11) px per unit of each of ``PARAMETER_TEMPLATES``; 0 for a time offset that no pose covers.
    """

    def flow(changed_K: Float64, changed_motion: RigidMotion) -> Float64:
        return sample.rigid_flow(changed_K, changed_motion)

    def refocused(ratio: float) -> Float64:
        # The declared focal length is ``ratio`` times the true one; skew scales with it, the centre stays.
        scaled: Float64 = K * np.array([[1 / ratio, 1 / ratio, 1.0], [1.0, 1 / ratio, 1.0], [1.0, 1.0, 1.0]])
        return scaled

    def recentred(axis: int, shift_px: float) -> Float64:
        changed = K.copy()
        changed[axis, 2] -= shift_px
        return changed

    # Central differences (f(x + h) - f(x - h)) / 2 h: their error is of second order in steps of a thousandth.
    step, step_s = 1e-3, 1e-3
    columns = [
        # A gain G adds G times the flow: the template needs no difference.
        flow(K, motion) * _PERCENT,
        _slope(flow(refocused(1 + step), motion), flow(refocused(1 - step), motion), step / _PERCENT),
    ]
    for axis in (0, 1):
        columns.append(_slope(flow(recentred(axis, step), motion), flow(recentred(axis, -step), motion), step))
    unchanged = np.zeros(3)
    for turn in np.eye(3) * step:
        columns.append(_slope(flow(K, remounted(turn, unchanged)), flow(K, remounted(-turn, unchanged)), step / _DEG))
    for shift in np.eye(3) * step:
        columns.append(_slope(flow(K, remounted(unchanged, shift)), flow(K, remounted(unchanged, -shift)), step))
    later, earlier = delayed(step_s), delayed(-step_s)
    if later is None or earlier is None:
        columns.append(np.zeros_like(columns[0]))
    else:
        columns.append(_slope(flow(K, later), flow(K, earlier), step_s / _MS))
    return np.stack(columns, axis=-1)


def _slope(ahead: Float64, behind: Float64, step: float) -> Float64:
    return (ahead - behind) / (2 * step)
