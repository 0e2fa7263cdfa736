"""What a depth camera keeps of the exact depth: its range, in millimetres."""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M

Floats = NDArray[np.float64]


def in_range(inverse_depth_per_m: Floats, depth_range_m: tuple[float, float]) -> Floats:
    """Inverse depth with NaN where the z-depth is nearer or farther than the range (both ends belong to it)."""
    near_m, far_m = depth_range_m
    valid = (inverse_depth_per_m >= 1 / far_m) & (inverse_depth_per_m <= 1 / near_m)
    return np.where(valid, inverse_depth_per_m, np.nan)


def depth_mm(valid_inverse_depth_per_m: Floats) -> NDArray[np.float32]:
    """Z-depth in millimetres as the file stores it; NaN stays NaN."""
    return (MM_PER_M / valid_inverse_depth_per_m).astype(np.float32)
