"""White noise and jumps of samples of a smooth motion, from each sample's neighbours.

Everything here is a short linear filter that gives exactly zero for polynomials up to a degree, so that smooth motion
vanishes whatever its speed, for even and for uneven stamps. What the motion still leaves is not guessed: the same
filter of a lower degree lets more of it through, and the difference of the two bounds it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import comb
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from fedora_qa.geometry import so3

Float64 = NDArray[np.float64]
Indices = NDArray[np.intp]

_WIDEST_STEP: Final = 1.5
"""Stencils with a step wider than so many median steps are left out: something is missing there."""

_NS_PER_US: Final = 1_000
_SHARE_BELOW: Final = 0.9
_SIGMAS_BELOW: Final = 1.644854
"""Nine in ten normal values are smaller. One in ten may be spoilt by jumps without moving the estimate far."""
_QUANTILE_COST: Final = 1.25
"""Standard error of a sigma from this quantile over that from the mean square, for normal values."""
_FAR_OUT: Final = 5.0


class Curve(Protocol):
    """Samples of a motion, seen as vectors from one of them, between which differences mean something."""

    def seen(self, stencils: Indices, centre: int) -> Float64:
        """Return the vectors (n, m, 3) of the samples ``stencils`` (n, m), relative to column ``centre``."""
        ...

    def apart(self, steps: int) -> Float64:
        """Return the vectors (N - steps, 3) from each sample to the one so many after it; the way back is minus it."""
        ...


@dataclass(frozen=True, slots=True)
class Vectors:
    """Samples (N, 3) of a space where differences are plain."""

    values: Float64

    def seen(self, stencils: Indices, centre: int) -> Float64:
        """Return differences from the centre."""
        return self.values[stencils] - self.values[stencils[:, centre, None]]

    def apart(self, steps: int) -> Float64:
        """Return differences."""
        return self.values[steps:] - self.values[:-steps]


@dataclass(frozen=True, slots=True)
class Orientations:
    """Quaternions (N, 4) x, y, z, w, of any nonzero length."""

    orientations_xyzw: Float64
    _apart: dict[int, Float64] = field(default_factory=dict, compare=False, repr=False)

    def seen(self, stencils: Indices, centre: int) -> Float64:
        """Return the rotation vectors ``Log(q_centre^-1 q)``, rad, in the frame of the centre."""
        q = self.orientations_xyzw
        return so3.log_quaternion(so3.compose(so3.inverse(q[stencils[:, centre]])[:, None], q[stencils]))

    def apart(self, steps: int) -> Float64:
        """Return the rotation vectors ``Log(q_i^-1 q_i+steps)``, rad; computed once."""
        if steps not in self._apart:
            q = self.orientations_xyzw
            self._apart[steps] = so3.log_quaternion(so3.compose(so3.inverse(q[:-steps]), q[steps:]))
        return self._apart[steps]


@dataclass(frozen=True, slots=True)
class NoiseLevel:
    """Standard deviation of white noise on each axis of each sample.

    Attributes
    ----------
    sigma, standard_error
        As measured, and its error if it is noise.
    motion
        What the motion may have added to sigma.
    count
        Number of differences that it rests on, three axes each.
    """

    sigma: float
    standard_error: float
    motion: float
    count: int


@dataclass(frozen=True, slots=True)
class Steps:
    """Estimated jumps between neighbouring samples.

    Attributes
    ----------
    before
        (n,) index of the sample before each place that was tested.
    sizes
        (n, 3) jump of all that follows, on each axis.
    gains
        (n,) standard deviation of a size for white noise of 1.
    motion
        (n,) what the motion may have added to a size, each axis.
    reach
        Samples on either side of a place that its size rests on.
    """

    before: Indices
    sizes: Float64
    gains: Float64
    motion: Float64
    reach: int


def noise_level(times_ns: NDArray[np.int64], curve: Curve, *, order: int) -> NoiseLevel | None:
    """Measure white noise by divided differences of an order, scaled to unit noise gain.

    Neighbouring differences correlate; for even stamps the variance of their mean square is
    ``sum_j (C(2d, d + j) / C(2d, d))^2 = C(4d, 2d) / C(2d, d)^2`` times that of independent ones. The motion's share
    is what two orders more take away.
    Sigma comes from the 90% quantile, so that a few jumps do not raise it. None where there are too few samples.
    """
    found = divided_differences(times_ns, curve, order)
    higher = divided_differences(times_ns, curve, order + 2)
    if len(found) < order or len(higher) < order:
        return None
    sigma = _sigma(found)
    correlation = comb(4 * order, 2 * order) / comb(2 * order, order) ** 2
    return NoiseLevel(
        sigma=sigma,
        standard_error=sigma * _QUANTILE_COST * float(np.sqrt(correlation / (2 * found.size))),
        motion=max(0.0, sigma - _sigma(higher)),
        count=len(found),
    )


def find_steps(times_ns: NDArray[np.int64], curve: Curve, *, half_width: int, degree: int, sigma: float) -> Steps:
    """Estimate at every place the jump between a sample and the next: the matched filter of a step.

    Least squares of a polynomial of ``degree`` plus a step, over ``half_width`` samples on either side. The same with
    a degree less by two lets more motion through: where the two differ by more than noise of ``sigma`` can, anywhere
    within reach of the filter, that is the bound.
    """
    before, sizes, looser_sizes, gains, difference_gains = _step_sizes(times_ns, curve, half_width, degree)
    motion = np.abs(sizes - looser_sizes).max(axis=-1, initial=0.0)
    beyond_noise = np.where(motion > _FAR_OUT * sigma * difference_gains, motion, 0.0)
    nearby = maximum_filter1d(beyond_noise, 2 * half_width + 1, mode="nearest") if len(before) else beyond_noise
    return Steps(before, sizes, gains, nearby, half_width)


def _step_sizes(
    times_ns: NDArray[np.int64], curve: Curve, half_width: int, degree: int
) -> tuple[Indices, Float64, Float64, Float64, Float64]:
    """Return the sample before each place, the jump there, that of a lower degree, its gain, and that of both apart."""
    size, centre = 2 * half_width, half_width - 1
    if _are_even(times_ns, size):
        before = np.arange(len(times_ns) - size + 1) + centre
        patterns, which = _offsets_us(times_ns[None, :size]), np.zeros(len(before), dtype=np.intp)
        tight, loose = _step_weights(patterns, degree), _step_weights(patterns, degree - 2)
        sizes, looser = _weighted_neighbours(curve, np.concatenate((tight, loose)), centre, len(before))
    else:
        stencils = _stencils(times_ns, size)
        before, seen = stencils[:, centre], curve.seen(stencils, centre)
        patterns, which = _patterns(times_ns, stencils)
        tight, loose = _step_weights(patterns, degree), _step_weights(patterns, degree - 2)
        sizes = np.einsum("nm,nmi->ni", tight[which], seen)
        looser = np.einsum("nm,nmi->ni", loose[which], seen)
    gains, apart = np.linalg.norm(tight, axis=-1), np.linalg.norm(tight - loose, axis=-1)
    return before, sizes, looser, gains[which], apart[which]


def _step_weights(offsets_us: NDArray[np.int64], degree: int) -> Float64:
    """Return the weights (n, m) of the least-squares size of a step in the middle, beside a polynomial."""
    count, samples = offsets_us.shape
    middle = (offsets_us[:, samples // 2 - 1, None] + offsets_us[:, samples // 2, None]) / 2
    scaled = (offsets_us - middle) / max(1.0, float(np.abs(offsets_us).max(initial=1)))
    step = np.broadcast_to(np.arange(samples) >= samples // 2, (count, samples)).astype(np.float64)
    design = np.concatenate((scaled[..., None] ** np.arange(degree + 1), step[..., None]), axis=-1)
    weights: Float64 = np.linalg.pinv(design).astype(np.float64)[:, -1, :]
    return weights


def divided_differences(times_ns: NDArray[np.int64], curve: Curve, order: int) -> Float64:
    """Return the divided differences (n, 3) of an order, scaled such that unit white noise comes out as unit noise."""
    centre = order // 2
    if _are_even(times_ns, order + 1):
        weights = _difference_weights(_offsets_us(times_ns[None, : order + 1]))
        alike: Float64 = _weighted_neighbours(curve, weights, centre, len(times_ns) - order)[0]
        return alike
    stencils = _stencils(times_ns, order + 1)
    patterns, which = _patterns(times_ns, stencils)
    found: Float64 = np.einsum("nm,nmi->ni", _difference_weights(patterns)[which], curve.seen(stencils, centre))
    return found


def _are_even(times_ns: NDArray[np.int64], size: int) -> bool:
    """Whether all steps are alike, so that all runs of neighbours of this size have one pattern."""
    steps_ns = np.diff(times_ns)
    return len(times_ns) >= size and int(steps_ns.min()) == int(steps_ns.max())


def _weighted_neighbours(curve: Curve, weights: Float64, centre: int, count: int) -> Float64:
    """Return (k, n, 3) sums, weighted by (k, m), over the first ``count`` runs of neighbours seen from ``centre``."""
    sums = np.zeros((len(weights), count, 3))
    for column, weight in enumerate(weights.T):
        steps = column - centre
        if steps:
            first, sign = (centre, 1.0) if steps > 0 else (column, -1.0)
            sums += (sign * weight)[:, None, None] * curve.apart(abs(steps))[first : first + count]
    return sums


def _difference_weights(offsets_us: NDArray[np.int64]) -> Float64:
    """Return the weights (n, m) of divided differences, 1 / prod_j (t_i - t_j), of unit length."""
    reach = np.maximum(offsets_us.max(axis=-1, keepdims=True), 1) / 2  # keeps products near 1
    offsets = offsets_us / reach
    weights = np.ones_like(offsets)
    for node in range(offsets.shape[-1]):
        gaps = offsets[:, node, None] - offsets
        gaps[:, node] = 1.0
        weights[:, node] = 1.0 / np.prod(gaps, axis=-1)
    unit: Float64 = weights / np.linalg.norm(weights, axis=-1, keepdims=True)
    return unit


def _stencils(times_ns: NDArray[np.int64], size: int) -> Indices:
    """Return runs of neighbours (n, size) without a gap among them."""
    count = len(times_ns) - size + 1
    if count < 1:
        return np.empty((0, size), dtype=np.intp)
    stencils: Indices = np.arange(count)[:, None] + np.arange(size)
    steps_ns = np.diff(times_ns)
    whole = (steps_ns[stencils[:, :-1]] <= _WIDEST_STEP * float(np.median(steps_ns))).all(axis=1)
    chosen: Indices = stencils[whole]
    return chosen


def _patterns(times_ns: NDArray[np.int64], stencils: Indices) -> tuple[NDArray[np.int64], Indices]:
    """Return the distinct patterns of offsets (p, m), whole microseconds, and which one each stencil has."""
    offsets_us = _offsets_us(times_ns[stencils])
    if len(offsets_us) and np.array_equal(offsets_us.min(axis=0), offsets_us.max(axis=0)):
        return offsets_us[:1], np.zeros(len(stencils), dtype=np.intp)
    patterns, which = np.unique(offsets_us, axis=0, return_inverse=True)
    return patterns, which.reshape(-1)


def _offsets_us(times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the offsets (n, m) of stamps (n, m) from the first of each row, in whole microseconds."""
    offsets_us: NDArray[np.int64] = (times_ns - times_ns[:, :1] + _NS_PER_US // 2) // _NS_PER_US
    return offsets_us


def _sigma(values: Float64) -> float:
    """Return the standard deviation of normal values from the size that nine in ten stay below."""
    return float(np.quantile(np.abs(values), _SHARE_BELOW)) / _SIGMAS_BELOW if values.size else 0.0


def sharpest(candidates: Sequence[Steps], sigma: float) -> Steps:
    """Return the steps with the least error at their 90th percentile, six standard errors and the motion's share."""

    def error(steps: Steps) -> float:
        return float(np.quantile(steps.motion + 6.0 * sigma * steps.gains, 0.9)) if len(steps.before) else np.inf

    return min(candidates, key=error)
