"""Pixels of a flow field that can be compared: edges in depth or flow, and pixels with a value.

The inverse depth of a plane is affine in the pixel. Its Laplacian therefore vanishes on every plane and marks edges,
and bilinear interpolation of it is exact. Near an edge a pixel mixes two surfaces of different motion, so edges are
widened by the reach of the kernel that smooths the frames.
"""

from typing import Final

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

Float32 = NDArray[np.float32]
Mask = NDArray[np.bool_]

_INFINITE = np.float32(np.inf)
_INFINITE_BITS = np.int32(0x7F800000)
"""Bits of infinity in single precision; any number whose exponent has these bits is infinite or NaN."""

EDGE: Final = 0.01
"""Relative Laplacian of inverse depth that makes an edge, and relative mismatch of it that makes an occlusion.

At such a step the flow of two neighbouring surfaces differs by 1% of their parallax: by 0.1 px where that is 10 px.
"""

LONGEST_FOOTPRINT: Final = 8.0
"""Length over width of the footprint of a pixel up to which texture is smoothed over all of the footprint.

P. S. Heckbert, Fundamentals of Texture Mapping and Image Warping (1989), derives the footprint; renderers limit their
anisotropic filtering to ratios between 4 and 16. Beyond that distant ground has aliases, which do not follow the flow.
"""

BREAK_PX: Final = 0.1
"""Second difference of a flow that makes a break. Across smaller ones a mix of two surfaces errs by less than this."""

_CROWDED_PX: Final = 0.25
"""Standard deviation of the flows that lead to one pixel, above which they belong to different surfaces."""

_WIDENED_PX: Final = 9
"""Edges are widened by 4 px on either side, where a mixed pixel contributes less than 1e-4 of its contrast.

At 3 px the contribution is 1e-3, which changed the residual flow of tiles of little texture next to a bright edge by up
to 0.1 px. The border is widened in the same way to five pixels, the reach of Gaussian and spline together: nearer to
the border frames are extrapolated.
"""


def inverse_depth(depth_m: Float32) -> Float32:
    """Return 1 / depth (H, W), 1/m, of a depth (H, W) in m; 0 where depth is invalid."""
    depth_m = np.ascontiguousarray(depth_m, dtype=np.float32)
    return np.asarray(inverse_in(depth_m, 0, 0, *depth_m.shape), dtype=np.float32)


def edges(inverse_depth_per_m: Float32, focal_px: float | None = None) -> NDArray[np.uint8]:
    """Return where a pixel is near an edge of the depth, an invalid pixel or the border.

    With a focal length, pixels whose surface is viewed at so flat an angle that its texture may be aliased are marked
    too. Over one pixel the inverse depth w of a plane changes by |grad w|, and the footprint of the pixel is longer
    than wide by f |grad w| / w.

    Parameters
    ----------
    inverse_depth_per_m
        (H, W) 1/m, 0 where invalid.
    focal_px
        Focal length, px; None: surfaces at flat angles are not marked.

    Returns
    -------
    ndarray of uint8
        (H, W) 1 within 4 px of such a pixel, else 0.
    """
    steepest = np.float32(np.inf if focal_px is None else LONGEST_FOOTPRINT / focal_px)
    return widened(mark_edges(inverse_depth_per_m, np.float32(EDGE), steepest))


def flow_conflicts(flow_px: Float32) -> NDArray[np.uint8]:
    """Return where a flow (H, W, 2), px, itself has edges, as maps (2, H, W) of the first and of the second frame.

    They are 1 at edges, else 0. In the first frame these are pixels within 4 px of a break of the flow, of a missing
    value or of the border. In the second frame these are pixels within 4 px of one to which points of different flow
    lead: one of the points must be occluded.
    """
    crowded = spread_at_targets(np.ascontiguousarray(flow_px)) > _CROWDED_PX**2
    return np.stack([widened(edge) for edge in (flow_breaks(flow_px), crowded.astype(np.uint8))])


def flow_breaks(flow_px: Float32) -> NDArray[np.uint8]:
    """Return where a flow (H, W, 2), px, breaks: (H, W), 1 also at missing values, beside them and at the border."""
    return _mark_breaks(np.ascontiguousarray(flow_px).reshape(len(flow_px), -1), np.float32(BREAK_PX))


@njit(cache=True)
def _mark_breaks(lines: Float32, largest_bend_px: np.float32) -> NDArray[np.uint8]:
    """Return where a flow has a larger Laplacian, as ``flow_breaks``; its rows (H, 2 W) hold u and v in turn, px."""
    height, width = len(lines), lines.shape[1] // 2
    marked = np.ones((height, width), np.uint8)
    is_smooth = np.empty(2 * max(width - 2, 0), np.bool_)
    for row in range(1, height - 1):
        above, here, below, line = lines[row - 1][2:-2], lines[row], lines[row + 1][2:-2], marked[row][1:-1]
        left, value, right = here[:-4], here[2:-2], here[4:]
        # As of the inverse depth: flow is smooth within a surface. Of a missing value the comparison is false.
        for index in range(len(value)):
            bend_px = left[index] + right[index] + above[index] + below[index] - np.float32(4) * value[index]
            is_smooth[index] = abs(bend_px) <= largest_bend_px
        for column in range(len(line)):
            line[column] = not (is_smooth[2 * column] & is_smooth[2 * column + 1])
    return marked


def widened(edge: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return edges (H, W), 1 and 0, widened by 4 px; the border always counts as an edge, and is marked in ``edge``."""
    for side in (edge[0], edge[-1], edge[:, 0], edge[:, -1]):
        side[...] = 1
    return np.asarray(cv2.dilate(edge, np.ones((_WIDENED_PX, _WIDENED_PX), np.uint8)), dtype=np.uint8)


@njit(cache=True, error_model="numpy")
def inverse_in(depth_m: Float32, left: int, top: int, height: int, width: int) -> Float32:
    """Return 1 / depth of a part of a frame.

    Parameters
    ----------
    depth_m
        (H, W) m.
    left, top
        First column and row of the part, px.
    height, width
        Of the part, px.

    Returns
    -------
    ndarray of float32
        (height, width) 1/m, 0 where depth is not finite and positive.
    """
    inverse = np.empty((height, width), np.float32)
    for row in range(height):
        depths, line = depth_m[top + row, left : left + width], inverse[row]
        for column in range(len(line)):
            depth = depths[column]
            valid = (depth > 0) & (depth < np.float32(np.inf))
            line[column] = np.float32(1) / depth if valid else np.float32(0)
    return inverse


@njit(cache=True)
def mark_edges(inverse_per_m: Float32, largest_bend: np.float32, largest_slope: np.float32) -> NDArray[np.uint8]:
    """Return where an inverse depth has edges.

    Parameters
    ----------
    inverse_per_m
        (H, W) 1/m, 0 where invalid.
    largest_bend
        Largest Laplacian that is no edge, as a share of the inverse depth.
    largest_slope
        Largest gradient that is no edge, as a share of the inverse depth, 1/px.

    Returns
    -------
    ndarray of uint8
        (H, W) 1 at edges, invalid pixels and the border, else 0.
    """
    height, width = inverse_per_m.shape
    marked = np.ones((height, width), np.uint8)
    steepest = largest_slope * largest_slope
    for row in range(1, height - 1):
        above, here, below, line = inverse_per_m[row - 1], inverse_per_m[row], inverse_per_m[row + 1], marked[row]
        for column in range(1, width - 1):
            left, right = here[column - 1], here[column + 1]
            line[column] = is_edge(here[column], left, right, above[column], below[column], largest_bend, steepest)
    return marked


@njit(cache=True)
def is_edge(
    value: np.float32,
    left: np.float32,
    right: np.float32,
    above: np.float32,
    below: np.float32,
    largest_bend: np.float32,
    steepest: np.float32,
) -> np.bool_:
    """Return whether a pixel of an inverse depth is invalid, bends too much or slopes too much.

    Parameters
    ----------
    value, left, right, above, below
        Inverse depth of the pixel and of its four neighbours, 1/m.
    largest_bend
        Largest Laplacian, as a share of the value.
    steepest
        Largest squared gradient, as a share of the squared value, 1/px^2.

    Returns
    -------
    bool
        Whether the pixel is an edge.
    """
    bend = abs(left + right + above + below - np.float32(4) * value)
    across, down = np.float32(0.5) * (right - left), np.float32(0.5) * (below - above)
    # f |grad w| / w above LONGEST_FOOTPRINT (Heckbert 1989); squared, so that no root is taken.
    is_steep = across * across + down * down > steepest * value * value
    # Without a branch, so that the compiler handles many pixels at once.
    return (bend > largest_bend * value) | is_steep | (value <= 0)


@njit(cache=True)
def spread_at_targets(flow_px: Float32) -> Float32:
    """Return the larger variance (H, W), px^2, of the components of the flows (H, W, 2), px, that lead to each pixel.

    It is 0 where fewer than two flows lead to a pixel.
    """
    height, width = flow_px.shape[:2]
    flows = flow_px.reshape(height * width, 2)
    # The latest pixel that leads to each target, and before each pixel the one that leads to the same target: few
    # targets have several, and sums for all of them would take most of the time.
    latest, before = np.full(height * width, -1, np.int32), np.empty(height * width, np.int32)
    for row in range(height):
        for column in range(width):
            source = row * width + column
            x, y = np.rint(column + np.float64(flows[source, 0])), np.rint(row + np.float64(flows[source, 1]))
            if not (0 <= x < width and 0 <= y < height):  # also where flow is NaN
                continue
            target = int(y) * width + int(x)
            before[source], latest[target] = latest[target], source
    spread = np.zeros(height * width, np.float32)
    for target in range(height * width):
        source = latest[target]
        if source < 0 or before[source] < 0:
            continue
        n, u_sum, v_sum, uu_sum, vv_sum = 0, 0.0, 0.0, 0.0, 0.0
        while source >= 0:
            u, v = np.float64(flows[source, 0]), np.float64(flows[source, 1])
            n, u_sum, v_sum, uu_sum, vv_sum = n + 1, u_sum + u, v_sum + v, uu_sum + u * u, vv_sum + v * v
            source = before[source]
        # E[u^2] - E[u]^2 cancels: in float64 its rounding stays far below the limit of 0.06 px^2.
        spread[target] = max(uu_sum / n - (u_sum / n) ** 2, vv_sum / n - (v_sum / n) ** 2)
    return spread.reshape(height, width)


@njit(cache=True)
def compare_patterns(lines: Float32, depth_m: Float32, static_m: Float32) -> tuple[int, int, int]:
    """Count pixels that have a flow and no depth, a static depth and no flow, and an infinite flow.

    Parameters
    ----------
    lines
        (H, 2 W) u and v of one pixel after another, px.
    depth_m, static_m
        (H, W) m; valid where finite and positive. ``static_m`` is NaN where an object moves by itself.

    Returns
    -------
    unfounded, missing, infinite
        The three counts, in pixels.
    """
    unfounded, missing, infinite = 0, 0, 0
    for row in range(len(depth_m)):
        line, depths, statics = lines[row], depth_m[row], static_m[row]
        # Few rows have a wrong pixel. A pass without branches finds these rows, and only their pixels are counted.
        if not _has_wrong_pixel(line, depths):
            continue
        for column in range(len(depths)):
            u, v = line[2 * column], line[2 * column + 1]
            present = np.isfinite(u) and np.isfinite(v)
            valid = depths[column] > 0 and np.isfinite(depths[column])
            unfounded += present and not valid
            missing += valid and not present and np.isfinite(statics[column])
            infinite += np.isinf(u) or np.isinf(v)
    return unfounded, missing, infinite


@njit(cache=True)
def _has_wrong_pixel(line: Float32, depths: Float32) -> bool:
    """Return whether any flow of a row is infinite, or present without a depth, or missing with one."""
    wrong = np.int32(0)
    for column in range(len(depths)):
        u, v = abs(line[2 * column]), abs(line[2 * column + 1])
        present, valid = (u < _INFINITE) & (v < _INFINITE), (depths[column] > 0) & (depths[column] < _INFINITE)
        wrong |= np.int32((present != valid) | (u == _INFINITE) | (v == _INFINITE))
    return bool(wrong != 0)


def depth_range_m(depth_m: Float32, static_m: Float32) -> tuple[float, float] | None:
    """Return the least and the largest valid static depth.

    Positive numbers of single precision are in the order of their bits, read as integers, which are compared several at
    a time. Infinity and then NaN are above all of them.

    Parameters
    ----------
    depth_m
        (H, W) m; valid where finite and positive.
    static_m
        (H, W) m; not finite where an object moves by itself.

    Returns
    -------
    tuple of float, or None
        Least and largest depth, m; None where no static depth is valid.
    """
    bits = (np.ascontiguousarray(values, dtype=np.float32).view(np.int32) for values in (depth_m, static_m))
    least, largest = _range_of_bits(*bits)
    range_m = np.array([least, largest], dtype=np.int32).view(np.float32)
    return None if largest == 0 else (float(range_m[0]), float(range_m[1]))


@njit(cache=True)
def _range_of_bits(depths: NDArray[np.int32], statics: NDArray[np.int32]) -> tuple[np.int32, np.int32]:
    least, largest = _INFINITE_BITS, np.int32(0)
    for row in range(len(depths)):
        depth_row, static_row = depths[row], statics[row]
        for column in range(len(depth_row)):
            bits = depth_row[column]
            counts = (bits > 0) & (bits < _INFINITE_BITS) & ((static_row[column] & _INFINITE_BITS) != _INFINITE_BITS)
            least = min(least, bits if counts else _INFINITE_BITS)
            largest = max(largest, bits if counts else np.int32(0))
    return least, largest
