"""What still fits into a budget of time, by what has been measured in this run and nothing else.

Two things are measured: how long windows take, and how long it takes to come from what they have shown to a record.
The latter is rehearsed on a copy, when windows have become twice as many as at the last rehearsal, so that rehearsals
together cost less than twice the last of them.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Final

_LATEST: Final = 8
"""Of so many windows the slowest counts for the next one: the first ones also load and compile, and are forgotten."""

_MOST_WINDOWS: Final = 8
"""In a step: a worker that dies takes them with it."""


@dataclass(slots=True)
class Pace:
    """How fast one file comes on, at one density of looking.

    Attributes
    ----------
    windows
        How many windows have been measured.
    """

    windows: int = 0
    _spent_s: float = 0.0
    _latest_s: deque[float] = field(default_factory=lambda: deque(maxlen=_LATEST))

    def add(self, windows: int, seconds: float) -> None:
        """Note how long some windows took together, with all that a step costs."""
        self.windows += windows
        self._spent_s += seconds
        self._latest_s.append(seconds / windows)

    @property
    def mean_s(self) -> float:
        """Seconds a window, of the latest."""
        return sum(self._latest_s) / len(self._latest_s)

    @property
    def longest_s(self) -> float:
        """Seconds of the slowest of the latest windows."""
        return max(self._latest_s)

    @property
    def unevenness(self) -> float:
        """How many times slower than their mean the slowest of the latest windows was: 1 where nothing disturbs.

        Another load of the machine, which makes some windows slower, may make judgement slower than rehearsed.
        """
        return self.longest_s / self.mean_s if self.mean_s else 1.0

    @property
    def spent_s(self) -> float:
        """Seconds of all windows so far."""
        return self._spent_s


@dataclass(slots=True)
class Reserve:
    """How long judgement will take: the second look, conclusions, statistics and evidence."""

    _rehearsed: list[tuple[int, float]] = field(default_factory=list)

    def add(self, windows: int, seconds: float) -> None:
        """Note a rehearsal after so many windows."""
        self._rehearsed.append((windows, seconds))

    @property
    def is_known(self) -> bool:
        """Whether there was any rehearsal."""
        return bool(self._rehearsed)

    def seconds(self, windows: int) -> float:
        """Return the seconds to keep for after so many windows: on the line through the last two rehearsals.

        After one, in proportion to the windows, which is too much where part of it does not grow with them. Never less
        than the last rehearsal took.
        """
        if not self._rehearsed:
            return 0.0
        last_windows, last_s = self._rehearsed[-1]
        if len(self._rehearsed) == 1:
            return last_s * max(1.0, windows / last_windows)
        before_windows, before_s = self._rehearsed[-2]
        slope = max(0.0, (last_s - before_s) / max(last_windows - before_windows, 1))
        return last_s + slope * max(0, windows - last_windows)

    def is_due(self, windows: int, pace: Pace, left_s: float) -> bool:
        """Whether to rehearse: windows have doubled, and there is time for it and for more windows after it.

        Before the first time nobody knows what it takes; then there must be time for as many windows again.
        """
        if not self._rehearsed:
            return left_s > pace.spent_s
        return (
            windows >= 2 * self._rehearsed[-1][0]
            and left_s > 2 * pace.unevenness * self.seconds(windows) + pace.longest_s
        )


def batch(left_s: float, pace: Pace, pending: int, workers: int) -> int:
    """Return how many windows to measure in one step, 0 where none fits.

    At most half of what fits, so that the pace is known anew before the end, and no worker waits for another for long.
    """
    if not pending or pace.longest_s > left_s:
        return 0
    share = -(-pending // workers)
    return max(1, min(_MOST_WINDOWS, int(left_s / pace.longest_s / 2), share))
