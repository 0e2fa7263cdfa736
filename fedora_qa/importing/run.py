"""Import a recording: recognise its format by the first bytes, decode and write it."""

import json
import re
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from shlex import quote
from typing import Any, Final, Literal

import h5py

from fedora_qa import __version__
from fedora_qa.engine.progress import Progress
from fedora_qa.errors import MisuseError
from fedora_qa.importing.aedat4 import MAGIC as AEDAT4_MAGIC
from fedora_qa.importing.aedat4 import open_aedat4
from fedora_qa.importing.prophesee import open_prophesee
from fedora_qa.importing.recording import Kind, Recording, Resolution
from fedora_qa.importing.ros1_bag import MAGIC as ROS1_MAGIC
from fedora_qa.importing.ros_bag import TopicMap, open_bag
from fedora_qa.importing.sequence_writer import SequenceWriter, present_streams
from fedora_qa.layout.create import DeferredErrorFile
from fedora_qa.layout.direct_chunks import ChunkWriter
from fedora_qa.storage.digest import Digest, file_digest
from fedora_qa.storage.folder import local_version
from fedora_qa.storage.signature import other_format

RecordingForm = Literal["prophesee", "aedat4", "bag"]

_READABLE: Final = "a recording (Prophesee EVT2, EVT3 or DAT, AEDAT 4.0, or a ROS bag)"
"""What can be brought in, in words."""

_MCAP_MAGIC: Final = b"\x89MCAP0\r\n"
_SQLITE_MAGIC: Final = b"SQLite format 3\0"

_BEGINNINGS: Final[tuple[tuple[bytes, RecordingForm], ...]] = (
    (b"% ", "prophesee"),
    (AEDAT4_MAGIC, "aedat4"),
    (ROS1_MAGIC, "bag"),
    (_MCAP_MAGIC, "bag"),
    (_SQLITE_MAGIC, "bag"),
)

_BAG_METADATA: Final = "metadata.yaml"
"""File that makes a folder a bag of ROS 2."""

_BAG_ENDINGS: Final = {ROS1_MAGIC: ".bag", _MCAP_MAGIC: ".mcap", _SQLITE_MAGIC: ".db3"}
"""The package ``rosbags`` chooses the format by the name."""

_START_BYTES: Final = 16
"""Bytes by which a form is recognised."""

PROVENANCE: Final = "provenance/import"
"""Text of an imported file: JSON with the source, its format, the tool and what was counted."""

_REPORTS: Final = 200
"""Reports of progress over a recording."""


@dataclass(frozen=True, slots=True)
class ImportOptions:
    """How a recording is read.

    Attributes
    ----------
    resolution
        Size of the event camera, where the recording does not state it, or states a wrong one.
    kind
        Whether sensors made the recording; None: as the format tells.
    topics
        Which topic of a bag holds which stream; None: the usual ones.
    allow_backwards
        Whether timestamps that decrease are written as they are.
    level
        Of compression: 1 is the fastest, 9 makes the smallest file.
    threads
        Number of threads that compress.
    """

    resolution: Resolution | None = None
    kind: Kind | None = None
    topics: TopicMap | None = None
    allow_backwards: bool = False
    level: int = 2
    threads: int = 1


@dataclass(frozen=True, slots=True)
class Imported:
    """What was written.

    Attributes
    ----------
    format
        Format of the recording, in words.
    rows
        Number of rows of each stream, in the order of the layout.
    facts
        Values of the header, and counts of what was left out.
    unread
        What else the recording holds that was not read, in sentences.
    """

    format: str
    rows: dict[str, int]
    facts: dict[str, str | int]
    unread: tuple[str, ...] = ()


def import_recording(source: Path, target: Path, options: ImportOptions, report: Progress) -> Imported:
    """Write a canonical file from a recording.

    Parameters
    ----------
    source
        The recording; only read.
    target
        A new file. Where an error is raised it is of no use, and the caller removes it.

    Raises
    ------
    MisuseError
        The recording cannot be read, or holds nothing that can be written.
    """
    version = local_version(source)
    with DeferredErrorFile(target, "the sequence") as file:
        with (
            h5py.File(file, "w") as sequence,
            _open_recording(source, options) as recording,
            ChunkWriter(options.threads) as chunks,
            ThreadPoolExecutor(1) as beside,
        ):
            digest = beside.submit(file_digest, source)
            writer = SequenceWriter(sequence, chunks, level=options.level, allow_backwards=options.allow_backwards)
            reported = 0
            for block in recording.blocks:
                writer.append(block)
                # A message of a bag may be one sample: each report of its own would cost more than the sample.
                if _REPORTS * (recording.done - reported) >= recording.size:
                    reported = recording.done
                    report("reading", recording.done, recording.size)
                if file.failure is not None:
                    break
            rows = {stream: writer.rows[stream] for stream in present_streams(writer.rows)}
            if not rows and file.failure is None:
                raise MisuseError(f"Expected events or other samples in {source}, got none; record or copy it again")
            kind = options.kind or recording.kind
            writer.finish(
                cameras=recording.cameras,
                root={
                    "sequence": source.stem,
                    "created_by": f"fedora-qa import {__version__}",
                    **({"kind": kind} if kind else {}),
                },
            )
            sequence[PROVENANCE] = json.dumps(_provenance(source.name, digest.result(), recording, rows), indent=1)
        file.raise_failure()
    if local_version(source) != version:
        raise MisuseError(f"Expected {source} to stay as it is, got a change meanwhile; import it again")
    return Imported(recording.format, rows, recording.facts, recording.unread)


def _open_recording(source: Path, options: ImportOptions) -> AbstractContextManager[Recording]:
    """Open a recording of any format; raises ``MisuseError`` where it cannot be read."""
    openers: Mapping[RecordingForm, Callable[[Path, Resolution | None], AbstractContextManager[Recording]]] = {
        "prophesee": open_prophesee,
        "aedat4": open_aedat4,
        "bag": partial(open_bag, topics=options.topics),
    }
    return openers[recognise(source)](source, options.resolution)


def _provenance(name: str, digest: Digest, recording: Recording, rows: dict[str, int]) -> dict[str, Any]:
    return {
        "tool": {"name": "fedora-qa", "version": __version__},
        "imported": datetime.now(UTC).isoformat(timespec="seconds"),
        "source": {
            "name": name,
            "format": recording.format,
            "size": digest.version.size,
            "sha256": digest.sha256,
            "digest": digest.kind,
        },
        "rows": rows,
        "facts": recording.facts,
        **({"unread": recording.unread} if recording.unread else {}),
    }


def recognise(path: Path) -> RecordingForm:
    """Return the form of a recording.

    Raises
    ------
    MisuseError
        There is no such file, it cannot be read, or it begins like no recording that can be brought in.
    """
    if not path.exists():
        raise MisuseError(f"Expected {_READABLE}, got a path that does not exist: {path}")
    if (path / _BAG_METADATA).is_file():
        return "bag"
    if not path.is_file():
        raise MisuseError(
            f"Expected {_READABLE}, got a folder without {_BAG_METADATA}, or a device: {path}; give the file"
        )
    try:
        with path.open("rb") as file:
            start = file.read(_START_BYTES)
    except OSError as error:
        raise MisuseError(f"Expected a readable file, got {error.strerror or error}: {path}") from error
    for beginning, form in _BEGINNINGS:
        if start.startswith(beginning):
            ending = _BAG_ENDINGS.get(beginning)
            if ending and path.suffix != ending:
                raise MisuseError(f"Expected a bag of this format to be named *{ending}, got {path}; rename it")
            return form
    if not start:
        raise MisuseError(f"Expected {_READABLE}, got an empty file: {path}; record or copy it again")
    if start.startswith(b"\x89HDF"):
        raise MisuseError(
            f"Expected {_READABLE}, got an HDF5 file: {path}; check it as it is, or draft a dialect with "
            f"fedora-qa layout {quote(str(path))} --draft-dialect mine.toml"
        )
    version = re.match(rb"#!AER-DAT([0-9.]+)", start)
    if version:
        raise MisuseError(
            f"Expected AEDAT 4.0, got AEDAT {version[1].decode()}: {path}; convert it to 4.0 with iniVation's software"
        )
    other, remedy = other_format(start)
    remedy = remedy or "; give the recording itself"
    raise MisuseError(f"Expected {_READABLE}, got {other} (by its first bytes): {path}{remedy}")
