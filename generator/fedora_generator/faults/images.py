"""Faults that every stream of images can have: colour, depth and flow."""

import h5py
import numpy as np

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import Array, edit_values


def mirrored(file: h5py.File, fault: Fault) -> None:
    """Write columns from right to left; the values, also the sign of a flow, stay as they are."""
    edit_values(file, fault, lambda images: images[:, :, ::-1])


def spatial_offset(file: h5py.File, fault: Fault) -> None:
    """Shift images to the right by whole pixels; the freed edge repeats the outermost colour, or is NaN."""
    shift = fault.count()
    edit_values(file, fault, lambda images: _shifted(images, shift))


def invalid_encoding(file: h5py.File, fault: Fault) -> None:
    """Write 0 where there is no value, instead of NaN."""
    edit_values(file, fault, lambda values: np.nan_to_num(values, nan=0.0))


def _shifted(images: Array, shift: int) -> Array:
    width = images.shape[2]
    if abs(shift) >= width:
        raise FaultError(f"Expected a shift of less than {width} px, got {shift}")
    columns = np.arange(width) - shift
    shifted = images[:, :, np.clip(columns, 0, width - 1)]
    if shifted.dtype.kind == "f":
        shifted[:, :, (columns < 0) | (columns >= width)] = np.nan
    return shifted
