"""A regular clock that was set back, and whose samples were then sorted by their timestamps."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.clocks.regular_clock import exact_period

Int64 = NDArray[np.int64]

_ROUNDINGS: Final = 2
"""Largest change of the difference of two timestamps by rounding, in units of the timestamps."""


@dataclass(frozen=True, slots=True)
class MergedClock:
    """Samples of an exact clock before and behind the instant at which it was set back.

    Attributes
    ----------
    before, behind
        (n,) and (m,) rows of the samples before that instant, and of those behind it, each in order. Where both have
        the same timestamps they take turns.
    offset_ns
        Of the samples behind it, negative: by as much the clock was set back.
    """

    before: Int64
    behind: Int64
    offset_ns: int


def merged_clock(times_ns: Int64, *, resolution_ns: int) -> MergedClock | None:
    """Return the samples before and behind the instant at which an exact clock was set back; None of another clock.

    Where timestamps overlap there are those of two clocks of the same period, which lie apart.

    Parameters
    ----------
    times_ns
        (N,) timestamps, ns, in order.
    resolution_ns
        Unit to which the timestamps are rounded, ns.
    """
    if len(times_ns) < 3:
        return None
    steps, within_ns = np.diff(times_ns), _ROUNDINGS * resolution_ns
    period_ns = exact_period(steps)
    if period_ns is None or np.any(steps <= 0):
        return None
    odd = np.flatnonzero(np.abs(steps - period_ns) > within_ns)
    if len(odd) < 2:
        return None
    first, last = int(odd[0]), int(odd[-1]) + 1

    def is_on(time_ns: np.int64) -> NDArray[np.bool_]:
        """Return whether each timestamp is whole periods from another one."""
        half_ns = period_ns // 2
        return np.asarray(np.abs((times_ns - time_ns + half_ns) % period_ns - half_ns) <= within_ns)

    on_first, on_last = is_on(times_ns[first]), is_on(times_ns[last])
    rows = np.arange(len(times_ns))
    before, behind = rows[on_first & (rows < last)], rows[on_last & (rows > first)]
    is_whole = np.array_equal(np.sort(np.concatenate([before, behind])), rows)
    are_even = all(
        np.all(np.abs(np.diff(times_ns[part]) - period_ns) <= within_ns) for part in (before, behind) if len(part)
    )
    if not (is_whole and are_even and len(before) and len(behind)):
        return None
    offset_ns = int(times_ns[behind[0]] - times_ns[before[-1]]) - period_ns
    return MergedClock(before, behind, offset_ns) if offset_ns < -within_ns else None
