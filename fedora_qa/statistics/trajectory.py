"""Distance and greatest speeds, from poses that may be noisy.

Summing the steps between noisy 200 Hz poses measures the noise: 5 mm add some 2 m of path a second. Here least-squares
quintic splines are fitted to segments of 2 s, each with a margin of 0.5 s on both sides, and their derivatives are
measured. The spacing of the knots decides how much is smoothed. It is chosen for each segment by generalised
cross-validation (Craven and Wahba 1979) with the degrees of freedom weighted by 1.4 against too fine a choice (Kim and
Gu 2004). So exact poses have a knot every second sample, noisy poses have as few knots as the motion allows, and a
single fast turn in a long quiet flight is not smoothed away.

Lengths and maxima of a noisy curve are still too large. A parametric bootstrap estimates the excess and its spread
(Efron and Tibshirani 1993, ch. 6): white noise of the fitted size is added to the fitted curves, fitted with the same
knots and measured again. The mean excess is subtracted; the standard error includes the spread, the whole excess, and
the change by twice as many knots, which is the part that smoothing may have removed.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Final, Self, cast

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

Float64 = NDArray[np.float64]

_DEGREE: Final = 5
_SAMPLES_PER_KNOT: Final = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256, 384)
_DEGREES_OF_FREEDOM_WEIGHT: Final = 1.4
_LARGEST_FREEDOM: Final = 0.6
"""Largest number of degrees of freedom per sample: with more, too few residuals remain to separate noise from
motion."""
_SEGMENT_SAMPLES: Final = 400
_MARGIN_SAMPLES: Final = 100
_REPETITIONS: Final = 24
_FEWEST_SAMPLES: Final = 16
_EVALUATION_ERROR: Final = 1e-5
"""Relative error of measuring the curve at three points an interval, for motion slower than 5 Hz at 200 samples/s."""
# Gauss-Legendre of two points on [-1, 1]: weights 1, exact for cubics.
_GAUSS_NODES: Final = np.array([-1.0, 1.0]) / np.sqrt(3.0)

_Speeds = Callable[[Float64, Float64], Float64]
"""Turns values and rates of change (..., d) into speeds (...)."""
_Noise = Callable[[Float64, np.random.Generator], Float64]
"""Draws noise of unit size about fitted values (n, r, d), independent in each."""


@dataclass(frozen=True, slots=True)
class CurveEstimate:
    """A value and its standard error.

    Attributes
    ----------
    value
        In the unit of the quantity.
    standard_error
        In the same unit.
    """

    value: float
    standard_error: float


@dataclass(frozen=True, slots=True)
class CurveMotion:
    """Length, greatest speed and noise of a curve.

    Attributes
    ----------
    length
        Integral of the speed over time.
    speed_max
        Greatest speed.
    noise
        Standard deviation of the samples about the curve, each axis.
    knot_spacing_s
        Mean distance of the knots, s: shorter motion is smoothed away.
    """

    length: CurveEstimate
    speed_max: CurveEstimate
    noise: float
    knot_spacing_s: float


def translation(times_s: Float64, positions_m: Float64) -> CurveMotion | None:
    """Estimate distance and greatest speed from positions.

    Parameters
    ----------
    times_s
        (n,) increasing.
    positions_m
        (n, 3) in the world.

    Returns
    -------
    CurveMotion | None
        Length in m, speed in m/s, noise in m on each axis; None where there are too few samples.
    """
    return _measure(times_s, positions_m, speeds=lambda _, rates: np.linalg.norm(rates, axis=-1), noise=_isotropic)


def rotation(times_s: Float64, orientations_xyzw: Float64) -> CurveMotion | None:
    """Estimate the angle turned and the greatest angular speed from orientations.

    The spline is fitted to the components of the quaternions. The angular velocity of its curve on the unit sphere is 2
    Im(q* dq/dt) / |q|^2, which a change of the length of q does not affect.

    Parameters
    ----------
    times_s
        (n,) increasing.
    orientations_xyzw
        (n, 4) quaternions of either sign, body to world.

    Returns
    -------
    CurveMotion | None
        Length in rad, speed in rad/s, noise in rad on each axis; None where there are too few samples.
    """
    q = orientations_xyzw / np.linalg.norm(orientations_xyzw, axis=1, keepdims=True)
    # q and -q are the same rotation. A negative dot product is a jump from q to -q; after an odd number of such jumps
    # the sign is turned back.
    turns = np.sum(q[1:] * q[:-1], axis=1) < 0
    signs = np.concatenate([[1.0], np.where(np.cumsum(turns) % 2, -1.0, 1.0)]) if len(q) else np.empty(0)
    motion = _measure(times_s, q * signs[:, None], speeds=_angular_speeds, noise=_tangential)
    if motion is None:
        return None
    return CurveMotion(motion.length, motion.speed_max, 2.0 * motion.noise, motion.knot_spacing_s)  # half angles in q


def velocities(times_s: Float64, positions_m: Float64) -> Float64 | None:
    """Return the velocities of the smooth curve through the positions.

    Parameters
    ----------
    times_s
        (n,) increasing.
    positions_m
        (n, 3) in the world.
    """
    if len(times_s) < _FEWEST_SAMPLES:
        return None
    fits = [_SegmentFit.best_to(segment) for segment in _segments(times_s, positions_m)]
    rates = [fit.curve.derivative()(fit.segment.core_times_s) for fit in fits]
    inner = [segment_rates[:-1] for segment_rates in rates[:-1]]  # segments share the samples where they meet
    return np.concatenate([*inner, rates[-1]])


@dataclass(frozen=True, slots=True)
class _Segment:
    """Samples of a segment with its margins, and the timestamps of the segment itself, both ends among them."""

    times_s: Float64
    values: Float64
    core_times_s: Float64


@dataclass(frozen=True, slots=True)
class _SegmentFit:
    """A spline through a segment, and the standard deviation of each of three axes about it."""

    segment: _Segment
    curve: "BSpline"
    pieces: int
    sigma: float
    score: float
    """Generalised cross-validation; smaller is better."""

    @classmethod
    def to(cls, segment: _Segment, pieces: int) -> Self:
        """Fit a spline; its pieces hold equally many samples, so that none is empty where samples are missing."""
        from scipy.interpolate import make_lsq_spline  # noqa: PLC0415 - slow to load, and only poses need it

        times_s, count = segment.times_s, len(segment.times_s)
        inner = np.interp(np.linspace(0, count - 1, pieces + 1)[1:-1], np.arange(count), times_s)
        # End knots degree + 1 times: the spline ends at its first and last sample.
        knots = np.concatenate([[times_s[0]] * (_DEGREE + 1), inner, [times_s[-1]] * (_DEGREE + 1)])
        curve = make_lsq_spline(times_s, segment.values, knots, _DEGREE)
        # Number of coefficients of a B-spline of this many pieces.
        freedom = pieces + _DEGREE
        squares = float(np.sum((segment.values - curve(times_s)) ** 2))
        # Residuals have three axes: those of a unit quaternion lie across it, in three of its four dimensions.
        sigma = float(np.sqrt(squares / (3 * (count - freedom))))
        # GCV up to a constant: RSS / (n - 1.4 freedom)^2 (Craven and Wahba 1979; weight 1.4 of Kim and Gu 2004).
        return cls(segment, curve, pieces, sigma, squares / (count - _DEGREES_OF_FREEDOM_WEIGHT * freedom) ** 2)

    @classmethod
    def best_to(cls, segment: _Segment) -> Self:
        """Fit with the number of pieces that cross-validation prefers."""
        numbers = sorted({max(1, (len(segment.times_s) - 1) // width) for width in _SAMPLES_PER_KNOT})
        return min((cls.to(segment, n) for n in numbers if _allowed(segment, n)), key=lambda fit: fit.score)

    def finer(self) -> Self:
        """Return the fit with twice the pieces, or this fit where that leaves too few residuals."""
        return self.to(self.segment, 2 * self.pieces) if _allowed(self.segment, 2 * self.pieces) else self

    def repeated(self, noise: _Noise, random: np.random.Generator) -> "BSpline":
        """Return the curves (repetitions, d) fitted with other noise; the fit is linear in the data."""
        from scipy.interpolate import BSpline, make_lsq_spline  # noqa: PLC0415 - slow to load, and only poses need it

        times_s = self.segment.times_s
        fitted = np.repeat(self.curve(times_s)[:, None], _REPETITIONS, axis=1)
        of_noise = make_lsq_spline(times_s, self.sigma * noise(fitted, random), self.curve.t, _DEGREE)
        return BSpline(self.curve.t, self.curve.c[:, None] + of_noise.c, _DEGREE)


def _allowed(segment: _Segment, pieces: int) -> bool:
    return pieces + _DEGREE < _LARGEST_FREEDOM * len(segment.times_s)


def _measure(times_s: Float64, values: Float64, *, speeds: _Speeds, noise: _Noise) -> CurveMotion | None:
    if len(times_s) < _FEWEST_SAMPLES:
        return None
    fits = [_SegmentFit.best_to(segment) for segment in _segments(times_s, values)]
    measured, spread = _without_noise(fits, speeds, noise)
    finer, _ = _without_noise([fit.finer() for fit in fits], speeds, noise)
    # The errors of the module's docstring (spread holds the excess), and that of evaluating the curve.
    errors = np.sqrt(spread**2 + (finer - measured) ** 2 + (_EVALUATION_ERROR * measured) ** 2)
    length, speed_max = (CurveEstimate(float(v), float(s)) for v, s in zip(measured, errors, strict=True))
    fitted_s = sum(fit.segment.times_s[-1] - fit.segment.times_s[0] for fit in fits)
    return CurveMotion(
        length,
        speed_max,
        noise=float(np.sqrt(np.mean([fit.sigma**2 for fit in fits]))),
        knot_spacing_s=float(fitted_s / sum(fit.pieces for fit in fits)),
    )


def _segments(times_s: Float64, values: Float64) -> list[_Segment]:
    last = len(times_s) - 1
    edges = np.linspace(0, last, max(1, round(last / _SEGMENT_SAMPLES)) + 1).astype(int)
    cut = []
    for start, stop in pairwise(edges):
        with_margins = slice(max(start - _MARGIN_SAMPLES, 0), stop + _MARGIN_SAMPLES + 1)
        cut.append(_Segment(times_s[with_margins], values[with_margins], times_s[start : stop + 1]))
    return cut


def _without_noise(fits: Sequence[_SegmentFit], speeds: _Speeds, noise: _Noise) -> tuple[Float64, Float64]:
    """Return length and maximum (2,) less the excess by noise, and their errors (2,)."""
    measured = _length_and_maximum(fits, [fit.curve for fit in fits], speeds)
    # A fixed seed: the record of a file must not depend on the run.
    random = np.random.default_rng(0)
    repeated = _length_and_maximum(fits, [fit.repeated(noise, random) for fit in fits], speeds)
    excess = repeated.mean(axis=1) - measured
    return np.maximum(measured - excess, 0.0), np.sqrt(repeated.var(axis=1, ddof=1) + excess**2)


def _length_and_maximum(fits: Sequence[_SegmentFit], curves: "Sequence[BSpline]", speeds: _Speeds) -> Float64:
    """Return length and greatest speed, (2,), or (2, repetitions) where the curves are repeated.

    Integrates by Gauss's two-point rule on each interval; the maximum is over its points and the samples.
    """
    lengths, maxima = [], []
    for fit, curve in zip(fits, curves, strict=True):
        times_s, rates = fit.segment.core_times_s, curve.derivative()
        half = np.diff(times_s)[:, None] / 2
        points = ((times_s[1:] + times_s[:-1])[:, None] / 2 + half * _GAUSS_NODES).ravel()
        between, at_samples = (speeds(curve(t), rates(t)) for t in (points, times_s))
        lengths.append(np.tensordot(np.repeat(half, 2), between, axes=1))
        maxima.append(np.maximum(between.max(axis=0), at_samples.max(axis=0)))
    return np.array([np.sum(lengths, axis=0), np.max(maxima, axis=0)])


def _angular_speeds(q: Float64, rates: Float64) -> Float64:
    squared = np.sum(q**2, axis=-1)
    # Only the part of dq/dt across q is a rotation: omega = 2 |across| / |q|.
    across = rates - q * (np.sum(q * rates, axis=-1) / squared)[..., None]
    return cast(Float64, 2.0 * np.linalg.norm(across, axis=-1) / np.sqrt(squared))


def _isotropic(fitted: Float64, random: np.random.Generator) -> Float64:
    return random.standard_normal(fitted.shape)


def _tangential(fitted: Float64, random: np.random.Generator) -> Float64:
    """Return noise of unit size across the quaternions: noise of a rotation does not change their length."""
    unit = fitted / np.linalg.norm(fitted, axis=-1, keepdims=True)
    noise = random.standard_normal(fitted.shape)
    return cast(Float64, noise - unit * np.sum(unit * noise, axis=-1, keepdims=True))
