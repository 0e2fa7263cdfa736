"""Ends of the range, pixels that pile up there, and the steps of stored depths."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.checks.depth.range import DepthRange
from tests.support.depth_world import clean, first_hypothesis, value, with_depth
from tests.support.flow_world import judged, observe

Depths = NDArray[Any]


def test_coarse_steps_are_noted() -> None:
    """Steps of 5 cm are noted with their size; millimetres are not worth a word."""
    coarse = judged(DepthRange(), with_depth(lambda depth: np.rint(depth / 50) * 50)).result
    assert coarse.outcome == "warned"
    assert "steps of 50 mm" in coarse.reason
    assert judged(DepthRange(), with_depth(np.rint)).result.outcome == "passed"


def test_fine_steps_are_stated() -> None:
    """Depths in whole millimetres pass, and what was inferred says so; float32 depths have no step."""
    stated = observe(DepthRange(), with_depth(np.rint))
    assert stated.inferred["depth_step_mm"] == pytest.approx(1.0, rel=1e-3)
    assert "depth_step_mm" not in observe(DepthRange(), clean()).inferred


def test_depth_cut_off_at_the_end_is_found() -> None:
    """Pixels that pile up on the end of the range are found, and counted."""
    far_mm = float(np.median(clean().rows_by_key["path/depth"]))
    world = with_depth(lambda depth: np.minimum(depth, far_mm)).declaring(depth_range_m=(0.1, far_mm / 1000))
    result = judged(DepthRange(), world)
    assert first_hypothesis(result).cause == "invalid_encoding"
    assert value(result, "on_far_end") == pytest.approx(clean().rows_by_key["path/depth"].size / 2, rel=0.01)


@pytest.mark.parametrize(("factor", "code"), [(1e-3, "nearest"), (1e3, "farthest")])
def test_ends_beyond_the_range_are_stated(factor: float, code: str) -> None:
    """Depths beyond the declared range are stated, and the unit suspected that would bring them back."""
    result = judged(DepthRange(), with_depth(lambda depth: depth * factor))
    assert result.alarms[0].finding.code == f"depth.range.{code}"
    assert first_hypothesis(result).magnitude == pytest.approx(factor)
