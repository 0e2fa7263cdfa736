"""How far an image moves from one frame to the next, by corners that are tracked."""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

CORNERS: Final = 500
FEWEST_CORNERS: Final = 10
"""Corners of which a tenth can be stated."""

FARTHEST_SHARE: Final = 0.1
"""Share of the corners that move at least as far as stated: more than are tracked to a wrong place."""

RETURN_PX: Final = 0.1
"""Largest distance, px, at which a corner ends that is tracked to the next image and back."""

_WINDOW: Final = (15, 15)
"""Columns and rows around a corner that are compared, px; with three halvings of the image they reach 60 px."""

_WHITE_DN: Final = 255.0


def tracked_motion_px(light_dn: NDArray[np.float32]) -> float:
    """Return a distance that the image moves at least, somewhere, from one frame to the next.

    A tenth of the corners (J. Shi, C. Tomasi, "Good features to track", CVPR 1994) move as far, by the tracker of Lucas
    and Kanade on a pyramid (J.-Y. Bouguet, 2000). Corners that are not tracked back to their place are left out
    (forward-backward error: Z. Kalal, K. Mikolajczyk, J. Matas, ICPR 2010).

    Parameters
    ----------
    light_dn
        (2, h, w) light of both frames, linear DN.

    Returns
    -------
    float
        In px, less the error of a track; 0 where too few corners are tracked.
    """
    # The tracker takes 8 bits: the root spreads dark values, of which linear bits have few.
    codes = np.clip(light_dn, 0, _WHITE_DN)
    codes *= _WHITE_DN
    before, after = np.rint(np.sqrt(codes, out=codes), out=codes).astype(np.uint8)
    corners = cv2.goodFeaturesToTrack(before, CORNERS, 0.01, 5)
    if corners is None:
        return 0.0
    # The fourth argument only receives the result.
    ahead, is_ahead, _ = cv2.calcOpticalFlowPyrLK(before, after, corners, corners.copy(), winSize=_WINDOW, maxLevel=3)
    back, is_back, _ = cv2.calcOpticalFlowPyrLK(after, before, ahead, ahead.copy(), winSize=_WINDOW, maxLevel=3)
    steps, returns = (ahead - corners)[:, 0], (back - corners)[:, 0]
    tracked = (is_ahead[:, 0] == 1) & (is_back[:, 0] == 1) & (np.hypot(*returns.T) <= RETURN_PX)
    if np.count_nonzero(tracked) < FEWEST_CORNERS:
        return 0.0
    farthest_px = float(np.quantile(np.hypot(*steps[tracked].T), 1 - FARTHEST_SHARE))
    return max(farthest_px - RETURN_PX, 0.0)
