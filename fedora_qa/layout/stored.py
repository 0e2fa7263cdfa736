"""How a dataset is stored, and what turns what is stored into canonical rows."""

import h5py

from fedora_qa.layout.binding import Binding, rows_together
from fedora_qa.layout.canonical import DatasetSpec
from fedora_qa.layout.dialect import NS_PER_TIME_UNIT, QUATERNION_COLUMNS, DatasetPlace, scale_of


def as_stored(spec: DatasetSpec, place: DatasetPlace, dataset: h5py.Dataset, path: str) -> Binding:
    """Return the binding of a dataset that was found at a path, where its dialect places it."""
    return Binding(
        key=spec.key,
        path=path,
        rows=dataset.shape[0],
        shape=dataset.shape,
        dtype=dataset.dtype,
        columns=place.columns or _quaternion_columns(spec, place),
        ns_per_unit=NS_PER_TIME_UNIT[place.time_unit] if spec.is_timestamps else None,
        scale=scale_of(spec.key, place),
        polarity=place.polarity,
        # 0 for contiguous storage: ``Sequence.chunk_rows`` then chooses blocks of about a megabyte.
        chunk_rows=rows_together(spec.key, dataset.chunks[0]) if dataset.chunks else 0,
        stored_chunk=dataset.chunks or (),
    )


def _quaternion_columns(spec: DatasetSpec, place: DatasetPlace) -> tuple[int, ...] | None:
    if spec.key != "path/pose/orientation" or place.quaternion == "xyzw":
        return None
    return QUATERNION_COLUMNS[place.quaternion]
