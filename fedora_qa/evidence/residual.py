"""What the flow does not explain: how a frame, carried back by the flow, differs from the one before it."""

from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import LUMA_WEIGHTS_RGB

Float32 = NDArray[np.float32]

_WEIGHTS: Final = np.array(LUMA_WEIGHTS_RGB, dtype=np.float32)
_OUTSIDE: Final = -10.0
"""A place that lies in no picture, for pixels whose flow is unknown."""


def carried_back_dn(
    earlier: NDArray[Any], later: NDArray[Any], flow_px: NDArray[Any], block: int
) -> NDArray[np.float16]:
    """Return the luma of ``later``, looked up where the flow leads, minus the luma of ``earlier``, DN.

    For a picture, not for a measurement: pixels that are covered or uncovered meanwhile, and the averaging over blocks,
    leave something too.

    Parameters
    ----------
    earlier, later
        (h, w, 3) codes of the frames at both ends of the flow's interval, averaged over blocks of pixels.
    flow_px
        (h, w, 2), u right and v down, px of the stored image; NaN where unknown.
    block
        Px of the stored image that one px of these pictures stands for, in each direction.

    Returns
    -------
    (h, w); NaN where the flow is unknown or leads out of the picture.
    """
    before, after = ((image.astype(np.float32) @ _WEIGHTS).astype(np.float32) for image in (earlier, later))
    rows, columns = np.indices(before.shape, dtype=np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        x, y = columns + flow_px[..., 0] / block, rows + flow_px[..., 1] / block
    height, width = before.shape
    within = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)  # False for NaN
    to_column, to_row = (np.where(within, place, _OUTSIDE).astype(np.float32) for place in (x, y))
    found = cv2.remap(after, to_column, to_row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.where(within, found - before, np.nan).astype(np.float16)
