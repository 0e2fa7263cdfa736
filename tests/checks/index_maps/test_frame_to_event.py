"""Index maps are held exactly, and deviations are named."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.index_maps.depth import IndexMapsDepth
from fedora_qa.checks.index_maps.frame_to_event import MapRule, MapWords, map_observation
from fedora_qa.checks.index_maps.rgb import IndexMapsRgb
from fedora_qa.diagnosis.hypothesis import only_feature
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.faults.index_maps import IndexShift
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.layout.binding import INVALID_TIMESTAMP_NS
from fedora_qa.sequence.facts import NEVER_NS, Facts, IndexMap, clock_of
from tests.support.checked import diagnoses_of, run_check
from tests.support.facts import exact_facts, with_map
from tests.support.handmade import write_handmade

CLEAN = exact_facts()
LEFT = CLEAN.index_maps["rgb_to_event"].expected_left
RIGHT = CLEAN.index_maps["rgb_to_event"].expected_right
EVENTS_PER_MS = 1000
FRAMES_US = np.arange(0, 1_000_001, 20_000)
CHECKS = {"rgb_to_event": IndexMapsRgb(), "depth_to_event": IndexMapsDepth()}


def judged(name: str, facts: Facts) -> Judged:
    check = CHECKS[name]
    return judge({check.name: check.examine(facts)}, [check], 1e-4)[0]


def half(stored: np.ndarray) -> np.ndarray:
    return np.where(np.arange(len(LEFT)) < 60, LEFT, stored)


FAULTS = {
    "off by one": (LEFT + 1, "index_off_by_one", 1.0),
    "off by minus three": (LEFT - 3, "index_off_by_one", -3.0),
    "zeros": (np.zeros_like(LEFT), "missing_stream", None),
    "not written to the end": (half(np.zeros_like(LEFT)), "truncated", 100 * 41 / 101),
    "the nearest event": (LEFT - np.arange(len(LEFT)) % 3 // 2, "index_off_by_one", -1.0),
    "the frame before": (np.concatenate([LEFT[:1], LEFT[:-1]]), "time_offset", 20.0),
    "shifted from a frame on": (half(LEFT + 40), "index_off_by_one", 40.0),
    "an event clock 2000 ppm fast": (LEFT + np.rint(2e-3 * LEFT).astype(int), "clock_rate", 2000.0),
    "events were stamped 2 ms late afterwards": (LEFT + 2 * EVENTS_PER_MS + LEFT % 7, "time_offset", 2.0),
}


@pytest.mark.parametrize("name", CHECKS)
def test_exact_map_passes(name: str) -> None:
    """The definition itself has no wrong entry."""
    assert judged(name, CLEAN).result.outcome == "passed"


@pytest.mark.parametrize("name", CHECKS)
@pytest.mark.parametrize(("stored", "cause", "magnitude"), FAULTS.values(), ids=FAULTS)
def test_deviation_is_named(name: str, stored: np.ndarray, cause: str, magnitude: float | None) -> None:
    """The check fails and its first hypothesis is what was planted."""
    facts = with_map(CLEAN, name, stored)
    alarm = judged(name, facts).alarms[0]
    first = hypotheses_of(alarm, facts)[0]
    assert first.cause == cause
    if magnitude is not None:
        assert first.magnitude == pytest.approx(magnitude, rel=0.01)
    assert alarm.finding.where.stream == name


def test_no_entry_is_right_for_a_frame_without_a_time() -> None:
    """A timestamp that is NaN is a finding of its own."""
    times_ns = CLEAN.clocks["rgb"].times_ns.copy()
    times_ns[5] = INVALID_TIMESTAMP_NS
    stored, expected = LEFT.copy(), LEFT.copy()
    stored[5], expected[5] = 0, 1234
    clocks = {**CLEAN.clocks, "rgb": clock_of(times_ns, None)}
    index_map = replace(CLEAN.index_maps["rgb_to_event"], stored=stored, expected_left=expected)
    facts = replace(CLEAN, clocks=clocks, index_maps={**CLEAN.index_maps, "rgb_to_event": index_map})
    result = judged("rgb_to_event", facts).result
    assert result.outcome == "passed"
    assert result.coverage is not None
    assert result.coverage.seen == len(LEFT) - 1


@pytest.mark.parametrize("name", CHECKS)
def test_events_that_were_lost_shift_every_map(name: str) -> None:
    """Where another map is right beyond the frame at which a shift begins, no events were lost there."""
    (other,) = CHECKS.keys() - {name}
    one = with_map(CLEAN, name, half(LEFT + 40))
    both = with_map(one, other, half(LEFT + 40))
    of_one, of_both = ({h.cause for h in hypotheses_of(judged(name, facts).alarms[0], facts)} for facts in (one, both))
    assert of_one == {"index_off_by_one"}
    assert of_both == {"index_off_by_one", "dropped_samples"}


@pytest.mark.parametrize("name", CHECKS)
def test_a_shift_is_undone_from_the_frame_on_at_which_it_begins(name: str) -> None:
    facts = with_map(CLEAN, name, half(LEFT + 40))
    faults = list(faults_for("index_off_by_one", name, 40.0, judged(name, facts).alarms, {}, facts))
    assert faults == [IndexShift(name, 40, (60, 101)), IndexShift(name, 40)]


@pytest.mark.parametrize("name", CHECKS)
def test_right_side_is_told_from_off_by_one(name: str) -> None:
    """Where every other frame shares its stamp with an event, only those entries point behind it."""
    facts = with_map(CLEAN, name, RIGHT)
    assert hypotheses_of(judged(name, facts).alarms[0], facts)[0].cause == "index_side"


def test_one_wrong_entry_is_found_and_placed() -> None:
    """A single entry off by one among a hundred is an alarm, and its frame is named."""
    stored = LEFT.copy()
    stored[37] += 1
    alarm = judged("rgb_to_event", with_map(CLEAN, "rgb_to_event", stored)).alarms[0]
    assert alarm.finding.where.frame == 37
    assert alarm.finding.where.start_us == pytest.approx(37 * 20_000)


def test_the_other_cameras_map_is_named() -> None:
    """Where the cameras run at different instants, a map that was made of the other's stamps is told."""
    maps = dict(CLEAN.index_maps)
    later = LEFT + 777 + LEFT // 1000 % 13
    maps["depth_to_event"] = replace(maps["depth_to_event"], stored=LEFT, expected_left=later, expected_right=later)
    maps["rgb_to_event"] = replace(maps["rgb_to_event"], stored=later)
    alarm = judged("rgb_to_event", replace(CLEAN, index_maps=maps)).alarms[0]
    assert "the other camera" in alarm.finding.message


@pytest.mark.parametrize(
    ("change", "words", "cause"),
    [
        (lambda left: left, "", ""),
        (lambda left: left + 2, "they are off by +2", "ms_to_event:index_off_by_one"),
        (lambda left: np.where(left > 0, left - 1, 0), "they are off by -1", "ms_to_event:index_off_by_one"),
        (lambda left: left + 2 * EVENTS_PER_MS + left % 7, "events that are +2", "ms_to_event:unknown"),
        (lambda left: left + left // EVENTS_PER_MS % 2 * 5, "they are off by +5", "ms_to_event:unknown"),
        (lambda left: left + left // EVENTS_PER_MS % 3 * 5, "no common rule reproduces them", "ms_to_event:unknown"),
        (lambda left: left * 0, "they are zero", "ms_to_event:unknown"),
    ],
)
def test_milliseconds_are_held_to_their_own_instants(change: Any, words: str, cause: str, tmp_path: Path) -> None:
    """Entry k counts the events before k ms of the stored clock, whatever frames there are."""
    path = write_milliseconds(tmp_path / "milliseconds.h5", change)
    result = run_check(path, "index_maps.milliseconds")
    assert result.outcome == ("failed" if words else "passed")
    assert all(words in finding.message and "Millisecond" in finding.message for finding in result.findings)
    diagnoses = diagnoses_of(path, "index_maps.milliseconds")
    assert [f"{diagnosis.stream}:{diagnosis.cause}" for diagnosis in diagnoses] == [cause] * bool(words)


@pytest.mark.parametrize(
    ("change", "cause", "magnitude", "status"),
    [
        (lambda left: left + 2, "index_off_by_one", 2.0, "confirmed"),
        (lambda left: left - 3, "index_off_by_one", -3.0, "confirmed"),
        # With one event added to all entries, the first would be 1.
        (lambda left: np.maximum(left - 1, 0), "index_off_by_one", -1.0, "suggested"),
        (lambda left: left + left // EVENTS_PER_MS % 2 * 5, "unknown", None, "unidentified"),
    ],
)
def test_a_shift_of_milliseconds_is_confirmed_where_undoing_clears_it(
    change: Any, cause: str, magnitude: float | None, status: str, tmp_path: Path
) -> None:
    """A constant shift of all entries is undone exactly; of every other entry it is none."""
    path = write_milliseconds(tmp_path / "milliseconds.h5", change)
    # Trials measure as much as the run itself did: of several checks.
    options = CheckOptions(select=("index_maps.milliseconds", "event_stream"), evidence=None)
    (diagnosis,) = check_file(path, options).record.diagnoses
    assert (diagnosis.cause, diagnosis.stream) == (cause, "ms_to_event")
    assert (diagnosis.magnitude, diagnosis.status) == (magnitude, status)


def write_milliseconds(path: Path, change: Any) -> Path:
    """A file with an event each microsecond, and the changed map of its milliseconds."""
    write_handmade(path)
    with h5py.File(path, "a") as file:
        times_us = np.arange(0, 100_000)
        for name, values in {"t": times_us, "x": times_us % 16, "y": times_us % 12, "p": times_us % 2}.items():
            kept = file[f"path/events/{name}"].dtype
            del file[f"path/events/{name}"]
            file[f"path/events/{name}"] = values.astype(kept)
        file["metadata/ms_to_event"] = change(np.arange(90) * EVENTS_PER_MS)
    return path


def test_maps_of_no_frame_are_not_judged() -> None:
    """A map without an entry is neither right nor wrong."""
    empty = np.empty(0, np.int64)
    facts = replace(CLEAN, index_maps={"rgb_to_event": replace(CLEAN.index_maps["rgb_to_event"], stored=empty)})
    assert judged("rgb_to_event", facts).result.outcome == "not_observable"


@given(seed=st.integers(0, 1000), count=st.integers(2000, 5000), delay_us=st.integers(5_000, 15_000))
def test_a_delay_after_the_map_was_made_is_exact_to_the_gaps_between_events(
    seed: int, count: int, delay_us: int
) -> None:
    """Undoing the stated delay makes the entries right again, and the stated error covers the true delay."""
    written_us = np.sort(np.random.default_rng(seed).choice(1_000_000, count, replace=False))
    rule = rule_of(stored_map(np.searchsorted(written_us, FRAMES_US), written_us + delay_us))
    assert rule.rule == "delayed_events"
    assert rule.size is not None
    assert rule.standard_error is not None
    # No value of a uniform distribution is farther than sqrt(3) standard deviations; the nearest whole us may be.
    assert abs(1e3 * rule.size - delay_us) <= 2 * np.sqrt(3) * 1e3 * rule.standard_error
    undone_us = written_us + delay_us - 1e3 * rule.size
    assert np.mean(np.searchsorted(undone_us, FRAMES_US - 1e-6) == np.searchsorted(written_us, FRAMES_US)) >= 0.9


@pytest.mark.parametrize("ppm", [3_000.0, 25_300.0])
def test_a_rate_after_the_map_was_made_is_exact(ppm: float) -> None:
    """The stated error, of gaps of 1 ms within 1 s, covers the true rate."""
    written_us = np.arange(0, 1_000_000, 1_000) + 7
    fast_us = np.rint(written_us * (1 + 1e-6 * ppm)).astype(np.int64)
    rule = rule_of(stored_map(np.searchsorted(written_us, FRAMES_US), fast_us))
    assert rule.rule == "drifting_events"
    assert rule.size is not None
    assert rule.standard_error is not None
    assert abs(rule.size - ppm) <= np.sqrt(3) * rule.standard_error < 1_000.0


def test_two_entries_state_no_delay() -> None:
    """Any delay fits one entry, and many fit two."""
    frames_us, written_us = np.array([500_000, 900_000]), 1000 * np.arange(1000) + np.arange(1000) ** 2 % 997
    index_map = stored_map(np.searchsorted(written_us, frames_us), written_us + 30_400, frames_us)
    assert rule_of(index_map, frames_us).rule != "delayed_events"


def stored_map(stored: np.ndarray, events_us: np.ndarray, frames_us: np.ndarray = FRAMES_US) -> IndexMap:
    """Return a map with the events that its entries point to."""
    around_ns = np.concatenate([[-NEVER_NS], 1000 * events_us, [NEVER_NS]])
    return IndexMap(
        stored,
        np.searchsorted(events_us, frames_us, "left"),
        np.searchsorted(events_us, frames_us, "right"),
        pointed_ns=np.stack([around_ns[stored], around_ns[stored + 1]], axis=1),
    )


def rule_of(index_map: IndexMap, frames_us: np.ndarray = FRAMES_US) -> MapRule:
    """Return the rule that a map's wrong entries follow."""
    words = MapWords("index_maps.rgb", "rgb_to_event", "rgb", "frame")
    observation = map_observation(CLEAN, index_map, 1000 * frames_us, words)
    return only_feature(observation.measurements[0].features, MapRule)
