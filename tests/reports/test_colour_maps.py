"""Colours say what the legends promise."""

import colorsys

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_reports import colour_maps
from fedora_reports.colour_maps import BRIGHTER, DARKER, NO_EVENT, NO_VALUE, by_table, event_colours, flow_colours

VIRIDIS_ENDS = [(68, 1, 84), (253, 231, 37)]
"""First and last colour of viridis as matplotlib publishes it."""


def lightness(colours: np.ndarray) -> np.ndarray:
    """CIE L* of colours (n, 3), 0 to 100."""
    lab = cv2.cvtColor(colours[None].astype(np.float32) / 255, cv2.COLOR_RGB2LAB)
    return np.asarray(lab[0, :, 0])


def test_ends_of_the_scale_are_the_ends_of_the_table() -> None:
    """The least value has the first colour, the greatest the last, what lies beyond theirs, and NaN is grey."""
    shares = np.array([[0.0, 1.0, -3.0, 7.0, np.nan, np.inf]])
    first, last = VIRIDIS_ENDS
    expected = [first, last, first, last, NO_VALUE, NO_VALUE]
    np.testing.assert_allclose(by_table(shares, colour_maps.SEQUENTIAL)[0].astype(int), expected, atol=1)


def test_sequential_map_rises_evenly_in_lightness() -> None:
    """Each step is lighter than the one before, by nearly the same amount: no band and no edge of its own."""
    steps = np.diff(lightness(colour_maps.SEQUENTIAL[::8]))
    assert (steps > 0).all()
    assert steps.max() < 1.5 * steps.mean()


def test_diverging_map_is_lightest_at_zero() -> None:
    """Both arms darken from the middle, so that sign and size can be told without hue."""
    light = lightness(colour_maps.DIVERGING)
    assert (np.diff(light[:128]) >= -0.5).all()
    assert (np.diff(light[128:]) <= 0.5).all()
    assert abs(int(light[0]) - int(light[-1])) < 15


@pytest.mark.parametrize(("u", "v", "hue_deg"), [(1, 0, 0), (0, 1, 90), (-1, 0, 180), (0, -1, 270), (1, 1, 45)])
def test_hue_is_the_direction_of_flow(u: float, v: float, hue_deg: float) -> None:
    """Right is red, down is 90 degrees of hue further; checked with the standard library's colours."""
    picture = flow_colours(np.array([[[u, v]]], dtype=float), float(np.hypot(u, v)))
    hue, saturation, value = colorsys.rgb_to_hsv(*(picture[0, 0] / 255))
    assert (hue * 360 - hue_deg + 180) % 360 - 180 == pytest.approx(0, abs=0.5)
    assert (saturation, value) == pytest.approx((1.0, 1.0), abs=0.01)


def test_saturation_is_the_length_of_flow() -> None:
    """No flow is white, half is half, what is longer than full is full, and what is not finite is grey."""
    flow_px = np.array([[[0, 0], [2, 0], [9, 0], [np.nan, 0], [0, np.inf]]], dtype=np.float32)
    picture = flow_colours(flow_px, 4.0)
    np.testing.assert_allclose(picture[0], [(255, 255, 255), (255, 128, 128), (255, 0, 0), NO_VALUE, NO_VALUE], atol=1)


def test_flow_without_scale_is_white() -> None:
    """Where nothing moves there is no full length, and the picture is white."""
    assert (flow_colours(np.zeros((2, 3, 2)), 0.0) == 255).all()


def test_events_are_red_blue_or_both() -> None:
    """Full pixels have the pure colours, both polarities mix, and no event is the background."""
    picture = event_colours(np.array([[5, 0, 5, 0]]), np.array([[0, 5, 5, 0]]), 5)
    mixed = np.rint((np.array(BRIGHTER) + DARKER) / 2)
    np.testing.assert_allclose(picture[0], [BRIGHTER, DARKER, mixed, NO_EVENT], atol=1)


@given(st.integers(1, 60000), st.integers(1, 1000))
def test_a_single_event_is_seen(count: int, full: int) -> None:
    """However busy the rest is, one event stands out against the background, and more are never fainter."""
    alone, many = event_colours(np.array([[1, count]]), np.zeros((1, 2)), full)[0].astype(int)
    assert abs(alone - NO_EVENT).max() > 80
    assert (abs(many - NO_EVENT) >= abs(alone - NO_EVENT) - 1).all()


def test_red_and_blue_differ_for_the_colour_blind() -> None:
    """The two polarities differ in lightness or along blue to yellow, which red-green blindness leaves."""
    red, blue = np.array([BRIGHTER]), np.array([DARKER])
    labs = cv2.cvtColor(np.stack([red, blue]).astype(np.float32) / 255, cv2.COLOR_RGB2LAB)[:, 0]
    assert abs(labs[0, 2] - labs[1, 2]) > 60
