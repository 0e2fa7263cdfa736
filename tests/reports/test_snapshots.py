"""Snapshots are read as they were kept, and their pictures tell their numbers."""

import base64

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_reports.colour_maps import Image, drawing
from fedora_reports.evidence import Evidence
from fedora_reports.panels import arrows_over, panels_of, scales_for
from fedora_reports.snapshots import snapshots_of, worst_location_of
from tests.reports.evidence_samples import beside, moments, place


def decoded(image: Image) -> np.ndarray:
    """The pixels (h, w, 3) RGB of a data URI."""
    data = base64.b64decode(image.uri.removeprefix("data:image/webp;base64,"))
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1])


def evidence(**changed: np.ndarray) -> Evidence:
    """Three snapshots, with some arrays exchanged."""
    return Evidence(moments() | {f"moments/{name}": array for name, array in changed.items()}, {})


def captions(found: Evidence) -> dict[str, str]:
    """The captions of the first snapshot."""
    snapshots = snapshots_of(found)
    return {panel.kind: panel.caption for panel in panels_of(snapshots[0], scales_for(snapshots))}


def test_captions_tell_range_unit_and_interval() -> None:
    """Each caption states what the picture holds, in its unit."""
    depth_m = np.full((3, 8, 12), 4.0)
    depth_m[1] = 9.0
    told = captions(evidence(
        rgb=np.full((3, 8, 12, 3), 200, np.uint8), depth_m=depth_m, flow_px=np.full((3, 8, 12, 2), 3.0),
        residual_dn=np.full((3, 8, 12), -3.0), brighter=np.ones((3, 6, 9), np.uint16),
        darker=np.zeros((3, 6, 9), np.uint16),
    ))  # fmt: skip
    assert told == {
        "frame": "DN 200 to 200 of 255",
        "events": "54 brighter (red), 0 darker (blue) in 20\u00a0ms",
        "depth": "4 to 4 m",
        "flow": "up to 4.24 px in 20\u00a0ms, along the arrows",
        "residual": "3 DN rms, up to 3 DN",
    }


def test_dark_frames_are_brightened_and_say_so() -> None:
    """A night frame is shown by a whole factor brighter, without burning out, and the caption tells the factor."""
    found = evidence(rgb=np.full((3, 8, 12, 3), 20, np.uint8))
    assert captions(found)["frame"] == "DN 20 to 20 of 255, shown 8 times as bright"
    snapshots = snapshots_of(found)
    frame = next(panels_of(snapshots[0], scales_for(snapshots)))
    assert abs(decoded(frame.image).astype(int) - 160).max() <= 3


def test_one_colour_means_one_depth_in_all_snapshots() -> None:
    """The scale spans all snapshots, so equal depths have equal colours wherever they are."""
    depth_m = np.full((3, 8, 12), 5.0)
    depth_m[0, 0, 0], depth_m[2, 0, 0] = 1.0, 25.0
    snapshots = snapshots_of(evidence(depth_m=depth_m))
    scales = scales_for(snapshots)
    pictures = [
        decoded(panel.image) for snapshot in snapshots for panel in panels_of(snapshot, scales) if panel.kind == "depth"
    ]
    np.testing.assert_array_equal(pictures[0][4, 4], pictures[2][4, 4])
    assert tuple(pictures[0][0, 0]) == (253, 231, 37)  # the nearest is the brightest


@pytest.mark.parametrize("stream", ["rgb", "depth_m", "flow_px", "residual_dn", "brighter"])
def test_a_missing_stream_costs_its_picture_only(stream: str) -> None:
    """The other four are drawn."""
    arrays = moments()
    del arrays[f"moments/{stream}"]
    snapshots = snapshots_of(Evidence(arrays, {}))
    assert len(list(panels_of(snapshots[0], scales_for(snapshots)))) == 4


def test_a_snapshot_without_frame_or_events_has_grey_panels() -> None:
    """NaN snapshots mean that nothing was there: the columns stay, grey, and say so."""
    times_us = np.array([np.nan, 5e5, 1e6])
    told = captions(evidence(rgb_times_us=times_us, events_interval_us=np.stack([times_us, times_us], axis=1)))
    assert (told["frame"], told["events"]) == ("none here", "none here")


def test_place_has_its_box_and_time() -> None:
    """A place is a snapshot without its first axis."""
    (found,) = worst_location_of(Evidence(place("F1"), {}), "F1")
    assert (found.box, found.time_us, found.worst) == ((0.0, 0.0, 0.5, 0.5), 500e3, True)
    assert worst_location_of(Evidence(place("F1"), {}), "F2") == ()


def test_frames_beside_a_place_share_its_box() -> None:
    """Before, at, and after, in time; the box of the place is drawn over all of them."""
    found = worst_location_of(Evidence(place("F1") | beside("F1"), {}), "F1")
    assert [(one.time_us, one.worst) for one in found] == [(0.0, False), (500e3, True), (1e6, False)]
    assert {one.box for one in found} == {(0.0, 0.0, 0.5, 0.5)}
    assert worst_location_of(Evidence(beside("F1"), {}), "F1") == ()


def test_whole_picture_needs_no_box() -> None:
    """A finding of the whole picture is not framed."""
    arrays = place("F1") | {"places/F1/box": np.array([0.0, 0.0, 1.0, 1.0])}
    (found,) = worst_location_of(Evidence(arrays, {}), "F1")
    assert found.box is None


@given(st.floats(0, 1), st.floats(0, 1))
def test_box_of_one_pixel_can_be_seen(x: float, y: float) -> None:
    """A tiny box grows to be seen, stays within the picture, and still holds its pixel."""
    arrays = place("F1") | {"places/F1/box": np.array([x, y, x, y])}
    (found,) = worst_location_of(Evidence(arrays, {}), "F1")
    assert found.box is not None
    left, top, right, bottom = found.box
    assert right - left == pytest.approx(0.06)
    assert bottom - top == pytest.approx(0.06)
    assert 0 <= left <= x + 1e-9
    assert x - 1e-9 <= right <= 1 + 1e-9
    assert 0 <= top <= y + 1e-9


def test_events_are_drawn_over_the_frame() -> None:
    """Each pixel of the event camera covers its share of the frame in grey; without a frame the ground is empty."""
    brighter, nothing = np.zeros((3, 6, 9), np.uint16), np.zeros((3, 6, 9), np.uint16)
    brighter[:, 3, 3] = 9
    rgb = np.zeros((3, 12, 18, 3), np.uint8)
    arrays = moments() | {"moments/rgb": rgb, "moments/brighter": brighter, "moments/darker": nothing}
    (snapshot, *_) = snapshots_of(Evidence(arrays, {}))
    picture = next(decoded(one.image) for one in panels_of(snapshot, scales_for([snapshot])) if one.kind == "events")
    assert picture.shape == (12, 18, 3)
    red = np.argwhere(picture[..., 0].astype(int) - picture[..., 2] > 100)
    assert (red.min(axis=0).tolist(), red.max(axis=0).tolist()) == ([6, 6], [7, 7])
    assert np.unique(picture[0]).tolist() == [153]  # black keeps 40% of its contrast against white


def test_one_colour_means_one_speed_of_flow() -> None:
    """A field over five times the interval and five times as long has the same colours."""
    flow_px = np.full((3, 8, 12, 2), 1.0)
    interval_us = np.array([[0.0, 20e3], [0.0, 100e3], [0.0, 20e3]])
    flow_px[1] *= 5
    snapshots = snapshots_of(evidence(flow_px=flow_px, flow_interval_us=interval_us))
    pictures = [
        decoded(panel.image)
        for snapshot in snapshots
        for panel in panels_of(snapshot, scales_for(snapshots))
        if panel.kind == "flow"
    ]
    np.testing.assert_array_equal(pictures[0], pictures[1])


def test_the_length_of_an_interval_does_not_overflow() -> None:
    """Whatever type of number holds the interval, an end before its start is no length."""
    for dtype in (np.uint8, np.int16, np.uint64, np.float64):
        interval_us = np.array([[1, 0], [0, 100], [100, 250]]).astype(dtype)
        lengths_s = [snapshot.flow_interval_s for snapshot in snapshots_of(evidence(flow_interval_us=interval_us))]
        assert lengths_s == pytest.approx([1.0, 100e-6, 150e-6])


def test_small_residuals_stay_pale() -> None:
    """What averaging leaves where all is right is not blown up to the full scale of colours."""
    snapshots = snapshots_of(evidence(residual_dn=np.full((3, 8, 12), 1.0)))
    (picture,) = (
        decoded(panel.image) for panel in panels_of(snapshots[0], scales_for(snapshots)) if panel.kind == "residual"
    )
    assert picture.min() > 220


def test_arrows_point_along_the_flow() -> None:
    """One arrow a grid step, from its place to where the flow leads, none where there is none."""
    flow_px = np.zeros((9, 9, 2))
    flow_px[..., 0] = 2.0
    flow_px[4, 4] = np.nan
    path = arrows_over(flow_px, 2.0)
    assert path.count("M") == 80
    assert path.startswith("M0.5 0.5l0.8 0.0")
    assert arrows_over(np.zeros((9, 9, 2)), 0.0) == ""


def test_large_pictures_are_made_smaller_and_others_kept() -> None:
    """No side is longer than is seen, proportions stay, and a small drawing survives pixel by pixel."""
    large = drawing(np.zeros((1080, 1440, 3), np.uint8), "large")
    assert (large.width, large.height) == (720, 540)
    small = np.random.default_rng(0).integers(0, 256, (5, 7, 3)).astype(np.uint8)
    np.testing.assert_array_equal(decoded(drawing(small, "small")), small)


def test_no_picture_is_larger_than_its_share_of_the_report() -> None:
    """Noise, which nothing can compress, is written with loss or smaller; its words and proportions stay."""
    noise = np.random.default_rng(0).integers(0, 256, (540, 720, 3)).astype(np.uint8)
    image = drawing(noise, "noise")
    assert len(image.uri) <= 4 / 3 * 14_000 + 40
    assert image.alt == "noise"
    assert image.width / image.height == pytest.approx(4 / 3, rel=0.02)
    assert decoded(image).shape == (image.height, image.width, 3)
