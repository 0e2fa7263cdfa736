"""Which pixels show the same surface point in both frames, from depth and the camera's motion: never from the flow.

The inverse depth of a plane is affine in the pixel, so its Laplacian vanishes on every plane and marks edges, and
bilinear interpolation of it is exact. Near an edge a pixel mixes two surfaces that move apart; edges are widened by the
reach of the kernel that the frames are smoothed with.
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.mask_kernels import inverse_of, mark_edges, seen_again, spread_at_targets
from fedora_qa.estimators.flow.visibility_kernels import seen_in_parts
from fedora_qa.geometry.camera import RigidMotion

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

EDGE: Final = 0.01
"""Relative Laplacian of inverse depth that makes an edge, and relative mismatch of it that makes an occlusion.

At such a step the flow of two neighbouring surfaces differs by 1% of their parallax: by 0.1 px where that is 10 px.
"""

_LONGEST_FOOTPRINT: Final = 8.0
"""Length over width of a pixel's footprint up to which texture is known to be smoothed over all of it.

P. S. Heckbert, Fundamentals of Texture Mapping and Image Warping (1989), derives the footprint; engines end their
anisotropic filtering between 4 and 16. Beyond it distant ground shows aliases, which do not follow the flow.
"""

BREAK_PX: Final = 0.1
"""Second difference of a flow that makes a break: across lesser ones the mixing of two surfaces errs by less."""

_CROWDED_PX: Final = 0.25
"""Spread of the flows that lead to one pixel from which on they must belong to different surfaces."""

_WIDENED_PX: Final = 9
"""Edges are widened by 4 px on either side, where a mixed pixel is seen with less than 1e-4 of its contrast.

At 3 px it is 1e-3, which beside a bright edge moved tiles of little texture by up to 0.1 px. Widened alike, the border
pixels are five deep, the reach of Gaussian and spline together: nearer to the border frames are extrapolated.
"""


def inverse_depth(depth_m: Float32) -> Float32:
    """Return 1 / depth (H, W), 0 where depth is invalid."""
    return np.asarray(inverse_of(np.ascontiguousarray(depth_m, dtype=np.float32)), dtype=np.float32)


def edges(inverse_depth_per_m: Float32, focal_px: float | None = None) -> NDArray[np.uint8]:
    """Return 1 within 4 px of an edge of the depth, of an invalid pixel or of the border, else 0; (H, W).

    With a focal length, too, of pixels whose surface is seen at so flat an angle that its texture may be aliased: over
    one pixel the inverse depth w of a plane changes by |grad w|, and the pixel's footprint is longer than wide by
    f |grad w| / w.
    """
    steepest = np.float32(np.inf if focal_px is None else _LONGEST_FOOTPRINT / focal_px)
    return widened(mark_edges(inverse_depth_per_m, np.float32(EDGE), steepest))


def seen_in_both(
    K: Float64,
    motion: RigidMotion,
    origins: NDArray[np.int64],
    size: tuple[int, int],
    first: tuple[Float32, NDArray[np.uint8]],
    second: tuple[Float32, NDArray[np.uint8]],
    uncertainty_px: float,
) -> Mask:
    """Return which pixels of tiles of the first frame reappear in the second, away from edges in either, (n, h, w).

    Parameters
    ----------
    origins, size
        (n, 2) first columns and rows of tiles; height and width of each.
    first, second
        Inverse depth, 1/m, 0 where invalid, and edges, both (H, W), of each frame.
    uncertainty_px
        How far the motion may misplace a pixel. Where the inverse depth slopes, so much is its value uncertain.
    """
    H = K @ motion.R @ np.linalg.inv(K)
    return np.asarray(seen_again(H, K @ motion.t_m, origins, size, *first, *second, EDGE, uncertainty_px))


def seen_in_few_tiles(
    K: Float64,
    motion: RigidMotion,
    origins: NDArray[np.int64],
    size: tuple[int, int],
    depths_m: tuple[Float32, Float32],
    uncertainty_px: float,
    fewest: int = 0,
) -> Mask:
    """Return what `seen_in_both` does, from the depths (H, W) of both frames: only of parts are edges looked for.

    Cheaper where tiles are a few hundredths of a large frame. Tiles of which surely fewer than the ``fewest`` pixels
    reappear may be left empty.
    """
    H = K @ motion.R @ np.linalg.inv(K)
    bends = np.float32(EDGE), np.float32(_LONGEST_FOOTPRINT / K[0, 0])
    return np.asarray(seen_in_parts(H, K @ motion.t_m, origins, size, *depths_m, bends, EDGE, uncertainty_px, fewest))


def flow_conflicts(flow_px: Float32) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return where a flow (H, W, 2) itself tells of edges, 1 there, else 0: maps (H, W) of the first and second frame.

    First frame: within 4 px of a break of the flow, of a missing value or of the border. Second frame: within 4 px of a
    pixel to which points of different flow lead, one of which must be occluded.
    """
    u, v = (np.ascontiguousarray(flow_px[..., i]) for i in range(2))
    known = np.logical_and(np.isfinite(u), np.isfinite(v))
    u, v = np.where(known, u, np.float32(0)), np.where(known, v, np.float32(0))
    breaks = ~known
    for component in (u, v):
        breaks |= np.abs(cv2.Laplacian(component, cv2.CV_32F, borderType=cv2.BORDER_REPLICATE)) > BREAK_PX
    crowded = spread_at_targets(flow_px) > _CROWDED_PX**2
    return widened(breaks.astype(np.uint8)), widened(crowded.astype(np.uint8))


def widened(edge: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Widen edges (H, W), 1 and 0, of which the outermost pixels always are some."""
    for side in (edge[0], edge[-1], edge[:, 0], edge[:, -1]):
        side[...] = 1
    return np.asarray(cv2.dilate(edge, np.ones((_WIDENED_PX, _WIDENED_PX), np.uint8)), dtype=np.uint8)
