"""The gaps of a clock: lost samples, and parts that are late."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.support.altered_clocks import CLOCKS, hypotheses_for, times_ns
from tests.support.facts import MS, clock, exact_facts, with_clock


@given(st.lists(st.integers(1, 1998), min_size=1, max_size=40, unique=True))
def test_samples_lost_at_random_are_counted(lost: list[int]) -> None:
    """However many samples of an exact clock are lost at random places, they are gaps and no coarse grid."""
    facts = with_clock(exact_facts(), "imu", clock(np.delete(times_ns("imu"), lost)))
    value = {m.name: m.value for m in CLOCKS["clocks.gaps"].examine(facts).measurements}
    assert value["imu.missing"] == len(lost)


@pytest.mark.parametrize("name", ["clocks.order", "clocks.gaps"])
def test_a_part_that_is_late_by_many_samples_is_neither_lost_nor_shuffled(name: str) -> None:
    """Poses of half a second that are 90 ms late leave a gap and stand before others: one offset, with its sign."""
    facts = exact_facts()
    times_ns = facts.clocks["pose"].times_ns.copy()
    times_ns[100:200] += 90 * MS
    first = hypotheses_for(name, with_clock(facts, "pose", clock(times_ns)))[0]
    assert (first.cause, first.stream, first.magnitude) == ("time_offset", "pose", pytest.approx(90.0))
