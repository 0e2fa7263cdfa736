"""A part of a regular clock that runs late, early, or at another rate than the rest."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

Int64 = NDArray[np.int64]

_EXACT_RATIO: Final = 0.5
"""Share of the steps that must equal the period: then the clock is exact, and deviating timestamps were displaced."""

_LEAST_OUTSIDE: Final = 0.1
"""Share of the timestamps that must lie outside the displaced part."""
_ROUNDINGS: Final = 2
"""Units by which rounding alone moves the difference of two timestamps: half of one each, and the period's own."""


@dataclass(frozen=True, slots=True)
class DisplacedSegment:
    """Rows of a clock that lie beside its line.

    Attributes
    ----------
    first, last
        Rows, both of them displaced.
    offset_ns
        Median by which they are late.
    drift
        By how much their clock runs fast, seconds a second; 0 where all are late alike.
    """

    first: int
    last: int
    offset_ns: float
    drift: float


def displaced_part(times_ns: Int64, *, resolution_ns: int) -> DisplacedSegment | None:
    """Return the part of a clock that was moved; None where there is none, or where the clock is not exact.

    Timestamps are compared with the line through the first, with the median step as its period; whole periods, which
    lost samples leave, do not count. The part must begin or end with a jump: a clock that is off its rate throughout
    has none.

    Parameters
    ----------
    times_ns
        (N,) timestamps.
    resolution_ns
        Unit to which they are rounded, ns.

    Returns
    -------
    DisplacedSegment | None
        From the first to the last displaced row.
    """
    if len(times_ns) < 3:
        return None
    steps = np.diff(times_ns)
    period = int(np.median(steps))
    if period <= 0 or np.mean(steps == period) < _EXACT_RATIO:
        return None
    # Deviation from the line through the first timestamp, modulo the period: lost samples leave whole periods.
    deviation_ns = (times_ns - times_ns[0] + period // 2) % period - period // 2
    beside = np.abs(deviation_ns) > resolution_ns
    rows = np.flatnonzero(beside)
    if not len(rows) or len(times_ns) - (rows[-1] - rows[0] + 1) < _LEAST_OUTSIDE * len(times_ns):
        return None
    first, last = int(rows[0]), int(rows[-1])
    # Steps of the deviation into the part and out of it; a part that lasts to the end has no second jump.
    jumps = np.abs(np.diff(deviation_ns))[[max(first - 1, 0), min(last, len(deviation_ns) - 2)]]
    if jumps.max() <= _ROUNDINGS * resolution_ns:
        return None
    inside = deviation_ns[first : last + 1]
    steady = bool(np.ptp(inside) <= _ROUNDINGS * resolution_ns)
    # Slope of the deviation, ns, over the time by the clock's rows, ns: s/s.
    drift = 0.0 if steady else float(np.polyfit(period * np.arange(len(inside), dtype=float), inside, 1)[0])
    return DisplacedSegment(first, last, float(np.median(inside)), drift)
