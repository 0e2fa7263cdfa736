"""The step of stored values: each kind of rounding is recognised, and numbers that were not rounded have none."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.estimators.storage.steps import depth_step, level_step, stored_step
from fedora_qa.sequence.stored_step import DOUBLE_ROUNDOFF, HALF_ROUNDOFF, SINGLE_ROUNDOFF, StoredStep

seeds = st.integers(0, 2**32 - 1)


def values_of(seed: int, size: float, count: int = 1000) -> np.ndarray:
    """Values of either sign that are spread over decades about a size."""
    random = np.random.default_rng(seed)
    return size * random.normal(size=count) * np.exp(random.normal(size=count))


@settings(max_examples=50, deadline=None)
@given(seed=seeds, power=st.integers(0, 9), single=st.booleans())
def test_decimals_are_recognised(seed: int, power: int, single: bool) -> None:
    """Of float32 where its digits suffice for the step."""
    step = 10.0**-power
    values = np.round(values_of(seed, 100 * step), power)
    found = stored_step(values.astype(np.float32) if single else values)
    assert found.size == pytest.approx(step, rel=1e-12)


@settings(max_examples=50, deadline=None)
@given(seed=seeds, power=st.integers(0, 20))
def test_binary_steps_are_recognised(seed: int, power: int) -> None:
    """In double precision; 1/64 px, 1/128 px and all others."""
    found = stored_step(np.rint(values_of(seed, 100.0)) * 2.0**-power)
    assert found.size == 2.0**-power


@settings(max_examples=50, deadline=None)
@given(seed=seeds, size=st.floats(1e-2, 1e2), kind=st.sampled_from([np.float16, np.float32, np.float64]))
def test_numbers_that_were_not_rounded_have_no_step(seed: int, size: float, kind: type[np.floating]) -> None:
    """But for the mantissa of their type, whichever type they are stored in afterwards."""
    values = values_of(seed, size).astype(kind).astype(np.float64)
    roundoff = {np.float16: HALF_ROUNDOFF, np.float32: SINGLE_ROUNDOFF, np.float64: DOUBLE_ROUNDOFF}[kind]
    found = stored_step(values, with_unknown_steps=kind is np.float64)
    assert found.roundoff == roundoff
    if kind is not np.float16:  # whose smallest values lie on a grid of equal steps
        assert found.size == 0.0


@settings(max_examples=50, deadline=None)
@given(seed=seeds, step=st.floats(1e-6, 1.0), single=st.booleans())
def test_a_full_scale_over_integers_is_recognised(seed: int, step: float, single: bool) -> None:
    """Any step, where values are dense enough for neighbours to be a few steps apart."""
    values = step * np.rint(values_of(seed, 300.0))
    found = stored_step(values.astype(np.float32) if single else values, with_unknown_steps=True)
    assert found.size == pytest.approx(step, rel=1e-3)


@pytest.mark.parametrize("values", [np.zeros(1000), np.full(1000, 9.81), np.full(1000, np.nan), np.empty(0)])
def test_constants_give_no_step(values: np.ndarray) -> None:
    """One number lies on some grid; it shows no rounding."""
    assert stored_step(values, with_unknown_steps=True).size == 0.0


@pytest.mark.parametrize(("step", "with_unknown_steps"), [(0.01, False), (0.01234567, True)])
def test_a_grid_of_seven_tenths_of_the_values_is_no_step(step: float, with_unknown_steps: bool) -> None:
    """Far beyond chance, but the step of a dataset is that of nearly all of its values."""
    values = values_of(0, 10.0)
    on_grid = step * np.rint(values / step)
    on_grid[::10], on_grid[3::10], on_grid[7::10] = values[::10], values[3::10], values[7::10]
    assert stored_step(on_grid, with_unknown_steps=with_unknown_steps).size == 0.0


def test_a_fault_of_a_few_values_leaves_the_step() -> None:
    """A twentieth of the values is off the grid."""
    values = np.round(values_of(1, 10.0), 3)
    values[::20] *= 1.2345678901
    assert stored_step(values).size == pytest.approx(1e-3)


@settings(max_examples=50, deadline=None)
@given(seed=seeds, power=st.integers(0, 6))
def test_rounding_errors_stay_within_the_bound(seed: int, power: int) -> None:
    """The bound holds for each value, and is not loose: the worst error comes near it."""
    exact = values_of(seed, 100 * 10.0**-power)
    errors = np.abs(np.round(exact, power) - exact)
    bounds = StoredStep(10.0**-power).error_bounds(exact)
    assert np.all(errors <= bounds * (1 + 1e-9))
    assert errors.max() > 0.9 * bounds.min()


@settings(max_examples=50, deadline=None)
@given(seed=seeds, step=st.floats(1e-5, 1.0), sway=st.floats(0.6, 3.0), single=st.booleans())
def test_few_levels_show_their_step(seed: int, step: float, sway: float, single: bool) -> None:
    """Samples that sway by a few steps, as of a hovering vehicle, lie on few levels and return to them."""
    noise = 0.2 * np.random.default_rng(seed).normal(size=1000)
    values = step * np.rint(sway * np.sin(np.arange(1000) / 30) + noise)
    found = level_step(values.astype(np.float32) if single else values)
    assert found == pytest.approx(step, rel=1e-5)


@settings(max_examples=30, deadline=None)
@given(seed=seeds, step=st.floats(1e-5, 1.0), first=st.sampled_from([0, -300, 10_000]))
def test_levels_that_never_return_show_their_step_by_their_distances(seed: int, step: float, first: int) -> None:
    """A drift by one to four steps at a time, each level of which is held for twenty samples."""
    rises = np.random.default_rng(seed).integers(1, 5, 60)
    rises[7] = 1
    values = step * (first + np.repeat(np.cumsum(rises), 20))
    assert level_step(values) == pytest.approx(step, rel=1e-5)


@pytest.mark.parametrize("step", [0.0123, 0.37])
def test_levels_two_and_three_steps_apart_show_their_step(step: float) -> None:
    """The least distance is no step, but two."""
    rises = np.random.default_rng(0).integers(2, 4, 60)
    assert level_step(step * np.repeat(np.cumsum(rises), 20)) == pytest.approx(step, rel=1e-5)


def test_levels_of_other_origin_have_no_step() -> None:
    """Samples that change each time, a constant, one change, and a slow stream whose samples are held for ten rows."""
    random = np.random.default_rng(5)
    for values in (
        random.normal(size=1000),
        np.full(1000, 9.81),
        np.repeat([0.0, 1.0], 500),
        np.repeat(random.normal(size=100), 10),
        np.empty(0),
    ):
        assert level_step(values) == 0.0


@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_each_component_has_its_own_step(seed: int) -> None:
    """Millimetres, 1/64, and no step beside each other; a constant component takes the coarsest."""
    columns = [values_of(seed + i, 10.0) for i in range(3)]
    values = np.stack([np.round(columns[0], 3), np.rint(64 * columns[1]) / 64, columns[2], np.ones(1000)], axis=1)
    found = stored_step(values)
    assert [found.component(i).size for i in range(4)] == pytest.approx([1e-3, 1 / 64, 0.0, 1 / 64])
    assert found.size == 1 / 64


@pytest.mark.parametrize("step", [1 / 128, 1 / 64, 1 / 4])
def test_a_binary_step_is_found_among_float16_numbers(step: float) -> None:
    """Multiples of 1/128 below 8 are float16 numbers too; float16 numbers themselves have no step."""
    values = np.random.default_rng(9).uniform(0.4, 11.3, 3000)
    found = stored_step(step * np.rint(values / step))
    assert found.size == step
    assert stored_step(values.astype(np.float16)).size == 0.0


ROWS, COLUMNS = np.mgrid[:120, :160].astype(np.float64)


def plane_m(slope_across: float = 1e-4, slope_down: float = 2.5e-3, far_m: float = 25.0) -> NDArray[np.float64]:
    """A plane: its inverse depth is affine in the pixel."""
    return 1.0 / (1.0 / far_m + slope_across * COLUMNS + slope_down * ROWS)


def ball_m() -> NDArray[np.float64]:
    """The near half of a ball of 2 m radius, 6 m away, that fills the view."""
    return 6.0 - np.sqrt(4.0 - ((COLUMNS - 80) / 60) ** 2 - ((ROWS - 60) / 60) ** 2)


SMOOTH = {
    "plane": plane_m(),
    "plane without roll": plane_m(slope_across=0.0),
    "plane across": plane_m(slope_down=0.0),
    "wall": np.full((120, 160), 5.0),
    "ball": ball_m(),
    "noise": np.random.default_rng(1).uniform(0.5, 20.0, (120, 160)),
    "nothing valid": np.full((120, 160), np.nan),
    "one row": plane_m()[:1],
}


@pytest.mark.parametrize("depths_m", SMOOTH.values(), ids=SMOOTH)
def test_float32_has_no_step(depths_m: NDArray[np.float64]) -> None:
    """Depths as fine as float32 have no step, however regular the surface."""
    assert depth_step(depths_m.astype(np.float32)) is None


@settings(max_examples=100, deadline=None)
@given(st.floats(1e-3, 2e-2), st.floats(-3e-4, 3e-4), st.floats(1e-4, 4e-4))
def test_steps_of_depth_are_measured(step_m: float, across: float, down: float) -> None:
    """Depths rounded to any step show it to a percent, where the surface bends by less."""
    depths_m = plane_m(across, down, far_m=4.0)
    found = depth_step(np.rint(depths_m / step_m) * step_m)
    assert found is not None
    assert found.size_m == pytest.approx(step_m, rel=0.01)


@pytest.mark.parametrize("bits", [12, 16])
def test_steps_of_inverse_depth_are_measured(bits: int) -> None:
    """A z-buffer's equal steps of 1/z are the largest share of the depth where that is largest."""
    step_per_m = 2.0**-bits
    depths_m = 1.0 / (np.rint(1.0 / plane_m() / step_per_m) * step_per_m)
    found = depth_step(depths_m)
    assert found is not None
    assert found.relative == pytest.approx(step_per_m * found.depth_m, rel=0.01)
    assert found.depth_m == pytest.approx(depths_m.max(), rel=0.05)


def test_half_floats_are_found() -> None:
    """Half floats have ten bits of mantissa: a step of 2^-10 at the near end of an octave."""
    found = depth_step(plane_m().astype(np.float16))
    assert found is not None
    assert found.relative == pytest.approx(2.0**-10, rel=0.25)


def test_steps_on_a_curved_surface_are_found() -> None:
    """Millimetres show on a ball too, whose own second differences are smooth."""
    found = depth_step(np.rint(1000 * ball_m()) / 1000)
    assert found is not None
    assert found.size_m == pytest.approx(1e-3, rel=0.01)


@pytest.mark.parametrize("invalid_m", [0.0, -1.0, np.nan])
def test_invalid_depths_leave_the_step(invalid_m: float) -> None:
    """Neither their values nor the edges around them are steps."""
    depths_m = np.rint(1000 * plane_m()) / 1000
    depths_m[::7, ::5] = invalid_m
    step = depth_step(depths_m)
    assert step is not None
    assert step.size_m == pytest.approx(1e-3, rel=0.01)
