"""All checks of depth: clean files pass at every effort, and nothing crashes where nothing can be compared."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fedora_qa.checks.depth.range import DepthRange
from fedora_qa.checks.protocol import Check
from fedora_qa.sequence.facts import Clock
from fedora_qa.views import depth_pairs as pairs
from tests.support.depth_world import AGREEMENT, clean, noisy, with_depth
from tests.support.flow_world import FlowWorld, judged

ALL: tuple[Check[Any], ...] = (DepthRange(), *AGREEMENT)


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


@pytest.mark.parametrize("check", AGREEMENT, ids=lambda check: check.name)
def test_large_frames_pass(check: Check[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """A clean file whose frames are looked at every third row and column passes."""
    monkeypatch.setattr(pairs, "_PIXELS", 192 * 144 // 9)
    assert judged(check, clean(), tile_share=0.5).result.outcome == "passed"


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
