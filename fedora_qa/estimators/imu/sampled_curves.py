"""Samples of a motion, their neighbours in time, and divided differences of these.

Divided differences are short linear filters that are exactly zero for polynomials up to a degree. A smooth motion
therefore vanishes at any speed, for even and for uneven timestamps.
"""

from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_qa.geometry import so3

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Indices = NDArray[np.intp]

_WIDEST_STEP: Final = 1.5
"""Stencils with a step wider than this many median steps are left out, as samples are missing there."""

_BLOCK: Final = 4096
"""Number of runs of neighbours that are weighted at once: their vectors fit into a few MB."""

_NS_PER_US: Final = 1_000


class SampledCurve(Protocol):
    """Samples (N) of a motion, given by vectors from one sample to another."""

    def relative_vectors(self, stencils: Indices, centre: int) -> Float64:
        """Return the vectors of samples relative to one sample of each stencil.

        Parameters
        ----------
        stencils
            (n, m) indices of samples.
        centre
            Column of ``stencils`` that holds the reference sample.

        Returns
        -------
        ndarray of float64
            (n, m, 3) in the unit of the curve.
        """
        ...

    def lagged_differences(self, lag: int) -> Float64:
        """Return the vectors (N - lag, 3) from each sample to the one ``lag`` after it.

        The vectors in the reverse direction are minus these.
        """
        ...


@dataclass(frozen=True, slots=True)
class VectorSamples:
    """Samples of a vector space, such as positions.

    Attributes
    ----------
    values
        (N, 3) of any unit.
    """

    values: Float64

    def relative_vectors(self, stencils: Indices, centre: int) -> Float64:
        """Return the differences of samples from one sample of each stencil.

        Parameters
        ----------
        stencils, centre
            As of ``SampledCurve.relative_vectors``.

        Returns
        -------
        ndarray of float64
            (n, m, 3) in the unit of the values.
        """
        return self.values[stencils] - self.values[stencils[:, centre, None]]

    def lagged_differences(self, lag: int) -> Float64:
        """Return the differences (N - lag, 3) of each sample ``lag`` after another."""
        return self.values[lag:] - self.values[:-lag]


@dataclass(frozen=True, slots=True)
class OrientationSamples:
    """Samples of an orientation.

    Attributes
    ----------
    orientations_xyzw
        (N, 4) quaternions x, y, z, w, of any nonzero length.
    """

    orientations_xyzw: Float64
    _differences: dict[int, Float64] = field(default_factory=dict, compare=False, repr=False)

    def relative_vectors(self, stencils: Indices, centre: int) -> Float64:
        """Return the rotation vectors ``Log(q_centre^-1 q)`` of samples, in the frame of the centre.

        Parameters
        ----------
        stencils, centre
            As of ``SampledCurve.relative_vectors``.

        Returns
        -------
        ndarray of float64
            (n, m, 3) rad.
        """
        q = self.orientations_xyzw
        return so3.log_quaternion(so3.compose(so3.inverse(q[stencils[:, centre]])[:, None], q[stencils]))

    def lagged_differences(self, lag: int) -> Float64:
        """Return the rotation vectors ``Log(q_i^-1 q_i+lag)`` (N - lag, 3), rad; computed once for each lag."""
        if lag not in self._differences:
            q = self.orientations_xyzw
            self._differences[lag] = so3.log_quaternion(so3.compose(so3.inverse(q[:-lag]), q[lag:]))
        return self._differences[lag]


def divided_differences(times_ns: Int64, curve: SampledCurve, order: int) -> Float64:
    """Return the divided differences of an order, scaled so that unit white noise gives unit noise.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, strictly increasing.
    curve
        The N samples.
    order
        Of the differences; each is a weighted sum of ``order + 1`` neighbouring samples.

    Returns
    -------
    ndarray of float64
        (n, 3) in the unit of the curve. Runs of neighbours with a step wider than 1.5 median steps are left out.
    """
    centre = order // 2
    if are_evenly_spaced(times_ns, order + 1):
        weights = _difference_weights(offsets_us_of(times_ns[None, : order + 1]))
        even: Float64 = weighted_neighbours(curve, weights, centre, len(times_ns) - order)[0]
        return even
    stencils = stencils_of(times_ns, order + 1)
    patterns, pattern_of_row = patterns_of(times_ns, stencils)
    differences: Float64 = np.einsum(
        "nm,nmi->ni", _difference_weights(patterns)[pattern_of_row], curve.relative_vectors(stencils, centre)
    )
    return differences


def are_evenly_spaced(times_ns: Int64, size: int) -> bool:
    """Return whether all steps are equal, so that all runs of ``size`` neighbours have the same weights.

    Steps below a microsecond are left to ``stencils_of``, which has no run of such.
    """
    steps_ns = np.diff(times_ns)
    return len(times_ns) >= size and _NS_PER_US <= int(steps_ns.min()) == int(steps_ns.max())


def weighted_neighbours(curve: SampledCurve, weights: Float64, centre: int, count: int) -> Float64:
    """Return the sums (k, n, 3), weighted by (k, m), over the first n = ``count`` runs of m neighbours.

    Samples are taken relative to the one in column ``centre`` of each run.
    """
    sums = np.empty((len(weights), count, 3))
    for begin in range(0, count, _BLOCK):
        runs = slice(begin, min(begin + _BLOCK, count))
        vectors = np.zeros((weights.shape[1], runs.stop - begin, 3))
        for column in range(weights.shape[1]):
            if lag := column - centre:
                first, sign = (centre, 1.0) if lag > 0 else (column, -1.0)
                vectors[column] = sign * curve.lagged_differences(abs(lag))[first + begin : first + runs.stop]
        sums[:, runs] = np.tensordot(weights, vectors, 1)
    return sums


def _difference_weights(offsets_us: Int64) -> Float64:
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


def stencils_of(times_ns: Int64, size: int) -> Indices:
    """Return indices (n, size) of runs of neighbours that have no gap among them and differ by microseconds."""
    count = len(times_ns) - size + 1
    if count < 1:
        return np.empty((0, size), dtype=np.intp)
    stencils: Indices = np.arange(count)[:, None] + np.arange(size)
    steps_ns = np.diff(times_ns)
    # Offsets count in whole microseconds: two times within one would be the same.
    usable = (steps_ns >= _NS_PER_US) & (steps_ns <= _WIDEST_STEP * float(np.median(steps_ns)))
    continuous: Indices = stencils[usable[stencils[:, :-1]].all(axis=1)]
    return continuous


def patterns_of(times_ns: Int64, stencils: Indices) -> tuple[Int64, Indices]:
    """Return the distinct patterns of offsets (p, m), whole microseconds, and the index of the pattern (n,).

    ``stencils`` are (n, m) indices of samples.
    """
    offsets_us = offsets_us_of(times_ns[stencils])
    if len(offsets_us) and np.array_equal(offsets_us.min(axis=0), offsets_us.max(axis=0)):
        return offsets_us[:1], np.zeros(len(stencils), dtype=np.intp)
    patterns, pattern_of_row = np.unique(offsets_us, axis=0, return_inverse=True)
    return patterns, pattern_of_row.reshape(-1)


def offsets_us_of(times_ns: Int64) -> Int64:
    """Return the offsets (n, m) of timestamps (n, m) from the first of each row, in whole microseconds."""
    offsets_us: Int64 = (times_ns - times_ns[:, :1] + _NS_PER_US // 2) // _NS_PER_US
    return offsets_us
