"""``manifest.json``: what a corpus holds, for studies of detection.

::

    {"corpus_version": 1,
     "made_with": {"generator", "scenes": {name: digest}, "size": [width, height], "duration_s", "quality"},
     "items": [item, ...],
     "skipped": [{"file", "reason"}, ...]}

An item has ``file`` (beneath the manifest's folder), ``scene``, ``seed``, ``base`` (the clean file it is a copy of,
null for a clean one), ``faults``, ``sha256`` and ``bytes``; ``observable`` (whether a good tool should detect the fault
where the sequence has texture and motion) and ``notes``; and its first fault once more as ``cause``, ``stream``,
``magnitude`` and ``unit``, all null for a clean file, for readers of one fault a file. Where sequences begin at
different times of their flight, ``start_s`` is that time.

Each of ``faults`` has ``cause``, ``stream``, ``magnitude`` (positive: timestamps too late, values too large; null
where the fault has no size), ``unit``, ``seed``, ``start_s`` and ``stop_s`` (half-open, seconds after the file's first
timestamp), ``region`` ([x0, y0, x1, y1], half-open, pixels of the stream's own image), and ``donor`` (the clean file
that the stream of another sequence comes from). What does not apply is null.

``skipped`` names the faults that the data could not hold, and why.
"""

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from fedora_generator.corpus.plan import PlannedFile
from fedora_generator.errors import OutputError

Item = dict[str, Any]

MANIFEST: Final = "manifest.json"
PROGRESS: Final = "progress.json"
"""A manifest of the files made so far, while a corpus is not complete."""

CORPUS_VERSION: Final = 1

_OF_ONE_FAULT: Final = ("cause", "stream", "magnitude", "unit")


def description_of(planned: PlannedFile) -> Item:
    """Return the manifest's item of a planned file, as far as the plan determines it: all but digest and bytes."""
    item: Item = json.loads(json.dumps(asdict(planned)))
    if planned.start_s is None:
        del item["start_s"]  # as in corpora whose sequences all begin where their scenes do
    for fault in item["faults"]:
        if fault["direction_deg"] is None:
            del fault["direction_deg"]  # as in corpora whose shifts all go to the right
    first = item["faults"][0] if item["faults"] else dict.fromkeys(_OF_ONE_FAULT)
    return item | {name: first[name] for name in _OF_ONE_FAULT}


def item_of(planned: PlannedFile, path: Path) -> Item:
    """Return the manifest's item of a complete file."""
    return description_of(planned) | {"sha256": digest_of(path), "bytes": path.stat().st_size}


def is_complete(planned: PlannedFile, path: Path, item: Item | None) -> bool:
    """Whether a file exists with the content that its item states, and the item is the planned one."""
    if item is None or not path.is_file() or path.stat().st_size != item.get("bytes"):
        return False
    return item == description_of(planned) | {"sha256": digest_of(path), "bytes": item["bytes"]}


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_listing(path: Path, made_with: Item, items: Iterable[Item], skipped: Iterable[Item]) -> None:
    """Write a manifest in one step; the same content gives the same bytes.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    content = {
        "corpus_version": CORPUS_VERSION,
        "made_with": made_with,
        "items": [*items],
        "skipped": [*skipped],
    }
    partial = path.with_name(f".{path.name}.partial")
    try:
        partial.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        partial.replace(path)
    except OSError as error:
        raise OutputError(f"Expected to be able to write {path}, got: {error}") from error
    finally:
        partial.unlink(missing_ok=True)


def read_listing(folder: Path) -> Item | None:
    """Return the manifest of a folder, or the progress of one that is not complete; None if it has neither."""
    for name in (MANIFEST, PROGRESS):
        try:
            listing = json.loads((folder / name).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue
        if isinstance(listing, dict) and listing.get("corpus_version") == CORPUS_VERSION:
            return listing
    return None
