"""The scale of depth is measured from the camera's path, and depths or positions are named."""

from typing import Any

import pytest
from numpy.typing import NDArray

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.depth.scale import DepthScale
from tests.support.depth_world import clean, first_hypothesis, value, with_depth
from tests.support.flow_world import judged

Depths = NDArray[Any]


@pytest.mark.parametrize("factor", [1e-3, 0.3048, 1.01, 1000.0])
def test_scale_is_measured(factor: float) -> None:
    """Any wrong unit is found from the path alone, with its factor to a thousandth."""
    result = judged(DepthScale(), with_depth(lambda depth: depth * factor))
    assert value(result, "scale") == pytest.approx(factor, rel=1e-3)
    assert first_hypothesis(result).cause == "unit_mm_m"


@pytest.mark.parametrize(("factor", "stream"), [(1e-3, "depth"), (1000.0, "depth")])
def test_implausible_depths_are_at_fault(factor: float, stream: str) -> None:
    """Depths of millimetres or kilometres are depth's fault."""
    assert first_hypothesis(judged(DepthScale(), with_depth(lambda depth: depth * factor))).stream == stream


@pytest.mark.parametrize("factor", [1000.0, 3.2808, 1.02])
def test_plausible_depths_leave_it_to_the_positions(factor: float) -> None:
    """Where depths lie in their range, positions in another unit are more probable, by the factor to two thousandths.

    The lever arm stays in metres: its part of the path does not count.
    """
    positions_m = clean().rows_by_key["path/pose/position"]
    (alarm,) = judged(DepthScale(), clean().with_rows(path_pose_position=factor * positions_m)).alarms
    best = max(hypotheses_of(alarm, clean().facts), key=lambda hypothesis: hypothesis.support)
    assert (best.cause, best.stream) == ("unit_mm_m", "pose")
    assert best.magnitude == pytest.approx(factor, rel=2e-3)
