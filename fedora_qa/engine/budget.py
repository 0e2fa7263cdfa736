"""What still fits into a budget of time, estimated from durations measured in this run and from nothing else.

Two durations are measured: of windows, and of the steps from their states to a record. The latter is rehearsed on a
copy whenever the number of windows has doubled since the last rehearsal. So all rehearsals together take less than
twice as long as the last of them.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Final

_LATEST: Final = 8
"""Number of latest windows whose slowest predicts the next one. The first windows, which also load and compile, drop
out of them."""

_MOST_WINDOWS: Final = 8
"""Most windows of a step: a worker that dies loses them."""


@dataclass(slots=True)
class Pace:
    """How fast the windows of one file are measured at one density.

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
        """Mean seconds of the latest windows."""
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
    """How long judgement will take: follow-ups, conclusions, statistics and evidence."""

    _rehearsed: list[tuple[int, float]] = field(default_factory=list)

    def add(self, windows: int, seconds: float) -> None:
        """Note a rehearsal after so many windows."""
        self._rehearsed.append((windows, seconds))

    @property
    def is_known(self) -> bool:
        """Whether there was any rehearsal."""
        return bool(self._rehearsed)

    def seconds(self, windows: int) -> float:
        """Return the seconds that judgement takes after so many windows, on the line through the last two rehearsals.

        After one rehearsal they are proportional to the windows, an upper bound where judgement has a constant part.
        They are never fewer than the last rehearsal took.
        """
        if not self._rehearsed:
            return 0.0
        last_windows, last_s = self._rehearsed[-1]
        if len(self._rehearsed) == 1:
            return last_s * max(1.0, windows / last_windows)
        before_windows, before_s = self._rehearsed[-2]
        # Judgement does not get faster with more windows: a negative slope is scatter of the measured times.
        slope = max(0.0, (last_s - before_s) / max(last_windows - before_windows, 1))
        return last_s + slope * max(0, windows - last_windows)

    def is_due(self, windows: int, pace: Pace, left_s: float) -> bool:
        """Whether to rehearse: windows have doubled, and there is time for it and for more windows after it.

        Before the first rehearsal its duration is unknown; then there must be time for as many windows again.
        """
        if not self._rehearsed:
            # Assumed bound of the unknown duration: that of all windows so far.
            return left_s > pace.spent_s
        return (
            # Twice: for the rehearsal and for judgement. Without time for one window more it would decide nothing.
            windows >= 2 * self._rehearsed[-1][0]
            and left_s > 2 * pace.unevenness * self.seconds(windows) + pace.longest_s
        )


def batch(left_s: float, pace: Pace, pending: int, workers: int) -> int:
    """Return how many windows to measure in one step, 0 where none fits.

    At most half of the windows that fit, so that the pace is measured again before the end, and workers end together.
    """
    if not pending or pace.longest_s > left_s:
        return 0
    # Rounded up: the last windows are spread over all workers.
    share = -(-pending // workers)
    return max(1, min(_MOST_WINDOWS, int(left_s / pace.longest_s / 2), share))
