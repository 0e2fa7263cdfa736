"""What made the wrong entries of a map from frames to events: the rules that makers of files follow by mistake."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Suspect
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.fitting.robust import NORMAL_QUARTILE
from fedora_qa.sequence.facts import IndexMap

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

_MOST: Final = 0.9
"""A deviation is named after a rule that gives at least this share of the wrong entries; most of all entries wins."""

_NEIGHBOURS: Final = (-2, -1, 1, 2)

_CLEAR: Final = 0.3
"""Share of a shift in time, or of a drift, that its spread may be for it to be named."""


@dataclass(frozen=True, slots=True)
class WrongMap:
    """A map with wrong entries.

    Attributes
    ----------
    stream, frames
        Its name, and that of its frames.
    index_map
        As stored and as expected, both cut to the shorter length.
    frame_times_ns
        (n,) stamps of the frames.
    events
        Number of events.
    wrong
        Rows of the wrong entries.
    other
        What the map of the other camera should be, None where there is none of that length.
    """

    stream: str
    frames: str
    index_map: IndexMap
    frame_times_ns: Int64
    events: int
    wrong: NDArray[np.intp]
    other: Int64 | None

    @property
    def off(self) -> Int64:
        """By how many events each wrong entry is off."""
        off: Int64 = (self.index_map.stored - self.index_map.expected_left)[self.wrong]
        return off


def name_deviation(found: WrongMap) -> tuple[str, tuple[Suspect, ...]]:
    """Name the rule that gives the wrong entries, and the causes that would make a file follow it."""
    stored = found.index_map.stored
    fitting = [
        (float(np.mean(stored == entries)), name, suspects)
        for name, entries, suspects in _candidates(found)
        if np.mean(stored[found.wrong] == entries[found.wrong]) >= _MOST
    ]
    if fitting:
        _, name, suspects = max(fitting, key=lambda fit: fit[0])
        return name, suspects
    if set(np.unique(found.off)) <= {-1, 0}:
        name = "they point to the nearest event, before or behind"
        return name, (Suspect("index_off_by_one", found.stream, 0.8, -1.0, "events"),)
    return _in_time(found) or _unnamed(found)


def _candidates(found: WrongMap) -> Iterator[tuple[str, Int64, tuple[Suspect, ...]]]:
    left, right = found.index_map.expected_left, found.index_map.expected_right
    shift = int(np.median(found.off))
    yield "they point behind equal stamps", right, (Suspect("index_side", found.stream, 0.95),)
    yield "they are zero", np.zeros_like(left), _suspects_of_zeros(found)
    clipped = (Suspect("index_off_by_one", found.stream, 0.8, -1.0, "events"),)
    yield "they stop at the last event", np.minimum(left, found.events - 1), clipped
    yield f"they are off by {shift:+d}", left + shift, tuple(_suspects_of_shift(found, shift))
    if found.other is not None and not np.array_equal(found.other, left):
        mixed = Suspect("index_off_by_one", found.stream, 0.6)
        yield "they are those of the other camera", found.other, (*_suspects_of_timestamps(found), mixed)
    for frames in _NEIGHBOURS:
        rows = np.clip(np.arange(len(left)) + frames, 0, len(left) - 1)
        period_ms = 1e3 * float(np.median(np.diff(found.frame_times_ns))) / NS_PER_S if len(left) > 1 else 0.0
        late = (Suspect("time_offset", found.frames, 0.9, -frames * period_ms, "ms"),)
        yield f"they belong to the frame {abs(frames)} {'later' if frames > 0 else 'earlier'}", left[rows], late


def _suspects_of_zeros(found: WrongMap) -> tuple[Suspect, ...]:
    """Tell a map that was not written to its end, zero from some frame on, from one that was not written."""
    share = len(found.wrong) / max(len(found.index_map.stored), 1)
    ends_early = found.wrong[-1] == len(found.index_map.stored) - 1 and share < _MOST
    missing = Suspect("missing_stream", found.stream, 0.5)
    return (Suspect("truncated", found.stream, 0.8, 100 * share, "percent"), missing) if ends_early else (missing,)


def _suspects_of_shift(found: WrongMap, shift: int) -> Iterator[Suspect]:
    """Suspect, where a shift begins at some frame, events that were lost or doubled after the map was made."""
    yield Suspect("index_off_by_one", found.stream, 0.9, float(shift), "events", 0.0)
    from_somewhere = found.wrong[0] > 1 and found.wrong[-1] == len(found.index_map.stored) - 1
    if from_somewhere and abs(shift) > 1:
        yield Suspect("dropped_samples" if shift > 0 else "duplicated_samples", "events", 0.5)


def _in_time(found: WrongMap) -> tuple[str, tuple[Suspect, ...]] | None:
    """Fit the delay of events that would explain the entries: their deviation over the local event rate.

    If events were stamped d late after the map was made, an entry exceeds the count by rate * d. A delay that grows
    with time is a clock of another rate.
    """
    times_s = found.frame_times_ns / NS_PER_S
    if len(times_s) < 3 or np.any(np.diff(times_s) <= 0):
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        rate = np.gradient(found.index_map.expected_left.astype(np.float64), times_s)
        shifts_ms = 1e3 * found.off / rate[found.wrong]
    known = np.isfinite(shifts_ms)
    times_s, shifts_ms = times_s[found.wrong][known], shifts_ms[known]
    if len(shifts_ms) < 3:
        return None
    return _constant(found, shifts_ms) or _drift(found, times_s, shifts_ms)


def _constant(found: WrongMap, shifts_ms: Float64) -> tuple[str, tuple[Suspect, ...]] | None:
    late_ms, spread_ms = _robust(shifts_ms)
    if not spread_ms < _CLEAR * abs(late_ms):
        return None
    error_ms = spread_ms / np.sqrt(len(shifts_ms))
    late = Suspect("time_offset", "events", 0.8, late_ms, "ms", error_ms)
    early = Suspect("time_offset", found.frames, 0.4, -late_ms, "ms", error_ms)
    return f"the entries fit events that are {late_ms:+.4g} ms late", (late, early)


def _drift(found: WrongMap, times_s: Float64, shifts_ms: Float64) -> tuple[str, tuple[Suspect, ...]] | None:
    elapsed_s = times_s - found.frame_times_ns[0] / NS_PER_S
    ppm, spread_ppm = _robust(1e3 * shifts_ms[elapsed_s > 0] / elapsed_s[elapsed_s > 0])
    if not spread_ppm < _CLEAR * abs(ppm):
        return None
    error_ppm = spread_ppm / np.sqrt(len(shifts_ms))
    fast = Suspect("clock_rate", "events", 0.8, ppm, "ppm", error_ppm)
    slow = Suspect("clock_rate", found.frames, 0.4, -ppm, "ppm", error_ppm)
    return f"the entries fit an event clock that runs {ppm:+.4g} ppm fast", (fast, slow)


def _unnamed(found: WrongMap) -> tuple[str, tuple[Suspect, ...]]:
    """Where no rule gives the entries, whatever changed the stamps afterwards is suspected."""
    of_events = tuple(Suspect(cause, "events", 0.3) for cause in ("unsorted", "dropped_samples", "duplicated_samples"))
    suspects = (*_suspects_of_timestamps(found), *of_events, Suspect("index_off_by_one", found.stream, 0.2))
    return "no known deviation", suspects


def _suspects_of_timestamps(found: WrongMap) -> Iterator[Suspect]:
    """Suspect that a map was made before the stamps of its frames, or of events, were changed."""
    left = found.index_map.expected_left
    if len(left) > 2 and len(np.unique(left[1:-1])) == 1:
        yield Suspect("time_unit", found.frames, 0.65)
        yield Suspect("time_unit", "events", 0.5)
    for cause in ("time_unit", "unsorted", "time_offset", "clock_rate", "quantised_time"):
        yield Suspect(cause, found.frames, 0.3)


def _robust(values: Float64) -> tuple[float, float]:
    """Return the median and the standard deviation by the median absolute deviation; NaN without values."""
    if not len(values):
        return float("nan"), float("nan")
    middle = float(np.median(values))
    return middle, float(np.median(np.abs(values - middle))) / NORMAL_QUARTILE
