"""Arrays that windows share are made once while neighbouring windows need them, within a limit of bytes."""

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.sequence.window import Leases, Sampling, Span, Window
from tests.support.flow_world import make_world

IMAGE_BYTES = 800


class Maker:
    """Makes images, asks leases for them, and remembers which were made."""

    def __init__(self, leases: Leases) -> None:
        self.leases = leases
        self.made: list[int] = []

    def get(self, number: int) -> NDArray[Any]:
        def make() -> NDArray[Any]:
            self.made.append(number)
            return np.full(IMAGE_BYTES // 8, float(number))

        return self.leases.get(("image", number), make)

    def window(self, *numbers: int) -> None:
        """Begin a window, and request images in it."""
        self.leases.begin_window()
        for number in numbers:
            self.get(number)


@given(st.lists(st.lists(st.integers(0, 9), max_size=20), max_size=8), st.integers(0, 12))
def test_results_do_not_depend_on_the_limit(windows: list[list[int]], images: int) -> None:
    """Whatever is requested in whatever order, it is the right image, and no more is kept than the limit allows."""
    maker = Maker(Leases(images * IMAGE_BYTES))
    for wanted in windows:
        maker.leases.begin_window()
        for number in wanted:
            assert (maker.get(number) == number).all()
            assert maker.leases.kept_bytes <= images * IMAGE_BYTES


@given(st.lists(st.sets(st.integers(0, 9)), max_size=8))
def test_what_neighbouring_windows_request_is_made_once(windows: list[set[int]]) -> None:
    """An image is made again only where a whole window has passed that did not request it."""
    maker, before = Maker(Leases()), set[int]()
    for wanted in windows:
        made = len(maker.made)
        maker.window(*sorted(wanted), *sorted(wanted))
        assert set(maker.made[made:]) == wanted - before
        assert len(maker.made) - made == len(wanted - before)
        before = wanted
        assert maker.leases.kept_bytes >= len(wanted) * IMAGE_BYTES


def test_what_lies_ahead_is_kept_for_its_window() -> None:
    """An image of a later window is leased until that window; one behind it is not."""
    leases = Leases()
    maker = Maker(leases)
    for window in range(5):
        leases.begin_window(lambda key, first=window: isinstance(key, tuple) and key[1] >= first)
        if window in (0, 3):
            maker.get(0)
            maker.get(3)
    # Image 0 lay behind, and was made again; image 3 was not.
    assert maker.made == [0, 3, 0]
    leases.begin_window()
    leases.begin_window()
    assert leases.kept_bytes == 0


def test_what_lies_ahead_gives_way_where_bytes_are_short() -> None:
    """An image of a later window ends before those that this window requests."""
    maker = Maker(Leases(2 * IMAGE_BYTES))
    for wanted in ((9, 1), (2, 3), (3, 9)):
        maker.leases.begin_window(lambda key: isinstance(key, tuple) and key[1] == 9)
        for number in wanted:
            maker.get(number)
    assert maker.made == [9, 1, 2, 3, 9]


def test_leases_of_the_window_before_end_first() -> None:
    """Where not all fits, this window's images stay, and those that it has not requested yet give way."""
    maker = Maker(Leases(3 * IMAGE_BYTES))
    maker.window(1, 2, 3)
    maker.window(3, 4, 3, 4)
    assert maker.made == [1, 2, 3, 4]
    maker.window(2, 3, 4)
    assert maker.made == [1, 2, 3, 4, 2]


def test_what_does_not_fit_is_made_again() -> None:
    """A limit that holds two images keeps these two, and beside them the latest of the others in this window."""
    maker = Maker(Leases(2 * IMAGE_BYTES))
    maker.window(1, 2, 3, 1, 2, 3)
    assert maker.made == [1, 2, 3]
    maker.window(1, 2, 3, 3, 4, 3)
    assert maker.made == [1, 2, 3, 3, 4, 3]


def test_an_error_is_leased_like_an_image() -> None:
    """Rows that cannot be decoded are tried once while windows ask for them."""
    leases, tried = Leases(), list[int]()

    def fail() -> UnreadableRowsError:
        tried.append(1)
        return UnreadableRowsError("path/depth", 0, 1, "damaged")

    assert leases.get(1, fail) is leases.get(1, fail)
    assert tried == [1]


def test_all_is_forgotten() -> None:
    """After that nothing is kept."""
    maker = Maker(Leases())
    maker.window(1, 2)
    maker.leases.forget()
    assert maker.leases.kept_bytes == 0
    maker.get(1)
    assert maker.made == [1, 2, 1]


def test_neighbouring_windows_share_the_image_between_them() -> None:
    """Depth in metres that one window looked at beyond its end is not computed again by the next."""
    world = make_world(())
    shared = Leases()
    first, second = (
        Window(Span(i, 0, 1, {"depth": (10 * i, 10 * i + 10)}), world.facts, world, Sampling(), shared) for i in (0, 1)
    )
    assert first.depth_m(10) is second.depth_m(10)
    alone = Window(second.span, world.facts, world, Sampling())
    assert alone.depth_m(10) is not second.depth_m(10)
    np.testing.assert_array_equal(alone.depth_m(10), second.depth_m(10))


def test_a_window_keeps_its_latest_two_depths_where_nothing_else_fits() -> None:
    """Depth at both ends of an interval is made once, however often it is asked for by turns; a third one drops one."""
    world = make_world(())
    window = Window(Span(0, 0, 1, {"depth": (0, 10)}), world.facts, world, Sampling(), Leases(0))
    before, after = window.depth_m(3), window.depth_m(4)
    assert window.depth_m(3) is before
    assert window.depth_m(4) is after
    window.depth_m(5)
    assert window.depth_m(4) is after
    assert window.depth_m(3) is not before
    np.testing.assert_array_equal(window.depth_m(3), before)
