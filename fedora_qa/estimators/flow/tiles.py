"""Tiles of an image, which of them to look at, and patches of them."""

from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.residual import HALO_PX, TILE_PX

_MARGIN_PX: Final = 8
"""Tiles keep clear of the border by this, where smoothing extrapolates."""


@dataclass(frozen=True, slots=True)
class TileGrid:
    """Whole tiles of an image, centred; ``origins`` (n, 2) are the columns and rows of their first pixels."""

    height: int
    width: int
    origins: NDArray[np.int64]

    @classmethod
    @cache
    def of(cls, height: int, width: int) -> "TileGrid":
        """Cut an image into tiles; none where it is too small."""
        starts = []
        for size in (width, height):
            count = max((size - 2 * _MARGIN_PX) // TILE_PX, 0)
            starts.append((size - count * TILE_PX) // 2 + TILE_PX * np.arange(count, dtype=np.int64))
        columns, rows = np.meshgrid(*starts)
        return cls(height, width, np.stack((columns.ravel(), rows.ravel()), axis=-1))

    def sample(self, share: float, *seed: int) -> NDArray[np.int64]:
        """Return the origins of a share of the tiles, at least one; which ones follows from ``seed`` alone."""
        count = len(self.origins)
        wanted = min(count, max(1, round(share * count)))
        if wanted == count:
            return self.origins
        chosen = np.random.default_rng(seed).permutation(count)[:wanted]
        return self.origins[np.sort(chosen)]


def pixels_of(origins: NDArray[np.int64], halo_px: int = HALO_PX) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return columns and rows (n, size, size) of each tile with its halo."""
    offsets = np.arange(-halo_px, TILE_PX + halo_px, dtype=np.int64)
    size = len(offsets)
    columns = np.broadcast_to((origins[:, 0, None] + offsets)[:, None, :], (len(origins), size, size))
    rows = np.broadcast_to((origins[:, 1, None] + offsets)[:, :, None], (len(origins), size, size))
    return columns, rows


def patches_of(image: NDArray[Any], origins: NDArray[np.int64], halo_px: int = HALO_PX) -> NDArray[Any]:
    """Return a copy (n, size, size, ...) of each tile of an image with its halo."""
    size = TILE_PX + 2 * halo_px
    windows = np.lib.stride_tricks.sliding_window_view(image, (size, size), axis=(0, 1))
    taken = windows[origins[:, 1] - halo_px, origins[:, 0] - halo_px]
    return taken if image.ndim == 2 else np.moveaxis(taken, 1, -1)
