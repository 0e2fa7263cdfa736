"""Positions of events in the view of another camera: OpenCV's, and left out beyond the view."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.sequence.declared import Camera, Lens
from fedora_qa.sequence.window import Events
from fedora_qa.views.event_view import EventView, positions_px, view_around

RADTAN = Lens("radtan", (-0.37, 0.16, 4e-4, -3e-4))
EVENTS = Camera(64, 48, np.array([[56.0, 0, 31.0], [0, 55.0, 24.5], [0, 0, 1]]), np.eye(4), lens=RADTAN)
TURN, _ = cv2.Rodrigues(np.array([0.01, -0.02, 0.015]))


def other_camera() -> Camera:
    """A pinhole with the centre of the event camera, whose rays r of the events are TURN r."""
    T_body_camera = np.eye(4)
    T_body_camera[:3, :3] = TURN.T
    return replace(EVENTS, K=np.diag([120.0, 120.0, 1.0]), T_body_camera=T_body_camera, lens=None)


def view_through_lenses(events: Camera, other: Camera) -> EventView:
    return view_around(events.K, positions_px(events, other))


def positions(view: EventView) -> tuple[NDArray[Any], NDArray[Any]]:
    assert view.positions is not None
    return view.positions.columns, view.positions.rows


def test_positions_are_those_of_opencv() -> None:
    """Lens and rotation as ``cv2.undistortPoints``, by the K that the view states, between pixels."""
    view = view_through_lenses(EVENTS, other_camera())
    columns, rows = positions(view)
    pixels = np.dstack(np.meshgrid(np.arange(64.0), np.arange(48.0))).reshape(-1, 1, 2)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-12)
    expected = cv2.undistortPoints(pixels, EVENTS.K, np.array(RADTAN.coefficients), R=TURN, P=view.K, criteria=criteria)
    np.testing.assert_allclose(np.dstack([columns, rows]).reshape(-1, 1, 2), expected, atol=1e-6)
    # The view is the smallest image around all positions.
    assert np.floor([columns.min(), rows.min()]).tolist() == [0, 0]
    assert (np.ceil([rows.max(), columns.max()]) + 1).tolist() == list(view.shape)
    assert view.share == 1.0


def test_a_pixel_is_as_wide_as_its_neighbours_are_apart() -> None:
    """Radially the lens stretches most: by the derivative of its inverse, towards the left border on the middle row."""
    lens = Lens("radtan", (-0.37, 0.16, 0.0, 0.0))
    events = replace(EVENTS, K=np.array([[56.0, 0, 31.0], [0, 56.0, 24.0], [0, 0, 1]]), lens=lens)
    view = view_through_lenses(events, replace(events, lens=None))
    columns, _ = positions(view)
    assert view.positions is not None
    apart_px = (columns[24, 6] - columns[24, 4]) / 2
    assert view.positions.widths_px[24, 5] == pytest.approx(apart_px, rel=1e-9)
    assert view.positions.widths_px[24, 31] == pytest.approx(1.0, abs=1e-3)
    assert apart_px > 1.1


def test_pixels_that_no_view_holds_are_left_out() -> None:
    """A fisheye of half a turn images rays beside and behind any pinhole: its margin has no position."""
    fisheye = replace(EVENTS, K=np.array([[20.0, 0, 31.5], [0, 20.0, 23.5], [0, 0, 1]]),
                      lens=Lens("equidistant", (0.0, 0.0, 0.0, 0.0)))  # fmt: skip
    view = view_through_lenses(fisheye, replace(fisheye, lens=None))
    columns, _ = positions(view)
    assert np.isfinite(columns[24, 32])
    assert np.isnan(columns[0, 0])
    assert view.shape[0] <= 2 * 48
    assert view.shape[1] <= 2 * 64
    x, y = np.array([32, 0, 99, 32], np.uint16), np.array([24, 0, 24, 25], np.uint16)
    events = Events(x, y, np.arange(4), np.zeros(4, np.uint8))
    wanted = np.ones(view.shape[0], np.bool_)
    # The second has no position, the third is beyond the sensor.
    assert view.chosen(events, (0, 4, 1), wanted).tolist() == [0, 3]
    wanted[:] = False
    assert view.chosen(events, (0, 4, 1), wanted).tolist() == []
