"""One step of paths along a field: exact where flow is linear, kept from breaks and from places that are covered."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from fedora_qa.estimators.flow.path_kernels import (
    PathStates,
    interpolation_errors,
    medians_of_parts,
    spans_at_targets,
    step,
)

HEIGHT, WIDTH = 60, 90
COLUMNS, ROWS = np.meshgrid(np.arange(float(WIDTH)), np.arange(float(HEIGHT)))
NOTHING, UNKNOWN = np.empty((0, 0, 4), np.float32), np.empty((0, 0), np.float32)


class Stepped:
    """Paths that begin at ``x`` and ``y``, after one step along a flow (H, W, 2)."""

    def __init__(
        self,
        flow_px: NDArray[np.float64],
        x: ArrayLike,
        y: ArrayLike,
        *,
        first: bool = False,
        crowds: bool = False,
        many: bool = False,
    ):
        lines = np.ascontiguousarray(flow_px, np.float32).reshape(len(flow_px), -1)
        self.x, self.y = (np.array(at, dtype=np.float64).ravel() for at in np.broadcast_arrays(x, y))
        self.bound_px = np.zeros(len(self.x))
        self.clear, self.stays = np.ones(len(self.x), np.bool_), np.ones(len(self.x), np.bool_)
        spans = spans_at_targets(lines) if crowds else NOTHING
        errors_px = interpolation_errors(lines) if many else UNKNOWN
        paths = PathStates(self.x, self.y, self.bound_px, self.clear, self.stays)
        step(lines, spans, errors_px, 0.001, first, True, paths)


def flow_of(u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
    return np.stack(np.broadcast_arrays(u, v, COLUMNS)[:2], axis=-1)


def test_linear_flow_is_read_exactly() -> None:
    """Between pixels too, and the bound is that of rounding alone, grown by nothing as it was zero."""
    x, y = np.array([20.25, 44.5, 60.0]), np.array([30.75, 12.0, 33.3])
    moved = Stepped(flow_of(0.05 * COLUMNS - 1, 0.02 * COLUMNS - 0.03 * ROWS), x, y)
    np.testing.assert_allclose(moved.x, x + 0.05 * x - 1, atol=1e-5)
    np.testing.assert_allclose(moved.y, y + 0.02 * x - 0.03 * y, atol=1e-5)
    assert moved.clear.all()
    np.testing.assert_allclose(moved.bound_px, 0.001, atol=1e-5)


def test_bent_flow_errs_within_the_bound() -> None:
    """A parabola between pixels is read too large by an eighth of its second difference; twice that is allowed."""
    moved = Stepped(flow_of(0.02 * (COLUMNS - 40) ** 2, 0.0), np.array([40.5, 43.5]), 30.0)
    errors_px = moved.x - np.array([40.5 + 0.02 * 0.25, 43.5 + 0.02 * 12.25])
    np.testing.assert_allclose(errors_px, 0.04 / 8, atol=1e-5)
    np.testing.assert_allclose(moved.bound_px, 0.04 / 4 + 0.001, atol=1e-4)


@pytest.mark.parametrize("spoilt", ["break", "missing"])
def test_paths_keep_four_pixels_from_breaks(spoilt: str) -> None:
    """Of a step between columns 39 and 40, of a missing value at 40, and of the border."""
    flow_px = flow_of(np.where(COLUMNS < 40, 1.0, 3.0), 0.0)
    if spoilt == "missing":
        flow_px = flow_of(1.0, 0.0)
        flow_px[:, 40] = np.nan
    clear = Stepped(flow_px, np.arange(WIDTH), 30).clear
    right = 45 if spoilt == "break" else 46  # the neighbours of a missing value bend as well
    assert set(np.flatnonzero(clear)) == {*range(5, 35), *range(right, WIDTH - 5)}


def test_many_paths_are_as_few() -> None:
    """What is looked at once for all pixels is what is looked at about each path: bounds, and what keeps clear."""
    rng = np.random.default_rng(7)
    flow_px = flow_of(0.02 * (COLUMNS - 40) ** 2 / 9 + np.where(ROWS > 40, 2.0, 0.0), 0.05 * ROWS)
    flow_px += rng.normal(0, 0.005, flow_px.shape)
    flow_px[12, 70], flow_px[20, 30, 1] = np.nan, np.inf
    x, y = rng.uniform(0, WIDTH, 3000), rng.uniform(0, HEIGHT, 3000)
    few, many = (Stepped(flow_px, x, y, many=each) for each in (False, True))
    assert 500 < few.clear.sum() < 2500
    np.testing.assert_array_equal(many.clear, few.clear)
    np.testing.assert_array_equal(many.bound_px, few.bound_px)
    np.testing.assert_array_equal(many.x, few.x)


def test_what_is_covered_midway_is_not_clear() -> None:
    """A post that moves over a wall covers a strip of it; the wall beside it, and the post itself, stay clear."""
    post = (COLUMNS >= 60) & (COLUMNS < 80)
    flow_px = flow_of(np.where(post, -30.0, -2.0), 0.0)  # the post ends on columns 30 to 49
    clear = Stepped(flow_px, np.arange(WIDTH), 30, first=True, crowds=True).clear
    assert not clear[34:50].any()  # wall that ends on columns 32 to 47
    assert clear[12:22].all()  # wall that ends on columns 10 to 19
    assert not clear[66:74].any()  # the post, which ends where the wall does, too: either is hidden


def test_what_covers_a_surface_is_told_in_large_frames_too() -> None:
    """Cells of 8 px: a post of 60 px that moves by 50 px over a wall at rest covers the wall there, and no further."""
    flow_px = np.zeros((900, 1000, 2))
    flow_px[:, 400:460, 0] = 50.0
    clear = Stepped(flow_px, np.arange(1000), 450, first=True, crowds=True).clear
    assert not clear[460:510].any()  # wall that the post ends on
    assert clear[20:390].all()
    assert clear[530:980].all()


def test_a_sloping_surface_does_not_cover_itself() -> None:
    """Flow that grows by a third of a pixel a pixel leads to places side by side."""
    flow_px = flow_of(0.33 * (COLUMNS - 45), 0.33 * (ROWS - 30))
    x, y = COLUMNS[15:-15:3, 20:-20:3], ROWS[15:-15:3, 20:-20:3]
    assert Stepped(flow_px, x, y, first=True, crowds=True).clear.all()


def test_paths_without_a_flow_wait_and_those_of_infinite_flow_leave() -> None:
    """Neither is clear; only the one that leaves the image does not stay."""
    flow_px = flow_of(1.0, 0.0)
    flow_px[30, 20], flow_px[30, 40], flow_px[30, 60] = np.nan, np.inf, 100.0
    moved = Stepped(flow_px, np.array([20.0, 40.0, 60.0]), 30.0)
    assert moved.stays.tolist() == [True, False, False]
    assert not moved.clear.any()
    assert moved.x[0] == 20.0


def test_medians_of_parts_are_those_of_numpy() -> None:
    """Part by part; of nothing there is none."""
    values, starts = np.random.default_rng(5).normal(size=40), np.array([0, 7, 7, 19, 40])
    expected = [np.median(values[a:b]) if b > a else np.nan for a, b in pairwise(starts)]
    np.testing.assert_array_equal(medians_of_parts(values, starts), expected)
