"""Which rows of large frames are looked at."""

import numpy as np
import pytest

from fedora_qa.views.frames import bands, near


@pytest.mark.parametrize("share", [0.25, 0.6])
@pytest.mark.parametrize("height", [480, 101])
def test_bands_are_a_share_that_moves(height: int, share: float) -> None:
    """Each field is looked at in its share of the rows, alike upside down, and 40 fields together in all rows."""
    fields = np.array([bands(height, share, number) for number in range(40)])
    assert np.allclose(fields.mean(axis=1), share, atol=6 / height)
    assert np.array_equal(fields, fields[:, ::-1])
    assert fields.any(axis=0).all()


def test_all_rows_are_all_rows() -> None:
    """A share of one leaves nothing out."""
    assert bands(33, 1.0, 7).all()


@pytest.mark.parametrize("reach", [0, 1, 12])
def test_rows_near_others(reach: int) -> None:
    """By definition, also at the border."""
    rows = bands(60, 0.2, 3)
    places = np.flatnonzero(rows)
    expected = [np.abs(places - row).min() <= reach for row in range(60)]
    np.testing.assert_array_equal(near(rows, reach), expected)
