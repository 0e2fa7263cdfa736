"""Repeats, order and exposure of colour frames, in a closed-form world that exists in memory."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.images.exposure import FramePairGain, ImagesExposure, WindowExposure
from fedora_qa.checks.images.order import ImagesOrder
from fedora_qa.checks.images.repeats import ImagesRepeats
from fedora_qa.checks.protocol import Check
from fedora_qa.diagnosis.diagnose import choose_causes
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.estimators.images.gain import CODES
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.record.types import Finding, Where
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.window import Sampling
from tests.support.facts import exact_facts
from tests.support.flow_world import FlowWorld, judged, make_world

Frames = NDArray[np.uint8]
world_of = cache(make_world)
CHECKS = {"repeats": ImagesRepeats(), "order": ImagesOrder(), "exposure": ImagesExposure()}
FRAME = 8


@pytest.fixture(scope="module")
def world() -> FlowWorld:
    return world_of((25, 50))


def frames_of(world: FlowWorld) -> Frames:
    return np.asarray(world.rows_by_key["path/rgb"]).copy()


def frozen(frames: Frames, count: int) -> Frames:
    frames[FRAME : FRAME + count] = frames[FRAME - 1]
    return frames


def exchanged(frames: Frames, distance: int) -> Frames:
    frames[[FRAME, FRAME + distance]] = frames[[FRAME + distance, FRAME]]
    return frames


def exposed(frames: Frames, percent: float, count: int = 1) -> Frames:
    bright = np.clip(np.rint(frames[FRAME : FRAME + count] * (1 + percent / 100)), 0, 255)
    frames[FRAME : FRAME + count] = bright.astype(np.uint8)
    return frames


def first(result: Judged) -> tuple[str, float | None, int | None]:
    """Cause, size and frame of the first alarm's best supported hypothesis."""
    alarm = result.alarms[0]
    best = max(hypotheses_of(alarm, exact_facts()), key=lambda hypothesis: hypothesis.support)
    return f"{best.stream}:{best.cause}", best.magnitude, alarm.finding.where.frame


@pytest.mark.parametrize("name", CHECKS)
@pytest.mark.parametrize("rates", [(50,), (25,), (10, 25, 50)], ids=str)
def test_clean_frames_pass(name: str, rates: tuple[int, ...]) -> None:
    """Every rate of the flow will do."""
    assert judged(CHECKS[name], world_of(rates)).result.outcome == "passed"


@pytest.mark.parametrize("name", CHECKS)
def test_pose_noise_does_not_matter(name: str) -> None:
    """Declared noise of centimetres and half a degree raises no alarm."""
    noisy = world_of((50,), noise=PoseModel(0.02, 0.01))
    assert judged(CHECKS[name], noisy).result.outcome == "passed"


@pytest.mark.parametrize("count", [1, 3])
def test_frozen_frames_are_counted(world: FlowWorld, count: int) -> None:
    """Repeats and order both name frozen frames, how many, and where they begin."""
    faulty = world.with_rows(path_rgb=frozen(frames_of(world), count))
    for name in ("repeats", "order"):
        assert first(judged(CHECKS[name], faulty)) == ("rgb:frozen_frames", count, FRAME)


@pytest.mark.parametrize("left", ["flow", "pose"])
def test_one_stream_is_enough_to_tell_that_the_camera_moves(world: FlowWorld, left: str) -> None:
    """Frozen frames are found by flow alone and by the pose alone."""
    faulty = world.with_rows(path_rgb=frozen(frames_of(world), 2))
    for stream in ("pose",) if left == "flow" else ("flow/25hz", "flow/50hz"):
        faulty = faulty.without(stream)
    assert first(judged(ImagesRepeats(), faulty)) == ("rgb:frozen_frames", 2, FRAME)


def test_a_frame_that_comes_back_is_a_repeat(world: FlowWorld) -> None:
    """A frame that equals one long before it is found as well."""
    frames = frames_of(world)
    frames[FRAME + 4] = frames[FRAME]
    assert first(judged(ImagesRepeats(), world.with_rows(path_rgb=frames))) == ("rgb:frozen_frames", 1, FRAME + 4)


def test_a_camera_that_comes_back_may_see_the_same(world: FlowWorld) -> None:
    """A frame that equals an earlier one is no fault where the pose is that of the earlier one, too."""
    frames, poses, clocks = frames_of(world), world.rows_by_key, world.facts.clocks
    frames[FRAME + 4] = frames[FRAME]
    there, back = np.searchsorted(clocks["pose"].times_ns, clocks["rgb"].times_ns[[FRAME, FRAME + 4]])
    returned = {}
    for name in ("position", "orientation"):
        rows = poses[f"path/pose/{name}"].copy()
        rows[back - 4 : back + 5] = rows[there - 4 : there + 5]
        returned[f"path_pose_{name}"] = rows
    world = world.with_rows(path_rgb=frames, **returned)
    assert judged(ImagesRepeats(), world).result.outcome == "passed"


def test_resting_camera_may_repeat_its_frames(world: FlowWorld) -> None:
    """All frames alike, no flow and one pose: neither repeats nor order can be told from a buffer that is stuck."""
    frames, pose = frames_of(world), world.rows_by_key
    still = world.with_flow(lambda _, flow: np.zeros_like(flow)).with_rows(
        path_rgb=np.repeat(frames[:1], len(frames), axis=0),
        path_pose_position=np.repeat(pose["path/pose/position"][:1], len(pose["path/pose/position"]), axis=0),
        path_pose_orientation=np.repeat(pose["path/pose/orientation"][:1], len(pose["path/pose/orientation"]), axis=0),
    )
    repeats = judged(ImagesRepeats(), still).result
    assert (repeats.outcome, repeats.findings) == ("not_observable", ())
    assert "the camera is at rest" in repeats.reason
    assert judged(ImagesOrder(), still).result.outcome == "not_observable"
    assert judged(ImagesExposure(), still).result.outcome == "passed"


def test_camera_at_rest_whose_frames_differ_repeats_none(world: FlowWorld) -> None:
    """Where all frames differ none is repeated, wherever the camera is."""
    still = world.with_flow(lambda _, flow: np.zeros_like(flow)).without("pose")
    assert judged(ImagesRepeats(), still).result.outcome == "passed"


def test_repeats_that_nothing_explains_are_noted(world: FlowWorld) -> None:
    """Without pose, flow and events repeated frames are a warning, no failure."""
    alone = world.with_rows(path_rgb=frozen(frames_of(world), 2))
    for stream in ("pose", "flow/25hz", "flow/50hz"):
        alone = alone.without(stream)
    result = judged(ImagesRepeats(), alone).result
    assert result.outcome == "warned"
    assert "2 frames repeat" in result.reason


@pytest.mark.parametrize("distance", [1, 2])
def test_exchanged_frames_are_named_with_their_distance(world: FlowWorld, distance: int) -> None:
    """Neighbours, and frames two apart, are named with place; they are no repeats."""
    faulty = world.with_rows(path_rgb=exchanged(frames_of(world), distance))
    assert first(judged(ImagesOrder(), faulty)) == ("rgb:swapped_frames", distance, FRAME)
    assert judged(ImagesRepeats(), faulty).result.outcome == "passed"


def test_flow_that_leads_elsewhere_is_not_blamed_on_single_frames(world: FlowWorld) -> None:
    """With the sign of all flow wrong no frame can be told from the rest."""
    assert judged(ImagesOrder(), world.with_flow(lambda _, flow: -flow)).result.outcome == "not_observable"


@pytest.mark.parametrize(("percent", "count"), [(1.0, 1), (-5.0, 1), (30.0, 3), (3.0, 20)])
def test_exposure_jumps_are_sized_and_placed(world: FlowWorld, percent: float, count: int) -> None:
    """One frame or several, up or down: the first changed frame, and by how much, but for what is clipped."""
    cause, size, frame = first(
        judged(ImagesExposure(), world.with_rows(path_rgb=exposed(frames_of(world), percent, count)))
    )
    assert (cause, frame) == ("rgb:exposure_or_gamma", FRAME)
    assert size == pytest.approx(percent, rel=0.1, abs=0.02)


@pytest.mark.parametrize("percent", [4.0, -6.0])
def test_a_gain_of_all_frames_betrays_itself_where_it_came_after_rounding(world: FlowWorld, percent: float) -> None:
    """No frame differs from its neighbours, but the codes that rounded values cannot reach are missing in all."""
    every = np.rint(frames_of(world) * (1 + percent / 100)).astype(np.uint8)
    result = judged(ImagesExposure(), world.with_rows(path_rgb=every))
    assert [alarm.finding.code for alarm in result.alarms] == ["images.exposure.rounded_before"]
    hypothesis = hypotheses_of(result.alarms[0], exact_facts())[0]
    assert (hypothesis.cause, hypothesis.stream) == ("exposure_or_gamma", "rgb")
    assert hypothesis.magnitude == pytest.approx(percent, abs=0.1)


def test_slow_light_is_no_jump(world: FlowWorld) -> None:
    """Light that grows by half a percent a frame raises no alarm."""
    frames = frames_of(world)
    grown = frames * 1.005 ** np.arange(len(frames))[:, None, None, None]
    slow = world.with_rows(path_rgb=np.rint(np.clip(grown, 0, 255)).astype(np.uint8))
    assert judged(ImagesExposure(), slow).result.outcome == "passed"


@pytest.mark.parametrize("value", [0, 255])
def test_blank_frame_is_counted(world: FlowWorld, value: int) -> None:
    """A black or white frame among others fails with its number, and is neither frozen nor exchanged."""
    frames = frames_of(world)
    frames[FRAME] = value
    faulty = world.with_rows(path_rgb=frames)
    result = judged(ImagesExposure(), faulty)
    assert result.result.measurements[0].value == 1
    assert result.alarms[0].finding.where.frame == FRAME
    assert judged(ImagesOrder(), faulty).result.outcome == "passed"
    assert judged(ImagesRepeats(), faulty).result.outcome == "passed"


def test_only_blank_frames_tell_nothing(world: FlowWorld) -> None:
    """A grey wall is legal: nothing can be told of its frames."""
    blank = world.with_rows(path_rgb=np.full_like(frames_of(world), 128))
    assert judged(ImagesExposure(), blank).result.outcome == "not_observable"
    assert judged(ImagesOrder(), blank).result.outcome == "not_observable"
    assert judged(ImagesRepeats(), blank).result.outcome == "not_observable"


def test_overexposed_files_are_noted(world: FlowWorld) -> None:
    """A file with half of its pixels at 255 is warned about."""
    frames = frames_of(world)
    frames[:, :, : frames.shape[2] // 2] = 255
    result = judged(ImagesExposure(), world.with_rows(path_rgb=frames)).result
    assert result.outcome == "warned"
    assert "at 255" in result.reason


def test_exposure_needs_no_flow(world: FlowWorld) -> None:
    """Without flow a jump of 30% is still found, in its frame."""
    faulty = world.with_rows(path_rgb=exposed(frames_of(world), 30.0)).without("flow/25hz").without("flow/50hz")
    assert first(judged(ImagesExposure(), faulty))[::2] == ("rgb:exposure_or_gamma", FRAME)


@pytest.mark.parametrize("name", CHECKS)
def test_missing_flow_values_do_not_matter(world: FlowWorld, name: str) -> None:
    """Flow that is NaN in half of each field, or everywhere in one, raises no alarm."""

    def holes(stream: str, flow: NDArray[Any]) -> NDArray[Any]:
        flow = flow.copy()
        flow[:, : flow.shape[1] // 2] = np.nan
        flow[3] = np.nan
        return flow

    assert judged(CHECKS[name], world.with_flow(holes)).result.outcome == "passed"


@pytest.mark.parametrize("check", CHECKS.values(), ids=CHECKS)
def test_states_merge_to_the_same_observation(world: FlowWorld, check: Check[Any]) -> None:
    """Windows dealt out to two workers give what one gives."""
    windows = world.windows(Sampling())
    whole, parts = check.start(world.facts), [check.start(world.facts) for _ in range(2)]
    for i, window in enumerate(windows):
        check.update(whole, window)
        check.update(parts[i * 2 // len(windows)], window)
    assert check.conclude(check.merge(*parts), world.facts) == check.conclude(whole, world.facts)


def test_frames_on_another_grid_than_the_flow(world: FlowWorld) -> None:
    """A colour camera of half the resolution is seen on the flow's grid."""
    camera = world.facts.declared.cameras["rgb"]
    K = np.diag([0.5, 0.5, 1.0]) @ camera.K - np.array([[0, 0, 0.25], [0, 0, 0.25], [0, 0, 0]])
    small = replace(camera, width=camera.width // 2, height=camera.height // 2, K=K)
    frames = frames_of(world)
    n, height, width, _ = frames.shape
    halved = frames.reshape(n, height // 2, 2, width // 2, 2, 3).mean(axis=(2, 4))
    declared = {"rgb": small, "depth": world.facts.declared.cameras["depth"]}
    coarse = world.declaring(cameras=declared).with_rows(path_rgb=np.rint(halved).astype(np.uint8))
    for check in CHECKS.values():
        assert judged(check, coarse).result.outcome == "passed"
    faulty = coarse.with_rows(path_rgb=exchanged(frames_of(coarse), 1))
    assert first(judged(ImagesOrder(), faulty))[0] == "rgb:swapped_frames"


def test_a_jump_of_brightness_with_wrong_weights_is_of_exchanged_channels() -> None:
    """Exchanged channels change luma and the weights that events give them; a jump alone is one of the exposure."""
    gains = tuple(FramePairGain(i, i + 1, -0.08 if i == 10 else 0.0, 1e-3) for i in range(25))
    window = WindowExposure(gains, (), 0.0, range(26), np.zeros(CODES, np.int64))
    jumped = {"images.exposure": ImagesExposure().conclude([window], exact_facts())}
    jump = judge(jumped, [ImagesExposure()], 1e-4)[0].alarms[0]
    order = replace(jump, finding=Finding("F9", "images.channels.order", "error", "off", Where(stream="rgb")))
    hypotheses = {
        jump.finding.id: hypotheses_of(jump, exact_facts()),
        "F9": (Hypothesis("channel_order", "rgb", 0.95), Hypothesis("exposure_or_gamma", "rgb", 0.4)),
    }
    assert choose_causes([jump], {jump.finding.id: hypotheses[jump.finding.id]})[0].cause == "exposure_or_gamma"
    assert [diagnosis.cause for diagnosis in choose_causes([jump, order], hypotheses)] == ["channel_order"]
