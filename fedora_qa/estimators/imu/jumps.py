"""Jumps between the samples of a smooth motion, by the matched filter of a step.

The filter is exactly zero for polynomials up to a degree. What remains of the motion is bounded twice.

*Slow motion.* The same filter of a lower degree passes more of it, and the difference of the two is the bound. For a
vibration of frequency w the filter of degree 5 over eight samples on either side passes up to twice the difference,
from 0.14 w_s on, with w_s the sampling frequency: the difference is then no bound.

*Vibration.* Polynomial and step leave a residual of norm ``rho`` over the samples. A jump in the middle adds nothing to
it, as the fit has a step there. For a sinusoid of unit amplitude with phase p, the size is ``H(w) sin p``, and
``rho^2 = a(w)^2 sin^2 p + b(w)^2 cos^2 p >= a(w)^2 sin^2 p``: only the part that is odd about the middle contributes to
the size. Hence ``|size| <= K rho`` with ``K = max_w H(w) / a(w)``, which is between 0.9 and 3 for the filters in use.

A spike or a part of another shape leaves a residual as well, but at one place; a vibration leaves it at all places
nearby. Therefore ``rho`` counts only where its lower quartile over the places nearby exceeds noise, and up to a
multiple of that quartile. An order statistic as the level of interference beside a target: H. Rohling, Radar CFAR
thresholding in clutter and multiple target situations, IEEE Trans. AES-19 (1983) 608.

Above 0.3 w_s a vibration is noise: the differences of neighbours that measure the noise do not distinguish them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.special import chdtri

from fedora_qa.estimators.imu.sampled_curves import (
    SampledCurve,
    VectorSamples,
    are_evenly_spaced,
    offsets_us_of,
    patterns_of,
    stencils_of,
    weighted_neighbours,
)

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Indices = NDArray[np.intp]

_BEYOND_NOISE_SIGMAS: Final = 5.0
"""Difference of filters of two degrees, in standard errors, above which the motion causes it and not noise."""

_HIGHEST_CYCLES: Final = 0.3
"""Highest frequency of a vibration that is not noise, cycles a sample."""

_FREQUENCIES: Final = 256

_NEARBY_REACHES: Final = 3
"""Distance, in reaches of the filter, of the places whose residuals give the level of a vibration. A spike has a
residual at two of these six reaches, so that two spikes leave a third without."""

_LEVEL_PERCENT: Final = 25

_NOISE_PROBABILITY: Final = 0.01
"""Probability with which the residual of noise exceeds its limit at a place. The lower quartile exceeds it only if it
does so at three of the three independent places nearby: once in a million."""

_ABOVE_LEVEL: Final = 3.7
"""Largest ratio of the residual of a vibration to its lower quartile over the places nearby: 1 / sin(22.5 deg) by the
phase, of which sin^2 is below its quartile, times sqrt(2) by the beat of two sinusoids."""


@dataclass(frozen=True, slots=True)
class StepEstimates:
    """Estimated jumps between neighbouring samples.

    Attributes
    ----------
    before
        (n,) index of the sample before each estimated jump.
    sizes
        (n, 3) jump of all later samples, on each axis, in the unit of the curve.
    gains
        (n,) standard deviation of a size for white noise of standard deviation 1.
    motion
        (n,) part of a size on any axis that the motion may have added, in the unit of the curve.
    reach
        Number of samples on either side of a jump that its size is estimated from.
    """

    before: Indices
    sizes: Float64
    gains: Float64
    motion: Float64
    reach: int


def find_steps(times_ns: Int64, curve: SampledCurve, *, half_width: int, degree: int, sigma: float) -> StepEstimates:
    """Estimate the jump between each sample and the next with the matched filter of a step.

    The estimate is the least-squares fit of a polynomial plus a step. The same fit with a degree less by two passes
    more of the motion. Where the two differ by more than noise explains, anywhere within reach of the filter, the
    difference bounds the part of the motion. Where the residuals of the fit exceed noise at three quarters of the
    places nearby, they bound the part of a vibration.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, strictly increasing.
    curve
        The N samples.
    half_width
        Number of samples on either side that a size is estimated from.
    degree
        Of the polynomial.
    sigma
        Standard deviation of white noise of a sample, in the unit of the curve.

    Returns
    -------
    StepEstimates
        One for each pair of neighbours with ``half_width`` samples on either side and no gap among them.
    """
    size, centre = 2 * half_width, half_width - 1
    if are_evenly_spaced(times_ns, size):
        before = np.arange(len(times_ns) - size + 1) + centre
        patterns, pattern_of_row = offsets_us_of(times_ns[None, :size]), np.zeros(len(before), dtype=np.intp)
        weights, lower_weights = _step_weights(patterns, degree), _step_weights(patterns, degree - 2)
        sizes, lower_sizes = weighted_neighbours(curve, np.concatenate((weights, lower_weights)), centre, len(before))
        largest = _largest_step(before, sizes, len(times_ns))
        basis_of_residuals = null_space(_polynomial_and_step(patterns, degree)[0].T).T
        residuals, of_largest = (
            weighted_neighbours(each, basis_of_residuals, centre, len(before)) for each in (curve, largest)
        )
        squares = ((residuals - of_largest) ** 2).sum(axis=0)
    else:
        stencils = stencils_of(times_ns, size)
        before, vectors = stencils[:, centre], curve.relative_vectors(stencils, centre)
        patterns, pattern_of_row = patterns_of(times_ns, stencils)
        weights, lower_weights = _step_weights(patterns, degree), _step_weights(patterns, degree - 2)
        sizes = np.einsum("nm,nmi->ni", weights[pattern_of_row], vectors)
        lower_sizes = np.einsum("nm,nmi->ni", lower_weights[pattern_of_row], vectors)
        basis = np.linalg.qr(_polynomial_and_step(patterns, degree))[0][pattern_of_row]
        vectors = vectors - _largest_step(before, sizes, len(times_ns)).relative_vectors(stencils, centre)
        squares = ((vectors - basis @ (basis.swapaxes(-1, -2) @ vectors)) ** 2).sum(axis=1)
    # The gain of a linear filter for white noise is the length of its weights.
    gains = np.linalg.norm(weights, axis=-1)[pattern_of_row]
    difference_gains = np.linalg.norm(weights - lower_weights, axis=-1)[pattern_of_row]
    motion = np.abs(sizes - lower_sizes).max(axis=-1, initial=0.0)
    beyond_noise = np.where(motion > _BEYOND_NOISE_SIGMAS * sigma * difference_gains, motion, 0.0)
    from scipy.ndimage import maximum_filter1d  # noqa: PLC0415 - slow to load, and only poses and the IMU need it

    slow = maximum_filter1d(beyond_noise, 2 * half_width + 1, mode="nearest") if len(before) else beyond_noise
    vibration = _bound_of_vibration(squares, half_width=half_width, degree=degree, sigma=sigma)
    return StepEstimates(before, sizes, gains, np.maximum(slow, vibration), half_width)


def _largest_step(before: Indices, sizes: Float64, count: int) -> VectorSamples:
    """Return samples (count) that are 0 up to the largest of the jumps and equal to its size from there on."""
    if not len(before):
        return VectorSamples(np.zeros((count, 3)))
    largest = int(np.argmax(np.abs(sizes).max(axis=-1)))
    return VectorSamples(np.where(np.arange(count)[:, None] > before[largest], sizes[largest], 0.0))


def _bound_of_vibration(squared_residuals: Float64, *, half_width: int, degree: int, sigma: float) -> Float64:
    """Return the part (n,) of sizes that a vibration may have added on any axis.

    ``squared_residuals`` are (n, 3) sums of squares over the samples around each place.
    """
    from scipy.ndimage import percentile_filter  # noqa: PLC0415 - as above

    if not len(squared_residuals):
        return np.zeros(0)
    # For white noise the sum of squares is sigma^2 times chi-square of this many degrees of freedom.
    of_noise = sigma**2 * float(chdtri(2 * half_width - degree - 2, _NOISE_PROBABILITY))
    size = 2 * _NEARBY_REACHES * half_width + 1
    # An axis at a time: the filter of one dimension is faster.
    level = np.stack(
        [percentile_filter(axis, _LEVEL_PERCENT, size=size, mode="mirror") for axis in squared_residuals.T], axis=-1
    )
    of_vibration = np.where(level > of_noise, np.minimum(squared_residuals, _ABOVE_LEVEL**2 * level), 0.0)
    bound: Float64 = _size_to_residual(half_width, degree) * np.sqrt(of_vibration.max(axis=-1))
    return bound


@cache
def _size_to_residual(half_width: int, degree: int) -> float:
    """Return the largest ratio K of size to norm of residuals for sinusoids; 0 for a fit without odd residuals."""
    # Odd functions over the samples less the odd powers and the step.
    if half_width - (degree + 1) // 2 - 1 < 1:
        return 0.0
    offsets_us = np.arange(2 * half_width)[None]
    places = offsets_us[0] - (half_width - 0.5)
    # Slower ones than half a cycle over the samples have the ratio of the next odd power, which is not the largest.
    cycles = np.linspace(0.25 / half_width, _HIGHEST_CYCLES, _FREQUENCIES)
    sinusoids = np.sin(2 * np.pi * places[:, None] * cycles)
    sizes = _step_weights(offsets_us, degree)[0] @ sinusoids
    residuals = null_space(_polynomial_and_step(offsets_us, degree)[0].T).T @ sinusoids
    return float(np.max(np.abs(sizes) / np.linalg.norm(residuals, axis=0)))


def most_precise_steps(candidates: Sequence[StepEstimates], sigma: float) -> StepEstimates:
    """Return the candidate with the least error: 90th percentile of six standard errors plus the part of the motion.

    Parameters
    ----------
    candidates
        Steps estimated with different filters; at least one.
    sigma
        Standard deviation of white noise of a sample, in the unit of the curve.

    Returns
    -------
    StepEstimates
        One of the candidates. A candidate without any step is returned only if all have none.
    """

    def error(steps: StepEstimates) -> float:
        return float(np.quantile(steps.motion + 6.0 * sigma * steps.gains, 0.9)) if len(steps.before) else np.inf

    return min(candidates, key=error)


def _step_weights(offsets_us: Int64, degree: int) -> Float64:
    """Return the weights (n, m) that give the size of a step in the middle, fitted together with a polynomial."""
    # The last row of the pseudoinverse is the linear estimate of the last unknown, the step.
    weights: Float64 = np.linalg.pinv(_polynomial_and_step(offsets_us, degree)).astype(np.float64)[:, -1, :]
    return weights


def _polynomial_and_step(offsets_us: Int64, degree: int) -> Float64:
    """Return the powers of the time and the step in the middle (n, m, degree + 2), each about 1 at the ends."""
    count, samples = offsets_us.shape
    middle = (offsets_us[:, samples // 2 - 1, None] + offsets_us[:, samples // 2, None]) / 2
    scaled = (offsets_us - middle) / max(1.0, float(np.abs(offsets_us).max(initial=1)))
    step = np.broadcast_to(np.arange(samples) >= samples // 2, (count, samples)).astype(np.float64)
    return np.concatenate((scaled[..., None] ** np.arange(degree + 1), step[..., None]), axis=-1)
