"""The types and shapes in which datasets may be stored, beside those of the layout."""

from typing import Any, Final

import h5py
import numpy as np

from fedora_qa.layout.bitshuffle import require_sound_blocks
from fedora_qa.layout.canonical import DatasetSpec
from fedora_qa.layout.dialect import DatasetPlace
from fedora_qa.layout.links import READ_ERRORS, RefusedError
from fedora_qa.sources.source import OutsideRows

_FIRST_ROWS: Final = 1 << 16
"""Rows that tell whether floats are whole numbers, and which code polarity has: so many events are of either kind."""


def holds_without_loss(spec: DatasetSpec, dtype: np.dtype[Any]) -> bool:
    """Return whether another type than the layout's holds the values of a dataset as they were meant.

    Parameters
    ----------
    spec
        Of the dataset.
    dtype
        As stored.

    Returns
    -------
    bool
        Wider types, and whole numbers in others that hold them; float32 samples, whose step of 2^-24 of the value is
        below the noise of any IMU; millimetres of depth as integers of 16 bits or more. Narrower floats and scaled
        integers lose, and 8 bits hold no millimetres.
    """
    canonical = np.dtype(spec.dtype)
    if canonical.kind == "f":
        millimetres = spec.key == "path/depth" and dtype.kind in "iu" and dtype.itemsize >= 2
        return millimetres or (dtype.kind == "f" and dtype.itemsize >= 4)
    # float64 holds microseconds and indices up to 2^53 (285 years), float32 columns, rows and polarity up to 2^24.
    return dtype.kind in "iub" or dtype.itemsize >= (8 if canonical.itemsize == 8 else 4)


def is_whole(spec: DatasetSpec, dataset: h5py.Dataset) -> bool:
    """Whether the first values in place of whole numbers are such, in the range of the layout's type, or not finite.

    Damage is found elsewhere.
    """
    canonical = np.dtype(spec.dtype)
    if canonical.kind == "f":
        return True
    try:
        # Images have a row a frame: one is enough.
        rows = 1 if spec.is_image else _FIRST_ROWS
        require_sound_blocks(dataset, 0, rows)
        values = np.asarray(dataset[:rows], np.float64)
    except READ_ERRORS:
        return True
    finite, limits = values[np.isfinite(values)], np.iinfo(canonical)
    # A polarity of -1 is darker.
    least = -1 if spec.key == "path/events/p" else limits.min
    return bool(np.all((finite == np.rint(finite)) & (finite >= least) & (finite <= limits.max)))


def is_signed_polarity(dataset: h5py.Dataset) -> bool:
    """Whether the first events have polarities -1 and none 0, so that -1 is darker. Damage is found elsewhere."""
    if dataset.dtype.kind not in "if":
        return False
    try:
        require_sound_blocks(dataset, 0, _FIRST_ROWS)
        polarity = dataset[:_FIRST_ROWS]
    except READ_ERRORS:
        return False
    return bool(np.any(polarity == -1) and not np.any(polarity == 0))


def require_readable_type(spec: DatasetSpec, dataset: h5py.Dataset | OutsideRows, path: str) -> None:
    """Refuse types without a safe conversion: all that are not numbers, and colours that are not 8-bit codes."""
    # At most 8 bytes: an extended float does not fit float64 without loss.
    numeric = dataset.dtype.kind in "iufb" and dataset.dtype.subdtype is None and dataset.dtype.itemsize <= 8
    if not numeric or (spec.key == "path/rgb" and dataset.dtype != np.uint8):
        message = f"Expected {path} as {spec.dtype}, got {dataset.dtype}, which cannot be converted safely"
        raise RefusedError("wrong_dtype", "wrong_dtype", message)


def require_shape(spec: DatasetSpec, place: DatasetPlace, dataset: h5py.Dataset | OutsideRows, path: str) -> None:
    """Refuse a rank, a fixed size or an empty image that the layout does not have."""
    shape: tuple[int, ...] | None = dataset.shape
    stored = place.stored_shape(spec)
    # Length 0 along time is a legal empty stream; rows or images without entries are not.
    if shape is None or len(shape) not in place.ranks_of(spec) or 0 in shape[1:]:
        fits = False
    elif place.columns:
        # A table (rank 2) or an image with channels has the axis of columns; a grey image counts as one entry.
        has_columns = len(shape) == 2 or len(shape) == len(stored)
        entries = shape[-1] if has_columns else 1
        fits = all(0 <= column < entries for column in place.columns)
    else:
        fits = all(isinstance(size, str) or size == length for size, length in zip(stored, shape, strict=True))
    if not fits:
        expected = " x ".join(str(size) for size in stored)
        raise RefusedError("wrong_shape", "wrong_shape", f"Expected {path} of shape {expected}, got {shape}")
