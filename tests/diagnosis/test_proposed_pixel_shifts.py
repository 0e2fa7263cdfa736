"""Shifts of pixels that are proposed: in the stream's own pixels, along its axes, and within the image."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.checks.flow_geometry.endpoint import FieldsOff
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.faults.image_part import ImagePart
from fedora_qa.faults.pixels import PixelShift
from fedora_qa.record.types import Measurement, Result, Where
from fedora_qa.views.flow_comparison import FlowParameterFit
from tests.support.memory_sequence import facts_of, memory_sequence
from tests.support.proposed_faults import alarm, failed_result


def test_a_shift_of_depth_is_opposite_to_that_of_the_edges_of_colour() -> None:
    """Colour lies 3 px left of the steps of depth: depth lies 3 px right. What is within its limit comes last."""
    values = {"shift_right": (-3.1, 0.3), "shift_down": (4.0, 6.0)}
    measurements = tuple(
        Measurement(name, value, "px", 0.1, 0.0, limit, 0.3) for name, (value, limit) in values.items()
    )
    aligned = {"alignment.depth": Result("alignment.depth", "failed", "shifted", measurements=measurements)}
    facts = facts_of(memory_sequence())
    shifts = list(faults_for("spatial_offset", "depth", 2.0, (), aligned, facts))
    assert shifts[:2] == [PixelShift("depth", 3, 0), PixelShift("depth", 3, -4)]


def test_a_shift_of_colour_is_in_its_own_pixels() -> None:
    """Events lie 2.5 px right and 5 px up of frames whose pixels are finer by 10.39 to 8.66: 3 px, and 6 px."""
    shifted = dict([failed_result("event_response.alignment", shift_right=2.5, shift_down=-5.0)])
    facts = facts_of(memory_sequence())
    assert next(iter(faults_for("spatial_offset", "rgb", 6.0, (), shifted, facts))) == PixelShift("rgb", -3, 6)
    assert next(iter(faults_for("spatial_offset", "events", 5.0, (), shifted, facts))) == PixelShift("events", 2, -5)


def test_a_shift_after_which_little_of_an_image_is_left_is_not_tried() -> None:
    """A second fit extrapolates: what is shifted out of the image takes its findings with it."""
    facts = facts_of(memory_sequence())
    half_px = max(facts.layout.bindings["path/depth"].shape[1:]) // 2
    assert PixelShift("depth", 0, half_px) in faults_for("spatial_offset", "depth", half_px, (), {}, facts)
    assert not list(faults_for("spatial_offset", "depth", half_px + 1.0, (), {}, facts))


@pytest.mark.parametrize(("right_px", "is_tried"), [(4.0, True), (6.0, False)])
def test_a_shift_after_which_little_of_a_part_is_left_is_not_tried(right_px: float, is_tried: bool) -> None:
    """Depth deviates in 10 columns alone."""
    facts = facts_of(memory_sequence())
    rate = facts.flow_streams[0]
    failure = alarm("flow_geometry.endpoint.error", FieldsOff(3, 0.5, True, 0, 0, (0, 0, 10, 40)))
    failure = replace(failure, finding=replace(failure.finding, where=Where(stream=rate)))
    faults = list(faults_for("spatial_offset", "depth", right_px, [failure], {}, facts))
    assert (ImagePart(PixelShift("depth", right_px, 0), (0, 0, 10, 40)) in faults) is is_tried


def test_a_shift_is_tried_along_the_axes_too() -> None:
    """The measured shift may be at the end of its range, where another check fits a larger one."""
    shifted = dict([failed_result("event_response.alignment", shift_right=5.0, shift_down=0.0)])
    faults = list(faults_for("spatial_offset", "events", 20.0, (), shifted, facts_of(memory_sequence())))
    assert faults == [PixelShift("events", 5, 0), PixelShift("events", 20, 0), PixelShift("events", 0, 20)]


def test_both_components_of_a_shift_of_flow_are_undone() -> None:
    """Near whole pixels these come first: undoing them loses nothing."""
    facts = facts_of(memory_sequence())
    for components, whole in (((0.28, 0.24), []), ((-6.01, 2.02), [PixelShift("flow", -6, 2)]), ((0.02, 0.05), [])):
        size = float(np.copysign(np.hypot(*components), max(components, key=abs)))
        fit = FlowParameterFit("spatial_offset", size, "px", 0.01, 0.9, components)
        alarms = [alarm("flow_geometry.endpoint.error", fit)]
        faults = list(faults_for("spatial_offset", "flow", size, alarms, {}, facts))
        assert faults == [*whole, PixelShift("flow", *components)]
