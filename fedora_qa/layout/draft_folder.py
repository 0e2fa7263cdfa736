"""Draft a dialect for a folder: what each file is, is guessed as for datasets (``draft``)."""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from fedora_qa.errors import FedoraError
from fedora_qa.layout.dialect import FORMS
from fedora_qa.layout.draft import (
    Guess,
    camera_line,
    camera_lines,
    comment,
    draft_lines,
    guess_places,
    in_order,
    names_intrinsics,
    quoted,
    unit_of_timestamps,
)
from fedora_qa.layout.inventory import HEAD_ROWS, Fields, StoredObject, take_inventory
from fedora_qa.layout.metadata import PINHOLE
from fedora_qa.sources.arrays import arrays_of, npz_names
from fedora_qa.sources.images import images_of, numbers_of
from fedora_qa.sources.source import OutsideRows, SourceError
from fedora_qa.sources.text import document_value, number_table
from fedora_qa.storage.folder import list_files
from fedora_qa.storage.signature import require_signature

_MOST_SINGLE: Final = 4
"""Files of one ending in a folder that are files by themselves; more are rows of one dataset."""

_LEAST_TIME: Final = 1_000_000
"""Numbers in the names of images from which on they are times: a count of frames is lower."""

_MOST_FILES: Final = 200
"""Files that are opened for a draft; others of a folder are listed."""


def draft_folder(folder: Path, name: str) -> str:
    """Return the text of a dialect for a folder, with every guess and its reason, and what nothing was guessed for.

    Parameters
    ----------
    folder
        Of which the first rows, and the first images, are read.
    name
        Name of the dialect.

    Returns
    -------
    str
        TOML.
    """
    groups = _groups(folder)
    items: list[StoredObject] = []
    unread: list[str] = []
    for role, paths in list(groups.items())[:_MOST_FILES]:
        try:
            items += _inventory(folder, role, paths)
        except (SourceError, FedoraError, OSError) as error:
            unread.append(f"  {_pattern(folder, paths)}: {error}")
    # Of two views the rectified one: that of the sensor has a distortion.
    items.sort(key=lambda item: "rect" not in item.path.lower())
    guesses = {guess.key: guess for guess in guess_places(items)}
    # Timestamps in names of images override other guesses: a table of as many rows may belong to any stream.
    guesses |= {guess.key: guess for guess in tuple(_times_of_names(groups, guesses))}
    ordered = in_order(guesses)
    cameras = [*camera_lines(item for item in items if item.form == "hdf5"), *_document_cameras(groups)]
    used = list(dict.fromkeys(str(guess.fields["file"]) for guess in ordered))
    used += [role for role in groups if any(f'file = "{role}"' in line for line in cameras) and role not in used]
    # The first role identifies the dialect, and is that of a file that is given by itself: HDF5 where there is any.
    used.sort(key=lambda role: FORMS[groups[role][0].suffix.lower()] != "hdf5")
    lines = [
        "# A draft, guessed from names, shapes, types and first values. Verify every line before you use it:",
        "# a wrong unit here is a finding about the draft, not about the files. In [files], replace what differs from",
        "# sequence to sequence by *.",
        f"name = {quoted(name)}",
        'description = "drafted"',
        "",
        "[files]",
        *(f"{role} = {quoted(_pattern(folder, groups[role]))}" for role in used),
        "",
        *draft_lines(ordered, items),
    ]
    lines += ["# Not read:", *map(comment, unread)] if unread else []
    others = [
        role for role, paths in groups.items() if FORMS[paths[0].suffix.lower()] == "document" and role not in used
    ]
    lines += [
        comment(f"A document without a camera that is known: {_pattern(folder, groups[role])}") for role in others
    ]
    lines += ["", "[metadata]", *cameras] if cameras else []
    return "\n".join(lines).rstrip() + "\n"


def _groups(folder: Path) -> dict[str, list[Path]]:
    """Return the files by the role that a dialect would give them: images of one folder together, others alone."""
    together: dict[tuple[str, str], list[Path]] = {}
    for file in list_files(folder):
        suffix = Path(file.name).suffix.lower()
        if suffix in FORMS:
            together.setdefault((file.name.rpartition("/")[0], suffix), []).append(folder / file.name)
    groups: dict[str, list[Path]] = {}
    for (inside, suffix), paths in together.items():
        one_role = FORMS[suffix] == "images" or (suffix == ".npy" and len(paths) > _MOST_SINGLE)
        for members in [paths] if one_role else [[path] for path in paths]:
            stem = inside if one_role else f"{inside}/{members[0].stem}"
            role = re.sub(r"\W+", "_", stem, flags=re.ASCII).strip("_").lower() or FORMS[suffix]
            # Two files may differ in their endings alone.
            role = role if role not in groups else f"{role}_{suffix[1:]}"
            groups.setdefault(role, []).extend(members)
    return groups


def _pattern(folder: Path, paths: Iterable[Path]) -> str:
    first, *others = paths
    name = first.relative_to(folder)
    return (name.parent / f"*{first.suffix}").as_posix() if others else name.as_posix()


def _inventory(folder: Path, role: str, paths: list[Path]) -> Iterator[StoredObject]:
    """Yield what the files of a role hold, with first rows; raises ``SourceError``, ``FedoraError`` or ``OSError``."""
    form, pattern = FORMS[paths[0].suffix.lower()], _pattern(folder, paths)
    if form == "hdf5":
        require_signature(paths[0])
        with closing(h5py.File(paths[0], "r", locking="best-effort")) as file:
            for item in take_inventory(file):
                yield replace(item, role=role)
        return
    names = [path.name for path in paths]
    sources: list[tuple[str, OutsideRows | None]] = []
    if form == "images":
        sources = [("", images_of(paths[0].parent, names))]
    elif form == "text":
        sources = [("", number_table(paths[0]))]
    elif paths[0].suffix.lower() == ".npz":
        sources = [
            (member, arrays_of(paths[0].parent, names, member, is_joined=False)) for member in npz_names(paths[0])
        ]
    elif form == "array":
        sources = [("", arrays_of(paths[0].parent, names, "", is_joined=False))]
    for member, source in sources:
        if source is not None and source.shape and 0 not in source.shape:
            rows = 1 if len(source.shape) > 2 else min(HEAD_ROWS, source.shape[0])
            path = f"{pattern}/{member}" if member else pattern
            tail = source.rows(source.shape[0] - 1, source.shape[0])[0] if len(source.shape) < 3 else None
            yield StoredObject(path, source.shape, source.dtype, source.rows(0, rows), role, form, member, tail=tail)


def _times_of_names(groups: Mapping[str, list[Path]], guesses: Mapping[str, Guess]) -> Iterator[Guess]:
    """Guess that large numbers in the names of images are their timestamps."""
    for key in ("path/rgb", "path/depth"):
        guess = guesses.get(key)
        paths = groups.get(str(guess.fields.get("file", ""))) if guess else None
        numbers = numbers_of(paths[0].parent, [path.name for path in paths]) if paths and len(paths) > 1 else None
        if guess is None or numbers is None:
            continue
        head = numbers.rows(0, min(HEAD_ROWS, len(numbers.numbers))).astype(np.float64)
        if head[-1] >= _LEAST_TIME or numbers.dtype.kind == "f":
            unit, why = unit_of_timestamps(head, "frames")
            fields: Fields = {"file": guess.fields["file"], "time_unit": unit}
            yield Guess(f"{key}_ts", fields, f"the numbers in their names; {why}")


def _document_cameras(groups: Mapping[str, list[Path]]) -> list[str]:
    """Return the lines of cameras in documents: lists of four numbers, or 3 x 3 matrices, of telling names."""
    lines: list[str] = []
    for role, paths in groups.items():
        if FORMS[paths[0].suffix.lower()] != "document":
            continue
        with suppress(SourceError, OSError):
            for keys, value in _leaves(document_value(paths[0], "")):
                numbers = np.asarray(value, np.float64)
                is_list = numbers.shape == (len(PINHOLE),) and names_intrinsics(keys)
                if is_list or (numbers.shape == (3, 3) and numbers[2].tolist() == [0, 0, 1] and numbers[0, 0] > 1):
                    convert = ', convert = "fx_fy_cx_cy"' if is_list else ""
                    lines += camera_line(keys, f"file = {quoted(role)}, path = {quoted(keys)}{convert}")
    return lines


def _leaves(value: Any, keys: str = "") -> Iterator[tuple[str, Any]]:
    """Yield lists of numbers in a document, and intrinsics that have names, with the keys that lead to them."""
    if isinstance(value, dict):
        if all(isinstance(value.get(name), int | float) for name in PINHOLE):
            yield keys, [value[name] for name in PINHOLE]
        for key, below in value.items():
            yield from _leaves(below, f"{keys}/{key}" if keys else str(key))
    elif isinstance(value, list) and value:
        with suppress(ValueError, TypeError):
            if np.asarray(value).dtype.kind in "iuf":
                yield keys, value
                return
        for number, below in enumerate(value):
            yield from _leaves(below, f"{keys}/{number}")
