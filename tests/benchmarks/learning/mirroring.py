"""The augmentation: samples mirrored left to right, which a drive or flight through a mirrored world would give."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

MIRRORED_MOTION: Final[NDArray[np.float32]] = np.array([1, -1, 1, -1, 1, -1], np.float32)
"""In the body (X forward, Y left, Z up) translation changes its sign along Y, and rotation about X and Z."""

MIRRORED_FLOW: Final[NDArray[np.float32]] = np.array([-1, 1], np.float32)
"""u changes its sign."""
