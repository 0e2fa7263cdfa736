"""List the datasets of a file by a walk that ends, however deep, wide or circular the groups are."""

from dataclasses import dataclass
from typing import Final

import h5py

from fedora_qa.layout.links import READ_ERRORS

DEEPEST: Final = 32
"""Groups within groups; the canonical layout has three levels."""

MOST_OBJECTS: Final = 10_000
"""Links that are read. The canonical layout has some forty datasets."""


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
