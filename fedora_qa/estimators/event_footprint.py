"""Frames seen by the pixels of the event camera: area averages in linear intensity.

Two cameras with one centre and one orientation see the same ray at pixels related by ``x_to = K_to K_from^-1 x_from``,
separable in columns and rows where the skew is zero. A pixel covers [u - 1/2, u + 1/2]; its footprint in the other
image is averaged with exact weights for the pixels that it cuts.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

Float64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Footprints:
    """The footprints of an event camera's pixels in a frame.

    Attributes
    ----------
    rows, columns
        (h, H) and (w, W): length of each frame pixel that lies in a footprint over the footprint's length.
    inside
        (h, w): the footprint lies wholly in the frame.
    """

    rows: Any
    columns: Any
    split_rows: Any
    split_columns: Any
    inside: NDArray[np.bool_]

    def average(self, image: NDArray[Any]) -> Float64:
        """Return the (h, w) means of an (H, W) image over the footprints."""
        return _both(self.rows, image, self.columns)

    def split_bound(self, contrast: NDArray[Any]) -> Float64:
        """Bound the error (h, w) that comes from pixels which a footprint's border cuts.

        A pixel of mean m of which the share s lies inside is taken to give s m. Where it holds a step of height d the
        truth differs by at most s (1 - s) d: reached when the step runs along the border. ``contrast`` (H, W) bounds d.
        """
        return self.average(contrast) - _both(self.split_rows, contrast, self.split_columns)


def footprints(K_frame: Float64, shape_frame: tuple[int, int], K_event: Float64, shape_event: tuple[int, int]) -> Footprints:
    """Return the footprints of the event camera's pixels; shapes are (rows, columns), intrinsics (3, 3) without skew."""
    rows, split_rows, inside_rows = _axis(K_frame[1], K_event[1], 1, shape_frame[0], shape_event[0])
    columns, split_columns, inside_columns = _axis(K_frame[0], K_event[0], 0, shape_frame[1], shape_event[1])
    return Footprints(rows, columns, split_rows, split_columns, inside_rows[:, np.newaxis] & inside_columns)


def _axis(frame: Float64, event: Float64, axis: int, size_frame: int, size_event: int) -> tuple[Any, Any, Any]:
    """Return the weights along one axis, the weights times the share of the pixel inside, and which are whole."""
    edges = (np.arange(size_event + 1) - 0.5 - event[2]) * (frame[axis] / event[axis]) + frame[2]
    pixels = np.arange(size_frame)
    start, stop = edges[:-1, np.newaxis], edges[1:, np.newaxis]
    shares = np.clip(np.minimum(stop, pixels + 0.5) - np.maximum(start, pixels - 0.5), 0.0, 1.0)
    weights = shares / (stop - start)
    # One part in a million of a pixel is what K as written in a file may lack.
    inside = (edges[:-1] >= -0.5 - 1e-6) & (edges[1:] <= size_frame - 0.5 + 1e-6)
    return csr_array(weights), csr_array(weights * shares), inside


def _both(rows: Any, image: NDArray[Any], columns: Any) -> Float64:
    averaged: Float64 = np.ascontiguousarray((columns @ (rows @ image).T).T, dtype=np.float64)
    return averaged
