"""Names in a file that are nearly those of the layout: a key that was misspelt, or damaged."""

from difflib import get_close_matches
from itertools import chain
from typing import Final

import h5py

from fedora_qa.layout.canonical import BESIDE, DATASETS, METADATA_GROUPS, datasets_of
from fedora_qa.layout.external_files import ExternalFiles
from fedora_qa.layout.links import names_in

_LEAST_SIMILARITY: Final = 0.85
"""Of difflib's ratio, 2 M / T for M equal letters of T: a letter of a name of seven may differ, two of fourteen."""


def similar_path(file: h5py.File, path: str, external_files: ExternalFiles | None = None) -> str | None:
    """Return a path in the file that is nearly a missing one of the layout and that the layout lacks.

    Parameters
    ----------
    file
        The open file.
    path
        Canonical path of a dataset that the file does not hold.
    external_files
        Which other files it may read from.

    Returns
    -------
    path
        Where the first part of ``path`` that is missing has a name like it beside it; None: there is none.
    """
    parts = path.split("/")
    for depth, part in enumerate(parts):
        parent = "/".join(parts[:depth])
        names = names_in(file, parent or "/", external_files)
        if part not in names:
            unknown = sorted(set(names) - _known_names(parent))
            return next((f"{parent}/{name}" for name in get_close_matches(part, unknown, 1, _LEAST_SIMILARITY)), None)
    return None


def _known_names(parent: str) -> set[str]:
    """Return the names that the layout has in a group."""
    beginning = f"{parent}/" if parent else ""
    beside = (spec.key for stream in BESIDE for spec in datasets_of(stream))
    paths = chain(DATASETS, beside, METADATA_GROUPS)
    return {path.removeprefix(beginning).split("/")[0] for path in paths if path.startswith(beginning)}
