"""Colour of another centre in the view of depth: by parallax, without what the colour camera does not see."""

from dataclasses import replace

import numpy as np

from fedora_qa.sequence.declared import Camera
from fedora_qa.views.event_delays import colour_positions

DEPTH = Camera(80, 60, np.array([[100.0, 0, 39.5], [0, 100.0, 29.5], [0, 0, 1]]), np.eye(4))
BESIDE = np.eye(4)
BESIDE[0, 3] = 0.2
RGB = replace(DEPTH, width=160, height=120, K=np.array([[200.0, 0, 79.5], [0, 200.0, 59.5], [0, 0, 1]]),
              T_body_camera=BESIDE)  # fmt: skip


def box_before_a_wall() -> np.ndarray[tuple[int, int], np.dtype[np.float32]]:
    depth_m = np.full((60, 80), 4.0, np.float32)
    depth_m[20:40, 30:50] = 2.0
    return depth_m


def test_parallax_is_that_of_the_depth() -> None:
    """f b / z: 10 colour pixels to the left on the wall, 20 on the box; pixels are half as wide."""
    columns, rows, usable = colour_positions(box_before_a_wall(), DEPTH, RGB)
    assert columns[10, 60] == 2 * (60 - 39.5) + 79.5 - 10
    assert columns[30, 40] == 2 * (40 - 39.5) + 79.5 - 20
    assert rows[30, 40] == 2 * (30 - 29.5) + 59.5
    assert usable[10, 60]
    assert usable[30, 40]


def test_hidden_points_and_outlines_have_no_colour() -> None:
    """The colour camera lies to the right: the box hides 10 colour pixels, 5 of the view, of the wall on its left."""
    depth_m = box_before_a_wall()
    depth_m[50:, 70:] = np.nan
    _, _, usable = colour_positions(depth_m, DEPTH, RGB)
    assert not usable[30, 25:31].any()
    assert usable[30, 33:48].all()
    assert not usable[30, 49:51].any()
    assert usable[30, 53:60].all()
    assert usable[30, 10:23].all()
    # Without depth there is no colour, and none beyond the colour frame.
    assert not usable[55, 75]
    assert not usable[:, :4].any()
