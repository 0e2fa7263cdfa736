"""What can be drawn of a path, the box around it, and the camera before it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from fedora_reports.evidence import Evidence
from fedora_reports.html import render_html
from fedora_reports.trajectory_path import (
    OUTLINE,
    Box,
    Frusta,
    box_around,
    flown_path,
    frusta_of,
    round_step_m,
    view_of,
)
from tests.reports.evidence_samples import frusta
from tests.reports.trajectory_shapes import SHAPES, loop
from tests.support.records import file_record, passed, record

PLACES = arrays.arrays(
    np.float64, st.tuples(st.integers(1, 6), st.just(3)), elements=st.floats(-1e4, 1e4, allow_subnormal=False)
)


def test_runs_are_split_where_positions_are_missing() -> None:
    """Rows without a finite position are left out, and end a run; a missing speed is kept as unknown."""
    n = 8
    positions = np.arange(3.0 * n).reshape(n, 3)
    positions[[0, 3, 4], 1] = (np.nan, np.inf, np.nan)
    speeds = np.arange(n, dtype=float)
    speeds[2] = np.nan
    path = flown_path(np.arange(n), positions, speeds, np.zeros((n, 3)), most=100)
    assert path.times_us.tolist() == [1, 2, 5, 6, 7]
    assert path.runs == ((0, 2), (2, 5))
    assert path.speed_range_m_s == (1.0, 7.0)


def test_thinning_keeps_the_ends_and_adds_no_gaps() -> None:
    """A long path is thinned to as many poses as were asked for, in one run from the first to the last."""
    arrays = loop()
    path = flown_path(**arrays, most=50)
    assert len(path.times_us) == 50
    assert path.times_us[[0, -1]].tolist() == arrays["times_us"][[0, -1]].tolist()
    assert path.runs == ((0, 50),)


def test_wrong_shapes_are_refused() -> None:
    """Arrays of other shapes raise, and the message says which shapes came."""
    with pytest.raises(ValueError, match=r"Expected shapes .* got \(3,\), \(3, 2\)"):
        flown_path(np.zeros(3), np.zeros((3, 2)), np.zeros(3), np.zeros((3, 3)), most=10)


def test_speeds_of_rounding_do_not_vary() -> None:
    """A constant speed with rounding errors gets no scale of colours."""
    speeds = 5.0 + 1e-12 * np.arange(4)
    assert not flown_path(np.arange(4), np.zeros((4, 3)), speeds, np.zeros((4, 3)), most=10).speed_varies


@given(PLACES)
def test_box_holds_the_path(places: np.ndarray) -> None:
    """Every position lies in the box; no side is thinner than its share of the longest."""
    box = box_around(places)
    slack = 1e-9 * box.span_m
    assert (places >= box.low_m - slack).all()
    assert (places <= box.high_m + slack).all()
    sides = box.high_m - box.low_m
    assert (sides[:2] >= 0.25 * box.span_m).all()
    assert sides[2] >= 0.1 * box.span_m


def test_ticks_are_round_metres() -> None:
    """Ticks are at multiples of a round step, within the box, and say the metres where they stand."""
    box = Box(np.array([-20.0, 100_000.0, 0.0]), np.array([20.0, 100_010.0, 5.0]))
    assert [label for _, label in box.ticks(0, most=4)] == ["-20", "-10", "0", "10", "20"]
    for metres, label in box.ticks(1):
        assert float(label) == pytest.approx(metres)


@given(st.floats(1e-6, 1e6))
def test_round_steps(rough: float) -> None:
    """A step is 1, 2 or 5 times a power of ten, not below what was asked for, and below 2.5 times of it."""
    step = round_step_m(rough)
    assert rough * (1 - 1e-8) <= step <= 2.5 * rough
    assert f"{step:e}"[0] in "125"


@pytest.mark.parametrize("name", SHAPES)
def test_camera_just_holds_the_box(name: str) -> None:
    """Every corner is before the camera and within the slopes, and at least one touches them."""
    places = SHAPES[name]["positions_world_m"]
    places = places[np.isfinite(places).all(axis=1)]
    box = box_around(places)
    corners = np.stack(np.meshgrid(*zip(box.low_m, box.high_m, strict=True)), axis=-1).reshape(-1, 3)
    view = view_of(places, corners, (0.3, 0.2))
    assert ((corners - view.eye) @ view.axes[2] < 0).all()
    filled = np.abs(view.project(corners)) / (0.3, 0.2)
    assert filled.max() == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)


@given(st.floats(0.0, 2 * np.pi))
def test_straight_flight_is_seen_from_the_side(heading: float) -> None:
    """A straight level flight in any direction is nearer across the view than along it."""
    places = np.linspace(0.0, 30.0, 7)[:, None] * np.array([np.cos(heading), np.sin(heading), 0.0])
    view = view_of(places, places + np.array([[0.0, 0.0, 1.0]]), (0.3, 0.2))
    along = places[-1] / 30.0
    assert abs(along @ view.axes[0]) > 0.8


def test_a_path_beyond_the_resolution_of_metres_has_ticks() -> None:
    """At 1e20 m the sides of the box vanish in rounding; each axis keeps one tick."""
    box = box_around(np.full((3, 3), 1e20))
    assert [len(box.ticks(axis)) for axis in range(3)] == [1, 1, 1]


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
