"""Conservation of events: the signal less the sum of its events, for the models ``log`` and ``linear``.

An ideal pixel of the model ``log`` keeps ``-C- < L - ref < C+``, and ``ref`` changes only by steps of C+ and -C-. With
P brighter and M darker events so far, ``E = L - C+ P + C- M`` therefore varies by less than C+ + C- over any interval
of time. Each frame bounds L at its time. A pixel violates the law where the largest lower bound of E exceeds the
smallest upper bound by C+ + C- or more. Where the reference is the signal at the first frame, E counts from 0 there,
and ``-C- < E < C+``.

Signals are int64 multiples of 2^-40 nat, so that neighbouring frame runs can be joined exactly in any order.

In the model ``linear`` the reference is the last value. While a pixel gives no event, its value stays within [ref - C-,
ref + C+]. Over a run without events it therefore varies by at most C+ + C-. Each brighter event raises the reference by
at least C+ + 1, because thresholds are strict and values whole. P brighter events without a darker one between two
frames therefore raise the value by at least P (C+ + 1) - C+ - C-. There is no upper bound: one event can come from a
step of any size. Where the first reference is the value at the first frame, the first run stays within the thresholds
around that value.
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

# Integer units of the signal for each nat.
UNITS_PER_NAT: Final = 2.0**40
EVERY_FRAME: Final = (np.inf, 0.0)
"""The rule that accepts every frame."""

FARTHEST = 1 << 61
"""Absolute value, in units, of a bound that excludes no value."""

_MANTISSA_BITS = 52
_ROOT_OF_HALF = 0x3FE6A09E667F3BCD
"""Bits of sqrt(1/2) in double precision. Mantissas whose logarithm is taken lie between sqrt(1/2) and sqrt(2)."""
_LN_2 = float(np.log(2.0))


@dataclass(frozen=True, slots=True)
class ConservationLaw:
    """The law of an ideal pixel, and the rules by which frames are accepted.

    Attributes
    ----------
    threshold_on, threshold_off
        C+ and C-: change of the signal by a brighter and by a darker event, nat, both positive.
    dark
        Constant in the signal ln(light + dark), DN.
    uneven
        k rules (a, b), DN and a ratio: a frame is used at a pixel only where its error is below a + b (light + dark).
    """

    threshold_on: float
    threshold_off: float
    dark: float = 0.0
    uneven: tuple[tuple[float, float], ...] = (EVERY_FRAME,)


@dataclass(slots=True)
class Excursions:
    """Bounds of E for every pixel over consecutive frames, by each of the k rules of a law.

    Attributes
    ----------
    law
        Thresholds, dark value and rules.
    first_frame, last_frame
        Numbers of the first and the last frame, both included.
    total
        (h, w) sum of the events between the first and the last frame, less the drift; units.
    highest, lowest
        (k, h, w) largest lower bound and smallest upper bound of E, counted from the first frame; units.
    highest_at, lowest_at
        (h, w) numbers of the frames that give these bounds by the first rule.
    start
        (2, h, w) light and its error at frame 0, DN; (2, 0, 0) for frames that begin later.
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
        """Continue over further frames, in place.

        Parameters
        ----------
        light, error
            (n, h, w) light at each frame, DN, and a bound of its error; infinite where the light is not known.
        counts
            (n - 1, 2, h, w) darker and brighter events between the frames.
        drift
            (n - 1,) apparent gain of the signal between the frames that is not due to light (leak), nat.
        frames
            (n,) numbers of the frames; the first is ``last_frame``.
        """
        self._add_frames(light, error, counts, drift, frames, begun=True)
        self.last_frame = int(frames[-1])

    def then(self, later: "Excursions") -> "Excursions":
        """Join with the excursions that begin at the last frame of these. The result is exact, hence associative."""
        # E from the first frame = E from the first frame of the later run - events in between.
        highest = np.where(later.highest > -FARTHEST, later.highest - self.total, -FARTHEST)
        lowest = np.where(later.lowest < FARTHEST, later.lowest - self.total, FARTHEST)
        # Of equal bounds the earlier frame counts.
        highest_at = np.where(highest[0] > self.highest[0], later.highest_at, self.highest_at)
        lowest_at = np.where(lowest[0] < self.lowest[0], later.lowest_at, self.lowest_at)
        np.maximum(highest, self.highest, out=highest)
        np.minimum(lowest, self.lowest, out=lowest)
        ends, total = (self.first_frame, later.last_frame), self.total + later.total
        return Excursions(self.law, *ends, total, highest, lowest, highest_at, lowest_at, self.start)

    def excess(self, rule: int = 0) -> Float64:
        """Return the least variation (h, w) of E by a rule, nat; negative where E may be constant."""
        variation: Float64 = (self.highest[rule].astype(np.float64) - self.lowest[rule]) / UNITS_PER_NAT
        return variation

    def departure(self, rule: int = 0) -> Float64:
        """Return the least distance (h, w) of E beyond the thresholds around its start, by a rule.

        It is in nat, and negative where E may stay within the thresholds.
        """
        light, error = self.start[:, np.newaxis]
        no_counts, first = np.zeros((0, 2, *light.shape[1:]), np.int32), np.zeros(1, np.int64)
        start = bound(light, error, no_counts, np.zeros(0), replace(self.law, uneven=(self.law.uneven[rule],)), first)
        # A correct pixel has -C- < E - start < C+.
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
        (n, h, w) light at each frame, DN, and a bound of its error; infinite where the light is not known.
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    drift
        (n - 1,) apparent gain of the signal between the frames that is not due to light (leak), nat.
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
    """Light and its error at n frames, and the events between them: the input of ``follow_excursions``.

    Attributes
    ----------
    light, error
        (n, h, w) light, and a bound of its error, DN.
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    drift
        (n - 1,) apparent gain of the signal that is not due to light, units.
    frames
        (n,) numbers of the frames.
    """

    light: Images
    error: Images
    counts: Int32
    drift: Int64
    frames: Int32


class ExtremeBounds(NamedTuple):
    """The arrays of ``Excursions`` that ``follow_excursions`` updates.

    Attributes
    ----------
    total
        (h, w) sums of events, units.
    highest, lowest
        (k, h, w) largest lower and smallest upper bounds of E, units.
    highest_at, lowest_at
        (h, w) frames of these bounds by the first rule.
    """

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
    """Update the bounds of E, signal less events, of every pixel over the frames, by each of k rules of acceptance.

    The signal is ln(light + dark). A frame is used at a pixel only where its error is finite and below
    a + b (light + dark), with (a, b) a row of ``uneven``.

    Parameters
    ----------
    bounds
        Frames, DN, and events between them.
    dark
        Constant in the signal, DN.
    steps
        C- and C+, units, both positive.
    uneven
        (k, 2) rules.
    units
        Units per nat.
    begun
        Whether ``extremes`` contain the first frame already.
    extremes
        Updated in place.
    """
    light, error, counts, drift, frames = bounds
    total, highest, lowest, highest_at, lowest_at = extremes
    width = light.shape[2]
    ends, accepted = np.empty((2, width), np.int64), np.empty(width, np.bool_)
    mantissas, exponents = np.empty((2, width)), np.empty((2, width))
    # By rows: the bounds of a row stay in the cache while all frames are processed.
    for row in range(light.shape[1]):
        for frame in range(len(light)):
            if frame > 0:
                # Events lie in (frame - 1, frame]: they are added before the bounds of this frame are taken.
                off, on, subtracted = counts[frame - 1, 0, row], counts[frame - 1, 1, row], total[row]
                for column in range(width):
                    # E = L - total, with total = C+ P - C- M - drift.
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
    """Split the lower and the upper bound of light + dark of a row into mantissa and exponent, (2, w) each.

    ``bits`` is a view of the bits of ``mantissas``. Where the light is not known, both bounds are 1.
    """
    for column in range(len(light)):
        bright, off = light[column] + dark, float(error[column])
        # If the error is as large as the light, the lower bound is 0, whose logarithm is not finite.
        bounded = (bright > off) & (off < np.inf)
        mantissas[0, column] = bright - off if bounded else 1.0
        mantissas[1, column] = bright + off if bounded else 1.0
    for end in range(2):
        for column in range(len(light)):
            whole = bits[end, column]
            # Bits of positive doubles are ordered as the numbers: the exponent counts octaves from sqrt(1/2) on.
            exponent = (whole - _ROOT_OF_HALF) >> _MANTISSA_BITS
            bits[end, column] = whole - (exponent << _MANTISSA_BITS)
            exponents[end, column] = exponent


@njit(cache=True, error_model="numpy")
def _log_of_parts(mantissas: Float64, exponents: Float64, units: float, logs: Int64) -> None:
    """Write logarithms (2, w) in units, the first row rounded down and the second up; without a branch.

    ln m = 2 artanh s with s = (m - 1) / (m + 1), by its series. As |s| < 0.1716, the terms left out are below 1e-13.
    """
    for end in range(2):
        for column in range(mantissas.shape[1]):
            m = mantissas[end, column]
            s = (m - 1.0) / (m + 1.0)
            z = s * s
            # artanh(s) / s = 1 + z / 3 + z^2 / 5 + ... + z^7 / 15, z = s^2
            series = 1.0 / 9.0 + z * (1.0 / 11.0 + z * (1.0 / 13.0 + z * (1.0 / 15.0)))
            series = 1.0 + z * (1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * series)))
            log = (exponents[end, column] * _LN_2 + 2.0 * s * series) * units
            # Rounded outwards: rounding to whole units must not tighten a bound.
            logs[end, column] = np.int64(np.floor(log) if end == 0 else np.ceil(log))


@njit(cache=True)
def _widen(ends: Int64, accepted: Bool, total: Int64, highest: Int64, lowest: Int64) -> None:
    """Update the largest lower and the smallest upper bound of E = L - total of a row (w,) by a frame."""
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
        # E = L - total. Only a tighter bound replaces the frame: of equal bounds the earlier one counts, as in
        # ``then``.
        least = ends[0, column] - total[column] if accepted[column] else -FARTHEST
        most = ends[1, column] - total[column] if accepted[column] else FARTHEST
        highest_at[column] = frame if least > highest[column] else highest_at[column]
        highest[column] = max(least, highest[column])
        lowest_at[column] = frame if most < lowest[column] else lowest_at[column]
        lowest[column] = min(most, lowest[column])


@dataclass(frozen=True, slots=True)
class EventFreeRuns:
    """Runs without events of every pixel over consecutive frames.

    Attributes
    ----------
    first_frame, last_frame
        Numbers of the first and the last frame, both included.
    head, tail
        (2, h, w) largest lower and smallest upper bound of the value, DN, in the first run and in the last run.
    quiet
        (h, w) True where there is no event: head and tail are one run.
    broken
        (h, w) True where a law was violated within the frames.
    limit
        C+ + C-: the largest variation of the value in a run, DN.
    start
        (2, h, w) lower and upper bound of the value at the first frame, DN.
    """

    first_frame: int
    last_frame: int
    head: Float64
    tail: Float64
    quiet: Bool
    broken: Bool
    limit: float
    start: Float64

    def departure(self, threshold_on: float, threshold_off: float) -> Float64:
        """Return the least distance of the first run beyond the thresholds around its start.

        Parameters
        ----------
        threshold_on, threshold_off
            C+ and C-, DN, both positive.

        Returns
        -------
        Float64
            (h, w) in DN; negative where the run may stay within the thresholds.
        """
        rise = self.head[0] - self.start[1] - threshold_on
        fall = self.start[0] - self.head[1] - threshold_off
        farthest: Float64 = np.maximum(rise, fall)
        return farthest

    def excess(self) -> Float64:
        """Return the least variation (h, w) of the value in the first run, DN; negative where it may be constant."""
        variation: Float64 = self.head[0] - self.head[1]
        return variation

    def then(self, later: "EventFreeRuns") -> "EventFreeRuns":
        """Join with the runs that begin at the last frame of these. The result is exact, hence associative."""
        # The last run of the earlier frames and the first run of the later ones are one run.
        across = _tighter(self.tail, later.head)
        return EventFreeRuns(
            self.first_frame,
            later.last_frame,
            np.where(self.quiet, across, self.head),
            np.where(later.quiet, across, later.tail),
            self.quiet & later.quiet,
            self.broken | later.broken | (across[0] - across[1] > self.limit),
            self.limit,
            self.start,
        )


def follow_runs(
    lower: Float64,
    upper: Float64,
    counts: NDArray[np.int32],
    *,
    threshold_on: float,
    threshold_off: float,
    spread: float = 0.0,
    frames: NDArray[np.int64],
) -> EventFreeRuns:
    """Return the runs over consecutive frames.

    Parameters
    ----------
    lower, upper
        (n, h, w) bounds of the value at each frame, DN; infinite where the value is not known.
    counts
        (n - 1, 2, h, w) darker and brighter events between the frames.
    threshold_on, threshold_off
        C+ and C-, DN, both positive.
    spread
        Largest deviation of a pixel's thresholds from C+ and C-, DN.
    frames
        (n,) numbers of the frames.

    Returns
    -------
    EventFreeRuns
        Of each pixel (h, w), from the first frame to the last.
    """
    # A value within [ref - C-, ref + C+] varies by at most C+ + C-.
    limit = threshold_on + threshold_off + 2 * spread
    quiet = np.ones(lower.shape[1:], np.bool_)
    bounds = np.stack([lower, upper], axis=1)
    numbers = frames.tolist()
    runs = EventFreeRuns(numbers[0], numbers[0], bounds[0], bounds[0], quiet, ~quiet, limit, bounds[0])
    for i in range(len(counts)):
        off, on = counts[i]
        silent = (on == 0) & (off == 0)
        step = _tighter(bounds[i], bounds[i + 1])
        rise, fall = bounds[i + 1, 1] - bounds[i, 0], bounds[i, 1] - bounds[i + 1, 0]
        # A run without events varies by at most C+ + C-; P events of one sign by at least P (C + 1) - C+ - C-.
        broken = silent & (step[0] - step[1] > limit)
        broken |= (on > 0) & (off == 0) & (rise < on * (threshold_on - spread + 1) - limit)
        broken |= (off > 0) & (on == 0) & (fall < off * (threshold_off - spread + 1) - limit)
        # With events between two frames, each of the two frames bounds a different run.
        head, tail = np.where(silent, step, bounds[i]), np.where(silent, step, bounds[i + 1])
        runs = runs.then(EventFreeRuns(numbers[i], numbers[i + 1], head, tail, silent, broken, limit, bounds[i]))
    return runs


def _tighter(earlier: Float64, later: Float64) -> Float64:
    """Return the tighter of two pairs of bounds (2, h, w): the larger lower and the smaller upper one."""
    return np.stack([np.maximum(earlier[0], later[0]), np.minimum(earlier[1], later[1])])
