"""Jumps between the samples of a smooth motion, by the matched filter of a step.

The filter is exactly zero for polynomials up to a degree. What remains of the motion is bounded: the same filter of a
lower degree passes more of it, and the difference of the two is the bound.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.imu.sampled_curves import (
    SampledCurve,
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
    difference bounds the part of the motion.

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
    else:
        stencils = stencils_of(times_ns, size)
        before, vectors = stencils[:, centre], curve.relative_vectors(stencils, centre)
        patterns, pattern_of_row = patterns_of(times_ns, stencils)
        weights, lower_weights = _step_weights(patterns, degree), _step_weights(patterns, degree - 2)
        sizes = np.einsum("nm,nmi->ni", weights[pattern_of_row], vectors)
        lower_sizes = np.einsum("nm,nmi->ni", lower_weights[pattern_of_row], vectors)
    # The gain of a linear filter for white noise is the length of its weights.
    gains = np.linalg.norm(weights, axis=-1)[pattern_of_row]
    difference_gains = np.linalg.norm(weights - lower_weights, axis=-1)[pattern_of_row]
    motion = np.abs(sizes - lower_sizes).max(axis=-1, initial=0.0)
    beyond_noise = np.where(motion > _BEYOND_NOISE_SIGMAS * sigma * difference_gains, motion, 0.0)
    from scipy.ndimage import maximum_filter1d  # noqa: PLC0415 - slow to load, and only poses and the IMU need it

    nearby = maximum_filter1d(beyond_noise, 2 * half_width + 1, mode="nearest") if len(before) else beyond_noise
    return StepEstimates(before, sizes, gains, nearby, half_width)


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
    count, samples = offsets_us.shape
    middle = (offsets_us[:, samples // 2 - 1, None] + offsets_us[:, samples // 2, None]) / 2
    scaled = (offsets_us - middle) / max(1.0, float(np.abs(offsets_us).max(initial=1)))
    step = np.broadcast_to(np.arange(samples) >= samples // 2, (count, samples)).astype(np.float64)
    design = np.concatenate((scaled[..., None] ** np.arange(degree + 1), step[..., None]), axis=-1)
    # The last row of the pseudoinverse is the linear estimate of the last unknown, the step.
    weights: Float64 = np.linalg.pinv(design).astype(np.float64)[:, -1, :]
    return weights
