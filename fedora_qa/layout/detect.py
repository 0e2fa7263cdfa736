"""Recognise the dialect of a file."""

import h5py

from fedora_qa.conventions import FORMAT_NAME
from fedora_qa.layout.canonical import DATASETS, spec_of
from fedora_qa.layout.dialect import DIALECT_NAMES, Dialect, load_dialect
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.links import READ_ERRORS, RefusedError, find_dataset
from fedora_qa.layout.stored_attribute import text_attribute

_KINDS = {"int": "iu", "float": "f"}


def declares_fedora(file: h5py.File) -> bool:
    """Whether the file declares that it follows the canonical layout."""
    return text_attribute(file, "format") == FORMAT_NAME


def detect_dialect(file: h5py.File, external_files: ExternalFiles | None = None) -> Dialect:
    """Return the dialect that the file declares, or else the one with most datasets in the file.

    Among equals the hints decide, then the order of ``DIALECT_NAMES``. A file without any of these datasets is read as
    canonical, and all of its streams are reported absent.
    """
    if declares_fedora(file):
        return load_dialect(FORMAT_NAME)
    dialects = [load_dialect(name) for name in DIALECT_NAMES]
    scores: list[tuple[int, bool]] = []
    for dialect in dialects:
        count, hinted = 0, False
        for spec in map(spec_of, dict.fromkeys((*DATASETS, *dialect.datasets))):
            place = dialect.place_of(spec.key)
            # Datasets in other files of the folder do not identify the dialect of this file.
            place = place if place is None or place.file == dialect.first_role else None
            dataset = None if place is None else _dataset(file, place.path or spec.key, external_files)
            # Rank only: a dataset of a wrong size still identifies its dialect, and the size is reported later.
            if place is not None and dataset is not None and len(dataset.shape) in place.ranks_of(spec):
                count += 1
        for hint in dialect.hints:
            dataset = _dataset(file, hint.path, external_files)
            if dataset is None or hint.rank not in {None, len(dataset.shape)}:
                continue
            hinted = hint.kind is None or dataset.dtype.kind in _KINDS[hint.kind]
            if hinted:
                break
        scores.append((count, hinted))
    # ``index`` returns the first of equals, so that the order of ``DIALECT_NAMES`` decides last.
    return dialects[scores.index(max(scores))]


def _dataset(file: h5py.File, path: str, external_files: ExternalFiles | None) -> h5py.Dataset | None:
    """Return the dataset at a path if it has a shape and a type that can be read."""
    try:
        dataset = find_dataset(file, path, external_files)
        legible = dataset is not None and dataset.shape is not None and dataset.dtype is not None
    except (RefusedError, *READ_ERRORS):
        return None
    return dataset if legible else None
