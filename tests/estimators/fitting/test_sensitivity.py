"""The range of detection limits of a value that is the worst of several."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.estimators.fitting.robust import DETECTION_SIGMAS, sensitivity_range

SIZES = st.floats(0.0, 1e3)


@given(st.lists(st.tuples(SIZES, SIZES), min_size=1))
def test_no_place_lies_outside_the_range(pairs: list[tuple[float, float]]) -> None:
    """Both ends are places that were compared, and every limit lies between theirs."""
    errors, bounds = np.array(pairs).T
    found = sensitivity_range(errors, bounds)
    assert found is not None
    limits = [2 * bound + DETECTION_SIGMAS * error for error, bound in pairs]
    ends = [2 * bound + DETECTION_SIGMAS * error for error, bound in found]
    assert ends == [min(limits), max(limits)]
    assert set(found) <= set(pairs)


def test_places_that_measured_nothing_are_left_out() -> None:
    """Errors that are not finite state no limit; without any place there is no range."""
    assert sensitivity_range([np.nan, 2.0, np.inf], 0.5) == ((2.0, 0.5), (2.0, 0.5))
    assert sensitivity_range([np.nan], 0.0) is None
    assert sensitivity_range([[1.0, 3.0]], [[0.1], [0.2]]) == ((1.0, 0.1), (3.0, 0.2))
