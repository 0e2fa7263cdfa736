"""Instants are read as they were kept, and their pictures tell their numbers."""

import base64

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_reports.evidence import Evidence
from fedora_reports.instants import moments_of, place_of
from fedora_reports.panels import arrows_over, panels_of
from fedora_reports.picture_scales import scales_for
from fedora_reports.pictures import Image, drawing
from tests.reports.evidence_samples import moments, place


def decoded(image: Image) -> np.ndarray:
    """The pixels (h, w, 3) RGB of a data URI."""
    data = base64.b64decode(image.uri.removeprefix("data:image/webp;base64,"))
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[..., ::-1])


def evidence(**changed: np.ndarray) -> Evidence:
    """Three moments, with some arrays exchanged."""
    return Evidence(moments() | {f"moments/{name}": array for name, array in changed.items()}, {})


def captions(found: Evidence) -> dict[str, str]:
    """The captions of the first moment."""
    instants = moments_of(found)
    return {panel.kind: panel.caption for panel in panels_of(instants[0], scales_for(instants))}


def test_captions_tell_range_unit_and_interval() -> None:
    """Each caption states what the picture holds, in its unit."""
    depth_m = np.full((3, 8, 12), 4.0)
    depth_m[1] = 9.0
    told = captions(evidence(
        rgb=np.full((3, 8, 12, 3), 200, np.uint8), depth_m=depth_m, flow_px=np.full((3, 8, 12, 2), 3.0),
        brighter=np.ones((3, 6, 9), np.uint16), darker=np.zeros((3, 6, 9), np.uint16),
    ))  # fmt: skip
    assert told == {
        "frame": "DN 200 to 200 of 255",
        "events": "54 brighter (red), 0 darker (blue) in 20\u00a0ms",
        "depth": "4 to 4 m",
        "flow": "up to 4.24 px in 20\u00a0ms, along the arrows",
    }


def test_dark_frames_are_brightened_and_say_so() -> None:
    """A night frame is shown by a whole factor brighter, without burning out, and the caption tells the factor."""
    found = evidence(rgb=np.full((3, 8, 12, 3), 20, np.uint8))
    assert captions(found)["frame"] == "DN 20 to 20 of 255, shown 8 times as bright"
    instants = moments_of(found)
    frame = next(panels_of(instants[0], scales_for(instants)))
    assert abs(decoded(frame.image).astype(int) - 160).max() <= 3


def test_one_colour_means_one_depth_in_all_moments() -> None:
    """The scale spans all moments, so equal depths have equal colours wherever they are."""
    depth_m = np.full((3, 8, 12), 5.0)
    depth_m[0, 0, 0], depth_m[2, 0, 0] = 1.0, 25.0
    instants = moments_of(evidence(depth_m=depth_m))
    scales = scales_for(instants)
    pictures = [decoded(panel.image) for one in instants for panel in panels_of(one, scales) if panel.kind == "depth"]
    np.testing.assert_array_equal(pictures[0][4, 4], pictures[2][4, 4])
    assert tuple(pictures[0][0, 0]) == (253, 231, 37)  # the nearest is the brightest


@pytest.mark.parametrize("stream", ["rgb", "depth_m", "flow_px", "brighter"])
def test_a_missing_stream_costs_its_picture_only(stream: str) -> None:
    """The other three are drawn."""
    arrays = moments()
    del arrays[f"moments/{stream}"]
    instants = moments_of(Evidence(arrays, {}))
    assert len(list(panels_of(instants[0], scales_for(instants)))) == 3


def test_a_moment_without_frame_or_events_has_grey_panels() -> None:
    """NaN instants mean that nothing was there: the columns stay, grey, and say so."""
    times_us = np.array([np.nan, 5e5, 1e6])
    told = captions(evidence(rgb_times_us=times_us, events_interval_us=np.stack([times_us, times_us], axis=1)))
    assert (told["frame"], told["events"]) == ("none here", "none here")


def test_place_has_its_box_and_time() -> None:
    """A place is a moment without its first axis."""
    found = place_of(Evidence(place("F1"), {}), "F1")
    assert found is not None
    assert (found.box, found.time_us) == ((0.0, 0.0, 0.5, 0.5), 500e3)
    assert place_of(Evidence(place("F1"), {}), "F2") is None


def test_whole_picture_needs_no_box() -> None:
    """A finding of the whole picture is not framed."""
    arrays = place("F1") | {"places/F1/box": np.array([0.0, 0.0, 1.0, 1.0])}
    found = place_of(Evidence(arrays, {}), "F1")
    assert found is not None
    assert found.box is None


@given(st.floats(0, 1), st.floats(0, 1))
def test_box_of_one_pixel_can_be_seen(x: float, y: float) -> None:
    """A tiny box grows to be seen, stays within the picture, and still holds its pixel."""
    arrays = place("F1") | {"places/F1/box": np.array([x, y, x, y])}
    found = place_of(Evidence(arrays, {}), "F1")
    assert found is not None
    assert found.box is not None
    left, top, right, bottom = found.box
    assert right - left == pytest.approx(0.06)
    assert bottom - top == pytest.approx(0.06)
    assert 0 <= left <= x + 1e-9
    assert x - 1e-9 <= right <= 1 + 1e-9
    assert 0 <= top <= y + 1e-9


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
