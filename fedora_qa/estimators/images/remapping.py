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
    """Return an image at positions between its pixels.

    Parameters
    ----------
    image
        (H, W).
    columns, rows
        (n, m) positions, of any n, and m below 32767.
    interpolation, border
        Flags of OpenCV: how values between pixels, and beyond the image, are made.

    Returns
    -------
    (n, m).
    """
    if not columns.size:
        return cast(Image, np.empty(columns.shape, image.dtype))
    parts = (slice(first, first + _MOST_ROWS) for first in range(0, len(columns), _MOST_ROWS))
    values = [cv2.remap(image, columns[part], rows[part], interpolation, borderMode=border) for part in parts]
    return cast(Image, values[0] if len(values) == 1 else np.concatenate(values))
