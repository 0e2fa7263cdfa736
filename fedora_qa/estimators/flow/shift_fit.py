"""Fit a shift of the image to a flow field: by how many pixels the stored field lies away from the recomputed one.

A field that is shifted by d holds ``u(x - d)`` at the pixel x, where the flow of depth and pose is ``u(x)``. A small
step of d changes the field by ``-grad u`` times the step, so that steps of Gauss-Newton fit d. Pixels next to a break
of the flow are left out: there it has no gradient, and a field that was resampled mixes two surfaces.
"""

from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.mask import flow_breaks

Float64 = NDArray[np.float64]
Indices = NDArray[np.intp]

_LARGEST_PX: Final = 16.0
"""Longest shift that is fitted."""

_STEPS: Final = 30
_LONGEST_STEP_PX: Final = 2.0
"""Farther away the gradient of the flow is another one."""

_CONVERGED_PX: Final = 1e-5
"""A step of this length ends the fit: flow of float32 is not known better."""

_HUBER: Final = 3.0
"""Residuals beyond this multiple of the scale count less (P. J. Huber, Ann. Math. Stat. 35 (1964) 73): of normal ones
exp(-9 / 2) = 1%, so few that the information is that of least squares."""

_SIGMA_OF_MEDIAN: Final = 0.8493
"""Standard deviation of a component over the median length of a normal vector in the plane: 1 / sqrt(2 ln 2)."""

_TILE_PX: Final = 32
"""Side of the tiles whose residuals count as independent."""

_FEWEST_TILES: Final = 4
_FEWEST_PIXELS: Final = 20
_LEAST_CONDITION: Final = 1e-6
"""Least ratio of the two eigenvalues of the information on the shift. Below it the gradient has one direction, and a
shift across that changes nothing."""


@dataclass(frozen=True, slots=True)
class ShiftFit:
    """A shift of a stored field against the recomputed one.

    Attributes
    ----------
    shift_px
        (2,) px, to the right and down.
    covariance_px2
        (2, 2) px^2, from the scatter between tiles of 32 px.
    resampling_px
        (2,) px, by how much more the shift would be, had the field not been resampled along straight lines.
    removed_share, removed_share_of_all
        Share of the rms deviation that the shift removes, 0 to 1: of the fitted pixels, and of all, next to breaks too,
        where a field that was resampled along straight lines mixes two surfaces.
    variables
        (k,) fitted values of the variables that change the flow.
    """

    shift_px: Float64
    covariance_px2: Float64
    resampling_px: Float64
    removed_share: float
    removed_share_of_all: float
    variables: Float64


@dataclass(frozen=True, slots=True)
class ShiftSample:
    """Pixels of a stored field, and the flow of depth and pose that it is compared with.

    Attributes
    ----------
    columns, rows
        (n,) px.
    stored_px
        (n, 2) stored flow, px.
    recomputed_px
        (H, W, 2) flow of depth and pose of the whole image, px; NaN where there is none.
    effects_px
        (n, 2, k) change of the flow, px, by each of k independent variables of variance 1, such as the noise of a pose;
        k may be 0.
    variables
        (k,) values of these at which the flow was recomputed.
    sigma_px
        Least standard deviation of a residual, px.
    """

    columns: Indices
    rows: Indices
    stored_px: Float64
    recomputed_px: Float64
    effects_px: Float64
    variables: Float64
    sigma_px: float


@dataclass(frozen=True, slots=True)
class _Linearised:
    """The sample about some parameters: n pixels that lie on smooth surfaces, and m parameters.

    Attributes
    ----------
    residual_px
        (n, 2) stored flow, less the one that the parameters imply.
    jacobian
        (n, 2, m) derivative of the latter by the parameters.
    bends_px
        (n, 2) by how much a straight line between pixels leaves the recomputed flow, px.
    weights
        (n,) 1/px^2.
    tiles
        (n,) number of the tile of each pixel.
    """

    residual_px: Float64
    jacobian: Float64
    bends_px: Float64
    weights: Float64
    tiles: Indices

    @property
    def information(self) -> Float64:
        """Return (m, m)."""
        return self._information(np.s_[:])

    def of_tile(self, tile: int) -> tuple[Float64, Float64]:
        """Return information (m, m) and gradient (m,) of the pixels of a tile."""
        pixels = np.flatnonzero(self.tiles == tile)
        return self._information(pixels), self.gradients[pixels].sum(axis=0)

    def _information(self, pixels: Indices | slice) -> Float64:
        jacobian = self.jacobian[pixels]
        weighted = jacobian * self.weights[pixels][:, None, None]
        # Both components of all pixels are rows of one matrix: (2 n, m).
        flat, weighted_flat = (each.reshape(-1, each.shape[-1]) for each in (jacobian, weighted))
        return np.asarray(flat.T @ weighted_flat, dtype=np.float64)

    @property
    def gradients(self) -> Float64:
        """Return (n, m), of each pixel."""
        return self.along(self.residual_px)

    def along(self, change_px: Float64) -> Float64:
        """Return the gradients (n, m) by some change (n, 2) of the flow, px."""
        weighted_px = self.weights[:, None] * change_px
        return np.asarray((weighted_px[:, None, :] @ self.jacobian)[:, 0], dtype=np.float64)


def fit_shift(sample: ShiftSample) -> ShiftFit | None:
    """Fit the shift of a field robustly, together with the variables that change its flow.

    Parameters
    ----------
    sample
        Of one field.

    Returns
    -------
    ShiftFit or None
        None where too few pixels lie on smooth surfaces, where these do not determine the shift, and where it is longer
        than 16 px or the steps do not converge.

    Notes
    -----
    Minimises the sum of ``rho(|u_stored(x) - u(x - d) - E z| / sigma) + |z|^2 / 2`` over d and z, rho being Huber's and
    sigma the median of the residuals. With A the sum of the information on both and of that of the prior, P, and g_t
    the gradients summed over a tile, by a fit without the tile, their covariance is ``A^-1 (sum g_t g_t^T + P) A^-1``
    (R. M. Bell, D. F. McCaffrey, Surv. Methodol. 28 (2002) 169). Between pixels u follows a straight line, as most
    programs resample. Whether the field was resampled is not known.
    """
    flow = _Flow.of(sample.recomputed_px)
    prior = np.diag([0.0, 0.0, *np.ones(sample.effects_px.shape[2])])
    parameters = np.concatenate((np.zeros(2), sample.variables))
    for _ in range(_STEPS):
        about = _linearised(sample, flow, parameters)
        if about is None or not _determines_shift(about.information):
            return None
        step = np.linalg.solve(about.information + prior, about.gradients.sum(axis=0) - prior @ parameters)
        length_px = float(np.hypot(*step[:2]))
        parameters = parameters + step * min(1.0, _LONGEST_STEP_PX / max(length_px, _CONVERGED_PX))
        if np.hypot(*parameters[:2]) > _LARGEST_PX:
            return None
        if length_px < _CONVERGED_PX:
            break
    else:
        return None
    shifted = _linearised(sample, flow, parameters)
    if shifted is None or len(np.unique(shifted.tiles)) < _FEWEST_TILES:
        return None
    inverse = np.linalg.inv(shifted.information + prior)
    scatter = prior.copy()
    for tile in np.unique(shifted.tiles):
        information, gradient = shifted.of_tile(tile)
        # What the fit without the tile would leave in it: of few tiles each draws the fit towards itself.
        ahead = np.linalg.pinv(np.eye(len(prior)) - information @ inverse) @ gradient
        scatter += np.outer(ahead, ahead)
    has_flow = np.asarray(np.isfinite(sample.recomputed_px).all(axis=-1))
    return ShiftFit(
        parameters[:2],
        (inverse @ scatter @ inverse)[:2, :2],
        (inverse @ shifted.along(shifted.bends_px).sum(axis=0))[:2],
        _removed_share(sample, flow, parameters),
        _removed_share(sample, replace(flow, is_smooth=has_flow), parameters),
        parameters[2:],
    )


@dataclass(frozen=True, slots=True)
class _Flow:
    """The recomputed flow (H, W, 2), 0 where there is none, its derivatives, and where these are those of a surface.

    ``slopes`` and ``curvatures`` are (H, W, 2, 2): first and second derivatives along columns and along rows.
    """

    flow_px: Float64
    slopes: Float64
    curvatures: Float64
    is_smooth: NDArray[np.bool_]

    @staticmethod
    def of(recomputed_px: Float64) -> "_Flow":
        breaks = flow_breaks(recomputed_px.astype(np.float32))
        flow_px = np.nan_to_num(recomputed_px)
        # Central differences along columns and along rows.
        slopes = np.stack([np.gradient(flow_px, axis=axis) for axis in (1, 0)], axis=-1)
        curvatures = np.zeros_like(slopes)
        curvatures[:, 1:-1, :, 0] = np.diff(flow_px, n=2, axis=1)
        curvatures[1:-1, :, :, 1] = np.diff(flow_px, n=2, axis=0)
        # Neighbours of a break have one in the reach of their differences.
        return _Flow(flow_px, slopes, curvatures, cv2.dilate(breaks, np.ones((3, 3), np.uint8)) == 0)


def _linearised(sample: ShiftSample, flow: _Flow, parameters: Float64) -> _Linearised | None:
    """Return the sample about some parameters; None where too few pixels come from smooth surfaces."""
    height, width = flow.is_smooth.shape
    # The stored value of the pixel x comes from x - d, between the four pixels whose first is at ``top`` and ``left``.
    x, y = sample.columns - parameters[0], sample.rows - parameters[1]
    left, top = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    inside = np.flatnonzero((left >= 0) & (left < width - 1) & (top >= 0) & (top < height - 1))
    corners = [(top[inside] + down, left[inside] + right) for down in (0, 1) for right in (0, 1)]
    is_smooth = np.logical_and.reduce([flow.is_smooth[corner] for corner in corners])
    used = inside[is_smooth]
    if len(used) < _FEWEST_PIXELS:
        return None
    right, down = (x - left)[used], (y - top)[used]
    shares = ((1 - down) * (1 - right), (1 - down) * right, down * (1 - right), down * right)
    corners = [(row[is_smooth], column[is_smooth]) for row, column in corners]
    flow_px = sum(share[:, None] * flow.flow_px[corner] for share, corner in zip(shares, corners, strict=True))
    slopes = sum(share[:, None, None] * flow.slopes[corner] for share, corner in zip(shares, corners, strict=True))
    # A straight line over the share p of a pixel leaves a curve of second derivative u'' by p (1 - p) u'' / 2.
    curvatures = flow.curvatures[corners[0]]
    bends_px = (
        (right * (1 - right))[:, None] * curvatures[..., 0] + (down * (1 - down))[:, None] * curvatures[..., 1]
    ) / 2
    effects_px = sample.effects_px[used]
    residual_px = sample.stored_px[used] - flow_px - effects_px @ (parameters[2:] - sample.variables)
    length_px = np.hypot(*residual_px.T)
    sigma_px = max(_SIGMA_OF_MEDIAN * float(np.median(length_px)), sample.sigma_px)
    # Huber's weights.
    weights = np.minimum(1.0, _HUBER * sigma_px / np.maximum(length_px, sigma_px)) / sigma_px**2
    tiles = sample.rows[used] // _TILE_PX * (width // _TILE_PX + 1) + sample.columns[used] // _TILE_PX
    return _Linearised(residual_px, np.concatenate((-slopes, effects_px), axis=-1), bends_px, weights, tiles)


def _determines_shift(information: Float64) -> bool:
    """Whether the gradient of the flow has two directions."""
    eigenvalues = np.linalg.eigvalsh(information[:2, :2])
    return bool(eigenvalues[0] > _LEAST_CONDITION * eigenvalues[1])


def _removed_share(sample: ShiftSample, flow: _Flow, parameters: Float64) -> float:
    """Return the share of the rms deviation that the shift removes, 0 to 1."""
    as_recomputed = np.concatenate((np.zeros(2), sample.variables))
    shifted, as_stored = (_linearised(sample, flow, each) for each in (parameters, as_recomputed))
    if shifted is None or as_stored is None:
        return 0.0
    remaining_px, deviation_px = _rms_px(shifted, parameters[2:]), _rms_px(as_stored, sample.variables)
    return max(1.0 - remaining_px / deviation_px, 0.0) if deviation_px > 0 else 0.0


def _rms_px(about: _Linearised, variables: Float64) -> float:
    """Return the rms residual, px, that the best values of the variables leave at this shift."""
    information = about.information[2:, 2:] + np.eye(len(variables))
    change = np.linalg.solve(information, about.gradients[:, 2:].sum(axis=0) - variables)
    residual_px = about.residual_px - about.jacobian[:, :, 2:] @ change
    return float(np.sqrt(np.mean(np.sum(residual_px**2, axis=1))))
