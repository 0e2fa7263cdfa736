"""The order of timestamps: exact clocks advance, and a repeat is distinguished from a coarse grid."""

import numpy as np

from tests.support.altered_clocks import hypotheses_for
from tests.support.facts import clock, exact_facts, with_clock


def test_few_frames_on_a_grid_above_their_period_are_not_doubled() -> None:
    """Half a second of frames on a grid of 29.8 ms repeats eight timestamps evenly, which doubled frames do not."""
    frames = exact_facts().clocks["rgb"].times_ns[:26]
    coarse = hypotheses_for("clocks.order", with_clock(exact_facts(), "rgb", clock(frames // 29_800_000 * 29_800_000)))
    assert coarse[0].cause == "quantised_time"
    doubled = hypotheses_for(
        "clocks.order", with_clock(exact_facts(), "rgb", clock(np.repeat(frames, [3] * 4 + [1] * 22)))
    )
    assert doubled[0].cause == "duplicated_samples"


def test_one_doubled_frame_lies_on_no_odd_grid() -> None:
    """All steps of exact frames, one of them doubled, are of 20 ms too, but that is their period."""
    frames = exact_facts().clocks["rgb"].times_ns[:25]
    doubled = hypotheses_for("clocks.order", with_clock(exact_facts(), "rgb", clock(np.insert(frames, 9, frames[9]))))
    assert doubled[0].cause == "duplicated_samples"
