"""Events in the view of another camera with the same centre, through the lenses of both."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.contrast_kernels import on_rows
from fedora_qa.geometry.lens import pixels_of_rays, rays_of_pixels
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.window import Events, Window
from fedora_qa.views.camera_axes import is_identity

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

_LARGEST: Final = 2
"""Largest size of a view, in sizes of the event camera, centred on it. A lens may image rays that are nearly at a right
angle to its axis, whose positions are far away: these pixels are left out. The value is not derived."""


@dataclass(frozen=True, slots=True)
class PixelPositions:
    """Where the pixels of the event camera lie in a view.

    Attributes
    ----------
    columns, rows
        (h, w) positions in the view, px, also between its pixels; NaN for a pixel that lies beyond the view.
    widths_px
        (h, w) greatest width of a pixel's footprint in the view, px: the larger singular value of the derivatives of
        its position by the pixel.
    """

    columns: Float64
    rows: Float64
    widths_px: Float64


@dataclass(frozen=True, slots=True)
class EventView:
    """The view of a camera, in pixels of about the size of those of the event camera.

    Attributes
    ----------
    K
        (3, 3) intrinsics, px: focal lengths of the event camera, behind the lens and along the axes of the other one.
    shape
        Rows and columns.
    positions
        Of the pixels of the event camera; None where each pixel has its own coordinates in the view.
    """

    K: Float64
    shape: tuple[int, int]
    positions: PixelPositions | None = None

    @property
    def share(self) -> float | None:
        """Share of the event camera's pixels that lie in the view; None where all do."""
        return None if self.positions is None else float(np.mean(np.isfinite(self.positions.columns)))

    def chosen(self, events: Events, sample: tuple[int, int, int], wanted: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return which events of a regular sample lie in the view, in wanted rows of it.

        Parameters
        ----------
        events
            As stored; those beyond the sensor are left out.
        sample
            First event, the one after the last, and the step between the events that are read.
        wanted
            (rows,) of the view.

        Returns
        -------
        ndarray of int64
            (k,) indices of these events, ascending.
        """
        if self.positions is None:
            return np.asarray(on_rows(events.x, events.y, sample, self.shape[1], wanted))
        height, width = self.positions.rows.shape
        indices = on_rows(events.x, events.y, sample, width, np.ones(height, np.bool_))
        rows = self.positions.rows[events.y[indices], events.x[indices]]
        inside = np.isfinite(rows)
        return np.asarray(indices[inside][wanted[np.rint(rows[inside]).astype(np.int64)]])

    def places(self, x: Float32, y: Float32) -> tuple[Float32, Float32, Float32]:
        """Return columns, rows and widths (n,), px, of the pixels of events that ``chosen`` has returned.

        Parameters
        ----------
        x, y
            (n,) columns and rows of the event camera, px, whole numbers.
        """
        if self.positions is None:
            return x, y, np.ones_like(x)
        at = y.astype(np.int64), x.astype(np.int64)
        columns, rows, widths_px = (
            values[at].astype(np.float32)
            for values in (self.positions.columns, self.positions.rows, self.positions.widths_px)
        )
        return columns, rows, widths_px


def event_view(window: Window, camera: str) -> EventView:
    """Return the view of a camera that has the centre of the event camera, with the positions of all its pixels.

    A pixel u of the event camera has the ray ``r = undistorted(K_events^-1 u)``; in the view it lies at
    ``K distorted(R r)``, with R from the axes of the event camera to those of the other one, and with the lens of each.

    Parameters
    ----------
    window
        A window of the sequence, whose declared cameras have one centre. It keeps the view.
    camera
        Name of the camera of the view.
    """
    return window.derived(_event_view, camera)


def _event_view(window: Window, camera: str) -> EventView:
    cameras = window.facts.declared.cameras
    events, other = cameras["events"], cameras[camera]
    if events.lens == other.lens and is_identity(_rotation(events, other)):
        return EventView(events.K, (events.height, events.width))
    return view_around(events.K, window.derived_image(_positions_for_file, 0, camera))


def _positions_for_file(window: Window, _: int, camera: str) -> Float64:
    cameras = window.facts.declared.cameras
    return positions_px(cameras["events"], cameras[camera])


def _rotation(events: Camera, other: Camera) -> Float64:
    """Return the rotation from the axes of the event camera to those of another one."""
    return np.asarray(other.T_body_camera[:3, :3].T @ events.T_body_camera[:3, :3])


def positions_px(events: Camera, other: Camera) -> Float64:
    """Return where the pixels of the event camera lie behind the lens of another camera, by the K of the event camera.

    Returns
    -------
    ndarray of float64
        (3, h, w) columns, rows and widths, px, as in ``PixelPositions`` before the view is cut; NaN farther away than
        ``_LARGEST``, and for rays that the other camera does not image.
    """
    width, height = events.width, events.height
    x, y = rays_of_pixels(events.K, events.lens, *np.meshgrid(np.arange(width), np.arange(height)))
    rays = np.einsum("ij,jhw->ihw", _rotation(events, other), np.stack([x, y, np.ones_like(x)]))
    slopes = np.divide(rays[:2], rays[2], out=np.full_like(rays[:2], np.nan), where=rays[2] > 0)
    columns, rows = pixels_of_rays(events.K, other.lens, *slopes)
    # u = f(m) for pixel m. Central differences give df/dm, whose larger singular value s is the width: with a, b, c of
    # the matrix (df/dm)(df/dm)^T = [a c; c b], s^2 = (a + b) / 2 + sqrt((a - b)^2 / 4 + c^2).
    (u_down, u_right), (v_down, v_right) = np.gradient(columns), np.gradient(rows)
    a, b, c = u_right**2 + u_down**2, v_right**2 + v_down**2, u_right * v_right + u_down * v_down
    widths_px = np.sqrt(0.5 * (a + b) + np.sqrt(0.25 * (a - b) ** 2 + c**2))
    far_px = [np.abs(each - (size - 1) / 2) for each, size in ((columns, width), (rows, height))]
    near = (far_px[0] <= (_LARGEST * width - 1) / 2) & (far_px[1] <= (_LARGEST * height - 1) / 2)
    return np.where(near & np.isfinite(widths_px), np.stack([columns, rows, widths_px]), np.nan)


def view_around(K: Float64, positions: Float64) -> EventView:
    """Return the smallest view around the positions (3, h, w) of ``positions_px``; its first pixel is its origin."""
    columns, rows, widths_px = positions
    if not np.isfinite(columns).any():
        return EventView(K, (0, 0), PixelPositions(columns, rows, widths_px))
    left, top = (int(np.floor(np.nanmin(each))) for each in (columns, rows))
    right, bottom = (int(np.ceil(np.nanmax(each))) for each in (columns, rows))
    shape = bottom - top + 1, right - left + 1
    moved = PixelPositions(columns - left, rows - top, widths_px)
    return EventView(K - [[0, 0, left], [0, 0, top], [0, 0, 0]], shape, moved)
