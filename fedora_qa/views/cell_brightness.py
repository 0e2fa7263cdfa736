"""Brightness of the same surfaces at both ends of a field of flow, by cells of some pixels."""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.residual import HALO_PX, TILE_PX
from fedora_qa.estimators.flow.tiles import TileGrid, pixels_of
from fedora_qa.estimators.flow.warp import parts_about
from fedora_qa.estimators.images.gain import LEVELS_DN
from fedora_qa.estimators.images.luma import LUMA_ROUNDING_VARIANCE_DN2
from fedora_qa.estimators.images.vignetting import PARTS, CellRatios
from fedora_qa.geometry.lens import rays_of_pixels
from fedora_qa.sequence.declared import Camera
from fedora_qa.views.flow_intervals import Interval
from fedora_qa.views.flow_residuals import sample_tiles
from fedora_qa.views.warped_frames import FramePair

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

TILES: Final = 48
"""Tiles of a field that are compared, of 32 x 32 px: all of a frame of 270x200, 3% of 1440x1080. Other tiles are drawn
for each field, so that no place is left out."""

CELL_PX: Final = 8
"""Side of a cell: a quarter of a tile."""

_FEWEST_PIXELS: Final = CELL_PX**2 // 2
"""Least number of the pixels of a cell that both frames must show."""


_WHITE: Final = 255
"""Code at which a channel is clipped."""


def cell_ratios(frames: FramePair, interval: Interval, camera: Camera, tile_share: float) -> CellRatios | None:
    """Return the brightness of the same surfaces at both ends of a field of flow.

    Parameters
    ----------
    frames
        Frames at both ends of the interval.
    interval
        Of the field.
    camera
        Of the frames.
    tile_share
        Least share of the tiles that is compared, 0 to 1; ``TILES`` at least.

    Returns
    -------
    CellRatios or None
        None where the image has no tile, or no tile is visible in both frames.
    """
    height, width = frames.window.flow_px(interval.stream, interval.row).shape[:2]
    count = len(TileGrid.of(height, width).origins)
    tiles = sample_tiles(frames, interval, min(1.0, max(tile_share, TILES / max(count, 1))))
    if tiles is None or not tiles.usable.any():
        return None
    tiles = tiles.chosen(np.asarray(tiles.usable.any(axis=(1, 2))))
    inner = slice(HALO_PX, -HALO_PX)
    flow_px = tiles.flow_px[:, inner, inner]
    columns, rows = (places.astype(np.float32) for places in pixels_of(tiles.origins, halo_px=0))
    later = columns + flow_px[..., 0], rows + flow_px[..., 1]
    before_dn = frames.first(tiles.origins)[:, inner, inner]
    after_dn = frames.second(*later)
    usable = tiles.usable
    squared_radii = []
    for frame, places in ((frames.before, (columns, rows)), (frames.after, later)):
        x, y = frames.on_frame(*places)
        squared_radii.append(squared_radius(camera, x, y))
        usable = usable & ~_near_clipped(frames, frame, x, y)
    pixels = _sums(usable)
    values = np.stack((before_dn, after_dn, *squared_radii))
    before, after, s1, s2 = (_sums(np.where(usable, image, 0.0)) for image in values)
    with np.errstate(divide="ignore", invalid="ignore"):
        level_dn = np.sqrt(before * after) / pixels
    # The geometric mean of both frames, so that the choice favours neither.
    chosen = (pixels >= _FEWEST_PIXELS) & (level_dn >= LEVELS_DN[0]) & (level_dn <= LEVELS_DN[1])
    pixels, before, after, s1, s2 = (values[chosen] for values in (pixels, before, after, s1, s2))
    tile, cell_row, cell_column = np.nonzero(chosen)
    centre = tiles.origins[tile] + CELL_PX * np.stack((cell_column, cell_row), axis=-1) + CELL_PX // 2
    part_column, part_row = (centre * (PARTS[1], PARTS[0]) // (width, height)).T
    return CellRatios(
        np.log(after / before),
        (s1 - s2) / pixels,
        pixels * LUMA_ROUNDING_VARIANCE_DN2 * (before**-2 + after**-2),
        level_dn[chosen] * (s1 + s2) / (2 * pixels),
        part_row * PARTS[1] + part_column,
    )


def squared_radius(camera: Camera, columns: NDArray[np.floating], rows: NDArray[np.floating]) -> Float64:
    """Return the squared tangent of the angle to the optical axis, as a share of that of the farthest corner.

    Parameters
    ----------
    camera
        Of the image.
    columns, rows
        Positions in its image, px, of any shape.

    Returns
    -------
    ndarray of float64
        Of the same shape: 0 at the principal point, 1 in the farthest corner.
    """

    def squared_tangent(x: NDArray[np.floating], y: NDArray[np.floating]) -> Float64:
        slope_x, slope_y = rays_of_pixels(camera.K, camera.lens, np.asarray(x, np.float64), np.asarray(y, np.float64))
        return np.asarray(slope_x**2 + slope_y**2)

    right, bottom = camera.width - 1.0, camera.height - 1.0
    corners = squared_tangent(np.array([0.0, right, 0.0, right]), np.array([0.0, 0.0, bottom, bottom]))
    return np.asarray(squared_tangent(columns, rows) / corners.max())


def _near_clipped(frames: FramePair, frame: int, x: Float32, y: Float32) -> Mask:
    """Return where the smoothed values at positions (n, s, s) in a frame depend on a clipped pixel.

    Smoothing spreads the light of a bright spot farther over the surface in the frame that shows the surface smaller.
    Beside a spot that is left out, that frame would always be the brighter of both.
    """
    rgb, reach = frames.window.rgb(frame), frames.reach_px
    height, width = rgb.shape[:2]
    x, y = np.ascontiguousarray(x), np.ascontiguousarray(y)
    near = np.zeros(x.shape, np.bool_)
    # Only the part of the frame about each tile is searched: tiles are few hundredths of a large frame.
    for i, (left, top, right, bottom) in enumerate(parts_about(x, y, width, height).tolist()):
        first_x, first_y = max(left - reach, 0), max(top - reach, 0)
        white = rgb[first_y : bottom + reach, first_x : right + reach] == _WHITE
        if white.any():
            spots = white.any(axis=-1).view(np.uint8)
            dilated = cv2.dilate(spots, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
            columns, rows = (
                np.clip(np.nan_to_num(np.rint(places)), 0, size - 1).astype(np.intp) - first
                for places, size, first in ((x[i], width, first_x), (y[i], height, first_y))
            )
            near[i] = dilated[rows, columns] > 0
    return near


def _sums(values: NDArray[np.generic]) -> Float64:
    """Return the sums over the cells (n, 4, 4) of tiles (n, 32, 32)."""
    cells = TILE_PX // CELL_PX
    return np.asarray(values.reshape(-1, cells, CELL_PX, cells, CELL_PX).sum(axis=(2, 4), dtype=np.float64))
