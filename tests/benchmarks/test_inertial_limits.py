"""The table of inertial limits shows what the checks state, and its errors hold."""

import numpy as np
import pytest

from tests.benchmarks.inertial_limits import FAST, POSES, QUANTITIES, REACHED, SLOW, limits_of, spreads_of
from tests.support.motion_world import NOISY


def test_every_quantity_has_a_row_and_both_kinds_of_poses_a_figure_to_reach() -> None:
    """Rows and columns are those of the test bed."""
    assert QUANTITIES.keys() == REACHED.keys()
    assert {len(reached) for reached in REACHED.values()} == {len(POSES)}


def test_a_fast_flight_shows_more_than_a_slow_one() -> None:
    """Each limit is a finite number, and the more the body moves the smaller it is."""
    fast, slow = (limits_of(flight, NOISY, duration_s=4.0) for flight in (FAST, SLOW))
    assert all(0 < fast[quantity] < slow[quantity] < 1e6 for quantity in QUANTITIES)


def test_errors_are_neither_too_small_nor_too_large() -> None:
    """Values scatter by their standard errors: all together within 15%, each within what ten files leave to chance."""
    spreads = np.array(list(spreads_of(NOISY, draws=5, duration_s=4.0).values()))
    assert np.sqrt(np.mean(spreads**2)) == pytest.approx(1.0, abs=0.15)
    assert np.all((spreads > 0.4) & (spreads < 1.6))
