"""Find an object by its path, and refuse whatever would read another file that may not be read.

HDF5 can point out of a file in four ways: external links, soft links that lead through them, virtual datasets and
external storage. A file of unknown origin must not decide which other files are read.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Final

import h5py
from h5py import _objects, h5d, h5g, h5i, h5l, h5o

if TYPE_CHECKING:
    from fedora_qa.layout.external_files import ExternalFiles

READ_ERRORS: Final = (OSError, RuntimeError, KeyError, ValueError, TypeError, OverflowError, MemoryError)
"""What h5py raises where stored bytes are damaged, a filter is missing, or a size is absurd."""

MAX_LINKS: Final = 16
"""Soft links followed in a row before they count as a loop."""

_SHORT_PATH: Final = 16
"""Names of a path; those of the canonical layout have at most four."""

MOST_NAMES: Final = 1000
"""Names of a group that are read one by one. The canonical layout has at most ten in a group."""

LONGEST_MESSAGE: Final = 500
"""Characters of a message: names and link targets of a file may have any length."""


class RefusedError(Exception):
    """A path that leads nowhere usable. Of a long message the middle is left out.

    Attributes
    ----------
    rule
        Short name of the rule that was broken.
    cause, magnitude
        Identifier of ``causes.py``, and the fault's size in its unit where it has one.
    """

    def __init__(self, rule: str, cause: str, message: str, magnitude: float | None = None) -> None:
        # The beginning names the path and the end the remedy, so that both are needed.
        half = LONGEST_MESSAGE // 2
        shortened = message if len(message) <= LONGEST_MESSAGE else f"{message[:half]} ... {message[-half:]}"
        super().__init__(shortened)
        self.rule = rule
        self.cause = cause
        self.magnitude = magnitude


def find_dataset(file: h5py.File, path: str, external_files: "ExternalFiles | None" = None) -> h5py.Dataset | None:
    """Return the dataset at a path, or None where there is nothing.

    Parameters
    ----------
    external_files
        Which other files may be read; None: no other.

    Raises
    ------
    RefusedError
        The path leads out of the file, dangles, ends at a group, or cannot be followed because bytes are damaged.
    """
    with reading(path):
        target = _follow(file, path, MAX_LINKS, external_files)
        if target is None:
            return None
        if not isinstance(target, h5py.Dataset):
            message = f"Expected a dataset at {path}, got a group or named type"
            raise RefusedError("not_a_dataset", "wrong_shape", message)
        outside = target.is_virtual or target.external
        if outside and external_files is not None:
            external_files.require_sources(target, path)
        elif outside:
            message = (
                f"Expected the values of {path} in this file, got a virtual or externally stored dataset; copy them"
            )
            raise RefusedError("outside_link", "missing_stream", message)
        return target


@contextmanager
def reading(path: str) -> Iterator[None]:
    """Turn what h5py raises over damaged bytes into a ``RefusedError`` that names the path."""
    try:
        yield
    except READ_ERRORS as error:
        raise RefusedError("unreadable", "corrupt_chunk", f"Expected {path} to be readable, got: {error}") from error


def has_group(file: h5py.File, path: str, external_files: "ExternalFiles | None" = None) -> bool:
    """Whether a group lies at the path, inside this file or where else may be read."""
    try:
        return isinstance(find_object(file, path, external_files), h5py.Group)
    except RefusedError:
        return False


def find_object(
    file: h5py.File, path: str, external_files: "ExternalFiles | None" = None
) -> h5py.Group | h5py.Dataset | h5py.Datatype | None:
    """Return the object at a path, following only links that stay where may be read; None where there is nothing.

    Raises
    ------
    RefusedError
        As for ``find_dataset``.
    """
    with reading(path):
        return _follow(file, path, MAX_LINKS, external_files)


def damaged_name(file: h5py.File, path: str, external_files: "ExternalFiles | None" = None) -> str | None:
    """Return a name in a group that is no printable text, escaped; None where the first ``MOST_NAMES`` are text.

    Names carry no checksum, so that damage to one shows only in its bytes. A group that is not there, or whose names
    cannot be read, gives None.
    """
    damaged: list[str] = []
    names_read = 0

    def stop_at_damage(name: bytes) -> bool | None:
        nonlocal names_read
        names_read += 1
        # Bytes that are not UTF-8 decode to lone surrogates, which are not printable.
        if not name.decode("utf-8", "surrogateescape").isprintable():
            damaged.append(ascii(name)[2:-1])
        # A value other than None ends the iteration of h5py.
        return True if damaged or names_read == MOST_NAMES else None

    with suppress(RefusedError, *READ_ERRORS):
        group = find_object(file, path, external_files)
        if isinstance(group, h5py.Group):
            group.id.links.iterate(stop_at_damage)
    return damaged[0] if damaged else None


def names_in(file: h5py.File, path: str, external_files: "ExternalFiles | None" = None) -> tuple[str, ...]:
    """Return the first ``MOST_NAMES`` names in a group; none where it is not there, or cannot be read."""
    names: list[str] = []

    def keep(name: bytes) -> bool | None:
        names.append(name.decode("utf-8", "surrogateescape"))
        # A value other than None ends the iteration of h5py.
        return True if len(names) == MOST_NAMES else None

    with suppress(RefusedError, *READ_ERRORS):
        group = find_object(file, path, external_files)
        if isinstance(group, h5py.Group):
            group.id.links.iterate(keep)
    return tuple(names)


def _follow(
    file: h5py.File, path: str, links_left: int, external_files: "ExternalFiles | None"
) -> h5py.Group | h5py.Dataset | h5py.Datatype | None:
    root = h5g.open(file.id, b"/")
    parts = [part for part in path.split("/") if part not in {"", "."}]
    # HDF5 follows a path of hard links by itself, in one call: most paths are such, and a file has about a hundred.
    # Each prefix is walked from the root, n^2 / 2 steps in all, so that long paths are followed step by step.
    target: _objects.ObjectID | None = None
    if len(parts) <= _SHORT_PATH:
        with suppress(*READ_ERRORS):  # ``_step_by_step`` reports what is wrong, and where
            way = b""
            for part in parts:
                way += part.encode("utf-8", "surrogateescape")
                # Each prefix is tested: a link in the middle would lead HDF5 out of the file unchecked.
                if root.links.get_info(way).type != h5l.TYPE_HARD:
                    break
                way += b"/"
            else:
                target = h5o.open(root, way) if way else root
    if target is None:
        return _step_by_step(file, root, parts, links_left, external_files)
    return _object(file, target)


def _step_by_step(
    file: h5py.File, root: h5g.GroupID, parts: list[str], links_left: int, external_files: "ExternalFiles | None"
) -> h5py.Group | h5py.Dataset | h5py.Datatype | None:
    here, path = root, "/".join(parts)
    for depth, part in enumerate(parts):
        if not isinstance(here, h5g.GroupID):
            return None
        name = part.encode("utf-8", "surrogateescape")
        if not here.links.exists(name):
            # ``exists`` searches the index of the group: where that is damaged, a stream would count as absent.
            if _lists(here, name):
                message = f"Expected {path} where its group lists it, got nothing there: the group's index is damaged"
                raise RefusedError("unreadable", "corrupt_chunk", message)
            return None
        kind = here.links.get_info(name).type
        if kind == h5l.TYPE_EXTERNAL:
            filename, target = (stored.decode("utf-8", "surrogateescape") for stored in here.links.get_val(name))
            if external_files is None:
                raise RefusedError("outside_link", "missing_stream", f"Expected {path} in this file, got a link to "
                                   f"{filename}; copy the data into the file")  # fmt: skip
            rest = "/".join([target, *parts[depth + 1 :]])
            # The count bounds the recursion: two files may link to each other.
            other = external_files.named(file, filename, path) if links_left else None
            located = _follow(other, rest, links_left - 1, external_files) if other else None
            if located is None:
                raise RefusedError("dangling_link", "missing_stream", f"Expected data at {path}, got a link to "
                                   f"{target} in {filename}, where there is nothing")  # fmt: skip
            return located
        if kind == h5l.TYPE_SOFT:
            link = here.links.get_val(name).decode("utf-8", "surrogateescape")
            above = (h5i.get_name(here) or b"").decode("utf-8", "surrogateescape")
            # A relative soft link starts at the group that holds it.
            target = link if link.startswith("/") else "/".join([above, link])
            rest = "/".join([target, *parts[depth + 1 :]])
            located = _follow(file, rest, links_left - 1, external_files) if links_left else None
            if located is None:
                raise RefusedError("dangling_link", "missing_stream", f"Expected data at {path}, got a link to "
                                   f"{link}, where there is nothing")  # fmt: skip
            return located
        here = h5o.open(here, name)
    return _object(file, here)


def _object(file: h5py.File, identifier: _objects.ObjectID) -> h5py.Group | h5py.Dataset | h5py.Datatype:
    if isinstance(identifier, h5g.GroupID):
        return h5py.Group(identifier)
    if isinstance(identifier, h5d.DatasetID):
        return h5py.Dataset(identifier, readonly=file.mode == "r")
    return h5py.Datatype(identifier)


def _lists(group: h5g.GroupID, wanted: bytes) -> bool:
    """Whether a name is among the first ``MOST_NAMES`` of a group, read one by one and not by the group's index."""
    names: list[bytes] = []

    def stop_at_name(listed: bytes) -> bool | None:
        names.append(listed)
        return True if listed == wanted or len(names) == MOST_NAMES else None

    group.links.iterate(stop_at_name)
    return names[-1:] == [wanted]
