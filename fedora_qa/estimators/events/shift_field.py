"""Scale and roll of the shifts of the tiles of an image, and the error of a camera that the shifts follow.

The shift d of events against frames at the ray (X, Y) = ((x - cx) / fx, (y - cy) / fy) of the event camera is, to first
order in the error,

- of an image that is moved, or of another principal point: d = (a, b);
- of another focal length: d = k (x - cx, y - cy), of other focal lengths along columns and rows with a k for each;
- of a camera that is rotated by w = (wx, wy, wz): d = (fx (wy (1 + X^2) - wx X Y - wz Y),
  fy (-wx (1 + Y^2) + wy X Y + wz X)), because a ray P moves by w x P (Hartley and Zisserman 2004, section 8.4).

All are linear in their parameters. Some tiles have peaks at wrong edges, so the parameters come from the smallest sets
of tiles, by the least truncated sum of squares (MSAC: P. Torr, A. Zisserman, Computer Vision and Image Understanding 78
(2000) 138), and then from least squares over the tiles that follow.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.robust import jackknife_errors, robust_sigma

Float64 = NDArray[np.float64]

ShiftFieldModel = Literal["shift", "focal", "focal_by_axis", "shift_and_focal", "rotation"]

FOCAL_MODELS: Final[tuple[ShiftFieldModel, ...]] = ("focal", "focal_by_axis", "shift_and_focal")
"""Models of another focal length, the simplest first."""

SHIFT_AND_FOCAL_MODELS: Final[tuple[ShiftFieldModel, ...]] = ("shift_and_focal",)

ROTATION_MODELS: Final[tuple[ShiftFieldModel, ...]] = ("rotation",)

FEWEST_TILES: Final = 6
"""Least number of tiles with a shift: the two components of each are more than twice the parameters of every model."""

_NO_SHIFT_PX: Final = 1e-3
"""Shifts whose root median square is smaller follow no model."""


@dataclass(frozen=True, slots=True)
class ScaleAndRoll:
    """How much wider one image is than another, and how far it is turned about the principal point.

    Attributes
    ----------
    scale, scale_error
        Excess of the scale over 1, and its standard error.
    roll_rad, roll_error_rad
        Clockwise positive, and its standard error, rad.
    per_px
        Largest change of the scale, and of the roll in rad, by a displacement of each tile by up to 1 px.
    """

    scale: float
    scale_error: float
    roll_rad: float
    roll_error_rad: float
    per_px: float


@dataclass(frozen=True, slots=True)
class ShiftFieldFit:
    """A model of the shifts of tiles.

    Attributes
    ----------
    model
        What is wrong with the camera.
    explained
        Share of the truncated squares of the shifts that the model explains, 0 to 1, for equal numbers of parameters.
    beyond_shift
        The same of the squares that one shift of the whole image leaves; 0 for the model ``shift``.
    parameters
        ``shift``: to the right and down, px; ``focal``: the gain k; ``focal_by_axis``: its parts along columns and
        rows; ``shift_and_focal``: shift and k; ``rotation``: rotation vector, rad, in optical axes.
    """

    model: ShiftFieldModel
    explained: float
    beyond_shift: float
    parameters: tuple[float, ...]

    @property
    def focal_gains(self) -> tuple[float, float]:
        """By how much the image of events is wider along columns and along rows; 0 for models without."""
        match self.model:
            case "focal" | "focal_by_axis":
                return self.parameters[0], self.parameters[-1]
            case "shift_and_focal":
                return self.parameters[2], self.parameters[2]
        return 0.0, 0.0


def scale_and_roll(centres_px: Float64, shifts_px: Float64, errors_px: Float64, K: Float64) -> ScaleAndRoll | None:
    """Fit a shift of the whole image, a scale and a roll to the shifts of tiles.

    Parameters
    ----------
    centres_px
        (k, 2) centres of the tiles, columns and rows.
    shifts_px, errors_px
        (k, 2) shifts to the right and down, and their standard errors.
    K
        (3, 3) of the camera of the tiles.

    Returns
    -------
    ScaleAndRoll | None
        None of fewer than ``FEWEST_TILES`` tiles, or where one of them alone determines a parameter.
    """
    if len(shifts_px) < FEWEST_TILES:
        return None
    right_px, down_px = (centres_px - K[:2, 2]).T
    zero, unity = np.zeros_like(right_px), np.ones_like(right_px)
    # d = (a + k x - r y, b + k y + r x) for the scale k and the roll r.
    design = _design((unity, zero), (zero, unity), (right_px, down_px), (-down_px, right_px))
    weighted, targets = design / errors_px[..., np.newaxis], shifts_px / errors_px
    solutions = [_least_squares(weighted, targets)]
    for tile in range(len(shifts_px)):
        kept = np.arange(len(shifts_px)) != tile
        if np.linalg.matrix_rank(weighted[kept].reshape(-1, 4)) < 4:
            return None
        solutions.append(_least_squares(weighted[kept], targets[kept]))
    fitted, *left_out = solutions
    # Tiles that scatter by more than their errors have larger ones.
    scatter = max(1.0, float(robust_sigma((targets - weighted @ fitted).ravel(), 0.0)))
    rows = weighted.reshape(-1, 4)
    covariance = np.linalg.inv(rows.T @ rows)
    formal = scatter * np.sqrt(np.diag(covariance))
    errors = np.maximum(formal, jackknife_errors(left_out))
    # parameters = G shifts: by displacements of at most 1 px along each axis, at most sum |G|.
    gains = np.abs(covariance @ (rows / errors_px.reshape(-1, 1)).T).sum(axis=1)
    return ScaleAndRoll(float(fitted[2]), float(errors[2]), float(fitted[3]), float(errors[3]), float(gains[2:].max()))


def field_fits(centres_px: Float64, shifts_px: Float64, K: Float64) -> tuple[ShiftFieldFit, ...]:
    """Fit every model to the shifts of tiles.

    Parameters
    ----------
    centres_px
        (k, 2) centres of the tiles, columns and rows.
    shifts_px
        (k, 2) shifts to the right and down.
    K
        (3, 3) of the camera of the tiles.

    Returns
    -------
    tuple[ShiftFieldFit, ...]
        One for each model; none of fewer than ``FEWEST_TILES`` tiles, and none of tiles without a shift.
    """
    squares = (shifts_px**2).sum(axis=1)
    # Tiles at a wrong edge have shifts of any size: squares count up to the median of those of the tiles.
    most = float(np.median(squares)) if len(squares) else 0.0
    if len(shifts_px) < FEWEST_TILES or most < _NO_SHIFT_PX**2:
        return ()
    models = _models(centres_px, K)
    fitted = {model: _least_truncated(design, shifts_px, most) for model, design in models.items()}
    unexplained = float(np.minimum(squares, most).sum())
    _, of_shift = fitted["shift"]
    fits = []
    for model, (parameters, left) in fitted.items():
        # Mean squares for each degree of freedom, so that no model gains by its number of parameters.
        freedom = 2 * len(shifts_px) - len(parameters)
        explained = 1.0 - left / freedom * 2 * len(shifts_px) / unexplained
        beyond = 1.0 - left / freedom * (2 * len(shifts_px) - 2) / max(of_shift, 1e-300)
        fits.append(
            ShiftFieldFit(
                model,
                max(explained, 0.0),
                0.0 if model == "shift" else max(beyond, 0.0),
                tuple(float(value) for value in parameters),
            )
        )
    return tuple(fits)


def _models(centres_px: Float64, K: Float64) -> Mapping[ShiftFieldModel, Float64]:
    """Return the design (k, 2, parameters) of each model."""
    focal_px, centre_px = np.array([K[0, 0], K[1, 1]]), np.array([K[0, 2], K[1, 2]])
    right_px, down_px = (centres_px - centre_px).T
    X, Y = right_px / focal_px[0], down_px / focal_px[1]
    zero, unity = np.zeros_like(X), np.ones_like(X)

    to_the_right, down = (unity, zero), (zero, unity)
    fx, fy = focal_px
    return {
        "shift": _design(to_the_right, down),
        "focal": _design((right_px, down_px)),
        "focal_by_axis": _design((right_px, zero), (zero, down_px)),
        "shift_and_focal": _design(to_the_right, down, (right_px, down_px)),
        # w x P of the ray P = (X, Y, 1), divided by its depth (module docstring).
        "rotation": _design(
            (-fx * X * Y, -fy * (1 + Y**2)),
            (fx * (1 + X**2), fy * X * Y),
            (-fx * Y, fy * X),
        ),
    }


def _design(*columns: tuple[Float64, Float64]) -> Float64:
    """Return the design (k, 2, parameters) of the shifts (k,) to the right and down by each parameter."""
    return np.stack([np.stack(column, axis=-1) for column in columns], axis=-1)


def _least_truncated(design: Float64, shifts_px: Float64, most: float) -> tuple[Float64, float]:
    """Return the parameters with the least sum of squares, each at most ``most``, and this sum."""
    parameters = design.shape[2]
    best, least = np.zeros(parameters), np.inf
    for tiles in combinations(range(len(design)), -(-parameters // 2)):
        candidate = _least_squares(design[list(tiles)], shifts_px[list(tiles)])
        squares = _squares(design, shifts_px, candidate)
        # Least squares over the tiles that follow more closely than those at wrong edges.
        follows = squares < most
        if 2 * np.count_nonzero(follows) > parameters:
            refined = _least_squares(design[follows], shifts_px[follows])
            candidate = min(candidate, refined, key=lambda p: _truncated(_squares(design, shifts_px, p), most))
        total = _truncated(_squares(design, shifts_px, candidate), most)
        if total < least:
            best, least = candidate, total
    return best, least


def _least_squares(design: Float64, shifts_px: Float64) -> Float64:
    solution, *_ = np.linalg.lstsq(design.reshape(-1, design.shape[2]), shifts_px.reshape(-1), rcond=None)
    return np.asarray(solution, np.float64)


def _squares(design: Float64, shifts_px: Float64, parameters: Float64) -> Float64:
    squares: Float64 = ((shifts_px - design @ parameters) ** 2).sum(axis=1)
    return squares


def _truncated(squares: Float64, most: float) -> float:
    return float(np.minimum(squares, most).sum())
