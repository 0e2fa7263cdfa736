"""Index maps are held exactly, and deviations are named."""

import numpy as np
import pytest

from fedora_qa.checks.clocks.index_maps import Depth, Rgb
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.sequence.facts import Facts
from tests.support.facts import exact_facts, with_map

CLEAN = exact_facts()
LEFT = CLEAN.index_maps["rgb_to_event"].expected_left
RIGHT = CLEAN.index_maps["rgb_to_event"].expected_right
EVENTS_PER_MS = 1000
CHECKS = {"rgb_to_event": Rgb(), "depth_to_event": Depth()}


def judged(name: str, facts: Facts) -> Judged:
    check = CHECKS[name]
    return judge({check.name: check.examine(facts)}, [check], 1e-4)[0]


FAULTS = {
    "off by one": (LEFT + 1, "index_off_by_one", 1.0),
    "off by minus three": (LEFT - 3, "index_off_by_one", -3.0),
    "zeros": (np.zeros_like(LEFT), "missing_stream", None),
    "events were stamped 2 ms late afterwards": (LEFT + 2 * EVENTS_PER_MS + LEFT % 7, "time_offset", 2.0),
}


@pytest.mark.parametrize("name", CHECKS)
def test_exact_map_passes(name: str) -> None:
    """The definition itself has no wrong entry."""
    assert judged(name, CLEAN).result.outcome == "passed"


@pytest.mark.parametrize("name", CHECKS)
@pytest.mark.parametrize(("stored", "cause", "magnitude"), FAULTS.values(), ids=FAULTS)
def test_deviation_is_named(name: str, stored: np.ndarray, cause: str, magnitude: float | None) -> None:
    """The check fails and its first suspect is what was planted."""
    alarm = judged(name, with_map(CLEAN, name, stored)).alarms[0]
    assert alarm.suspects[0].cause == cause
    if magnitude is not None:
        assert alarm.suspects[0].magnitude == pytest.approx(magnitude, rel=0.01)
    assert alarm.finding.where.stream == name


@pytest.mark.parametrize("name", CHECKS)
def test_right_side_is_told_from_off_by_one(name: str) -> None:
    """Where every other frame shares its stamp with an event, only those entries point behind it."""
    alarm = judged(name, with_map(CLEAN, name, RIGHT)).alarms[0]
    assert alarm.suspects[0].cause == "index_side"


def test_one_wrong_entry_is_found_and_placed() -> None:
    """A single entry off by one among a hundred is an alarm, and its frame is named."""
    stored = LEFT.copy()
    stored[37] += 1
    alarm = judged("rgb_to_event", with_map(CLEAN, "rgb_to_event", stored)).alarms[0]
    assert alarm.finding.where.frame == 37
    assert alarm.finding.where.start_us == pytest.approx(37 * 20_000)
