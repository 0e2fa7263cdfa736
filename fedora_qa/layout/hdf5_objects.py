"""Objects of an HDF5 file: by path, by a walk, with attributes; no other file is read unless allowed.

HDF5 can point out of a file in four ways: external links, soft links that lead through them, virtual datasets and
external storage. A file of unknown origin must not decide which other files are read. A walk ends however deep, wide or
circular the groups are, and an attribute is read only if it is of a plain type.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from math import prod
from typing import TYPE_CHECKING, Any, Final

import h5py
import numpy as np
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

DEEPEST: Final = 32
"""Groups within groups; the canonical layout has three levels."""

MOST_OBJECTS: Final = 10_000
"""Links that are read. The canonical layout has some forty datasets."""

_LARGEST_ATTRIBUTE_BYTES: Final = 16 << 20
"""Largest attribute: a list of a million hot pixels. A damaged or hostile header can state any size."""

_LONGEST_TEXT: Final = 4096
"""Largest number of characters: a text of the layout is a word or a line."""


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


@dataclass(frozen=True, slots=True)
class Walk:
    """Paths of the datasets; ``unseen`` describes what the walk left out, and is empty where that is nothing."""

    paths: tuple[str, ...]
    unseen: tuple[str, ...]


def walk(file: h5py.File) -> Walk:
    """Return the paths of all datasets that hard links lead to, each once, in the order of their names.

    Names that cannot be printed are left out: neither a terminal nor a dialect should hold them. Objects deeper than
    ``DEEPEST`` or beyond ``MOST_OBJECTS`` are left out too.
    """
    paths: list[str] = []
    unprintable = damaged = too_deep = 0
    links = _Links()
    visited: set[tuple[int, int]] = set()
    waiting: list[tuple[str, int, h5py.h5g.GroupID, bytes]] = [("", 0, file.id, b"/")]
    while waiting:
        path, depth, parent, name = waiting.pop()
        try:
            member = h5py.h5o.open(parent, name)
            about = h5py.h5o.get_info(member)
            # File number and address identify an object: hard links can form cycles.
            place = about.fileno, about.addr
            if place in visited:
                continue
            visited.add(place)
            if isinstance(member, h5py.h5d.DatasetID):
                paths.append(path)
            if not isinstance(member, h5py.h5g.GroupID):
                continue
            if depth == DEEPEST:
                too_deep += 1
                continue
            names = links.names(member)
        except READ_ERRORS:
            damaged += 1
            continue
        # Reversed because the stack is emptied from its end: paths then come in the order of names.
        for below in sorted(names, reverse=True):
            readable = below.decode("utf-8", "surrogateescape")
            if readable.isprintable():
                waiting.append((f"{path}/{readable}" if path else readable, depth + 1, member, below))
            else:
                unprintable += 1
    unseen = (
        f"{unprintable} objects whose names cannot be printed" if unprintable else "",
        f"{damaged} objects that cannot be opened" if damaged else "",
        f"{too_deep} groups deeper than {DEEPEST} levels" if too_deep else "",
        f"what follows the first {MOST_OBJECTS} objects" if links.ended else "",
    )
    return Walk(tuple(paths), tuple(description for description in unseen if description))


class _Links:
    """Lists hard links group by group, until ``MOST_OBJECTS`` have been read."""

    def __init__(self) -> None:
        self.count = 0
        self.ended = False

    def names(self, group: h5py.h5g.GroupID) -> list[bytes]:
        """Return the names of a group's hard links."""
        members: list[bytes] = []

        def add_member(name: bytes, about: h5py.h5l.LinkInfo) -> bool | None:
            if self.count == MOST_OBJECTS:
                # A value other than None ends the iteration of h5py.
                self.ended = True
                return True
            self.count += 1
            # Soft and external links may dangle or leave the file.
            if about.type == h5py.h5l.TYPE_HARD:
                members.append(name)
            return None

        group.links.iterate(add_member, info=True)
        return members


def stored_attribute(holder: h5py.Group | h5py.Dataset, name: str) -> Any:
    """Return the value of an attribute, numbers or text, or None where there is none.

    Ragged arrays, references and compounds are never read. No attribute of the layout has such a type; where damage
    turns text into such a type, HDF5 follows its addresses out of the process's memory. A list of texts is never read
    either: it can refer to the same megabyte a million times.

    Raises
    ------
    ValueError
        The attribute is of such a type, or damaged.
    """
    try:
        attributes = holder.attrs
        if name not in attributes:
            return None
        attribute = attributes.get_id(name)
        dtype, shape = attribute.dtype, attribute.shape
        values = prod(shape or ())
        is_text = h5py.check_string_dtype(dtype) is not None
        # Kinds O and V of NumPy: ragged arrays, references and compounds.
        if dtype.kind in "OV" and not is_text:
            raise ValueError(f"a type that is neither numbers nor text ({dtype})")
        if is_text and values > 1:
            raise ValueError(f"{values} texts where one is expected")
        if values * dtype.itemsize > _LARGEST_ATTRIBUTE_BYTES:
            raise ValueError(f"{values * dtype.itemsize} bytes, more than the {_LARGEST_ATTRIBUTE_BYTES} that are read")
        if dtype.kind in "iuf" and shape is not None:
            numbers = np.empty(shape, dtype)
            attribute.read(numbers)
            return numbers[()]
        value = attributes[name]
        # The item size of text of variable length is that of a pointer, so that the bound on bytes does not apply.
        if isinstance(value, str | bytes) and len(value) > _LONGEST_TEXT:
            raise ValueError(f"a text of {len(value)} characters, more than the {_LONGEST_TEXT} that are read")
        return value
    except READ_ERRORS as error:
        raise ValueError(str(error)) from error


def text_attribute(holder: h5py.Group | h5py.Dataset, name: str) -> str | None:
    """Return an attribute that is text; None where there is none, or it is something else, or damaged."""
    try:
        stored = stored_attribute(holder, name)
    except ValueError:
        return None
    if isinstance(stored, bytes):
        return stored.decode("utf-8", "replace")
    return str(stored) if isinstance(stored, str) else None
