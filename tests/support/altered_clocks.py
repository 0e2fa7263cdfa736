"""Facts of an exact file with one clock altered, and what each clock check concludes from them."""

from dataclasses import replace

import numpy as np

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.clocks.resolution import ClocksResolution
from fedora_qa.checks.protocol import FactsCheck
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.sequence.facts import Facts
from tests.support.all_checks import CHECKS
from tests.support.facts import FLOW_PERIODS_NS, MS, clock, exact_facts, with_clock

CLOCKS = {
    check.name: check
    for check in CHECKS
    if check.name.startswith("clocks.") and isinstance(check, FactsCheck | ClocksResolution)
}


def judgement_of(name: str, facts: Facts) -> Judged:
    """The judgement of a clock check on facts."""
    check = CLOCKS[name]
    return judge({name: check.examine(facts)}, [check], 1e-4)[0]


def hypotheses_for(name: str, facts: Facts) -> tuple[Hypothesis, ...]:
    """The hypotheses for the first alarm of a check."""
    return hypotheses_of(judgement_of(name, facts).alarms[0], facts)


def times_ns(stream: str) -> np.ndarray:
    """The timestamps of a stream of the exact file."""
    return exact_facts().clocks[stream].times_ns.copy()


def with_shift(stream: str, ns: int) -> Facts:
    """All timestamps of a stream are late by ``ns``."""
    return with_clock(exact_facts(), stream, clock(times_ns(stream) + ns))


def with_factor(stream: str, factor: float) -> Facts:
    """All timestamps of a stream are multiplied by a factor."""
    interval = FLOW_PERIODS_NS.get(stream)
    interval = None if interval is None else round(interval * factor)
    timestamps = np.rint(times_ns(stream) * factor / 1000).astype(np.int64) * 1000
    return with_clock(exact_facts(), stream, clock(timestamps, interval))


def without_rows(stream: str, rows: slice) -> Facts:
    """Rows of a stream are lost."""
    return with_clock(exact_facts(), stream, clock(np.delete(times_ns(stream), rows)))


def with_exchange(stream: str, row: int) -> Facts:
    """A row of a stream and the next one are exchanged."""
    timestamps = times_ns(stream)
    timestamps[[row, row + 1]] = timestamps[[row + 1, row]]
    return with_clock(exact_facts(), stream, clock(timestamps))


def in_order_of_text(stream: str) -> Facts:
    """Timestamps are sorted as text, where 10 comes before 9."""
    timestamps = times_ns(stream)
    return with_clock(exact_facts(), stream, clock(timestamps[np.argsort(timestamps.astype(str), kind="stable")]))


def with_rolled_rows(stream: str, row: int) -> Facts:
    """The last ``row`` rows of a stream come first."""
    return with_clock(exact_facts(), stream, clock(np.roll(times_ns(stream), row)))


def with_repeat(stream: str, row: int) -> Facts:
    """A row of a stream is written twice."""
    timestamps = times_ns(stream)
    return with_clock(exact_facts(), stream, clock(np.insert(timestamps, row, timestamps[row])))


def with_wrap(stream: str) -> Facts:
    """A counter of 32 bits in microseconds wraps in the middle of a stream."""
    timestamps = times_ns(stream)
    timestamps[len(timestamps) // 2 :] -= 2**32 * 1000
    return with_clock(exact_facts(), stream, clock(timestamps))


def with_event_grid() -> Facts:
    """Timestamps of events lie on a grid of 1 ms."""
    facts = exact_facts()
    assert facts.events is not None
    return replace(facts, events=replace(facts.events, grid_ns=MS))


def with_unsorted_events() -> Facts:
    """Three events are earlier than the event before."""
    facts = exact_facts()
    assert facts.events is not None
    return replace(facts, events=replace(facts.events, decreases=3, first_decrease=77))


def with_event_wrap() -> Facts:
    """A counter of 32 bits in microseconds wraps at event 7."""
    facts = exact_facts()
    assert facts.events is not None
    return replace(facts, events=replace(facts.events, decreases=1, first_decrease=7, largest_decrease_ns=2**32 * 1000))


def with_row_numbers(stream: str) -> Facts:
    """Numbers of rows stand in the place of timestamps, in microseconds."""
    timestamps = times_ns(stream)
    return with_clock(exact_facts(), stream, clock(1000 * np.arange(len(timestamps))))


def with_step(stream: str, row: int, ns: int) -> Facts:
    """A clock is set forward by ``ns`` at a row."""
    timestamps = times_ns(stream)
    timestamps[row:] += ns
    return with_clock(exact_facts(), stream, clock(timestamps))


def with_grid(stream: str, grid_ns: int, lost: int | None = None) -> Facts:
    """Timestamps are rounded to a grid. One row may be lost."""
    timestamps = (times_ns(stream) + grid_ns // 2) // grid_ns * grid_ns
    return with_clock(exact_facts(), stream, clock(timestamps if lost is None else np.delete(timestamps, lost)))


def in_single_precision(stream: str) -> Facts:
    """Timestamps are stored as float32 in seconds, 100 s after zero."""
    origin_us = 100_000_000
    timestamps_us = origin_us + times_ns(stream) // 1000
    single_us = np.rint((timestamps_us / 1e6).astype(np.float32).astype(np.float64) * 1e6).astype(np.int64)
    facts = replace(exact_facts(), origin_us=float(origin_us))
    return with_clock(facts, stream, clock((single_us - origin_us) * 1000))


def with_factor_of_part(stream: str, factor: float) -> Facts:
    """The timestamps of the middle half of a stream are multiplied by a factor."""
    timestamps = times_ns(stream)
    part = slice(len(timestamps) // 4, 3 * len(timestamps) // 4)
    timestamps[part] = np.rint(timestamps[part] * factor / 1000).astype(np.int64) * 1000
    return with_clock(exact_facts(), stream, clock(timestamps))


def with_drift(rate: float) -> Facts:
    """The IMU clock runs fast by ``rate`` from 0.5 s to 1.5 s."""
    timestamps = times_ns("imu")
    late = np.rint(np.clip(timestamps - 500 * MS, 0, 1000 * MS) * rate / 1000).astype(np.int64) * 1000
    return with_clock(exact_facts(), "imu", clock(timestamps + late))


def only_rows(stream: str, rows: slice) -> Facts:
    """Only these rows of a stream are left."""
    facts = exact_facts()
    interval = FLOW_PERIODS_NS.get(stream)
    return with_clock(facts, stream, clock(facts.clocks[stream].times_ns[rows], interval))


def with_event_shift(shift_ns: int) -> Facts:
    """All events are late by ``shift_ns``."""
    facts = exact_facts()
    assert facts.events is not None
    events = replace(facts.events, first_ns=facts.events.first_ns + shift_ns, last_ns=facts.events.last_ns + shift_ns)
    return replace(facts, events=events)


def as_recording(facts: Facts) -> Facts:
    """The same facts of a sequence that is declared as recorded."""
    return replace(facts, declared=replace(facts.declared, kind="recorded"))
