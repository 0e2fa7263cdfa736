"""Compiled loops that follow signal minus events of every pixel, and join what they found."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]
Int32 = NDArray[np.int32]


FARTHEST = 1 << 61

_MANTISSA_BITS = 52
_ROOT_OF_HALF = 0x3FE6A09E667F3BCD
"""The bits of sqrt(1/2) as a number of double precision: from there to sqrt(2) a logarithm is taken of the mantissa."""
_LN_2 = float(np.log(2.0))


@njit(cache=True)
def follow_excursions(
    light: NDArray[np.floating],
    error: NDArray[np.floating],
    counts: Int32,
    dark: float,
    steps: tuple[int, int],
    drift: Int64,
    frames: Int32,
    uneven: Float64,
    units: float,
    begun: bool,
    total: Int64,
    highest: Int64,
    lowest: Int64,
    highest_at: Int32,
    lowest_at: Int32,
) -> None:
    """Follow signal minus events of every pixel over the frames, by each of some rules what to believe.

    The signal is the logarithm of ``light`` (n, h, w) and ``dark``, known to ``error`` (n, h, w), and counts ``units``
    times. ``counts`` (n - 1, 2, h, w) holds darker and brighter events between the frames, each a step of ``steps``,
    ``drift`` (n - 1,) what the signal gains besides, ``frames`` (n,) their numbers. What is found is taken into
    ``total`` (h, w), what the events sum to; ``highest`` (k, h, w), by each rule the largest lower bound of the
    difference; ``lowest`` (k, h, w) the smallest upper bound; ``highest_at`` and ``lowest_at`` (h, w), the frames of
    the first rule's. Bounds that are not finite, or off by more than the first of a rule's ``uneven`` (k, 2) and the
    second times the light, tell nothing. Where it has ``begun``, the first frame has been taken in before.
    """
    width = light.shape[2]
    ends, told = np.empty((2, width), np.int64), np.empty(width, np.bool_)
    mantissas, exponents = np.empty((2, width)), np.empty((2, width))
    for row in range(light.shape[1]):
        for frame in range(len(light)):
            if frame > 0:
                _move(counts[frame - 1, :, row], steps, drift[frame - 1], total[row])
            elif begun:
                continue
            lit, off = light[frame, row], error[frame, row]
            _part(lit, off, dark, mantissas, mantissas.view(np.int64), exponents)
            _log_of_parts(mantissas, exponents, units, ends)
            number = frames[frame]
            for rule in range(len(uneven)):
                _believe(lit, off, dark, uneven[rule, 0], uneven[rule, 1], told)
                higher, deeper = highest[rule, row], lowest[rule, row]
                if rule == 0:
                    _widen_and_note(ends, told, total[row], number, higher, deeper, highest_at[row], lowest_at[row])
                else:
                    _widen(ends, told, total[row], higher, deeper)


@njit(cache=True)
def _move(counts: Int32, steps: tuple[int, int], drift: int, total: Int64) -> None:
    off, on = counts
    for column in range(len(total)):
        total[column] += on[column] * steps[1] - off[column] * steps[0] - drift


@njit(cache=True)
def _part(
    light: NDArray[np.floating],
    error: NDArray[np.floating],
    dark: float,
    mantissas: Float64,
    bits: Int64,
    exponents: Float64,
) -> None:
    """Part the lower and the upper bound of the light of a row into mantissa and exponent, (2, w) each.

    ``bits`` are those of ``mantissas``. Where nothing is known it is the logarithm of 1.
    """
    for column in range(len(light)):
        bright, off = light[column] + dark, float(error[column])
        known = (bright > off) & (off < np.inf)
        mantissas[0, column] = bright - off if known else 1.0
        mantissas[1, column] = bright + off if known else 1.0
    for end in range(2):
        for column in range(len(light)):
            whole = bits[end, column]
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
            logs[end, column] = np.int64(np.floor(log) if end == 0 else np.ceil(log))


@njit(cache=True)
def _believe(
    light: NDArray[np.floating],
    error: NDArray[np.floating],
    dark: float,
    uneven: float,
    by_light: float,
    told: NDArray[np.bool_],
) -> None:
    for column in range(len(light)):
        bright, off = light[column] + dark, float(error[column])
        told[column] = (bright > off) & (off < uneven + by_light * bright)


@njit(cache=True)
def _widen(ends: Int64, told: NDArray[np.bool_], total: Int64, highest: Int64, lowest: Int64) -> None:
    for column in range(len(total)):
        least = ends[0, column] - total[column] if told[column] else -FARTHEST
        most = ends[1, column] - total[column] if told[column] else FARTHEST
        highest[column] = max(least, highest[column])
        lowest[column] = min(most, lowest[column])


@njit(cache=True)
def _widen_and_note(
    ends: Int64,
    told: NDArray[np.bool_],
    total: Int64,
    frame: int,
    highest: Int64,
    lowest: Int64,
    highest_at: Int32,
    lowest_at: Int32,
) -> None:
    """Take a frame's bounds of a row (w,) into the largest lower and the smallest upper one, with its number."""
    for column in range(len(total)):
        least = ends[0, column] - total[column] if told[column] else -FARTHEST
        most = ends[1, column] - total[column] if told[column] else FARTHEST
        highest_at[column] = frame if least > highest[column] else highest_at[column]
        highest[column] = max(least, highest[column])
        lowest_at[column] = frame if most < lowest[column] else lowest_at[column]
        lowest[column] = min(most, lowest[column])
