"""What events must conserve: the signal less the sum of its events stays within the thresholds at all times.

An ideal pixel keeps ``-C- < L - ref < C+``, and ``ref`` moves by C+ and C- only. So over any times, however far apart,
``E = L - C+ P + C- M`` varies by less than C+ + C-. Each frame bounds L at its time; the pixel violates the law where
the largest lower bound of E exceeds the smallest upper bound by C+ + C- or more. Where the reference is the signal at
the first frame, E is nothing there, and stays within the thresholds of it: -C- < E < C+.

Signals are int64 multiples of 2^-40 nat, so that neighbouring frame runs join exactly in any order.
"""

from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Bool = NDArray[np.bool_]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Images = NDArray[np.floating]

UNITS_PER_NAT: Final = 2.0**40
EVERY_FRAME: Final = (np.inf, 0.0)
"""The rule that accepts every frame."""

FARTHEST = 1 << 61
"""A bound that bounds nothing, in units."""

_MANTISSA_BITS = 52
_ROOT_OF_HALF = 0x3FE6A09E667F3BCD
"""The bits of sqrt(1/2) as a number of double precision: from there to sqrt(2) a logarithm is taken of the mantissa."""
_LN_2 = float(np.log(2.0))


@dataclass(frozen=True, slots=True)
class ConservationLaw:
    """What an ideal pixel does, and which frames are accepted.

    Attributes
    ----------
    threshold_on, threshold_off
        What a brighter and a darker event stand for, nat.
    dark
        The signal is ln(light + dark); DN.
    uneven
        Rules (a, b): a frame bounds nothing in a pixel whose error is not below a + b (light + dark), DN.
    """

    threshold_on: float
    threshold_off: float
    dark: float = 0.0
    uneven: tuple[tuple[float, float], ...] = (EVERY_FRAME,)


@dataclass(slots=True)
class Excursions:
    """Bounds of E for every pixel over some consecutive frames, by each of the k rules of a law.

    Attributes
    ----------
    first_frame, last_frame
        Both included.
    total
        (h, w) what the events between the first and the last frame sum to.
    highest, lowest
        (k, h, w) the largest lower bound and the smallest upper bound of E, counted from the first frame.
    highest_at, lowest_at
        (h, w) the frames of the first rule's.
    start
        (2, h, w) light and its error at frame 0; (2, 0, 0) of a run that begins later, where no reference is declared.
    """

    law: ConservationLaw
    first_frame: int
    last_frame: int
    total: Int64
    highest: Int64
    lowest: Int64
    highest_at: Int32
    lowest_at: Int32
    start: NDArray[np.floating[Any]]

    def follow(self, light: Images, error: Images, counts: Int32, drift: Float64, frames: Int64) -> None:
        """Go on, in place, over frames of which the first is this one's last; arguments as those of ``bound``."""
        self._add_frames(light, error, counts, drift, frames, begun=True)
        self.last_frame = int(frames[-1])

    def then(self, later: "Excursions") -> "Excursions":
        """Join with the excursions that begin at this one's last frame. Exact, hence associative."""
        # E counted from this run's first frame is E counted from the later run's less the events in between.
        highest = np.where(later.highest > -FARTHEST, later.highest - self.total, -FARTHEST)
        lowest = np.where(later.lowest < FARTHEST, later.lowest - self.total, FARTHEST)
        # Of equal ones the earlier.
        highest_at = np.where(highest[0] > self.highest[0], later.highest_at, self.highest_at)
        lowest_at = np.where(lowest[0] < self.lowest[0], later.lowest_at, self.lowest_at)
        np.maximum(highest, self.highest, out=highest)
        np.minimum(lowest, self.lowest, out=lowest)
        ends, total = (self.first_frame, later.last_frame), self.total + later.total
        return Excursions(self.law, *ends, total, highest, lowest, highest_at, lowest_at, self.start)

    def excess(self, rule: int = 0) -> Float64:
        """Return by how much (h, w) E varies at least, nat; negative where the bounds allow that it does not."""
        variation: Float64 = (self.highest[rule].astype(np.float64) - self.lowest[rule]) / UNITS_PER_NAT
        return variation

    def departure(self, rule: int = 0) -> Float64:
        """Return how far (h, w) E goes at least beyond the thresholds around its start, nat; mostly negative."""
        light, error = self.start[:, np.newaxis]
        no_counts, first = np.zeros((0, 2, *light.shape[1:]), np.int32), np.zeros(1, np.int64)
        start = bound(light, error, no_counts, np.zeros(0), replace(self.law, uneven=(self.law.uneven[rule],)), first)
        # Where E is nothing at the first frame, it stays within C+ above and C- below that start.
        rise = (self.highest[rule].astype(np.float64) - start.lowest[0]) / UNITS_PER_NAT - self.law.threshold_on
        fall = (start.highest[0].astype(np.float64) - self.lowest[rule]) / UNITS_PER_NAT - self.law.threshold_off
        farthest: Float64 = np.maximum(rise, fall)
        return farthest

    def _add_frames(
        self, light: Images, error: Images, counts: Int32, drift: Float64, frames: Int64, *, begun: bool
    ) -> None:
        law = self.law
        follow_excursions(
            FrameBounds(light, error, counts, np.rint(drift * UNITS_PER_NAT).astype(np.int64), frames.astype(np.int32)),
            law.dark,
            (round(law.threshold_off * UNITS_PER_NAT), round(law.threshold_on * UNITS_PER_NAT)),
            np.array(law.uneven, np.float64),
            UNITS_PER_NAT,
            begun,
            ExtremeBounds(self.total, self.highest, self.lowest, self.highest_at, self.lowest_at),
        )


def bound(
    light: Images, error: Images, counts: Int32, drift: Float64, law: ConservationLaw, frames: Int64
) -> Excursions:
    """Return the excursions over consecutive frames.

    Parameters
    ----------
    light, error
        (n, h, w) light at each frame, DN, and a bound of its error; infinite where nothing is known.
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    drift
        (n - 1,) nat that the signal appears to gain between frames besides (leak).
    law
        Thresholds and rules of acceptance.
    frames
        (n,) numbers of the frames.

    Returns
    -------
    Excursions
        Bounds of E of each pixel (h, w) by each of the k rules.
    """
    shape, rules = light.shape[1:], len(law.uneven)
    start = np.stack([light[0], error[0]]) if frames[0] == 0 else np.empty((2, 0, 0), light.dtype)
    excursions = Excursions(
        law,
        int(frames[0]),
        int(frames[-1]),
        np.zeros(shape, np.int64),
        np.full((rules, *shape), -FARTHEST),
        np.full((rules, *shape), FARTHEST),
        np.zeros(shape, np.int32),
        np.zeros(shape, np.int32),
        start,
    )
    excursions._add_frames(light, error, counts, drift, frames, begun=False)
    return excursions


class FrameBounds(NamedTuple):
    """Light and its error at n frames, and what happens between them: the input of ``follow_excursions``.

    Attributes
    ----------
    light, error
        (n, h, w).
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    drift
        (n - 1,) what the signal gains besides, units.
    frames
        (n,) their numbers.
    """

    light: Images
    error: Images
    counts: Int32
    drift: Int64
    frames: Int32


class ExtremeBounds(NamedTuple):
    """What ``follow_excursions`` updates: ``total`` to ``lowest_at`` of ``Excursions``."""

    total: Int64
    highest: Int64
    lowest: Int64
    highest_at: Int32
    lowest_at: Int32


@njit(cache=True)
def follow_excursions(
    bounds: FrameBounds,
    dark: float,
    steps: tuple[int, int],
    uneven: Float64,
    units: float,
    begun: bool,
    extremes: ExtremeBounds,
) -> None:
    """Bound signal minus events of every pixel over the frames, by each of k rules of acceptance.

    The signal is ln(light + dark) in units of 1 / ``units`` nat; a darker and a brighter event change it by ``steps``.
    A frame bounds nothing where its error is not finite, or is not below a + b (light + dark), (a, b) being a row of
    ``uneven`` (k, 2). If ``begun``, the first frame has been added before.

    Parameters
    ----------
    bounds
        Frames, DN, and what happens between them.
    dark
        DN.
    steps
        C- and C+, units.
    uneven
        (k, 2) rules.
    units
        Units per nat.
    begun
        Whether ``extremes`` hold the first frame already.
    extremes
        Updated in place.
    """
    light, error, counts, drift, frames = bounds
    total, highest, lowest, highest_at, lowest_at = extremes
    width = light.shape[2]
    ends, accepted = np.empty((2, width), np.int64), np.empty(width, np.bool_)
    mantissas, exponents = np.empty((2, width)), np.empty((2, width))
    # By rows, so that all frames of a row are followed while its bounds lie in the cache.
    for row in range(light.shape[1]):
        for frame in range(len(light)):
            if frame > 0:
                # Events lie in (frame - 1, frame]: they are added before the bounds of this frame are taken.
                off, on, subtracted = counts[frame - 1, 0, row], counts[frame - 1, 1, row], total[row]
                for column in range(width):
                    # E = L - C+ P + C- M + drift, module docstring: ``total`` is what is subtracted from L.
                    subtracted[column] += on[column] * steps[1] - off[column] * steps[0] - drift[frame - 1]
            elif begun:
                continue
            row_light, row_error = light[frame, row], error[frame, row]
            _split_bounds(row_light, row_error, dark, mantissas, mantissas.view(np.int64), exponents)
            _log_of_parts(mantissas, exponents, units, ends)
            number = frames[frame]
            for rule in range(len(uneven)):
                constant, by_light = uneven[rule, 0], uneven[rule, 1]
                for column in range(width):
                    bright, error_dn = row_light[column] + dark, float(row_error[column])
                    accepted[column] = (bright > error_dn) & (error_dn < constant + by_light * bright)
                higher, deeper = highest[rule, row], lowest[rule, row]
                if rule == 0:
                    _widen_and_note(ends, accepted, total[row], number, higher, deeper, highest_at[row], lowest_at[row])
                else:
                    _widen(ends, accepted, total[row], higher, deeper)


@njit(cache=True)
def _split_bounds(
    light: Images, error: Images, dark: float, mantissas: Float64, bits: Int64, exponents: Float64
) -> None:
    """Split the lower and the upper bound of the light of a row into mantissa and exponent, (2, w) each.

    ``bits`` are those of ``mantissas``. Where nothing is known it is the logarithm of 1.
    """
    for column in range(len(light)):
        bright, off = light[column] + dark, float(error[column])
        # An error as large as the light leaves the lower bound at no light, whose logarithm is not finite.
        bounded = (bright > off) & (off < np.inf)
        mantissas[0, column] = bright - off if bounded else 1.0
        mantissas[1, column] = bright + off if bounded else 1.0
    for end in range(2):
        for column in range(len(light)):
            whole = bits[end, column]
            # Bits of a double are ordered as the numbers: above those of sqrt(1/2) the exponent counts octaves.
            exponent = (whole - _ROOT_OF_HALF) >> _MANTISSA_BITS
            bits[end, column] = whole - (exponent << _MANTISSA_BITS)
            exponents[end, column] = exponent


@njit(cache=True, error_model="numpy")
def _log_of_parts(mantissas: Float64, exponents: Float64, units: float, logs: Int64) -> None:
    """Write logarithms (2, w) in units, the first rounded down and the second up; without a branch.

    ln m = 2 artanh s, s = (m - 1) / (m + 1), by its series: |s| < 0.1716, so that what is left out is below 1e-13.
    """
    for end in range(2):
        for column in range(mantissas.shape[1]):
            m = mantissas[end, column]
            s = (m - 1.0) / (m + 1.0)
            z = s * s
            series = 1.0 / 9.0 + z * (1.0 / 11.0 + z * (1.0 / 13.0 + z * (1.0 / 15.0)))
            series = 1.0 + z * (1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * series)))
            log = (exponents[end, column] * _LN_2 + 2.0 * s * series) * units
            # Rounded outwards: rounding to whole units must not tighten a bound.
            logs[end, column] = np.int64(np.floor(log) if end == 0 else np.ceil(log))


@njit(cache=True)
def _widen(ends: Int64, accepted: Bool, total: Int64, highest: Int64, lowest: Int64) -> None:
    for column in range(len(total)):
        least = ends[0, column] - total[column] if accepted[column] else -FARTHEST
        most = ends[1, column] - total[column] if accepted[column] else FARTHEST
        highest[column] = max(least, highest[column])
        lowest[column] = min(most, lowest[column])


@njit(cache=True)
def _widen_and_note(
    ends: Int64,
    accepted: Bool,
    total: Int64,
    frame: int,
    highest: Int64,
    lowest: Int64,
    highest_at: Int32,
    lowest_at: Int32,
) -> None:
    """Update the largest lower and the smallest upper bound of a row (w,) by a frame, and note its number."""
    for column in range(len(total)):
        # E = L - total. Only a tighter bound replaces the frame number: of equal ones the earlier, as in ``then``.
        least = ends[0, column] - total[column] if accepted[column] else -FARTHEST
        most = ends[1, column] - total[column] if accepted[column] else FARTHEST
        highest_at[column] = frame if least > highest[column] else highest_at[column]
        highest[column] = max(least, highest[column])
        lowest_at[column] = frame if most < lowest[column] else lowest_at[column]
        lowest[column] = min(most, lowest[column])
