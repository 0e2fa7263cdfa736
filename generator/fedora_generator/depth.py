"""What a depth camera keeps of the exact depth: its range, in millimetres."""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M

Floats = NDArray[np.float64]


def in_range(inverse_depth_per_m: Floats, depth_range_m: tuple[float, float]) -> Floats:
    """Inverse depth with NaN where the z-depth is nearer or farther than the range; both ends belong to it.

    It is what will be stored that must lie in the range, so that rounding makes no holes in a wall at its very end.
    """
    stored_mm = depth_mm(inverse_depth_per_m)
    near_mm, far_mm = (np.float32(MM_PER_M * end_m) for end_m in depth_range_m)
    return np.where((stored_mm >= near_mm) & (stored_mm <= far_mm), inverse_depth_per_m, np.nan)


def depth_mm(inverse_depth_per_m: Floats) -> NDArray[np.float32]:
    """Z-depth in millimetres as the file stores it; NaN stays NaN, and the sky (0) is infinitely far."""
    with np.errstate(divide="ignore", over="ignore"):
        return (MM_PER_M / inverse_depth_per_m).astype(np.float32)
