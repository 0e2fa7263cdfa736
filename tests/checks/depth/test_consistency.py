"""Depth frames are held against each other: faults are found, placed, sized and named."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.depth.consistency import DepthConsistency, medians_by_group
from fedora_qa.estimators.depth import pair_fit
from fedora_qa.judgement.judge import Judged
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Clock
from fedora_qa.sequence.stored_step import StoredStep
from fedora_qa.views import depth_pairs as pairs
from tests.support.depth_world import NOISE, clean, first_hypothesis, noisy, with_depth
from tests.support.flow_world import FlowWorld, judged, pixel_grid, rays_body

Depths = NDArray[Any]


def frozen(depth: Depths) -> Depths:
    depth[10:13] = depth[9]
    return depth


def swapped(depth: Depths) -> Depths:
    depth[[10, 11]] = depth[[11, 10]]
    return depth


def shifted(depth: Depths) -> Depths:
    columns = pixel_grid()[0].shape[1]
    moved = np.full_like(depth, np.nan)
    moved[:, :, 4:] = depth[:, :, : columns - 4]
    return moved


def from_frame_12(change: Callable[[Depths], Depths]) -> Callable[[Depths], Depths]:
    return lambda depth: np.concatenate([depth[:12], change(depth[12:])])


FAULTS: dict[str, tuple[Callable[[Depths], Depths], str, float | None]] = {
    "frozen": (frozen, "frozen_frames", 3.0),
    "swapped": (swapped, "swapped_frames", 1.0),
    "mirrored": (lambda depth: depth[:, :, ::-1], "mirrored", None),
    "upside down": (lambda depth: depth[:, ::-1], "mirrored", None),
    "turned by half": (lambda depth: depth[:, ::-1, ::-1], "mirrored", None),
    "mirrored from frame 12 on": (from_frame_12(lambda depth: depth[:, :, ::-1]), "mirrored", None),
    "upside down from frame 12 on": (from_frame_12(lambda depth: depth[:, ::-1]), "mirrored", None),
    "rays from frame 12 on": (
        from_frame_12(lambda depth: depth * np.linalg.norm(rays_body(), axis=-1)),
        "depth_ray_not_z",
        None,
    ),
    "shifted from frame 12 on": (from_frame_12(shifted), "spatial_offset", 4.0),
    "three rows up from frame 12 on": (from_frame_12(lambda depth: np.roll(depth, -3, axis=1)), "spatial_offset", -3.0),
    "shifted": (shifted, "spatial_offset", 4.0),
    "rays": (lambda depth: depth * np.linalg.norm(rays_body(), axis=-1), "depth_ray_not_z", None),
}


def with_clock_offset(milliseconds: float, world: FlowWorld | None = None) -> FlowWorld:
    """The clean file, or another, with depth stamped too late."""
    world = world or clean()
    facts = world.facts
    times_ns = facts.clocks["depth"].times_ns + round(1e6 * milliseconds)
    clocks = {**facts.clocks, "depth": Clock(times_ns, None, facts.clocks["depth"].advancing)}
    return replace(world, facts=replace(facts, clocks=clocks))


@pytest.mark.parametrize(("change", "cause", "size"), FAULTS.values(), ids=FAULTS)
def test_faults_of_depth_are_named(change: Callable[[Depths], Depths], cause: str, size: float | None) -> None:
    """A fault of the frames is found and named first, with its size."""
    hypothesis = first_hypothesis(judged(DepthConsistency(), with_depth(change)))
    assert (hypothesis.cause, hypothesis.stream) == (cause, "depth")
    if size is not None:
        assert hypothesis.magnitude == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize(("change", "cause", "size"), FAULTS.values(), ids=FAULTS)
def test_faults_of_large_frames_are_named(
    change: Callable[[Depths], Depths], cause: str, size: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where every second row and column is looked at, as in large frames, faults are found and named all the same."""
    monkeypatch.setattr(pairs, "_PIXELS", 192 * 144 // 4)
    hypothesis = first_hypothesis(judged(DepthConsistency(), with_depth(change), tile_share=0.5))
    assert (hypothesis.cause, hypothesis.stream) == (cause, "depth")
    if size is not None:
        assert hypothesis.magnitude == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize("milliseconds", [1.0, 5.0, -20.0])
def test_late_timestamps_are_measured(milliseconds: float) -> None:
    """Stamps that are late by a constant are found and measured to a percent."""
    hypothesis = first_hypothesis(judged(DepthConsistency(), with_clock_offset(milliseconds)))
    assert hypothesis.cause == "time_offset"
    assert hypothesis.stream == "depth"
    assert hypothesis.magnitude == pytest.approx(milliseconds, rel=0.01)


def test_a_motion_that_is_fitted_needs_no_allowance_for_interpolation() -> None:
    """Between samples of noisy poses the limits are those at the samples, and what is left of the motion is within."""
    at_samples, between = (
        {one.name: one for one in judged(DepthConsistency(), world).result.measurements}
        for world in (noisy(), with_clock_offset(3.0, noisy()))
    )
    for name in ("deviation", "worst_tile"):
        limit, least = between[name].limit, at_samples[name].least_detectable
        assert limit is not None
        assert least is not None
        assert limit < least
        assert not between[name].exceeds_limit


def stopped_early(world: FlowWorld, monkeypatch: pytest.MonkeyPatch) -> Judged:
    """The judgement where no fit of the motion has converged."""
    monkeypatch.setattr(pair_fit, "_ITERATIONS", 1)
    return judged(DepthConsistency(), world)


def test_a_fit_that_has_not_converged_shows_no_deviation(monkeypatch: pytest.MonkeyPatch) -> None:
    """Correct frames with noisy poses do not fail by what a fit has left that did not end."""
    result = stopped_early(noisy(), monkeypatch).result
    assert result.outcome != "failed"


def test_what_no_motion_explains_fails_without_a_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Mirrored frames deviate by more than the noise of the poses can explain, whatever the fit."""
    world = with_depth(from_frame_12(lambda depth: depth[:, :, ::-1]), noisy())
    alarms = stopped_early(world, monkeypatch).alarms
    assert "depth.consistency.frame" in {alarm.finding.code for alarm in alarms}


def test_a_bad_corner_fails_beside_agreeing_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where most pixels agree after a fit that did not end, a tile that does not is a deviation."""

    def deepen(depth: Depths) -> Depths:
        depth[10, 96:, 144:] *= 1.01
        return depth

    monkeypatch.setattr(pair_fit, "_CONVERGED", 0.0)
    alarms = judged(DepthConsistency(), with_depth(deepen, noisy())).alarms
    assert any(alarm.finding.code.endswith("tile") for alarm in alarms)


def test_frozen_frames_are_placed() -> None:
    """Single bad frames are placed by their rows."""
    where = judged(DepthConsistency(), with_depth(frozen)).alarms[0].finding.where
    assert (where.index_start, where.index_stop) == (9, 14)


@pytest.mark.parametrize("every_px", [1, 2])
def test_a_bad_corner_is_placed(every_px: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A corner that is 1% too deep in one frame is found, and its tile named; of thinned frames in px of all."""

    def deepen(depth: Depths) -> Depths:
        depth[10, 96:, 144:] *= 1.01
        return depth

    monkeypatch.setattr(pairs, "_PIXELS", 192 * 144 // every_px**2)
    result = judged(DepthConsistency(), with_depth(deepen), tile_share=0.5)
    alarm = next(alarm for alarm in result.alarms if alarm.finding.code.endswith("tile"))
    left, top, right, bottom = alarm.finding.where.tile or (0, 0, 0, 0)
    assert left >= 130
    assert top >= 85
    assert (right, bottom) <= (192, 144)


def test_a_region_that_is_shifted_is_named() -> None:
    """A fault of one corner is undone in the tile that is off most, where the rest of the image would hide it."""

    def shift_corner(depth: Depths) -> Depths:
        corner = depth[:, :60, :80]
        corner[:, :, 3:] = corner[:, :, :-3].copy()
        return depth

    hypothesis = first_hypothesis(judged(DepthConsistency(), with_depth(shift_corner)))
    assert (hypothesis.cause, hypothesis.stream) == ("spatial_offset", "depth")
    assert hypothesis.magnitude == pytest.approx(3.0, rel=0.1)


def rounded(world: FlowWorld, key: str, step: float) -> FlowWorld:
    """The file with poses that are stored in a step, as its values show."""
    rows = world.rows_by_key[key]
    grid = StoredStep(size=step)
    stored = world.with_rows(**{key.replace("/", "_"): np.rint(rows / step) * step})
    return replace(stored, facts=replace(stored.facts, steps={**stored.facts.steps, key: grid}))


ROUNDED = {
    "positions, 4 decimals": ("path/pose/position", 1e-4),
    "positions, 1 cm": ("path/pose/position", 1e-2),
    "quaternions, 6 decimals": ("path/pose/orientation", 1e-6),
    "quaternions, 3 decimals": ("path/pose/orientation", 1e-3),
}


@pytest.mark.parametrize(("key", "step"), ROUNDED.values(), ids=ROUNDED)
def test_the_step_of_poses_is_within_the_bounds(key: str, step: float) -> None:
    """Poses that are stored in a step pass. The step raises the limits, by no more than some times what it deviates."""
    exact, coarse = (judged(DepthConsistency(), world).result for world in (clean(), rounded(clean(), key, step)))
    assert coarse.outcome == "passed"
    for before, after in zip(exact.measurements[:2], coarse.measurements[:2], strict=True):
        assert after.value is not None
        assert before.limit is not None
        assert after.limit is not None
        assert before.limit < after.limit < before.limit + 5 * after.value


def test_steps_of_poses_excuse_no_other_error() -> None:
    """Depth that is 0.1% too large in one frame is found beside positions with 4 decimals."""

    def deepen(depth: Depths) -> Depths:
        depth[10] *= 1.001
        return depth

    world = rounded(with_depth(deepen), "path/pose/position", 1e-4)
    assert judged(DepthConsistency(), world).result.outcome == "failed"


def test_noise_that_is_declared_too_small_is_found() -> None:
    """Corrections larger than the declared noise are found, and their size named.

    With 33 degrees of freedom the noise found has a standard error of 12%: four of them are allowed.
    """
    world = noisy().declaring(pose=PoseModel(NOISE.position_sigma_m / 3, NOISE.rotation_sigma_rad / 3))
    result = judged(DepthConsistency(), world)
    alarm = next(alarm for alarm in result.alarms if alarm.finding.code.endswith("pose_correction"))
    hypothesis = next(h for h in hypotheses_of(alarm, world.facts) if h.cause == "noise_misdeclared")
    assert hypothesis.magnitude == pytest.approx(-67, abs=0.12 * 4 * 33)


def test_medians_by_group() -> None:
    """Against masks; groups that are too small have none."""
    rng = np.random.default_rng(1)
    first, second, groups = rng.random(500), rng.random(500), rng.integers(0, 7, 500).astype(np.uint8)
    groups[:3] = 7
    medians = medians_by_group(first, second, groups, 9, 4)
    for values, by_group in zip((first, second), medians, strict=True):
        np.testing.assert_array_equal(by_group[:7], [np.median(values[groups == group]) for group in range(7)])
        assert np.isnan(by_group[7:]).all()
