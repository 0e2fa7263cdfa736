"""Each clock check passes exact clocks and names what was planted in them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.checks import CHECKS
from fedora_qa.checks.clocks.rates import Rate
from fedora_qa.checks.clocks.resolution import Resolution
from fedora_qa.checks.protocol import FactsCheck
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.sequence.facts import Facts
from tests.support.facts import FLOW_PERIODS_NS, MS, PERIODS_NS, clock, exact_facts, with_clock

CLOCKS = {
    check.name: check
    for check in CHECKS
    if check.name.startswith("clocks.") and isinstance(check, FactsCheck | Resolution)
}


def judged(name: str, facts: Facts) -> Judged:
    check = CLOCKS[name]
    return judge({name: check.examine(facts)}, [check], 1e-4)[0]


def times(stream: str) -> np.ndarray:
    return exact_facts().clocks[stream].times_ns.copy()


def shifted(stream: str, ns: int) -> Facts:
    return with_clock(exact_facts(), stream, clock(times(stream) + ns))


def scaled(stream: str, factor: float) -> Facts:
    interval = FLOW_PERIODS_NS.get(stream)
    interval = None if interval is None else round(interval * factor)
    stamps = np.rint(times(stream) * factor / 1000).astype(np.int64) * 1000
    return with_clock(exact_facts(), stream, clock(stamps, interval))


def without(stream: str, rows: slice) -> Facts:
    return with_clock(exact_facts(), stream, clock(np.delete(times(stream), rows)))


def exchanged(stream: str, row: int) -> Facts:
    stamps = times(stream)
    stamps[[row, row + 1]] = stamps[[row + 1, row]]
    return with_clock(exact_facts(), stream, clock(stamps))


def repeated(stream: str, row: int) -> Facts:
    stamps = times(stream)
    return with_clock(exact_facts(), stream, clock(np.insert(stamps, row, stamps[row])))


def wrapped(stream: str) -> Facts:
    stamps = times(stream)
    stamps[len(stamps) // 2 :] -= 2**32 * 1000
    return with_clock(exact_facts(), stream, clock(stamps))


def quantised() -> Facts:
    facts = exact_facts()
    assert facts.events is not None
    return replace(facts, events=replace(facts.events, grid_ns=MS))


def unsorted_events() -> Facts:
    facts = exact_facts()
    assert facts.events is not None
    return replace(facts, events=replace(facts.events, decreases=3, first_decrease=77))


FAULTS: dict[str, tuple[str, Callable[[], Facts], str, str, float | None]] = {
    "two poses exchanged": ("clocks.order", lambda: exchanged("pose", 50), "unsorted", "pose", 1.0),
    "an IMU sample twice": ("clocks.order", lambda: repeated("imu", 50), "duplicated_samples", "imu", 1.0),
    "three events early": ("clocks.order", unsorted_events, "unsorted", "events", 3.0),
    "a 32-bit counter wraps": ("clocks.order", lambda: wrapped("imu"), "time_unit", "imu", None),
    "the IMU in milliseconds": ("clocks.unit", lambda: scaled("imu", 1e-3), "time_unit", "imu", 1e-3),
    "poses in nanoseconds": ("clocks.unit", lambda: scaled("pose", 1e3), "time_unit", "pose", 1e3),
    "frames in wall-clock time": ("clocks.unit", lambda: scaled("rgb", 32.0), "time_unit", "rgb", 32.0),
    "a pose clock 50 ppm fast": ("clocks.rate", lambda: scaled("pose", 1 + 50e-6), "clock_rate", "pose", 50.0),
    "flow 0.1% slow": ("clocks.rate", lambda: scaled("flow/10hz", 1.001), "clock_rate", "flow/10hz", 1000.0),
    "one IMU sample lost": ("clocks.gaps", lambda: without("imu", slice(70, 71)), "dropped_samples", "imu", 1.0),
    "seven frames lost": ("clocks.gaps", lambda: without("rgb", slice(20, 27)), "dropped_samples", "rgb", 7.0),
    "poses 30 ms late": ("clocks.span", lambda: shifted("pose", 30 * MS), "time_offset", "pose", 30.0),
    "the last 10% of depth lost": (
        "clocks.span",
        lambda: without("depth", slice(91, None)),
        "truncated",
        "depth",
        10.0,
    ),
    "events in milliseconds": ("clocks.resolution", quantised, "quantised_time", "events", 1.0),
}


@pytest.mark.parametrize("name", CLOCKS)
def test_exact_clocks_pass(name: str) -> None:
    """Nothing is wrong with a clean file."""
    assert judged(name, exact_facts()).result.outcome == "passed"


@pytest.mark.parametrize(("name", "facts", "cause", "stream", "magnitude"), FAULTS.values(), ids=FAULTS)
def test_planted_fault_is_named(
    name: str, facts: Callable[[], Facts], cause: str, stream: str, magnitude: float | None
) -> None:
    """The check fails, and its first suspect is the planted cause in its stream with its size."""
    alarms = judged(name, facts()).alarms
    assert alarms
    suspect = alarms[0].suspects[0]
    assert (suspect.cause, suspect.stream) == (cause, stream)
    if magnitude is not None:
        assert suspect.magnitude == pytest.approx(magnitude, rel=0.02)
    assert all(other.finding.where.stream == stream for other in judged(name, facts()).alarms)


def test_every_clock_check_has_a_planted_fault() -> None:
    """No check is without a proof that it can fail."""
    assert {name for name, *_ in FAULTS.values()} == set(CLOCKS)


@given(st.sampled_from(sorted(PERIODS_NS)), st.floats(0.3, 2000.0))
def test_any_rounded_clock_keeps_its_rate(stream: str, rate_hz: float) -> None:
    """Whole-microsecond rounding of a whole rate is no clock error, at any rate."""
    nominal = max(round(rate_hz), 1)
    stamps = np.rint(1e6 * np.arange(200) / nominal).astype(np.int64) * 1000
    observation = Rate().examine(with_clock(exact_facts(), stream, clock(stamps)))
    assert judge({"clocks.rate": observation}, [Rate()], 1e-4)[0].result.outcome == "passed"


@pytest.mark.parametrize("name", CLOCKS)
@pytest.mark.parametrize("count", [0, 1, 2])
def test_streams_with_hardly_a_stamp_are_no_failure(name: str, count: int) -> None:
    """A stream of two samples is neither a crash nor an alarm of order, unit, rate or gaps."""
    facts = exact_facts()
    few = {stream: clock(held.times_ns[:count]) for stream, held in facts.clocks.items()}
    facts = replace(facts, clocks=few, events=None if count == 0 else facts.events)
    if name == "clocks.resolution" and facts.events is None:
        return
    check = CLOCKS[name]
    assert check.not_applicable(facts) or judged(name, facts).result.outcome in {"passed", "not_observable", "warned"}
