"""The unit of timestamps, by the period and by the span of a stream."""

from dataclasses import replace

import pytest

from tests.support.altered_clocks import (
    hypotheses_for,
    judgement_of,
    times_ns,
    with_factor,
    without_rows,
)


@pytest.mark.parametrize(("factor", "cause"), [(26.6587, "clock_rate"), (37.1, "clock_rate"), (32.0, "time_unit")])
@pytest.mark.parametrize("name", ["clocks.unit", "clocks.span"])
def test_a_factor_near_that_of_a_unit_is_the_rate_of_a_clock(name: str, factor: float, cause: str) -> None:
    """Poses of 200 Hz whose period and span are 26.7 times as long are in wall time: the simulation ran at its pace."""
    first = max(hypotheses_for(name, with_factor("pose", factor)), key=lambda hypothesis: hypothesis.support)
    assert first.cause == cause
    assert first.magnitude == pytest.approx(1e6 * (factor - 1) if cause == "clock_rate" else factor, rel=1e-3)


@pytest.mark.parametrize("kept", [0.086, 0.09, 0.094])
def test_a_cut_stream_is_not_one_of_ticks(kept: float) -> None:
    """A tenth of the frames, or events that end with the motion, last as long as ticks of 90 kHz would."""
    facts = without_rows("rgb", slice(round(kept * len(times_ns("rgb"))) + 1, None))
    assert facts.events is not None
    still = replace(facts, events=replace(facts.events, last_ns=round(kept * facts.events.last_ns)))
    assert all(judgement.result.outcome == "passed" for judgement in [judgement_of("clocks.unit", still)])
