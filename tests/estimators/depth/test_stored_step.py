"""Steps of stored depths are found, measured, and not mistaken for the regularity of planes and balls."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.estimators.storage.steps import depth_step

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
