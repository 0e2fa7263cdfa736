"""What small faults of camera, mounting and time would do to the flow of tiles, from depth and the camera's motion."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.flow.comparison import is_noisy, templates_of
from fedora_qa.checks.flow.frames import geometry_of, inverse_depth_of
from fedora_qa.checks.flow.intervals import Interval
from fedora_qa.estimators.flow_motion_fit import FlowSample
from fedora_qa.estimators.flow_templates import CENTRE, FOCAL, MOUNTING, TIME_OFFSET
from fedora_qa.estimators.flow_tiles import patches_of, pixels_of
from fedora_qa.estimators.residual_flow import TILE_PX
from fedora_qa.geometry.rigid_flow import moved_points, twist_jacobian
from fedora_qa.sequence.window import Window

Float64 = NDArray[np.float64]

_STRIDE_PX: Final = 8
"""Templates are as smooth as the flow: sixteen pixels give the mean of a tile."""

_ABOUT_OPTICAL_AXIS: Final = 2
_PERCENT, _DEG = 0.01, np.pi / 180
_MS_PER_S = 1e3


def tile_templates(
    window: Window, interval: Interval, origins: NDArray[np.int64], usable: NDArray[np.bool_]
) -> Float64 | None:
    """Return templates (n, 2, 8) of tiles, the columns of ``GEOMETRIC``; None where depth or motion is not known.

    Stored minus true flow, px per unit of a fault in making the flow: the reverse of the same fault of a declaration.
    ``usable`` (n, 32, 32) are the pixels that count. Where poses are noisy the template of time, a difference of
    poses 2 ms apart, is nothing but noise and is left at zero.
    """
    geometry = geometry_of(window, interval)
    if geometry is None:
        return None
    every = slice(_STRIDE_PX // 2, TILE_PX, _STRIDE_PX)
    inverse = patches_of(inverse_depth_of(window, geometry.frames[0]), origins, halo_px=0)[:, every, every]
    chosen = usable[:, every, every] & (inverse > 0)
    columns, rows = (pixels[:, every, every][chosen].astype(np.float64) for pixels in pixels_of(origins, halo_px=0))
    depths_m = 1.0 / inverse[chosen].astype(np.float64)
    sample = FlowSample(columns, rows, depths_m, np.zeros((len(columns), 2)), 1.0)
    small = -templates_of(geometry.track, interval, geometry.motion, sample, geometry.correction)
    time = small[:, :, TIME_OFFSET.columns] * (_PERCENT * _MS_PER_S * interval.duration_s)
    if is_noisy(window.facts.declared.pose):
        time = np.zeros_like(time)
    K, motion = geometry.track.camera.K, geometry.motion.corrected(geometry.correction)
    points1_m = np.stack(moved_points(K, motion, columns, rows, depths_m), axis=-1)
    roll = twist_jacobian(K, points1_m)[:, :, _ABOUT_OPTICAL_AXIS, None] * _DEG
    parts = [small[:, :, part.columns] for part in (FOCAL, CENTRE, MOUNTING)]
    return _means(np.nan_to_num(np.concatenate((*parts, time, roll), axis=2)), chosen)


def _means(values: Float64, chosen: NDArray[np.bool_]) -> Float64:
    """Return the mean of values (k, 2, m) over the k chosen pixels of each tile; 0 for tiles without any."""
    tiles = np.nonzero(chosen)[0]
    sums = np.zeros((len(chosen), *values.shape[1:]))
    np.add.at(sums, tiles, values)
    counts = np.bincount(tiles, minlength=len(chosen))
    means: Float64 = sums / np.maximum(counts, 1)[:, None, None]
    return means
