"""Hot pixels that lie where declared ones would be moved to tell what moved the events."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.checks.event_stream.moved_hot_pixels import Pixel, suspects_of_moved

SIZE = 120, 89
DECLARED = ((78, 4), (91, 61), (13, 40), (55, 72), (30, 11))


def moved(move: Callable[[int, int], Pixel]) -> list[Pixel]:
    return [move(column, row) for column, row in DECLARED]


@pytest.mark.parametrize(
    ("found", "cause", "size"),
    [
        pytest.param(moved(lambda x, y: (119 - x, y)), "mirrored", None, id="mirrored"),
        pytest.param(moved(lambda x, y: (119 - x, 88 - y)), "mirrored", None, id="turned by half"),
        pytest.param(moved(lambda x, y: (y, x)), "axes_swapped", None, id="axes"),
        pytest.param(moved(lambda x, y: (x + 3, y)), "spatial_offset", 3.0, id="shifted"),
        pytest.param(moved(lambda x, y: (x - 2, y + 5))[:2], "spatial_offset", None, id="shifted both ways, two seen"),
        pytest.param([*moved(lambda x, y: (119 - x, y))[:3], (1, 1)], "mirrored", None, id="and one new"),
    ],
)
def test_what_moved_the_declared_pixels_is_named(found: list[Pixel], cause: str, size: float | None) -> None:
    """Each move is named from the pixels alone, a shift with its size, even if some pixels are hot besides."""
    (suspect,) = suspects_of_moved(found, DECLARED, SIZE)
    assert (suspect.cause, suspect.stream, suspect.magnitude) == (cause, "events", size)


@given(st.sets(st.tuples(st.integers(0, 119), st.integers(0, 88)), max_size=1))
def test_a_single_new_pixel_is_no_shift(found: set[Pixel]) -> None:
    """One pixel lies beside some declared one wherever it is: it is only named where it is a mirror image."""
    assert all(one.cause != "spatial_offset" for one in suspects_of_moved(sorted(found), DECLARED, SIZE))


def test_without_declared_pixels_nothing_was_moved() -> None:
    """Pixels that are hot where none is declared are new."""
    assert suspects_of_moved([(4, 5), (70, 3)], (), SIZE) == ()
    assert suspects_of_moved([], DECLARED, SIZE) == ()


def test_new_pixels_are_not_taken_for_moved_ones() -> None:
    """Pixels elsewhere, more of them than agree with any move, are new."""
    assert suspects_of_moved([(2, 3), (50, 50), (100, 7)], DECLARED, SIZE) == ()
