"""Frusta in drawings: at a size that suits the box, upright, and only those that lie in it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from fedora_reports.evidence import Evidence
from fedora_reports.html import render_html
from fedora_reports.trajectory_path import OUTLINE, Box, Frusta, frusta_of
from tests.reports.evidence_samples import frusta
from tests.support.records import file_record, passed, record

BOX = Box(np.array([5e6 - 10.0, -10.0, 0.0]), np.array([5e6 + 10.0, 10.0, 8.0]))


def test_frusta_have_the_size_of_the_drawing() -> None:
    """The longest ray is a tenth of the longest side; the peak is above the upper edge of the image, or below it."""
    kept = frusta_of(Evidence(frusta(), {}))
    assert kept is not None
    places = kept.places(BOX)
    assert places.shape == (2, 6, 3)
    np.testing.assert_allclose(places[:, 0], [[0.0, 0.3, -0.1]] * 2, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(places[:, 1:5] - places[:, :1], axis=-1), 0.1, rtol=1e-9)
    assert places[0, 5, 2] > places[0, 1:5, 2].max()
    assert places[1, 5, 2] < places[1, 1:5, 2].min()
    assert "camera of rgb" in kept.sentence


def test_frusta_that_cover_each_other_are_one() -> None:
    """Of views 0.1 m apart one is drawn each 2 m, in a box of 20 m; of a camera that turns by right angles, all."""
    views = frusta()
    ray, along = views["frusta/rgb/rays_world"][:1], np.arange(41.0)[:, None] / 10
    flight = Frusta("rgb", [5e6, 6.0, 2.0] + along * [1.0, 0.0, 0.0], np.repeat(ray, 41, axis=0))
    np.testing.assert_allclose(flight.places(BOX)[:, 0, 0] * BOX.span_m, [0.0, 2.0, 4.0], atol=1e-9)
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turns = np.concatenate([ray @ np.linalg.matrix_power(quarter, k) for k in range(4)])
    assert len(Frusta("rgb", np.tile([5e6, 6.0, 2.0], (4, 1)), turns).places(BOX)) == 4


def test_one_line_draws_every_edge() -> None:
    """Four rays, four sides of the image, and the peak over its upper edge."""
    edges = {frozenset(edge) for edge in pairwise(OUTLINE)}
    rays, sides = {frozenset({0, k}) for k in range(1, 5)}, {frozenset({k, k % 4 + 1}) for k in range(1, 5)}
    assert edges == rays | sides | {frozenset({1, 5}), frozenset({2, 5})}


@pytest.mark.parametrize("centre_m", [[0.0, 0.0, 0.0], [np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0]])
def test_a_camera_outside_of_the_box_is_left_out(centre_m: list[float]) -> None:
    """Far away, or nowhere."""
    kept = frusta_of(Evidence(frusta(np.array(centre_m)), {}))
    assert kept is not None
    assert kept.places(BOX).shape == (0, 6, 3)


def test_what_is_drawn_along_the_path_is_no_picture_of_a_check() -> None:
    """The arrays of the frusta are neither drawn as maps nor listed as what was not drawn."""
    arrays = frusta()
    file = replace(file_record(passed()), evidence={name: f"Title of {name}" for name in arrays})
    page = render_html(record(file), arrays)
    assert "Kept beside the record, not drawn" not in page
    assert page.count("Title of frusta") == len(arrays)  # in the list of all arrays


def test_arrays_that_do_not_fit_are_no_frusta() -> None:
    """Of other lengths; rays of no length are left out."""
    short = frusta() | {"frusta/rgb/rays_world": np.ones((3, 4, 3))}
    assert frusta_of(Evidence(short, {})) is None
    empty = frusta_of(Evidence(frusta() | {"frusta/rgb/rays_world": np.zeros((2, 4, 3))}, {}))
    assert empty is not None
    assert not len(empty.places(BOX))
