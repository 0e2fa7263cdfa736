"""Distance flown and the greatest speeds, from poses that may be noisy.

Summing the steps between noisy 200 Hz poses measures the noise: 5 mm add some 2 m of path a second. Here a
least-squares quintic spline is fitted to the poses and its derivative is measured. The spacing of its knots decides how
much is smoothed; it is chosen by generalised cross-validation (Craven and Wahba 1979) with the degrees of freedom
weighted by 1.4 against too fine a choice (Kim and Gu 2004), so that it follows the data: exact poses keep a knot every
second sample, noisy ones get as few as the motion allows.

Lengths and maxima of a noisy curve are still too large. By how much, and with what spread, is told by a parametric
bootstrap (Efron and Tibshirani 1993, ch. 6): white noise of the fitted size is added to the fitted curve, fitted with
the same knots and measured again. The mean excess is subtracted; the error bar holds the spread and the whole excess.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Self, cast

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_lsq_spline

Float64 = NDArray[np.float64]

_DEGREE: Final = 5
_SAMPLES_PER_KNOT: Final = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384)
_DEGREES_OF_FREEDOM_WEIGHT: Final = 1.4
_REPETITIONS: Final = 24
_FEWEST_SAMPLES: Final = 16
"""Fewer poses do not leave enough residuals to tell noise from motion."""
_EVALUATION_ERROR: Final = 1e-5
"""Relative error of measuring the curve at two points an interval, for motion slower than 5 Hz at 200 samples/s."""
_GAUSS_NODES: Final = np.array([-1.0, 1.0]) / np.sqrt(3.0)

_Speeds = Callable[[Float64, Float64], Float64]
"""Turns values and rates of change (n, d) into speeds (n,)."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value and its standard error."""

    value: float
    standard_error: float


@dataclass(frozen=True, slots=True)
class Motion:
    """How far and how fast a curve went.

    Attributes
    ----------
    length
        Speed integrated over time, ``speed_max`` its greatest value.
    noise
        Standard deviation of the samples about the curve, each axis.
    knot_spacing_s
        Mean distance of the knots: what is shorter has been smoothed away.
    """

    length: Estimate
    speed_max: Estimate
    noise: float
    knot_spacing_s: float


def translation(times_s: Float64, positions_m: Float64) -> Motion | None:
    """Measure positions (n, 3): metres and m/s. None where there are too few samples."""
    return _measure(times_s, positions_m, speeds=lambda _, rates: np.linalg.norm(rates, axis=1), noise=_isotropic)


def rotation(times_s: Float64, orientations_xyzw: Float64) -> Motion | None:
    """Measure orientations (n, 4), quaternions of either sign: radians and rad/s. None where there are too few samples.

    The spline is fitted to the components; the angular velocity of the curve it traces on the sphere is
    2 Im(q* dq/dt) / |q|^2, in which a change of length drops out.
    """
    motion = _measure(times_s, _of_one_sign(orientations_xyzw), speeds=_angular_speeds, noise=_tangential)
    if motion is None:
        return None
    return Motion(motion.length, motion.speed_max, 2.0 * motion.noise, motion.knot_spacing_s)  # half angles in q


@dataclass(frozen=True, slots=True)
class _Fit:
    """A spline, and the standard deviation of the residual of each of three axes."""

    curve: BSpline
    sigma: float

    @classmethod
    def to(cls, times_s: Float64, values: Float64, samples_per_knot: int) -> tuple[float, Self]:
        """Fit a spline and return its cross-validation score (smaller is better) with it."""
        count = len(times_s)
        knots = _knots(times_s, samples_per_knot)
        freedom = len(knots) - _DEGREE - 1
        curve = make_lsq_spline(times_s, values, knots, _DEGREE)
        squares = float(np.sum((values - curve(times_s)) ** 2))
        score = squares / (count - _DEGREES_OF_FREEDOM_WEIGHT * freedom) ** 2
        return score, cls(curve, np.sqrt(squares / (3 * (count - freedom))))

    def repeated(self, times_s: Float64, noise: Float64) -> BSpline:
        """Return the curve as it would have been fitted with other noise; the fit is linear in the data."""
        of_noise = make_lsq_spline(times_s, noise, self.curve.t, _DEGREE)
        return BSpline(self.curve.t, self.curve.c + of_noise.c, _DEGREE)


def _measure(
    times_s: Float64, values: Float64, *, speeds: _Speeds, noise: Callable[[Float64, np.random.Generator], Float64]
) -> Motion | None:
    if len(times_s) < _FEWEST_SAMPLES:
        return None
    fit = _best_fit(times_s, values)
    fitted = fit.curve(times_s)
    measured = _length_and_maximum(fit.curve, times_s, speeds)
    random = np.random.default_rng(0)
    repeated = np.array(
        [
            _length_and_maximum(fit.repeated(times_s, fit.sigma * noise(fitted, random)), times_s, speeds)
            for _ in range(_REPETITIONS)
        ]
    )
    excess = repeated.mean(axis=0) - measured
    corrected = np.maximum(measured - excess, 0.0)
    spread = np.sqrt(repeated.var(axis=0, ddof=1) + excess**2 + (_EVALUATION_ERROR * corrected) ** 2)
    length, speed_max = (Estimate(float(v), float(s)) for v, s in zip(corrected, spread, strict=True))
    return Motion(length, speed_max, fit.sigma, _knot_spacing_s(fit.curve))


def _best_fit(times_s: Float64, values: Float64) -> _Fit:
    widths = [m for m in _SAMPLES_PER_KNOT if _segments(len(times_s), m) + _DEGREE < 0.6 * len(times_s)]
    fits = [_Fit.to(times_s, values, width) for width in widths]
    return min(fits, key=lambda scored: scored[0])[1]


def _segments(count: int, samples_per_knot: int) -> int:
    return max(1, (count - 1) // samples_per_knot)


def _knots(times_s: Float64, samples_per_knot: int) -> Float64:
    """Place knots every so many samples, not seconds: each stretch between knots then holds data, gaps or none."""
    count = len(times_s)
    places = np.linspace(0, count - 1, _segments(count, samples_per_knot) + 1)[1:-1]
    inner = np.interp(places, np.arange(count), times_s)
    ends = [times_s[0]] * (_DEGREE + 1), [times_s[-1]] * (_DEGREE + 1)
    return np.concatenate([ends[0], inner, ends[1]])


def _knot_spacing_s(curve: BSpline) -> float:
    knots = curve.t[_DEGREE : len(curve.t) - _DEGREE]
    return float((knots[-1] - knots[0]) / (len(knots) - 1))


def _length_and_maximum(curve: BSpline, times_s: Float64, speeds: _Speeds) -> Float64:
    """Integrate by Gauss's two-point rule on each interval; the maximum is over the same points."""
    half = np.diff(times_s)[:, None] / 2
    points = ((times_s[1:] + times_s[:-1])[:, None] / 2 + half * _GAUSS_NODES).ravel()
    found = speeds(curve(points), curve.derivative()(points))
    return np.array([np.sum(found.reshape(-1, 2) * half), np.max(found)])


def _angular_speeds(q: Float64, rates: Float64) -> Float64:
    squared = np.sum(q**2, axis=1)
    across = rates - q * (np.sum(q * rates, axis=1) / squared)[:, None]
    return cast(Float64, 2.0 * np.linalg.norm(across, axis=1) / np.sqrt(squared))


def _of_one_sign(orientations_xyzw: Float64) -> Float64:
    """Return unit quaternions whose sign does not jump; q and -q are the same rotation."""
    q = orientations_xyzw / np.linalg.norm(orientations_xyzw, axis=1, keepdims=True)
    turns = np.sum(q[1:] * q[:-1], axis=1) < 0
    signs = np.concatenate([[1.0], np.where(np.cumsum(turns) % 2, -1.0, 1.0)]) if len(q) else np.empty(0)
    return cast(Float64, q * signs[:, None])


def _isotropic(fitted: Float64, random: np.random.Generator) -> Float64:
    return random.standard_normal(fitted.shape)


def _tangential(fitted: Float64, random: np.random.Generator) -> Float64:
    """Noise of a rotation moves a quaternion on its sphere, never along itself."""
    unit = fitted / np.linalg.norm(fitted, axis=1, keepdims=True)
    noise = random.standard_normal(fitted.shape)
    return cast(Float64, noise - unit * np.sum(unit * noise, axis=1, keepdims=True))
