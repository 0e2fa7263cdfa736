"""Frames out of their places in a part of the image, and images that were moved for a while."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.images.order import DisplacedFrames, FrameInterval, ImagesOrder, intervals_out_of_order
from fedora_qa.diagnosis.images import hypotheses_of_order
from fedora_qa.judgement.judge import Judged
from fedora_qa.sequence.window import Sampling
from fedora_qa.views.frame_pairs import seen_part
from tests.support.facts import exact_facts
from tests.support.flow_world import HEIGHT, WIDTH, FlowWorld, judged, make_world, observe

FRAME = 8
world_of = cache(make_world)


def part(frames: NDArray[np.uint8]) -> tuple[slice, slice]:
    """The middle quarter."""
    height, width = frames.shape[1:3]
    return slice(height // 4, 3 * height // 4), slice(width // 4, 3 * width // 4)


def first(result: Judged, code: str) -> str:
    alarm = next(alarm for alarm in result.alarms if alarm.finding.code == code)
    best = max(hypotheses_of(alarm, exact_facts()), key=lambda hypothesis: hypothesis.support)
    return f"{best.stream}:{best.cause}"


def make_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take frames for ones of four times as many pixels as usual."""
    for user in ("views.frames", "checks.images.order"):
        monkeypatch.setattr(f"fedora_qa.{user}.USUAL_PIXELS", WIDTH * HEIGHT // 4)


def with_part_of(world: FlowWorld, rows: dict[int, int]) -> FlowWorld:
    """The middle quarter of some frames taken from others."""
    frames = np.asarray(world.rows_by_key["path/rgb"])
    changed, (down, right) = frames.copy(), part(frames)
    for row, source in rows.items():
        changed[row, down, right] = frames[source, down, right]
    return world.with_rows(path_rgb=changed)


def cropped(world: FlowWorld, left: int, top: int, right: int, bottom: int) -> FlowWorld:
    """The same file with a part of the colour frames, and the camera that belongs to it."""
    depth = world.facts.declared.cameras["depth"]
    K = depth.K - np.array([[0, 0, left], [0, 0, top], [0, 0, 0]])
    cameras = {**world.facts.declared.cameras, "rgb": replace(depth, width=right - left, height=bottom - top, K=K)}
    frames = np.ascontiguousarray(np.asarray(world.rows_by_key["path/rgb"])[:, top:bottom, left:right])
    return world.declaring(cameras=cameras).with_rows(path_rgb=frames)


@pytest.mark.parametrize("box", [(58, 43, 134, 101), (10, 75, 86, 133)], ids=["middle", "off the centre"])
def test_only_what_colour_shows_is_compared(box: tuple[int, int, int, int]) -> None:
    """With 40% of the width and height of the colour frames, frames follow the flow and exchanged ones are named."""
    clean = cropped(world_of((50,)), *box)
    ratio = observe(ImagesOrder(), clean).measurements[0]
    assert ratio.value == pytest.approx(1.0, abs=0.1)
    assert not judged(ImagesOrder(), clean).alarms
    frames = np.asarray(clean.rows_by_key["path/rgb"]).copy()
    frames[[FRAME, FRAME + 1]] = frames[[FRAME + 1, FRAME]]
    result = judged(ImagesOrder(), clean.with_rows(path_rgb=frames))
    assert first(result, "images.order.share") == "rgb:swapped_frames"


@pytest.mark.parametrize(("angle_deg", "scale"), [(0.0, 1.0), (0.0, 1.7), (2.0, 0.6)])
def test_the_seen_part_maps_into_the_colour_frame(angle_deg: float, scale: float) -> None:
    """Each pixel of the part lies in the colour frame; without a rotation each pixel beside it lies outside."""
    world = cropped(world_of((50,)), 30, 20, 120, 100)
    cameras = world.facts.declared.cameras
    rgb = cameras["rgb"]
    K = np.diag([scale, scale, 1.0]) @ rgb.K
    T = rgb.T_body_camera.copy()
    T[:3, :3] = T[:3, :3] @ Rotation.from_euler("z", angle_deg, degrees=True).as_matrix()
    rgb = replace(rgb, K=K, width=int(90 * scale), height=int(80 * scale), T_body_camera=T)
    window = world.declaring(cameras={**cameras, "rgb": rgb}).windows(Sampling())[0]
    left, top, right, bottom = seen_part(window)
    assert (right - left) * (bottom - top) > 70 * 60

    def lies_inside(column: float, row: float) -> bool:
        ray = np.linalg.inv(cameras["depth"].K) @ [column, row, 1.0]
        x, y, z = K @ T[:3, :3].T @ cameras["depth"].T_body_camera[:3, :3] @ ray
        return bool(-1e-6 <= x / z <= rgb.width - 1 + 1e-6 and -1e-6 <= y / z <= rgb.height - 1 + 1e-6)

    corners = [(column, row) for column in (left, right - 1) for row in (top, bottom - 1)]
    if angle_deg:
        middles = [((left + right) / 2, top), ((left + right) / 2, bottom - 1), (left, (top + bottom) / 2)]
        assert all(lies_inside(*place) for place in middles)
    else:
        assert all(lies_inside(*place) for place in corners)
        assert not any(
            lies_inside(*place) for place in [(left - 1, top), (left, top - 1), (right, top), (left, bottom)]
        )


@pytest.mark.parametrize(
    ("rows", "cause"),
    [
        pytest.param({FRAME: FRAME - 1}, "rgb:frozen_frames", id="one frozen"),
        pytest.param({FRAME + i: FRAME - 1 for i in range(3)}, "rgb:frozen_frames", id="three frozen"),
        pytest.param({FRAME: FRAME + 1, FRAME + 1: FRAME}, "rgb:swapped_frames", id="exchanged"),
    ],
)
def test_a_part_of_a_frame_out_of_its_place_is_named(rows: dict[int, int], cause: str) -> None:
    """A middle quarter that stands still, or is that of the next frame, is found by its own motion."""
    assert first(judged(ImagesOrder(), with_part_of(world_of((50,)), rows)), "images.order.part") == cause


@pytest.mark.parametrize(
    ("rows", "code", "cause"),
    [
        pytest.param({FRAME: FRAME - 1}, "images.order.part", "rgb:frozen_frames", id="a part of one frozen"),
        pytest.param({FRAME: FRAME + 1, FRAME + 1: FRAME}, "images.order.part", "rgb:swapped_frames", id="exchanged"),
    ],
)
def test_the_middles_of_parts_tell(
    rows: dict[int, int], code: str, cause: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In frames that are large, of whose parts the middle is looked at, the same is found."""
    make_large(monkeypatch)
    assert first(judged(ImagesOrder(), with_part_of(world_of((50,)), rows), tile_share=0.25), code) == cause


def test_large_frames_in_order_pass(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is looked at of large frames in order raises no alarm, and the share is that of all pixels."""
    whole = observe(ImagesOrder(), world_of((50,))).measurements[0]
    make_large(monkeypatch)
    assert not judged(ImagesOrder(), world_of((50,)), tile_share=0.25).alarms
    assert observe(ImagesOrder(), world_of((50,)), tile_share=0.25).measurements[0].value == pytest.approx(
        whole.value, abs=0.1
    )


def test_frames_moved_for_a_while_are_not_frozen() -> None:
    """Frames that lie a few pixels to the right in half of the time jump twice, and come back in no interval beside."""
    world = world_of((50,))
    frames = np.asarray(world.rows_by_key["path/rgb"]).copy()
    frames[5:14] = np.roll(frames[5:14], 3, axis=2)
    assert first(judged(ImagesOrder(), world.with_rows(path_rgb=frames)), "images.order.share") == "rgb:spatial_offset"


def intervals(*ratios: float) -> list[FrameInterval]:
    return [FrameInterval(i, i + 1, ratio) for i, ratio in enumerate(ratios)]


@pytest.mark.parametrize(
    ("measured", "cause"),
    [
        pytest.param(intervals(1, 1, 0, 2, 1), "frozen_frames", id="frozen"),
        pytest.param(intervals(1, 0, 0, 0, 3.1, 1), "frozen_frames", id="three frozen"),
        pytest.param(intervals(1, 0.1, 1.4, 1, 1), "frozen_frames", id="catches up in part"),
        pytest.param(intervals(1, 2, -1, 2, 1), "swapped_frames", id="neighbours exchanged"),
        pytest.param(intervals(1, 3, -1, 1, -1, 3, 1), "swapped_frames", id="farther ones exchanged"),
        pytest.param([*intervals(1, 1, -1), FrameInterval(4, 5, 1.0)], "swapped_frames", id="nothing known beside"),
        pytest.param(intervals(1, 1, 0), "frozen_frames", id="frozen at the end"),
        pytest.param(intervals(1, 2.9, 1, 1, -0.2, 1), "spatial_offset", id="moved and moved back"),
        pytest.param(intervals(1, 0.7, 0.3, -0.6, -1, -1, -0.4, 0.8, 1), "mirrored", id="turned for long"),
    ],
)
def test_what_is_out_of_order_is_told_from_the_run(measured: list[FrameInterval], cause: str) -> None:
    """Frames out of place fall short and catch up side by side; whatever does not is the image's own."""
    hypotheses = hypotheses_of_order(intervals_out_of_order(measured))
    assert max(hypotheses, key=lambda hypothesis: hypothesis.support).cause == cause


@pytest.mark.parametrize(
    ("measured", "displaced"),
    [
        pytest.param(intervals(1, 1, 0, 1, 1, 2, 1), DisplacedFrames(3, 6, 1), id="a frame late"),
        pytest.param(intervals(1, -2, 1, 1, 3.2, 1), DisplacedFrames(2, 5, 3), id="three frames late"),
        pytest.param(intervals(1, 2, 1, 1, 0.1, 1), DisplacedFrames(2, 5, -1), id="a frame early"),
        pytest.param(intervals(1, 1, -1, 1, 1), DisplacedFrames(3, None, 2), id="two frames late to the end"),
        pytest.param(intervals(1, 0, 2, 1, 1), None, id="a single frame"),
        pytest.param(intervals(1, 1, 0), None, id="nothing known behind it"),
        pytest.param(intervals(1, 1.6, 1, 1, 0.4, 1), None, id="moved by no whole frame"),
    ],
)
def test_frames_that_follow_each_other_in_the_place_of_others(
    measured: list[FrameInterval], displaced: DisplacedFrames | None
) -> None:
    """The displacement at their first frame states by how many they are late, and that behind the last makes up."""
    assert intervals_out_of_order(measured).displaced == displaced


def test_order_alone_is_in_order() -> None:
    """Without an interval out of order nothing stands alone."""
    feature = intervals_out_of_order(intervals(1, 1.1, 0.9))
    assert (feature.relative_ratios, feature.isolated) == ((), False)
