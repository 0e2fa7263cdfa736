"""The scale of depth is measured from the camera's path, and depths or positions are named."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.depth.parameters import PairParameter, ResidualReduction, pool
from fedora_qa.checks.depth.scale import DepthScale
from fedora_qa.diagnosis.hypothesis import only_feature
from fedora_qa.sequence.stored_step import StoredStep
from tests.support.depth_world import NOISE, clean, first_hypothesis, noisy, value, with_depth
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


def test_pairs_that_scatter_excuse_a_deviation_only_where_the_noise_is_unknown() -> None:
    """The error of the mean is that of declared noise, whatever the scatter; the scatter, if none is declared."""
    values = (0.9, 1.3, 0.8, 1.4)
    pairs = [pair(k, value=value) for k, value in enumerate(values)]
    declared, undeclared = pool(pairs, known_noise=True), pool(pairs, known_noise=False)
    assert declared is not None
    assert undeclared is not None
    assert declared.value == undeclared.value
    assert declared.standard_error == pytest.approx(0.01 / 2, rel=0.05)
    assert undeclared.standard_error == pytest.approx(np.std(values, ddof=1) / 2, rel=0.05)


@pytest.mark.parametrize("factor", [0.1, 0.3048])
def test_noise_of_the_poses_does_not_make_up_for_a_unit(factor: float) -> None:
    """Corrections of the poses let the frames agree as declared: the factor is fitted without them, and explains them.

    Before it was, pairs that agreed so had a factor of 1, or none.
    """
    depths = with_depth(lambda depth: depth * factor, noisy())
    (scale,) = judged(DepthScale(), depths).alarms
    deviation = scale.statistic.value - factor
    assert abs(deviation) < 4 * scale.statistic.standard_error
    assert abs(factor - 1) > 4 * scale.statistic.standard_error
    assert only_feature(scale.statistic.features, ResidualReduction).share > 0.5


def test_corrections_count_where_they_exceed_their_noise() -> None:
    """Ten pairs of six directions: chi squared of 60 is expected, and 60 + 3 sqrt(120) = 93 is still noise."""
    for of_pair, share in ((6.0, 0.0), (9.2, 0.0), (9.4, 1.0)):
        pairs = [pair(k, declared=of_pair, fitted=6.0) for k in range(10)]
        pooled = pool(pairs, known_noise=True)
        assert pooled is not None
        assert pooled.residual_reduction == pytest.approx(share)
    half = pool([pair(k, declared=22.0, fitted=10.0) for k in range(10)], known_noise=True)
    assert half is not None
    # The excess of 16 falls to 4: the corrections are half as long.
    assert half.residual_reduction == pytest.approx(0.5)


def pair(number: int, value: float = 1.0, declared: float = 0.0, fitted: float = 0.0) -> PairParameter:
    """Return a pair of frames without residuals, with chi squared of its correction as declared and after the fit."""
    return PairParameter(number, number + 1, 100, value, 0.01, 0.0, 0.0, 0.0, declared, fitted, 6.0, True, np.inf, 1.0)


def test_shifted_depth_does_not_raise_the_limit() -> None:
    """Depth that is shifted by 1 px moves each pair by another amount, and the limit of the mean stays as it was."""
    moved = judged(DepthScale(), with_depth(lambda depth: np.roll(depth, 1, axis=2)))
    limits = [judgement.result.measurements[0].limit for judgement in (judged(DepthScale(), clean()), moved)]
    assert limits[0] is not None
    assert limits[1] is not None
    assert limits[1] < 2 * limits[0]


@pytest.mark.parametrize("step_m", [1e-4, 1e-3])
def test_rounded_positions_are_no_scale(step_m: float) -> None:
    """The step in which positions are stored is an error of each pair: rounding to it is no alarm."""
    world = clean().with_rows(path_pose_position=np.rint(clean().rows_by_key["path/pose/position"] / step_m) * step_m)
    steps = {"path/pose/position": StoredStep(step_m)}
    stepped = replace(world, facts=replace(world.facts, steps=steps))
    exact, rounded = (judged(DepthScale(), file).result for file in (clean(), stepped))
    assert rounded.outcome in {"passed", "not_observable"}
    errors = [result.measurements[0].standard_error for result in (exact, rounded)]
    assert errors[0] is not None
    assert errors[1] is not None
    assert errors[1] > 10 * errors[0]


def test_a_camera_that_stands_still_has_no_scale() -> None:
    """Frames without parallax contradict no path that consists of declared noise, and do contradict a real one."""
    still = with_depth(lambda depth: np.repeat(depth[:1], len(depth), axis=0), clean())
    poses = {
        key: np.repeat(rows[:1], len(rows), axis=0) for key, rows in still.rows_by_key.items() if "path/pose/" in key
    }
    rng = np.random.default_rng(1)
    jitter_m = rng.normal(0.0, NOISE.position_sigma_m, poses["path/pose/position"].shape)
    standing = noisy().with_rows(
        path_depth=still.rows_by_key["path/depth"],
        path_pose_orientation=poses["path/pose/orientation"],
        path_pose_position=poses["path/pose/position"] + jitter_m,
    )
    assert judged(DepthScale(), standing).result.outcome == "not_observable"
    moving = clean().with_rows(path_depth=still.rows_by_key["path/depth"])
    assert judged(DepthScale(), moving).result.outcome == "failed"
