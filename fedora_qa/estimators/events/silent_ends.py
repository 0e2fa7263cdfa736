"""Silences of the events at the begin or the end of a file, beside a camera that moves.

A scene that does not change gives no events, so that events may begin late. The image changes where the camera moves:
the events of a pixel follow from the path of the image across it, not from its speed. Events are therefore counted by
path. Let the body move by D during the silence, from one place to another. As many pixels then pass an edge as in any
other part of the file in which it moves by D.

Two properties of a correct file are allowed for:

- At the begin all pixels are at their references, and none fires until its light has changed by a threshold. Only
  events that follow another of the same pixel within a path of D / 2 are counted. The light of such a pixel changes by
  a threshold within D / 2, so that any phase of its reference gives an event within the silence.
- The image moves as the body turns, ``a`` px/rad, and as it moves, ``b`` px/m, where ``b`` depends on depth. Without
  ``a`` and ``b``: let it turn by U and move by V in the silence, and by u and v beside it. Then
  ``(a U + b V) / (a u + b v) >= min(U / u, V / v)``, so that the measure of motion with the fewer events is the bound.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri_exp

from fedora_qa.estimators.events.pixels import PixelEvents
from fedora_qa.estimators.events.rates import BINS, log_chance_of_empty_bin

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

PAIR_NS: Final = (6_250_000, 12_500_000, 25_000_000, 50_000_000, 100_000_000)
"""Lengths of time within which two events of a pixel are counted as a pair, ns."""

_PARTS: Final = 8
"""Parts of a silence over which positions are averaged, against their noise."""

_FEWEST_PARTS: Final = 3

_NOISE: Final = 6.0
"""Standard deviations of the noise of a distance that are subtracted from it: 1e-9, as for other findings."""


def count_pairs(events: PixelEvents, edges_ns: Int64) -> Int64:
    """Return how many events follow another of their pixel within each of ``PAIR_NS``, by time (lengths, bins).

    Parameters
    ----------
    events
        By pixel.
    edges_ns
        (bins + 1,) edges of the bins of the later event, ns from the file's origin.
    """
    times_ns = events.timestamped >> 1
    follows = np.ones(len(times_ns), np.bool_)
    follows[events.starts[:-1][events.starts[:-1] < len(times_ns)]] = False
    later = np.flatnonzero(follows)
    intervals_ns = times_ns[later] - times_ns[later - 1]
    return np.stack([np.histogram(times_ns[later[intervals_ns <= pair_ns]], edges_ns)[0] for pair_ns in PAIR_NS])


@dataclass(frozen=True, slots=True)
class Track:
    """Samples of the motion of the body.

    Attributes
    ----------
    times_ns
        (n,) increasing timestamps, ns from the file's origin.
    values
        (n, k) positions, m; quaternions, whose signs are continuous; or integrated angular velocities, rad.
    drifts
        Whether the values are integrated, so that an unknown constant rate and a random walk are added to them.
    """

    times_ns: Int64
    values: Float64
    drifts: bool = False

    def means(self, edges_ns: Float64) -> tuple[Float64, Float64]:
        """Return the means (parts, k) of the samples between edges, and their numbers (parts,); NaN without any."""
        rows = np.searchsorted(self.times_ns, edges_ns)
        counts = np.diff(rows).astype(np.float64)
        sums = np.concatenate([np.zeros((1, self.values.shape[1])), np.cumsum(self.values - self.values[0], axis=0)])
        with np.errstate(invalid="ignore"):
            return self.values[0] + np.diff(sums[rows], axis=0) / counts[:, np.newaxis], counts

    def moved(self, edges_ns: Float64) -> float:
        """Return a lower bound on how far two instants of a segment are apart, 0 at least; edges (parts + 1,), ns."""
        means, counts = self.means(edges_ns)
        places, fewest = means[counts > 0], float(counts[counts > 0].min(initial=np.inf))
        if len(places) < _FEWEST_PARTS:
            return 0.0
        if self.drifts:
            # |x(t - h) - 2 x(t) + x(t + h)| is at most twice the distance, and no constant rate changes it. White noise
            # s of rates leaves s sqrt(n) in the integral, and s / sqrt(3) in ``noise``.
            bent = [
                np.linalg.norm(places[: -2 * h] - 2 * places[h:-h] + places[2 * h :], axis=1).max()
                for h in range(1, (len(places) + 1) // 2)
            ]
            apart, error = float(max(bent)) / 2, self.noise() * float(np.sqrt(3 * counts.sum()))
        else:
            apart = float(np.linalg.norm(places[:, np.newaxis] - places, axis=-1).max())
            error = self.noise() * float(np.sqrt(2 / fewest))
        return max(apart - _NOISE * error, 0.0)

    def noise(self) -> float:
        """Return the standard deviation of a sample, of all components together, from second differences."""
        # White noise s leaves 6 s^2 in x[i-1] - 2 x[i] + x[i+1]. Motion adds to it, which only weakens the result.
        second = np.diff(self.values, 2, axis=0)
        return float(np.sqrt(np.mean(np.sum(second**2, axis=1)) / 6)) if len(second) else 0.0


@dataclass(frozen=True, slots=True)
class SilentEnd:
    """A silence at an end of the file.

    Attributes
    ----------
    expected
        Number of events that the motion of the camera during it gives at least.
    z
        Deviate of a standard normal distribution with the same tail probability; 0 at least.
    """

    expected: float
    z: float


def silent_end(
    silence_ns: tuple[float, float], far_ns: float, edges_ns: Int64, pairs: Int64, tracks: Sequence[Track]
) -> SilentEnd | None:
    """Compare a silence at an end with the events of the rest of the file, by the motion of the body.

    Parameters
    ----------
    silence_ns
        Begin and end of the silence, ns from the file's origin.
    far_ns
        The other end of the events, ns.
    edges_ns
        (bins + 1,) edges of the bins of ``pairs``, ns.
    pairs
        (lengths, bins) numbers of events that follow another of their pixel within each of ``PAIR_NS``.
    tracks
        Measures of the motion, which cover the silence.

    Returns
    -------
    SilentEnd or None
        By the measure with which the silence is most probable; None where none can be compared.
    """
    is_first = far_ns > silence_ns[1]
    beside_span_ns = abs(far_ns - (silence_ns[1] if is_first else silence_ns[0]))
    # Parts of equal length, from the silence to the other end.
    length_ns = min(silence_ns[1] - silence_ns[0], beside_span_ns) / _PARTS
    parts = int(beside_span_ns / length_ns) if length_ns else 0
    steps_ns: Float64 = length_ns * np.arange(parts + 1, dtype=np.float64)
    beside_ns = silence_ns[1] + steps_ns if is_first else silence_ns[0] - steps_ns[::-1]
    silent_ns: Float64 = np.linspace(silence_ns[0], silence_ns[1], _PARTS + 1)
    ends: list[SilentEnd] = []
    for track in tracks:
        moved = track.moved(silent_ns)
        moving, of_moving = track.means(beside_ns)
        is_moving = of_moving > 0
        if np.count_nonzero(is_moving) < _FEWEST_PARTS:
            return None
        centres_ns = (beside_ns[:-1] + beside_ns[1:])[is_moving] / 2
        path = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(moving[is_moving], axis=0), axis=1))])
        if moved <= 0 or not path[-1]:
            return SilentEnd(0.0, 0.0)
        # The longest interval of pairs whose path is never longer than half of the distance.
        fits = [np.max(np.interp(centres_ns + pair_ns, centres_ns, path) - path) <= moved / 2 for pair_ns in PAIR_NS]
        if not fits[0]:
            return SilentEnd(0.0, 0.0)
        counts = pairs[int(np.flatnonzero(fits)[-1])]
        step = min(moved / 2, float(path[-1]) / BINS)
        from_silence = path if is_first else path[-1] - path[::-1]
        instants_ns = centres_ns if is_first else centres_ns[::-1]
        marks_ns = np.interp(step * np.arange(BINS + 1), from_silence, instants_ns)
        sums = np.interp(marks_ns, edges_ns, np.concatenate([[0], np.cumsum(counts)]))
        mean, log_chance = log_chance_of_empty_bin(np.abs(np.diff(sums)), np.ones(BINS, np.bool_))
        ends.append(SilentEnd(float(mean) * moved / 2 / step, max(float(-ndtri_exp(log_chance)), 0.0)))
    return min(ends, key=lambda end: end.z) if ends else None
