"""Images read at any number of positions: OpenCV takes fewer than 32767 rows of them at once."""

from typing import Any, Final, TypeVar, cast

import cv2
import numpy as np
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Image = TypeVar("Image", bound=NDArray[Any])

_MOST_ROWS: Final = 32_766
"""Below SHRT_MAX, which ``cv2.remap`` refuses. All tiles of a frame of 1440x1080 have 48,960 rows of pixels."""


def read_at(
    image: Image, columns: Float32, rows: Float32, interpolation: int, border: int = cv2.BORDER_CONSTANT
) -> Image:
    """Return an image (H, W) at positions (n, m), of any n, and m below 32767; ``border`` says what lies beyond."""
    if not columns.size:
        return cast(Image, np.empty(columns.shape, image.dtype))
    parts = (slice(first, first + _MOST_ROWS) for first in range(0, len(columns), _MOST_ROWS))
    read = [cv2.remap(image, columns[part], rows[part], interpolation, borderMode=border) for part in parts]
    return cast(Image, read[0] if len(read) == 1 else np.concatenate(read))
