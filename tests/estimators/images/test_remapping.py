"""Images are read at any number of positions."""

import cv2
import numpy as np
import pytest

from fedora_qa.estimators.images.remapping import read_at


@pytest.mark.parametrize("count", [1, 32_766, 32_767, 70_001])
def test_rows_beyond_what_opencv_takes_are_read_alike(count: int) -> None:
    """A linear image read between pixels is its own value, in the first row of positions and in the last."""
    image = np.add.outer(2.0 * np.arange(40), np.arange(50)).astype(np.float32)
    columns = np.linspace(0, 49, 3 * count, dtype=np.float32).reshape(count, 3)
    rows = np.full_like(columns, 7.5)
    read = read_at(image, columns, rows, cv2.INTER_LINEAR)
    assert read.shape == columns.shape
    assert read == pytest.approx(15.0 + columns, abs=0.05)


def test_no_positions_give_nothing() -> None:
    """Without positions nothing is read, in the image's own type."""
    nowhere = np.zeros((0, 4), np.float32)
    read = read_at(np.zeros((5, 5), np.uint8), nowhere, nowhere, cv2.INTER_NEAREST)
    assert (read.shape, read.dtype) == ((0, 4), np.uint8)
