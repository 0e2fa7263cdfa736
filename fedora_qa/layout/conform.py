"""Hold one stored dataset to its description: type, rank, shape."""

import h5py
import numpy as np

from fedora_qa.layout.canonical import DatasetSpec
from fedora_qa.layout.dialect import DatasetPlace
from fedora_qa.layout.links import RefusedError


def legal_ranks(spec: DatasetSpec, place: DatasetPlace) -> tuple[int, ...]:
    """Return the ranks that the stored dataset may have.

    Columns are picked from a last axis that a canonical dataset of rank 1 does not have, and that a grey image lacks.
    """
    rank = len(spec.shape)
    if not place.columns:
        return (rank,)
    return (2,) if rank == 1 else (rank, rank - 1)


def require_readable_type(spec: DatasetSpec, dataset: h5py.Dataset, path: str) -> None:
    """Refuse what no safe conversion exists for: what is not numbers at all, and colours that are not 8-bit codes."""
    # At most 8 bytes: an extended float does not fit float64 without loss.
    numeric = dataset.dtype.kind in "iufb" and dataset.dtype.subdtype is None and dataset.dtype.itemsize <= 8
    if not numeric or (spec.key == "path/rgb" and dataset.dtype != np.uint8):
        message = f"Expected {path} as {spec.dtype}, got {dataset.dtype}, which cannot be converted safely"
        raise RefusedError("wrong_dtype", "wrong_dtype", message)


def require_shape(spec: DatasetSpec, place: DatasetPlace, dataset: h5py.Dataset, path: str) -> None:
    """Refuse a rank, a fixed size or an empty image that the layout does not have."""
    shape: tuple[int, ...] | None = dataset.shape
    # Length 0 along time is a legal empty stream; rows or images without entries are not.
    if shape is None or len(shape) not in legal_ranks(spec, place) or 0 in shape[1:]:
        fits = False
    elif place.columns:
        # A table (rank 2) or an image with channels has the axis of columns; a grey image counts as one entry.
        has_columns = len(shape) == 2 or len(shape) == len(spec.shape)
        entries = shape[-1] if has_columns else 1
        fits = all(0 <= column < entries for column in place.columns)
    else:
        fits = all(isinstance(size, str) or size == stored for size, stored in zip(spec.shape, shape, strict=True))
    if not fits:
        expected = " x ".join(str(size) for size in spec.shape)
        raise RefusedError("wrong_shape", "wrong_shape", f"Expected {path} of shape {expected}, got {shape}")
