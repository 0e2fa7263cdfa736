"""What is computed of single images is computed once while it is kept, within a limit of bytes."""

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.sequence.shared_images import SharedImages
from fedora_qa.sequence.window import Sampling, Span, Window
from tests.support.flow_world import make_world

IMAGE_BYTES = 800


class Maker:
    """Makes images and remembers which."""

    def __init__(self) -> None:
        self.made: list[int] = []

    def image(self, number: int) -> NDArray[Any]:
        self.made.append(number)
        return np.full(IMAGE_BYTES // 8, float(number))


@given(st.lists(st.integers(0, 9), max_size=60), st.integers(1, 12))
def test_results_do_not_depend_on_the_limit(wanted: list[int], images: int) -> None:
    """Whatever is asked for in whatever order, the image is the right one; one still kept is not made again."""
    shared, maker = SharedImages(images * IMAGE_BYTES), Maker()
    recent: list[int] = []
    for number in wanted:
        before = len(maker.made)
        assert (shared.get(("image", number), lambda number=number: maker.image(number)) == number).all()  # type: ignore[misc]
        assert (len(maker.made) > before) == (number not in recent)
        recent = [*(one for one in recent if one != number), number][-images:]


def test_an_image_larger_than_the_limit_is_kept_alone() -> None:
    """A limit that holds nothing still shares the latest image."""
    shared, maker = SharedImages(1), Maker()
    for number in (1, 1, 2, 2, 1):
        shared.get(number, lambda number=number: maker.image(number))  # type: ignore[misc]
    assert maker.made == [1, 2, 1]


def test_what_is_made_in_a_moment_goes_first() -> None:
    """Where not all fits, what takes long to make stays, though it was not asked for as lately."""
    shared, maker = SharedImages(2 * IMAGE_BYTES), Maker()
    for number in (1, 2, 3, 1, 2):
        shared.get(number, lambda number=number: maker.image(number), in_a_moment=number > 1)  # type: ignore[misc]
    assert maker.made == [1, 2, 3, 2]


def test_little_results_outlast_images_and_stay_within_their_share() -> None:
    """A digest is kept while images come and go; of very many the longest unused are dropped."""
    shared, made = SharedImages(4 * IMAGE_BYTES), list[int]()

    def little(number: int) -> NDArray[Any]:
        made.append(number)
        return np.array([number], np.int64)

    shared.get("digest", lambda: little(0))
    for number in range(20):
        shared.get(("image", number), lambda number=number: Maker().image(number))  # type: ignore[misc]
    assert shared.get("digest", lambda: little(0)) == 0
    assert made == [0]
    for number in range(1, 4 * IMAGE_BYTES // 8 // 2 + 1):
        shared.get(("digest", number), lambda number=number: little(number))  # type: ignore[misc]
    shared.get("digest", lambda: little(-1))
    assert made[-1] == -1


def test_neighbouring_windows_share_the_image_between_them() -> None:
    """Depth in metres that one window looked at beyond its end is not computed again by the next."""
    world = make_world(())
    shared = SharedImages()
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
    window = Window(Span(0, 0, 1, {"depth": (0, 10)}), world.facts, world, Sampling(), SharedImages(1))
    before, after = window.depth_m(3), window.depth_m(4)
    assert window.depth_m(3) is before
    assert window.depth_m(4) is after
    window.depth_m(5)
    assert window.depth_m(4) is after
    assert window.depth_m(3) is not before
    np.testing.assert_array_equal(window.depth_m(3), before)
