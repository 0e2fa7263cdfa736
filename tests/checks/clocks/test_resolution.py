"""Event timestamps that lie on no grid keep the distance of the renders that they have the times of."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.clocks.resolution import ClocksResolution, distance_of_instants_us
from fedora_qa.judgement.judge import judge
from fedora_qa.sequence.declared import Declared
from tests.support.facts import exact_facts
from tests.support.memory_sequence import MemorySequence, facts_of, memory_sequence


@given(seed=st.integers(0, 1000), count=st.integers(1000, 20_000))
def test_timestamps_at_random_keep_no_distance(seed: int, count: int) -> None:
    """However many share one: on a span of 1 s."""
    times_us = np.sort(np.random.default_rng(seed).integers(0, 1_000_000, count))
    assert distance_of_instants_us(facts_of(with_events(times_us))) == 0.0


@given(seed=st.integers(0, 1000), period_us=st.floats(20.0, 20_000.0))
def test_events_at_the_times_of_renders_keep_the_distance_of_renders(seed: int, period_us: float) -> None:
    """A period that is no whole number of microseconds is no grid; one other event is enough to break the distance."""
    renders_us = np.floor(np.arange(0.0, 1e6, period_us)).astype(np.int64)
    times_us = np.sort(np.random.default_rng(seed).choice(renders_us, 5000))
    assert distance_of_instants_us(facts_of(with_events(times_us))) >= np.floor(period_us)
    lone = np.sort(np.append(times_us, times_us[2500] + 3))
    assert distance_of_instants_us(facts_of(with_events(lone))) <= 3.0


def test_events_at_the_times_of_renders_are_named() -> None:
    """Their grid is 1 us, as it is declared."""
    times_us = np.repeat(np.floor(np.arange(0.0, 1e6, 5139.3)).astype(np.int64), 10)
    facts = replace(exact_facts(), events=facts_of(with_events(times_us)).events)
    assert facts.events is not None
    assert facts.events.grid_ns == 1000
    check = ClocksResolution()
    (alarm,) = judge({check.name: check.examine(facts)}, [check], 1e-4)[0].alarms
    (hypothesis,) = hypotheses_of(alarm, facts)
    assert (hypothesis.cause, hypothesis.stream, hypothesis.magnitude) == ("quantised_time", "events", 5.139)


def with_events(times_us: np.ndarray) -> MemorySequence:
    """Return a sequence whose events have other timestamps, in us, and no declared packets."""
    sequence = memory_sequence()
    zeros = np.zeros(len(times_us), np.int64)
    columns = {f"path__events__{name}": zeros.astype(sequence.arrays[f"path/events/{name}"].dtype) for name in "xyp"}
    return sequence.altered(declared=Declared(), path__events__t=1000 * times_us, **columns)


def test_declared_packets_that_the_timestamps_do_not_have_are_noted() -> None:
    """Packets may begin anywhere: only the steps between them are multiples of the interval."""
    rng = np.random.default_rng(0)
    packets_us, other_us = 7 + 200 * np.sort(rng.integers(0, 5000, 4000)), np.sort(rng.integers(0, 1_000_000, 4000))
    declared = exact_facts().declared
    assert declared.events is not None
    log_model = replace(declared.events, model="log", packet_interval_us=200)
    for times_us, codes in ((packets_us, []), (other_us, ["clocks.resolution.no_packets"])):
        events = facts_of(with_events(times_us)).events
        facts = replace(exact_facts(), events=events, declared=replace(declared, events=log_model))
        assert [notice.code for notice in ClocksResolution().examine(facts).notices] == codes
