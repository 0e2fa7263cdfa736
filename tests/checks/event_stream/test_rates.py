"""Hot pixels that lie where declared ones would be moved to tell what moved the events."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.checks.event_stream.rates import Pixel, moved_hot_pixels

SIZE = 120, 89
DECLARED = ((78, 4), (91, 61), (13, 40), (55, 72), (30, 11))


def moved(move: Callable[[int, int], Pixel]) -> list[Pixel]:
    return [move(column, row) for column, row in DECLARED]


@pytest.mark.parametrize(
    ("hot", "transform", "right_px"),
    [
        pytest.param(moved(lambda x, y: (119 - x, y)), "mirrored", None, id="mirrored"),
        pytest.param(moved(lambda x, y: (119 - x, 88 - y)), "mirrored", None, id="turned by half"),
        pytest.param(moved(lambda x, y: (y, x)), "transposed", None, id="axes"),
        pytest.param(moved(lambda x, y: (x + 3, y)), "shifted", 3.0, id="shifted"),
        pytest.param(moved(lambda x, y: (x - 2, y + 5))[:2], "shifted", None, id="shifted both ways, two seen"),
        pytest.param([*moved(lambda x, y: (119 - x, y))[:3], (1, 1)], "mirrored", None, id="and one new"),
    ],
)
def test_what_moved_the_declared_pixels_is_named(hot: list[Pixel], transform: str, right_px: float | None) -> None:
    """Each move is named from the pixels alone, a shift with its size, even if some pixels are hot besides."""
    move = moved_hot_pixels(hot, DECLARED, SIZE)
    assert move is not None
    assert (move.transform, move.right_px) == (transform, right_px)


@given(st.sets(st.tuples(st.integers(0, 119), st.integers(0, 88)), max_size=1))
def test_a_single_new_pixel_is_no_shift(hot: set[Pixel]) -> None:
    """One pixel lies beside some declared one wherever it is: it is only named where it is a mirror image."""
    move = moved_hot_pixels(sorted(hot), DECLARED, SIZE)
    assert move is None or move.transform != "shifted"


def test_without_declared_pixels_nothing_was_moved() -> None:
    """Pixels that are hot where none is declared are new."""
    assert moved_hot_pixels([(4, 5), (70, 3)], (), SIZE) is None
    assert moved_hot_pixels([], DECLARED, SIZE) is None


def test_new_pixels_are_not_taken_for_moved_ones() -> None:
    """Pixels elsewhere, more of them than agree with any move, are new."""
    assert moved_hot_pixels([(2, 3), (50, 50), (100, 7)], DECLARED, SIZE) is None
