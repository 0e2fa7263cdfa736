"""From the residual flow of a field's tiles to the field's own: mean error, gain, shift, each with its error."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from fedora_qa.estimators.flow_motion_fit import Evidence

Float64 = NDArray[np.float64]

MEAN: Final = slice(0, 2)
GAIN: Final = slice(2, 3)
SHIFT: Final = slice(3, 5)
TEMPLATES: Final = 5
"""Templates of a tile's residual flow: constant u and v; the flow itself; its slopes along columns and rows."""

_HUBER: Final = 2.0
_ITERATIONS: Final = 5
_SMALLEST_TRUE: Final = 1e-3
"""Share of the stored flow below which the true one is as good as zero."""

_TAIL: Final = 1e-6
"""Probability at which Student's and the normal distribution are matched, near where judgement draws its line."""


@dataclass(frozen=True, slots=True)
class FieldFit:
    """One field's tiles together.

    Attributes
    ----------
    mean_px, mean_error_px
        (2,) robust weighted mean of the tiles' residual flow, and its standard error.
    evidence
        Normal equations of the templates, robustly weighted.
    deviations
        (n,) each tile's distance from the mean in units of its standard error.
    """

    mean_px: Float64
    mean_error_px: Float64
    evidence: Evidence
    deviations: Float64


def fit_field(errors_px: Float64, covariances_px2: Float64, flows_px: Float64, slopes: Float64) -> FieldFit:
    """Fit tiles with residual flow (n, 2) of covariance (n, 2, 2), flow (n, 2) and its slopes (n, 2, 2), n > 1.

    ``slopes[:, i, j]`` is the derivative of component i along column (j = 0) or row (j = 1). Tiles far from the mean
    are weighted down after Huber; the standard error is the larger of the formal and the empirical one.
    """
    information = np.linalg.inv(covariances_px2)
    mean_px = np.median(errors_px, axis=0)
    for _ in range(_ITERATIONS):
        deviations = np.sqrt(np.einsum("ni,nij,nj->n", errors_px - mean_px, information, errors_px - mean_px))
        weights = np.minimum(1.0, _HUBER / np.maximum(deviations, 1e-12))
        matrix = np.einsum("n,nij->ij", weights, information)
        mean_px = np.linalg.solve(matrix, np.einsum("n,nij,nj->i", weights, information, errors_px))
    scores = np.einsum("n,nij,nj->ni", weights, information, errors_px - mean_px)
    return FieldFit(
        mean_px=mean_px,
        mean_error_px=robust_errors(matrix, scores),
        evidence=_evidence(errors_px, information * weights[:, None, None], flows_px, slopes),
        deviations=deviations,
    )


def robust_errors(matrix: Float64, scores: Float64) -> Float64:
    """Return the standard errors (p,) of ``matrix^-1 sum(scores)``, the larger of the formal and the empirical ones.

    The empirical ones are the sandwich over independent blocks, of which ``scores`` (k, p) has one row each, widened so
    that a normal limit keeps its false-alarm rate although the spread comes from few blocks (Student).
    """
    blocks, parameters = scores.shape
    freedom = blocks - parameters
    if freedom < 1:
        return np.full(parameters, np.inf)
    formal = np.linalg.inv(matrix)
    empirical = formal @ (scores.T @ scores) @ formal * blocks / freedom
    widening = float(stats.t.isf(_TAIL, freedom) / stats.norm.isf(_TAIL))
    errors: Float64 = np.sqrt(np.maximum(np.diag(formal), widening**2 * np.diag(empirical)))
    return errors


def gain_of_true(share_of_stored: float) -> tuple[float, float]:
    """Turn an error that is a share g of the stored flow into a gain on the true flow, and return its slope too.

    Stored = (1 + G) true and error = G true give G = g / (1 - g).
    """
    rest = 1.0 - share_of_stored
    rest = rest if abs(rest) > _SMALLEST_TRUE else np.copysign(_SMALLEST_TRUE, rest)
    return share_of_stored / rest, rest**-2


def _evidence(errors_px: Float64, information: Float64, flows_px: Float64, slopes: Float64) -> Evidence:
    count = len(errors_px)
    templates = np.concatenate((np.broadcast_to(np.eye(2), (count, 2, 2)), flows_px[:, :, None], slopes), axis=2)
    return Evidence(
        matrix=np.einsum("nia,nij,njb->ab", templates, information, templates),
        vector=np.einsum("nia,nij,nj->a", templates, information, errors_px),
        total=float(np.einsum("ni,nij,nj->", errors_px, information, errors_px)),
        count=errors_px.size,
    )
