"""What inverse transforms resolve, net, in rectangles of tiles."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.views.conservation_trials import most_resolved
from fedora_qa.views.sensor_events import GRID


@given(st.integers(0, 2**32 - 1))
def test_a_repair_that_only_moves_what_is_broken_mends_nothing(seed: int) -> None:
    """Pixels that are broken on the other side instead are none the better for it, whichever way they were mirrored."""
    before = np.random.default_rng(seed).random((4 * GRID, 6 * GRID)) < 0.3
    for left, up in ((True, False), (False, True), (True, True)):
        after = before[:: -1 if up else 1, :: -1 if left else 1]
        assert most_resolved(before, after, (False, left, up)) == 0


def test_a_repair_of_a_region_counts_what_it_mends_there() -> None:
    """What is broken elsewhere by undoing the fault of a tile does not count against it."""
    before, after = np.zeros((2, 4 * GRID, 4 * GRID), np.bool_)
    before[4:8, 8:12] = True
    after[12:, :] = True
    assert most_resolved(before, after) == 16
