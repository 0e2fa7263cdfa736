"""Faults of a part of the image: found, named, and not blamed on what spoils all of it; with and without pose noise."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.flow_geometry.endpoint import FlowGeometryEndpoint
from fedora_qa.checks.flow_rates.composition import FlowRatesComposition
from fedora_qa.checks.protocol import Check
from fedora_qa.sequence.declared import PoseModel
from tests.support.flow_world import HEIGHT, WIDTH, FlowWorld, judged, make_world

QUARTER = (slice(None), slice(HEIGHT // 2, None), slice(WIDTH // 2, None))
NOISE = PoseModel(position_sigma_m=0.002, rotation_sigma_rad=0.001)


@cache
def clean(noisy: bool, rates_hz: tuple[int, ...] = (25,)) -> FlowWorld:
    return make_world(rates_hz, noise=NOISE if noisy else None)


def in_a_quarter(
    change: Callable[[np.ndarray], np.ndarray],
    noisy: bool = False,
    only: str = "flow",
    rates_hz: tuple[int, ...] = (25,),
) -> FlowWorld:
    """The lower right quarter of every field of some rates, as the change of the whole field makes it."""

    def spoilt(stream: str, flow: np.ndarray) -> np.ndarray:
        flow = flow.copy()
        if stream.startswith(only):
            flow[QUARTER] = change(flow)[QUARTER]
        return flow

    return clean(noisy, rates_hz).with_flow(spoilt)


FAULTS = {
    "sign": (lambda flow: -flow, "flow_sign"),
    "axes": (lambda flow: flow[..., ::-1], "axes_swapped"),
    "mirror": (lambda flow: flow[:, :, ::-1], "mirrored"),
    "gain": (lambda flow: 1.01 * flow, "flow_gain"),
    "interval": (lambda flow: np.roll(flow, 1, axis=0), "flow_interval_shifted"),
    "interval, the first field kept": (lambda flow: flow[np.r_[0, : len(flow) - 1]], "flow_interval_shifted"),
}


NOISY_TOO = ("sign", "gain", "interval, the first field kept")


@pytest.mark.parametrize(
    ("name", "noisy"), [*((name, False) for name in FAULTS), *((name, True) for name in NOISY_TOO)]
)
def test_part_is_held_against_depth_and_pose(name: str, noisy: bool) -> None:
    """The first hypothesis of the endpoint error is what was done to a quarter of the image."""
    change, cause = FAULTS[name]
    world = in_a_quarter(change, noisy)
    result = judged(FlowGeometryEndpoint(), world, tile_share=0.25)
    alarm = next(alarm for alarm in result.alarms if alarm.finding.code.endswith("worst_pixel"))
    first = hypotheses_of(alarm, world.facts)[0]
    assert (first.cause, first.stream) == (cause, "flow")


@pytest.mark.parametrize("check", [FlowGeometryEndpoint(), FlowRatesComposition()], ids=["geometry", "rates"])
def test_part_of_one_rate_is_named(check: Check[object]) -> None:
    """Backward flow in a quarter of one rate: that rate is suspected by either check."""
    world = in_a_quarter(lambda flow: -flow, only="flow/25hz", rates_hz=(25, 50))
    named = {
        hypothesis.stream
        for alarm in judged(check, world, tile_share=0.25).alarms
        for hypothesis in hypotheses_of(alarm, world.facts)
        if hypothesis.cause == "flow_sign" and hypothesis.support > 0.3
    }
    assert "flow/25hz" in named


def test_pose_is_not_blamed_for_a_part() -> None:
    """A constant beside the flow of a quarter looks like a turned camera there; what spoils all is not named."""
    world = in_a_quarter(lambda flow: flow + np.float32(0.05))
    result = judged(FlowGeometryEndpoint(), world, tile_share=0.25)
    streams = {hypothesis.stream for alarm in result.alarms for hypothesis in hypotheses_of(alarm, world.facts)}
    assert streams <= {"flow", "flow/25hz", "depth"}
