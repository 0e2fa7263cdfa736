"""Faults that every stream of images can have: colour, depth and flow."""

import h5py
import numpy as np
from scipy.ndimage import shift

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import Array, edit_values


def mirrored(file: h5py.File, fault: Fault) -> None:
    """Write columns from right to left; the values, also the sign of a flow, stay as they are."""
    edit_values(file, fault, lambda images: images[:, :, ::-1])


def spatial_offset(file: h5py.File, fault: Fault) -> None:
    """Shift images to the right by whole pixels, or in any direction; the freed edge repeats the outermost, or is NaN.

    Between pixels colour follows a cubic spline and flow a straight line.
    """
    if fault.direction_deg is not None:
        angle, size_px = np.radians(fault.direction_deg), fault.magnitude_in("px")
        vector_px = size_px * float(np.cos(angle)), size_px * float(np.sin(angle))
        edit_values(file, fault, lambda images: _shifted_by_vector(images, vector_px))
        return
    columns = fault.count()
    edit_values(file, fault, lambda images: _shifted(images, columns))


def invalid_encoding(file: h5py.File, fault: Fault) -> None:
    """Write 0 where there is no value, instead of NaN."""
    edit_values(file, fault, lambda values: np.nan_to_num(values, nan=0.0))


def _shifted_by_vector(images: Array, vector_px: tuple[float, float]) -> Array:
    right_px, down_px = vector_px
    along = (0.0, down_px, right_px, 0.0)[: images.ndim]
    if images.dtype.kind == "f":
        # A spline would spread each NaN over the whole image.
        values = shift(images.astype(np.float64), along, order=1, mode="constant", cval=np.nan)
    else:
        splines = shift(images.astype(np.float64), along, order=3, mode="nearest")
        values = np.clip(np.rint(splines), 0, np.iinfo(images.dtype).max)
    return np.asarray(values).astype(images.dtype)


def _shifted(images: Array, shift: int) -> Array:
    width = images.shape[2]
    if abs(shift) >= width:
        raise FaultError(f"Expected a shift of less than {width} px, got {shift}")
    columns = np.arange(width) - shift
    shifted = images[:, :, np.clip(columns, 0, width - 1)]
    if shifted.dtype.kind == "f":
        shifted[:, :, (columns < 0) | (columns >= width)] = np.nan
    return shifted
