"""Whether the clock of a stream lies on the grid of the others.

Timestamps of simulators and of good recorders lie on one grid. The timestamps of depth frames, for example, are also
timestamps of colour frames, IMU and poses. After a random offset a stream lies on the grid of the others with a
probability of one microsecond over its period. So a stream that lies on it has no offset, and where all others lie on
one grid the one that does not has it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS
from fedora_qa.sequence.facts import Facts

Place = Literal["in", "out", "unknown"]

_WHOLE: Final = 0.02
"""Largest part of a period by which an offset may differ from whole periods to count as whole: its fit has an error."""

_ALL: Final = 0.999
"""Share of coincident timestamps from which two clocks are one: an offset of one frame in a thousand is less."""

_FEWEST_OTHERS: Final = 2
"""Streams that must agree with each other, because of two clocks that disagree either may be wrong."""


@dataclass(frozen=True, slots=True)
class ClockPlace:
    """Whether a clock lies on the grid of the others.

    Attributes
    ----------
    place
        ``in``: its timestamps lie on the grid of most other streams, and of at least two, or are of the most streams
        that share a grid; ``out``: they do not, while those of all others lie on one grid, or the streams that do not
        share it left it together; ``unknown``: neither.
    period_ms
        Of the stream.
    """

    place: Place
    period_ms: float

    def excludes(self, offset_ms: float | None) -> bool:
        """Whether the clock has not this offset: an offset of whole periods leaves it on the grid."""
        if self.place != "in":
            return False
        if offset_ms is None or not self.period_ms:
            return True
        periods = offset_ms / self.period_ms
        return round(periods) == 0 or abs(periods - round(periods)) > _WHOLE


def places_of_clocks(facts: Facts) -> dict[str, ClockPlace]:
    """Return for every stream whether its clock is in place, by the coincidence of timestamps with other streams.

    Parameters
    ----------
    facts
        Of the file. All rates of flow are one stream, as their timestamps are made together; events have no grid.

    Returns
    -------
    dict
        By stream.
    """
    times_ns: dict[str, NDArray[np.int64]] = {}
    for stream, clock in facts.clocks.items():
        name = "flow" if stream.startswith("flow/") else stream
        # Of several rates of flow the densest.
        if clock.usable and len(clock.times_ns) >= len(times_ns.get(name, ())):
            times_ns[name] = clock.times_ns
    agree = {frozenset(pair): _coincide(times_ns[pair[0]], times_ns[pair[1]]) for pair in combinations(times_ns, 2)}
    common = _most_on_one_grid(list(times_ns), agree)
    apart = [stream for stream in times_ns if stream not in common]
    # Streams of one device, or of one renderer, leave the grid of the others together, and keep their own.
    left_together = bool(common) and all(agree[frozenset(pair)] for pair in combinations(apart, 2))
    places: dict[str, ClockPlace] = {}
    for stream, of_stream_ns in times_ns.items():
        others = [other for other in times_ns if other != stream]
        on_grid = [agree[frozenset((stream, other))] for other in others]
        others_agree = all(agree[frozenset(pair)] for pair in combinations(others, 2))
        place: Place = "unknown"
        # A frame that is late by 5 ms still lies on the grids of poses at 200 Hz and of the IMU, but not of the others.
        if (sum(on_grid) >= _FEWEST_OTHERS and 2 * sum(on_grid) > len(on_grid)) or stream in common:
            place = "in"
        elif (len(others) >= _FEWEST_OTHERS and others_agree) or left_together:
            place = "out"
        # The median ignores gaps.
        period_ms = float(np.median(np.diff(of_stream_ns))) / NS_PER_MS if len(of_stream_ns) > 1 else 0.0
        places[stream] = ClockPlace(place, period_ms)
    return places


def _most_on_one_grid(streams: Sequence[str], agree: Mapping[frozenset[str], bool]) -> frozenset[str]:
    """Return more than half of the streams, which all share one grid; none where several such sets are as large."""
    for count in range(len(streams), max(len(streams) // 2, _FEWEST_OTHERS), -1):
        sets = [
            chosen
            for chosen in combinations(streams, count)
            if all(agree[frozenset(pair)] for pair in combinations(chosen, 2))
        ]
        if sets:
            return frozenset(sets[0]) if len(sets) == 1 else frozenset()
    return frozenset()


def _coincide(first_ns: NDArray[np.int64], second_ns: NDArray[np.int64]) -> bool:
    """Whether the timestamps of the stream with fewer samples, where both overlap, are timestamps of the other."""
    fewer_ns, more_ns = sorted((first_ns, second_ns), key=len)
    if not len(fewer_ns):
        return False
    within = fewer_ns[(fewer_ns >= more_ns.min()) & (fewer_ns <= more_ns.max())]
    return 2 * len(within) >= len(fewer_ns) and float(np.mean(np.isin(within, more_ns))) >= _ALL
