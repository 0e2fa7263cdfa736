"""Digests tell images apart: by any byte, any order of their words, and their shape."""

import numpy as np
import pytest

from fedora_qa.estimators.images.values import DIGEST_BYTES, digest_of

RNG = np.random.default_rng(0)
IMAGE = RNG.integers(0, 256, (45, 67, 3)).astype(np.uint8)


def test_equal_images_have_equal_digests() -> None:
    """Wherever in memory they lie, writable or not, contiguous or cut out."""
    wide = np.zeros((45, 90, 3), np.uint8)
    wide[:, 5:72] = IMAGE
    shifted = np.zeros(IMAGE.size + 3, np.uint8)[3:].reshape(IMAGE.shape)
    shifted[:] = IMAGE
    assert len(digest_of(IMAGE)) == DIGEST_BYTES
    for same in (IMAGE.copy(), wide[:, 5:72], shifted):
        np.testing.assert_array_equal(digest_of(same), digest_of(IMAGE))


def test_every_byte_counts() -> None:
    """One bit of a code, anywhere, the rest that fills no eight words among it."""
    digests = {digest_of(IMAGE).tobytes()}
    for place in range(0, IMAGE.size, 7):
        changed = IMAGE.copy()
        changed.flat[place] ^= 1
        digests.add(digest_of(changed).tobytes())
    assert len(digests) == len(range(0, IMAGE.size, 7)) + 1


@pytest.mark.parametrize("shape", [(16, 16, 3), (8, 32, 3), (32, 24, 1)])
def test_order_and_shape_count(shape: tuple[int, int, int]) -> None:
    """Rows that changed places, and the same bytes in another shape, are another image."""
    image = IMAGE.reshape(-1)[:768].reshape(shape)
    others = (image[::-1], image[:, ::-1], np.roll(image, 1, 0), image.reshape(shape[1], shape[0], shape[2]))
    different = [one for one in others if one.shape != shape or not np.array_equal(one, image)]
    assert len({digest_of(one).tobytes() for one in (image, *different)}) == len(different) + 1


def test_images_of_one_value_and_none() -> None:
    """Nothing to fold gives a digest, and so does black."""
    black, white = np.zeros((40, 40, 3), np.uint8), np.full((40, 40, 3), 255, np.uint8)
    empty = np.zeros((0, 0, 3), np.uint8)
    assert len({digest_of(one).tobytes() for one in (black, white, empty)}) == 3
