"""Which datasets lie in a file? A walk that ends, however deep, wide or circular its groups are."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import h5py

from fedora_qa.layout.links import READ_ERRORS

DEEPEST: Final = 32
"""Groups within groups; the canonical layout has three levels."""

MOST_OBJECTS: Final = 10_000
"""Links that are looked at. The canonical layout has some forty datasets."""


@dataclass(frozen=True, slots=True)
class Walk:
    """The datasets that were found, and what was not looked at, in words; empty where all was."""

    paths: tuple[str, ...]
    unseen: tuple[str, ...]


@dataclass
class _MissingMember:
    """Counts of what a walk leaves out."""

    unprintable: int = 0
    damaged: int = 0
    too_deep: int = 0
    too_many: bool = False

    def words(self) -> Iterator[str]:
        if self.unprintable:
            yield f"{self.unprintable} objects whose names cannot be printed"
        if self.damaged:
            yield f"{self.damaged} objects that cannot be opened"
        if self.too_deep:
            yield f"{self.too_deep} groups deeper than {DEEPEST} levels"
        if self.too_many:
            yield f"what follows the first {MOST_OBJECTS} objects"


def walk(file: h5py.File) -> Walk:
    """Return the paths of all datasets that hard links lead to, each once, in the order of their names.

    Names that cannot be printed are left out: neither a terminal nor a dialect should hold them. So is what lies
    deeper than ``DEEPEST`` or beyond ``MOST_OBJECTS``.
    """
    paths: list[str] = []
    missed, links = _MissingMember(), _Links()
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
                missed.too_deep += 1
                continue
            names = links.names(member)
        except READ_ERRORS:
            missed.damaged += 1
            continue
        # Reversed because the stack is emptied from its end: paths then come in the order of names.
        for below in sorted(names, reverse=True):
            readable = below.decode("utf-8", "surrogateescape")
            if readable.isprintable():
                waiting.append((f"{path}/{readable}" if path else readable, depth + 1, member, below))
            else:
                missed.unprintable += 1
    missed.too_many = links.ended
    return Walk(tuple(paths), tuple(missed.words()))


class _Links:
    """Lists hard links group by group, until ``MOST_OBJECTS`` have been looked at."""

    def __init__(self) -> None:
        self.looked_at = 0
        self.ended = False

    def names(self, group: h5py.h5g.GroupID) -> list[bytes]:
        """Return the names of a group's hard links."""
        members: list[bytes] = []

        def note(name: bytes, about: h5py.h5l.LinkInfo) -> bool | None:
            if self.looked_at == MOST_OBJECTS:
                # A value other than None ends the iteration of h5py.
                self.ended = True
                return True
            self.looked_at += 1
            # Soft and external links may dangle or leave the file.
            if about.type == h5py.h5l.TYPE_HARD:
                members.append(name)
            return None

        group.links.iterate(note, info=True)
        return members
