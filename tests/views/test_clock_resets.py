"""A clock of the events that was set for a while is told from its steps, and from events that are out of order."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.clocks.order import ClocksOrder
from fedora_qa.checks.index_maps.rgb import IndexMapsRgb
from fedora_qa.diagnosis.clocks import hypotheses_of_reset
from fedora_qa.judgement.judge import judge
from fedora_qa.sequence.facts import EventScan, Facts
from fedora_qa.sequence.scan import KEPT_STEPS, longest_steps
from fedora_qa.views.clock_resets import clock_reset
from tests.support.facts import MS, exact_facts, with_map

Int64 = NDArray[np.int64]

RIGHT_NS = np.cumsum(np.random.default_rng(4).integers(1, 400, 20_000)) * 1000
"""Twenty thousand events over four seconds, at most 0.4 ms apart."""

PART = slice(5_000, 15_000)


def scan_of(times_ns: Int64) -> EventScan:
    latest, steps = np.maximum.accumulate(times_ns), np.diff(times_ns)
    return EventScan(
        count=len(times_ns),
        first_ns=int(times_ns.min()),
        last_ns=int(times_ns.max()),
        decreases=int(np.count_nonzero(steps < 0)),
        first_decrease=int(np.argmax(steps < 0)) + 1 if np.any(steps < 0) else -1,
        grid_ns=1000,
        largest_decrease_ns=max(0, -int(steps.min())),
        behind=int(np.count_nonzero(times_ns < latest)),
        longest_steps=longest_steps((), 0, int(times_ns[0]), times_ns),
    )


def moved(change: Callable[[Int64], Int64], part: slice = PART) -> Int64:
    times_ns = RIGHT_NS.copy()
    times_ns[part] = change(times_ns[part])
    return times_ns


def facts_of(times_ns: Int64) -> Facts:
    return replace(exact_facts(4), events=scan_of(times_ns))


def gained(ppm: float) -> Callable[[Int64], Int64]:
    return lambda part: part + np.rint((part - part[0]) * ppm / 1e9).astype(np.int64) * 1000


@pytest.mark.parametrize(
    ("times_ns", "cause", "size", "within"),
    [
        pytest.param(moved(lambda part: part + 6 * MS), "time_offset", 6.0, 0.4, id="late"),
        pytest.param(moved(lambda part: part - 6 * MS), "time_offset", -6.0, 0.4, id="early"),
        pytest.param(moved(lambda part: part * 1000), "time_unit", 1000.0, 0.0, id="nanoseconds"),
        pytest.param(moved(lambda part: part // 1_000_000 * 1000), "time_unit", 0.001, 0.0, id="milliseconds"),
        pytest.param(moved(gained(5000)), "clock_rate", None, 0.0, id="gains"),
        pytest.param(moved(lambda part: gained(5000)(part) + 9 * MS), "clock_rate", 5000.0, 500.0, id="late and gains"),
    ],
)
def test_what_moved_a_part_is_told_from_its_steps(
    times_ns: Int64, cause: str, size: float | None, within: float
) -> None:
    """A part that is late, early, in another unit or gains leaves steps that say which, and by how much."""
    reset = clock_reset(scan_of(times_ns))
    assert reset is not None
    first = hypotheses_of_reset(reset)[0]
    assert first.cause == cause
    assert (first.magnitude is None) == (size is None)
    if size is not None and first.magnitude is not None:
        assert abs(first.magnitude - size) <= within


def exchanged(rows: int) -> Int64:
    return moved(lambda part: part[::-1], slice(7_000, 7_000 + rows))


@pytest.mark.parametrize(
    "times_ns",
    [
        pytest.param(RIGHT_NS, id="in order"),
        pytest.param(exchanged(2), id="two exchanged"),
        pytest.param(exchanged(7), id="seven in reverse"),
        pytest.param(np.random.default_rng(1).permutation(RIGHT_NS), id="shuffled"),
        pytest.param(
            np.concatenate([RIGHT_NS[:5_000], RIGHT_NS[9_000:15_000], RIGHT_NS[5_000:9_000], RIGHT_NS[15_000:]]),
            id="two blocks exchanged",
        ),
        pytest.param((RIGHT_NS + (np.arange(RIGHT_NS.size) % 4 == 0) * 6 * MS), id="a quarter of the pixels late"),
    ],
)
def test_events_out_of_order_are_no_clock_that_was_set(times_ns: Int64) -> None:
    """Neither events in order, nor single ones or blocks in another order, nor those of some pixels are a clock set."""
    assert clock_reset(scan_of(times_ns)) is None


@given(st.integers(2, 40), st.integers(1, 4_000))
def test_a_late_part_is_told_wherever_it_stands(offset_ms: int, rows: int) -> None:
    """The size follows from both steps to the longest natural one, at any place and length of the part."""
    part = slice(6_000, 6_000 + max(rows, 600))
    reset = clock_reset(scan_of(moved(lambda of_part: of_part + offset_ms * MS, part)))
    assert reset is not None
    first = hypotheses_of_reset(reset)[0]
    assert (first.cause, first.stream) == ("time_offset", "events")
    assert first.magnitude == pytest.approx(offset_ms, abs=first.standard_error)


@given(st.lists(st.integers(-50, 50), min_size=2, max_size=80), st.integers(1, 79))
def test_steps_are_the_longest_however_blocks_are_cut(steps: list[int], at: int) -> None:
    """Two blocks give the steps of one, in the order of the file, and no step left out is longer than one kept."""
    times_ns = np.cumsum(steps)
    at = min(at, len(times_ns) - 1)
    whole = longest_steps((), 0, int(times_ns[0]), times_ns)
    first = longest_steps((), 0, int(times_ns[0]), times_ns[:at])
    assert longest_steps(first, at, int(times_ns[at - 1]), times_ns[at:]) == whole
    assert [one.row for one in whole] == sorted(one.row for one in whole)
    for sign in (1, -1):
        lengths = np.sort(sign * np.diff(times_ns))[::-1]
        assert sorted((sign * one.length_ns for one in whole if sign * one.length_ns > 0), reverse=True) == [
            length for length in lengths[:KEPT_STEPS] if length > 0
        ]


def test_order_and_maps_propose_the_clock_first() -> None:
    """A late part is proposed for the order of the stamps, and for a map that is wrong only where the part lies."""
    facts = facts_of(moved(lambda part: part + 6 * MS))
    stored = facts.index_maps["rgb_to_event"].expected_left.copy()
    inside = int(np.searchsorted(facts.clocks["rgb"].times_ns, RIGHT_NS[PART][100]))
    stored[inside] += 40
    facts = with_map(facts, "rgb_to_event", stored)
    checks = (ClocksOrder(), IndexMapsRgb())
    for judged in judge({check.name: check.examine(facts) for check in checks}, checks, 1e-4):
        assert hypotheses_of(judged.alarms[0], facts)[0].cause == "time_offset"
