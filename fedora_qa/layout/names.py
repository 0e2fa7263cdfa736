"""Has a group a name that nobody gave it? Names carry no checksum, so that a damaged one only looks odd."""

import h5py

from fedora_qa.layout.elsewhere import Elsewhere
from fedora_qa.layout.links import MOST_NAMES, READ_ERRORS, RefusedError, find_object


def garbled_name(file: h5py.File, path: str, elsewhere: Elsewhere | None = None) -> str | None:
    """Return the first name of a group that is no printable text, made printable; None where all of them are.

    The first ``MOST_NAMES`` are looked at. A group that is not there, or cannot be listed, is for others to report.
    """
    try:
        group = find_object(file, path, elsewhere)
        return _garbled(group) if isinstance(group, h5py.Group) else None
    except (RefusedError, *READ_ERRORS):
        return None


def _garbled(group: h5py.Group) -> str | None:
    looked_at, garbled = 0, list[str]()

    def look(name: bytes) -> bool | None:
        nonlocal looked_at
        looked_at += 1
        # Bytes that are not UTF-8 decode to lone surrogates, which are not printable.
        if not name.decode("utf-8", "surrogateescape").isprintable():
            garbled.append(ascii(name)[2:-1])
        return True if garbled or looked_at == MOST_NAMES else None

    group.id.links.iterate(look)
    return garbled[0] if garbled else None
