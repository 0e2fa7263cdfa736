"""Depth frames of the closed-form flight, clean, noisy and changed, for the checks of depth."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.depth.consistency import DepthConsistency
from fedora_qa.checks.depth.projection import DepthProjection
from fedora_qa.checks.depth.scale import DepthScale
from fedora_qa.checks.protocol import Check
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Judged
from fedora_qa.sequence.declared import PoseModel
from tests.support.flow_world import FlowWorld, make_world

Depths = NDArray[Any]

NOISE = PoseModel(position_sigma_m=0.005, rotation_sigma_rad=np.radians(0.2))
RANGE_M = (0.1, 30.0)
AGREEMENT: tuple[Check[Any], ...] = (DepthConsistency(), DepthScale(), DepthProjection())


@cache
def clean() -> FlowWorld:
    return make_world((25,)).declaring(depth_range_m=RANGE_M)


@cache
def noisy() -> FlowWorld:
    return make_world((25,), noise=NOISE).declaring(depth_range_m=RANGE_M)


def with_depth(change: Callable[[Depths], Depths], world: FlowWorld | None = None) -> FlowWorld:
    world = world or clean()
    depth = change(world.rows_by_key["path/depth"].copy())
    return world.with_rows(path_depth=np.asarray(depth, dtype=np.float32))


def first_hypothesis(result: Judged) -> Hypothesis:
    assert result.result.outcome == "failed", result.result
    return hypotheses_of(result.alarms[0], clean().facts)[0]


def value(result: Judged, name: str) -> float:
    measured = next(measurement.value for measurement in result.result.measurements if measurement.name == name)
    assert measured is not None
    return measured
