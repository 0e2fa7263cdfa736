"""List the objects below a prefix of an object store. No object is opened."""

from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any, Final

from fedora_qa.errors import MisuseError
from fedora_qa.storage.place import RemoteFile
from fedora_qa.storage.server import file_system, repeated

MOST_OBJECTS: Final = 200_000
"""Objects below one prefix, as files below one folder."""

_PARTS_OF_URLS: Final = frozenset("?#")


@dataclass(frozen=True, slots=True)
class RemoteObject:
    """An object below a prefix; ``name`` is relative to it, with slashes."""

    name: str
    place: RemoteFile
    size: int


def list_objects(prefix: RemoteFile) -> tuple[RemoteObject, ...]:
    """Return the objects below a prefix, in the order of their names; hidden ones are left out, as of a folder.

    Raises
    ------
    MisuseError
        There are more than ``MOST_OBJECTS``, or an object whose name is no part of a URL.
    StorageError
        The store cannot be listed; the message states why.
    """
    files = file_system(prefix)
    listed: dict[str, dict[str, Any]] = repeated(lambda: files.find(prefix.url, detail=True), prefix)
    if len(listed) > MOST_OBJECTS:
        raise MisuseError(f"Expected {MOST_OBJECTS} objects at most below {prefix}, got {len(listed)}")
    root = prefix.url.removeprefix("s3://")
    objects = []
    for path, facts in sorted(listed.items()):
        name = path.removeprefix(root)
        parts = PurePosixPath(name).parts
        if not parts or any(part.startswith(".") for part in parts) or not name.isprintable():
            continue
        if _PARTS_OF_URLS & set(name):
            raise MisuseError(
                f"Expected names without ? and # below {prefix}, got {name!r}; name the objects one by one"
            )
        objects.append(RemoteObject(name, RemoteFile(f"{prefix.url}{name}"), int(facts.get("size") or 0)))
    return tuple(objects)
