"""The maps from frames to events, compared exactly with the timestamps, and the rule that gives their wrong entries."""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import FactsCheck, Observation
from fedora_qa.conventions import NS_PER_MS, NS_PER_S, NS_PER_US
from fedora_qa.estimators.fitting.robust import NORMAL_QUARTILE
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import NEVER_NS, Facts, IndexMap, has_place
from fedora_qa.views.clock_resets import clock_reset

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

_MOST: Final = 0.9
"""Least ratio of the wrong entries that a named rule reproduces. Of several rules, the one that reproduces most of all
entries is named."""

_NEIGHBOURS: Final = (-2, -1, 1, 2)

_FEWEST_ENTRIES: Final = 3
"""Least number of entries that state a delay exactly: any delay fits one of them, and many fit two."""

_CLEAR: Final = 0.3
"""Largest ratio of the spread to a shift in time, or to a drift, that is named."""

Rule = Literal[
    "behind_equal_timestamps",
    "zero",
    "last_event",
    "shifted",
    "other_camera",
    "neighbouring_frame",
    "nearest_event",
    "delayed_events",
    "drifting_events",
    "none",
]


@dataclass(frozen=True, slots=True)
class MapRule(Feature):
    """The rule that reproduces the wrong entries of a map.

    Attributes
    ----------
    rule
        ``none`` where no rule reproduces them.
    size, standard_error
        Of ``shifted`` in events; of ``neighbouring_frame`` the delay of frames in ms; of ``delayed_events`` in ms; of
        ``drifting_events`` in ppm; otherwise None.
    """

    rule: Rule
    size: float | None = None
    standard_error: float | None = None


@dataclass(frozen=True, slots=True)
class WrongEntries(Feature):
    """Extent of the wrong entries of a map.

    Attributes
    ----------
    frames
        Stream of the frames.
    ratio
        Ratio of wrong entries to all entries.
    begins_within, reaches_end
        Whether the first two entries are correct, and whether the last entry is wrong.
    all_at_one_event
        Whether the correct entries of all frames but the first and last are one number.
    rows
        First wrong entry, and the one behind the last.
    """

    frames: str
    ratio: float
    begins_within: bool
    reaches_end: bool
    all_at_one_event: bool
    rows: tuple[int, int] = (0, 0)


@dataclass(frozen=True, slots=True)
class _StoredMap:
    """A map with wrong entries.

    Attributes
    ----------
    index_map
        As stored and as expected, both cut to the shorter length.
    frame_times_ns
        (n,) timestamps of the frames.
    event_count
        Number of events.
    wrong
        Rows of the wrong entries.
    other_expected
        What the map of the other camera should be, None where there is none of that length.
    """

    index_map: IndexMap
    frame_times_ns: Int64
    event_count: int
    wrong: NDArray[np.intp]
    other_expected: Int64 | None

    @property
    def deviations(self) -> Int64:
        """Stored less correct entry, events, of each wrong entry."""
        deviations: Int64 = (self.index_map.stored - self.index_map.expected_left)[self.wrong]
        return deviations


class _FrameToEvent(FactsCheck):
    """Shared by the maps of both cameras."""

    stream: str
    frames: str

    def not_applicable(self, facts: Facts) -> str:
        """Require the map and timestamps that could be read."""
        return "" if self.stream in facts.index_maps else "the map or its timestamps cannot be read"

    def examine(self, facts: Facts) -> Observation:
        """Count entries that differ from the definition."""
        expected = [other.expected_left for stream, other in facts.index_maps.items() if stream != self.stream]
        return map_observation(
            facts,
            facts.index_maps[self.stream],
            facts.clocks[self.frames].times_ns,
            MapWords(f"index_maps.{self.frames}", self.stream, self.frames, "frame"),
            expected[0] if expected else None,
        )


@dataclass(frozen=True, slots=True)
class MapWords:
    """Names in the statements about a map.

    Attributes
    ----------
    check
        Name of the check.
    stream
        Stream of the finding.
    instants
        Stream of the instants that the map points from.
    noun
        What an entry belongs to.
    """

    check: str
    stream: str
    instants: str
    noun: str


def map_observation(
    facts: Facts, index_map: IndexMap, times_ns: Int64, words: MapWords, other_expected: Int64 | None = None
) -> Observation:
    """Count the entries of a map that differ from its definition, and name the rule that they follow.

    Parameters
    ----------
    index_map
        As stored, with its correct entries.
    times_ns
        (n,) instants that it points from, ns from the file's origin.
    words
        Names for the statements.
    other_expected
        Correct entries of the map of another camera, with which this one may have been exchanged; None without.

    Returns
    -------
    Observation
        One count, with the features ``MapRule`` and ``WrongEntries``.
    """
    events = facts.events
    # Rows beyond the shorter length have no counterpart; the coverage states them.
    length = min(len(index_map.stored), len(index_map.expected_left))
    whole = max(len(index_map.stored), len(index_map.expected_left))
    # No entry is correct or wrong for an instant that is NaN.
    placed = has_place(times_ns[:length])
    coverage = Coverage(int(np.count_nonzero(placed)), whole, f"{words.noun}s")
    if events is None or events.unreadable:
        return Observation(coverage, unobservable="event timestamps cannot be decoded, which the count needs")
    if not length:
        return Observation(coverage, unobservable=f"the map, or the stream of its {words.noun}s, is empty")
    if not placed.any():
        return Observation(coverage, unobservable=f"no {words.noun} has a place in time")
    wrong = np.flatnonzero((index_map.stored[:length] != index_map.expected_left[:length]) & placed)
    first = int(wrong[0]) if len(wrong) else None
    features: list[Feature] = []
    place = ""
    if first is not None:
        cut = IndexMap(
            index_map.stored[:length], index_map.expected_left[:length], index_map.expected_right[:length],
            pointed_ns=None if index_map.pointed_ns is None else index_map.pointed_ns[:length],
        )  # fmt: skip
        other = None if other_expected is None or len(other_expected) < length else other_expected[:length]
        text, rule = _rule_of(_StoredMap(cut, times_ns[:length], events.count, wrong, other), words.noun)
        left = cut.expected_left
        features = [
            rule,
            WrongEntries(
                words.instants,
                ratio=len(wrong) / max(length, 1),
                begins_within=bool(wrong[0] > 1),
                reaches_end=bool(wrong[-1] == length - 1),
                all_at_one_event=length > 2 and len(np.unique(left[1:-1])) == 1,
                rows=(int(wrong[0]), int(wrong[-1]) + 1),
            ),
        ]
        reset = clock_reset(events)
        if reset is not None and reset.covers(times_ns[wrong]):
            features.append(reset)
        place = (
            f": {text}. {words.noun.capitalize()} {first} points to event {index_map.stored[first]}, "
            f"expected {index_map.expected_left[first]}, the first event not before it"
        )
    wrong_entries = count_of_faults(
        name="wrong_entries",
        value=len(wrong),
        unit=f"{words.noun}s",
        statement=f"{len(wrong)} of {len(index_map.stored)} entries of {words.stream} are wrong{place}.",
        code=f"{words.check}.entry",
        where=Where(
            stream=words.stream,
            frame=first if words.noun == "frame" else None,
            index_start=first,
            start_us=None if first is None else facts.to_file_us(float(times_ns[first])),
        ),
        features=tuple(features),
    )
    return Observation(coverage, (wrong_entries,))


def _rule_of(stored_map: _StoredMap, noun: str) -> tuple[str, MapRule]:
    """Return the rule that reproduces the wrong entries, in words and as a feature."""
    stored, wrong = stored_map.index_map.stored, stored_map.wrong
    left, right = stored_map.index_map.expected_left, stored_map.index_map.expected_right
    shift = int(np.median(stored_map.deviations))
    # Each rule in words, the entries that it gives (n,), and the rule as a feature.
    candidates = [
        ("they point after equal timestamps", right, MapRule("behind_equal_timestamps")),
        ("they are zero", np.zeros_like(left), MapRule("zero")),
        ("they stop at the last event", np.minimum(left, stored_map.event_count - 1), MapRule("last_event")),
        (f"they are off by {shift:+d}", left + shift, MapRule("shifted", float(shift), 0.0)),
    ]
    if stored_map.other_expected is not None and not np.array_equal(stored_map.other_expected, left):
        candidates.append(("they are those of the other camera", stored_map.other_expected, MapRule("other_camera")))
    period_ms = 1e3 * float(np.median(np.diff(stored_map.frame_times_ns))) / NS_PER_S if len(left) > 1 else 0.0
    for frames in _NEIGHBOURS:
        rows = np.clip(np.arange(len(left)) + frames, 0, len(left) - 1)
        text = f"they belong to the {noun} {abs(frames)} {'later' if frames > 0 else 'earlier'}"
        candidates.append((text, left[rows], MapRule("neighbouring_frame", -frames * period_ms)))
    fits = [
        (float(np.mean(stored == entries)), text, rule)
        for text, entries, rule in candidates
        if np.mean(stored[wrong] == entries[wrong]) >= _MOST
    ]
    if fits:
        _, text, rule = max(fits, key=lambda fit: fit[0])
        return text, rule
    # The nearest event is the first not before the frame, or the one before that.
    if set(np.unique(stored_map.deviations)) <= {-1, 0}:
        return "they point to the nearest event, before or after", MapRule("nearest_event")
    return _rule_in_time(stored_map) or ("no common rule reproduces them", MapRule("none"))


def _rule_in_time(stored_map: _StoredMap) -> tuple[str, MapRule] | None:
    """Fit the delay of events that would explain the entries.

    A delay, or a rate of their clock, that reproduces entries exactly is preferred. Otherwise the delay is the
    deviation of the entries over the local event rate: if the timestamps of events were delayed by d after the map was
    made, an entry exceeds the count by rate * d. A delay that grows with time is a clock of another rate.
    """
    exact = _exact_rule(stored_map)
    if exact is not None:
        return _in_words(exact), exact
    wrong = stored_map.wrong
    times_s = stored_map.frame_times_ns / NS_PER_S
    # Local event rates need three frames in the order of time.
    if len(times_s) < 3 or np.any(np.diff(times_s) <= 0):
        return None
    with np.errstate(divide="ignore", invalid="ignore"):
        # Events a second at each frame, by central differences of the right entries.
        rate = np.gradient(stored_map.index_map.expected_left.astype(np.float64), times_s)
        # d = deviation / rate (derivation above), in ms.
        shifts_ms = 1e3 * stored_map.deviations / rate[wrong]
    finite = np.isfinite(shifts_ms)
    times_s, shifts_ms = times_s[wrong][finite], shifts_ms[finite]
    if len(shifts_ms) < 3:
        return None
    delay_ms, spread_ms = _median_and_spread(shifts_ms)
    if spread_ms < _CLEAR * abs(delay_ms):
        rule = MapRule("delayed_events", delay_ms, spread_ms / np.sqrt(len(shifts_ms)))
        return _in_words(rule), rule
    # A drift grows from the first frame on; 1 ms a second is 1000 ppm.
    elapsed_s = times_s - stored_map.frame_times_ns[0] / NS_PER_S
    ppm, spread_ppm = _median_and_spread(1e3 * shifts_ms[elapsed_s > 0] / elapsed_s[elapsed_s > 0])
    if spread_ppm < _CLEAR * abs(ppm):
        rule = MapRule("drifting_events", ppm, spread_ppm / np.sqrt(len(shifts_ms)))
        return _in_words(rule), rule
    return None


def _in_words(rule: MapRule) -> str:
    """Return a rule in time in words."""
    if rule.rule == "delayed_events":
        return f"they fit events that are {rule.size:+.4g} ms late"
    return f"they fit an event clock that runs {rule.size:+.4g} ppm fast"


def _exact_rule(stored_map: _StoredMap) -> MapRule | None:
    """Return the delay of events, or the rate of their clock, with which most wrong entries are right; None without.

    With events that are late by d, the entry s of a frame at the time f is right where
    ``t[s - 1] - d < f <= t[s] - d``, so that d lies from ``t[s - 1] - f`` to ``t[s] - f``. A clock that is fast by the
    rate r is late by ``r (f - f[0])``.
    """
    pointed_ns = stored_map.index_map.pointed_ns
    if pointed_ns is None:
        return None
    intervals_ns = pointed_ns[stored_map.wrong] - stored_map.frame_times_ns[stored_map.wrong, np.newaxis]
    # Where a frame is before or after all events, any larger delay does.
    bounded = np.all(np.abs(pointed_ns[stored_map.wrong]) < NEVER_NS, axis=1)
    if np.count_nonzero(bounded) < _FEWEST_ENTRIES:
        return None
    common = _most_common(intervals_ns.astype(np.float64))
    if common is not None:
        low_ns, high_ns = common
        # Timestamps are whole microseconds: so is a delay, where there is room for one.
        middle_ns = (low_ns + high_ns) / 2
        whole_us_ns = NS_PER_US * np.ceil(middle_ns / NS_PER_US)
        delay_ns = whole_us_ns if low_ns < whole_us_ns <= high_ns else middle_ns
        return MapRule("delayed_events", float(delay_ns / NS_PER_MS), _of_uniform(low_ns, high_ns) / NS_PER_MS)
    elapsed_ns = (stored_map.frame_times_ns - stored_map.frame_times_ns[0])[stored_map.wrong]
    later = elapsed_ns > 0
    common = _most_common(1e6 * intervals_ns[later] / elapsed_ns[later, np.newaxis])
    if common is None:
        return None
    return MapRule("drifting_events", sum(common) / 2, _of_uniform(*common))


def _most_common(intervals: Float64) -> tuple[float, float] | None:
    """Return the ends of what most of n intervals (n, 2) have in common; None where fewer than ``_MOST`` have any."""
    # An interval opens above its lower end: of equal ends those at which another closes come first.
    ends, opens = intervals.ravel(), np.tile([1, -1], len(intervals))
    order = np.lexsort((opens, ends))
    depth = np.cumsum(opens[order])
    deepest = int(np.argmax(depth)) if len(depth) else 0
    if len(intervals) < _FEWEST_ENTRIES or depth[deepest] < _MOST * len(intervals):
        return None
    low, high = ends[order[deepest : deepest + 2]].tolist()
    return low, high


def _of_uniform(low: float, high: float) -> float:
    """Return the standard deviation of a uniform distribution over an interval."""
    return float((high - low) / np.sqrt(12))


def _median_and_spread(values: Float64) -> tuple[float, float]:
    """Return the median and the standard deviation by the median absolute deviation; NaN without values."""
    if not len(values):
        return float("nan"), float("nan")
    middle = float(np.median(values))
    # 0.6745 standard deviations of a normal distribution are its median absolute deviation.
    return middle, float(np.median(np.abs(values - middle))) / NORMAL_QUARTILE
