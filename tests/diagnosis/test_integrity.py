"""Hypotheses for values that are out of range: codes of invalid pixels, or another unit."""

import pytest

from fedora_qa.checks.integrity.finite import OutOfRange
from fedora_qa.diagnosis.hypothesis import Hypothesis
from tests.support.proposals import proposed


@pytest.mark.parametrize(("in_metres", "factor"), [(80, 1e-3), (20, None)])
def test_scattered_values_are_in_metres_only_where_most_of_them_fall_into_the_range(
    in_metres: int, factor: float | None
) -> None:
    """Values out of range of which few fall into it in metres have another factor, which other checks measure."""
    values = OutOfRange(finite=1000, outside=100, in_range_times_1000=in_metres, constant=False)
    assert proposed("integrity.finite.outside_range", values, stream="depth") == (
        Hypothesis("invalid_encoding", "depth", 0.5),
        Hypothesis("unit_mm_m", "depth", 0.3, factor, "" if factor is None else "1"),
    )
