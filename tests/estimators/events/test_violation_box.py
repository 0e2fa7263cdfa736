"""A part of the sensor that violates the law is told from pixels all over it."""

import numpy as np
import pytest

from fedora_qa.estimators.events.violation_box import share_in_box, with_neighbours

SHAPE = 80, 120
EVEN = np.ones((4, 4))


def test_pixels_of_a_part_lie_in_its_box() -> None:
    """Of changes that are alike everywhere the share is that of the area."""
    pixels = np.zeros(SHAPE, np.bool_)
    pixels[:40:3, 90::2] = True
    assert share_in_box(EVEN, pixels) == pytest.approx(40 * 30 / (80 * 120), rel=0.1)


def test_changes_of_the_part_alone_lie_in_its_box() -> None:
    """Where nothing changes elsewhere, violations lie there whatever they come from."""
    pixels = np.zeros(SHAPE, np.bool_)
    pixels[:20:2, 90::2] = True
    changes = np.zeros((4, 4))
    changes[0, 3] = 1.0
    assert share_in_box(changes, pixels) > 0.9
    assert share_in_box(np.zeros((4, 4)), pixels) == 1.0


def test_lone_pixels_of_noise_do_not_widen_the_box() -> None:
    """Two in a thousand pixels, at random, are disturbed by noise besides."""
    pixels = np.random.default_rng(2).random(SHAPE) < 0.002
    assert share_in_box(EVEN, pixels) > 0.5
    pixels[:20, 100:] = True
    assert share_in_box(EVEN, with_neighbours(pixels)) < 0.1


@pytest.mark.parametrize("count", [0, 7])
def test_few_pixels_have_no_box(count: int) -> None:
    pixels = np.zeros(SHAPE, np.bool_)
    pixels[5, :count] = True
    assert share_in_box(EVEN, pixels) == 1.0
