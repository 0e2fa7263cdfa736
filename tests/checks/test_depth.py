"""Depth frames are held against each other: clean files pass, faults are found and named, and nothing crashes."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.checks.depth.consistency import DepthConsistency
from fedora_qa.checks.depth.projection import DepthProjection
from fedora_qa.checks.depth.range import DepthRange
from fedora_qa.checks.depth.scale import DepthScale
from fedora_qa.checks.protocol import Check
from fedora_qa.diagnosis.hypotheses import hypotheses_of
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Judged
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Clock
from fedora_qa.views import depth_pairs as pairs
from tests.support.flow_world import FlowWorld, judged, make_world, observe, pixel_grid, rays_body

Depths = NDArray[Any]

NOISE = PoseModel(position_sigma_m=0.005, rotation_sigma_rad=np.radians(0.2))
RANGE_M = (0.1, 30.0)
AGREEMENT: tuple[Check[Any], ...] = (DepthConsistency(), DepthScale(), DepthProjection())
ALL: tuple[Check[Any], ...] = (DepthRange(), *AGREEMENT)


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


def late(milliseconds: float) -> FlowWorld:
    """The clean file with depth stamped too late."""
    facts = clean().facts
    times_ns = facts.clocks["depth"].times_ns + round(1e6 * milliseconds)
    clocks = {**facts.clocks, "depth": Clock(times_ns, None, facts.clocks["depth"].advancing)}
    return replace(clean(), facts=replace(facts, clocks=clocks))


def named(result: Judged) -> Hypothesis:
    assert result.result.outcome == "failed", result.result
    return hypotheses_of(result.alarms[0], clean().facts)[0]


def value(result: Judged, name: str) -> float:
    found = next(one.value for one in result.result.measurements if one.name == name)
    assert found is not None
    return found


@pytest.mark.parametrize("check", ALL, ids=lambda check: check.name)
@pytest.mark.parametrize("world", [clean, noisy], ids=["exact pose", "noisy pose"])
def test_clean_file_passes(check: Check[Any], world: Callable[[], FlowWorld]) -> None:
    """A clean file passes, or cannot show what was asked; with an exact pose it passes."""
    outcome = judged(check, world()).result.outcome
    assert outcome == "passed" if world is clean else outcome in {"passed", "not_observable"}


@pytest.mark.parametrize("share", [0.05, 0.25])
@pytest.mark.parametrize("check", AGREEMENT, ids=lambda check: check.name)
def test_sampled_efforts_pass(check: Check[Any], share: float) -> None:
    """A coarser lattice passes the clean file too."""
    assert judged(check, clean(), tile_share=share).result.outcome == "passed"


@pytest.mark.parametrize("factor", [1e-3, 0.3048, 1.01, 1000.0])
def test_scale_is_measured(factor: float) -> None:
    """Any wrong unit is found from the path alone, with its factor to a thousandth."""
    result = judged(DepthScale(), with_depth(lambda depth: depth * factor))
    assert value(result, "scale") == pytest.approx(factor, rel=1e-3)
    assert named(result).cause == "unit_mm_m"


@pytest.mark.parametrize(("factor", "stream"), [(1e-3, "depth"), (1000.0, "depth")])
def test_implausible_depths_are_at_fault(factor: float, stream: str) -> None:
    """Depths of millimetres or kilometres are depth's fault."""
    assert named(judged(DepthScale(), with_depth(lambda depth: depth * factor))).stream == stream


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


def test_ray_lengths_are_told_from_z() -> None:
    """Lengths of rays read as an exponent of 1, and are named."""
    lengths = np.linalg.norm(rays_body(), axis=-1)
    result = judged(DepthProjection(), with_depth(lambda depth: depth * lengths))
    assert value(result, "ray_exponent") == pytest.approx(1.0, abs=0.05)
    assert named(result).cause == "depth_ray_not_z"


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


@pytest.mark.parametrize(("change", "cause", "size"), FAULTS.values(), ids=FAULTS)
def test_faults_of_depth_are_named(change: Callable[[Depths], Depths], cause: str, size: float | None) -> None:
    """A fault of the frames is found and named first, with its size."""
    hypothesis = named(judged(DepthConsistency(), with_depth(change)))
    assert (hypothesis.cause, hypothesis.stream) == (cause, "depth")
    if size is not None:
        assert hypothesis.magnitude == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize(("change", "cause", "size"), FAULTS.values(), ids=FAULTS)
def test_faults_of_large_frames_are_named(
    change: Callable[[Depths], Depths], cause: str, size: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where every second row and column is looked at, as in large frames, faults are found and named all the same."""
    monkeypatch.setattr(pairs, "_PIXELS", 192 * 144 // 4)
    hypothesis = named(judged(DepthConsistency(), with_depth(change), tile_share=0.5))
    assert (hypothesis.cause, hypothesis.stream) == (cause, "depth")
    if size is not None:
        assert hypothesis.magnitude == pytest.approx(size, rel=0.05)


@pytest.mark.parametrize("check", AGREEMENT, ids=lambda check: check.name)
def test_large_frames_pass(check: Check[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """A clean file whose frames are looked at every third row and column passes."""
    monkeypatch.setattr(pairs, "_PIXELS", 192 * 144 // 9)
    assert judged(check, clean(), tile_share=0.5).result.outcome == "passed"


@pytest.mark.parametrize("milliseconds", [1.0, 5.0, -20.0])
def test_late_timestamps_are_measured(milliseconds: float) -> None:
    """Stamps that are late by a constant are found and measured to a percent."""
    hypothesis = named(judged(DepthConsistency(), late(milliseconds)))
    assert hypothesis.cause == "time_offset"
    assert hypothesis.stream == "depth"
    assert hypothesis.magnitude == pytest.approx(milliseconds, rel=0.01)


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
    alarm = next(one for one in result.alarms if one.finding.code.endswith("tile"))
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

    hypothesis = named(judged(DepthConsistency(), with_depth(shift_corner)))
    assert (hypothesis.cause, hypothesis.stream) == ("spatial_offset", "depth")
    assert hypothesis.magnitude == pytest.approx(3.0, rel=0.1)


def test_noise_that_is_declared_too_small_is_found() -> None:
    """Corrections larger than the declared noise are found, and their size named.

    With 33 degrees of freedom the noise found has a standard error of 12%: four of them are allowed.
    """
    world = noisy().declaring(pose=PoseModel(NOISE.position_sigma_m / 3, NOISE.rotation_sigma_rad / 3))
    result = judged(DepthConsistency(), world)
    alarm = next(one for one in result.alarms if one.finding.code.endswith("pose_correction"))
    hypothesis = next(h for h in hypotheses_of(alarm, world.facts) if h.cause == "noise_misdeclared")
    assert hypothesis.magnitude == pytest.approx(-67, abs=0.12 * 4 * 33)


@pytest.mark.parametrize("check", AGREEMENT, ids=lambda check: check.name)
def test_no_motion_shows_nothing(check: Check[Any]) -> None:
    """A camera that stands still tells neither scale nor projection; its frames agree."""
    rows = clean().rows_by_key
    still = clean().with_rows(
        path_depth=np.broadcast_to(rows["path/depth"][:1], rows["path/depth"].shape),
        path_pose_position=np.broadcast_to(rows["path/pose/position"][:1], rows["path/pose/position"].shape),
        path_pose_orientation=np.broadcast_to(rows["path/pose/orientation"][:1], rows["path/pose/orientation"].shape),
    )
    outcome = judged(check, still).result.outcome
    assert outcome == ("passed" if check.name == "depth.consistency" else "not_observable")


@pytest.mark.parametrize("step_mm", [1.0, 20.0])
@pytest.mark.parametrize("check", AGREEMENT, ids=lambda check: check.name)
def test_quantised_depth_agrees(check: Check[Any], step_mm: float) -> None:
    """Steps widen what is allowed: honest depths in whole millimetres, or centimetres, are no alarm."""
    world = with_depth(lambda depth: np.rint(depth / step_mm) * step_mm)
    assert judged(check, world).result.outcome in {"passed", "not_observable"}


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
    assert named(result).cause == "invalid_encoding"
    assert value(result, "on_far_end") == pytest.approx(clean().rows_by_key["path/depth"].size / 2, rel=0.01)


@pytest.mark.parametrize(("factor", "code"), [(1e-3, "nearest"), (1e3, "farthest")])
def test_ends_beyond_the_range_are_stated(factor: float, code: str) -> None:
    """Depths beyond the declared range are stated, and the unit suspected that would bring them back."""
    result = judged(DepthRange(), with_depth(lambda depth: depth * factor))
    assert result.alarms[0].finding.code == f"depth.range.{code}"
    assert named(result).magnitude == pytest.approx(factor)


def without_poses() -> FlowWorld:
    rows = clean().rows_by_key["path/pose/position"]
    return clean().with_rows(path_pose_position=np.full_like(rows, np.nan))


def cut(count: int) -> FlowWorld:
    world, whole = clean(), clean().facts.clocks["depth"]
    clocks = {**world.facts.clocks, "depth": Clock(whole.times_ns[:count], None, whole.advancing[:count])}
    rows = {**world.rows_by_key, "path/depth": world.rows_by_key["path/depth"][:count]}
    sizes = {**world.facts.sizes, "path/depth": count}
    return replace(world, facts=replace(world.facts, clocks=clocks, sizes=sizes), rows_by_key=rows)


STRANGE: dict[str, Callable[[], FlowWorld]] = {
    "no frame": lambda: cut(0),
    "one frame": lambda: cut(1),
    "NaN poses": without_poses,
    "NaN depth": lambda: with_depth(lambda depth: np.full_like(depth, np.nan)),
    "no depth": lambda: with_depth(np.zeros_like),
    "infinite depth": lambda: with_depth(lambda depth: np.full_like(depth, np.inf)),
    "negative depth": lambda: with_depth(np.negative),
}


@pytest.mark.parametrize("world", STRANGE.values(), ids=STRANGE)
@pytest.mark.parametrize("check", AGREEMENT, ids=lambda check: check.name)
def test_nothing_to_compare_is_not_observable(check: Check[Any], world: Callable[[], FlowWorld]) -> None:
    """Where nothing can be compared the check says so, and never raises."""
    result = judged(check, world()).result
    assert result.outcome == "not_observable"
    assert result.reason


@pytest.mark.parametrize("check", AGREEMENT, ids=lambda check: check.name)
def test_not_applicable_without_a_pinhole_in_a_rigid_world(check: Check[Any]) -> None:
    """Without intrinsics, with another lens, or where objects move, the question cannot be asked."""
    camera = clean().facts.declared.cameras["depth"]
    for changed in (
        clean().declaring(cameras={}),
        clean().declaring(cameras={"depth": replace(camera, model="fisheye")}),
        clean().declaring(flow_model="scene"),
    ):
        assert check.not_applicable(changed.facts)
    assert not check.not_applicable(clean().facts)


@pytest.mark.parametrize("check", AGREEMENT, ids=lambda check: check.name)
def test_undeclared_noise_allows_any_correction(check: Check[Any]) -> None:
    """Where nothing is declared about the pose, no clean file fails, and consistency says what it cannot see."""
    world = clean().declaring(pose=None)
    result = judged(check, world).result
    assert result.outcome == ("warned" if check.name == "depth.consistency" else result.outcome)
    assert result.outcome != "failed"
