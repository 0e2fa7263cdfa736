"""Timestamps of the streams: int64 microseconds from the start of the sequence."""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.errors import SceneError
from fedora_generator.rates import exact_hz
from fedora_qa.conventions import US_PER_S

LONGEST_S: Final = 3600.0
"""All streams are written piece by piece; only timestamps are in memory for the whole length, 29 MB an hour."""

PIECE: Final = 1 << 16
"""Timestamps that are processed together: about a minute of the fastest clock, and whole chunks of its dataset."""


def whole_us(duration_s: float) -> int:
    """Duration in whole microseconds."""
    if not (math.isfinite(duration_s) and 0 < duration_s <= LONGEST_S):
        raise SceneError(f"Expected a duration above 0 and up to {LONGEST_S:g} s, got {duration_s:g} s")
    if (duration_us := round(duration_s * US_PER_S)) == 0:
        raise SceneError(f"Expected a duration of at least a microsecond, got {duration_s:g} s")
    return duration_us


def timestamps_us(duration_us: int, rate_hz: float) -> NDArray[np.int64]:
    """Timestamps (n,) of a stream, from 0 to the last that fits; both ends are written: n = floor(rate T) + 1."""
    period_us = US_PER_S / exact_hz(rate_hz)
    count = int(duration_us / period_us) + 1
    # In whole numbers: the timestamps of a rate are among those of its multiples, to the microsecond.
    return np.arange(count, dtype=np.int64) * period_us.numerator // period_us.denominator


def pieces(times_us: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Cut times (n,) into pieces of bounded size, so that memory does not grow with n."""
    return np.split(times_us, range(PIECE, len(times_us), PIECE))


def intervals_us(duration_us: int, rate_hz: float) -> NDArray[np.int64]:
    """Start and end (k, 2) of the abutting intervals of a flow rate."""
    timestamps = timestamps_us(duration_us, rate_hz)
    return np.stack([timestamps[:-1], timestamps[1:]], axis=-1)
