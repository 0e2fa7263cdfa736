"""What the rules of a release need of a sequence beyond its record: streams, cameras, and digests of its content."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableFileError, UnreadableRowsError
from fedora_qa.layout.canonical import DatasetSpec, datasets_of
from fedora_qa.layout.dialect import Dialect
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.sequence import Sequence, open_sequence

_BLOCKS: Final = 64
"""Blocks of a dataset that its digest is made of: all of IMU and pose at the paper's lengths, 64 frames of images."""


@dataclass(frozen=True, slots=True)
class Contents:
    """What one sequence holds.

    Attributes
    ----------
    absent
        Why a stream is not there, by stream.
    digests
        SHA-256 of a stream's content, by stream; streams that are absent, unreadable, or never change have none.
    poses
        Digests of the distinct poses, to find segments of one flight in two files.
    """

    streams: frozenset[str]
    absent: Mapping[str, str]
    cameras: Mapping[str, Camera]
    digests: Mapping[str, str]
    poses: frozenset[bytes]


def read_contents(
    path: Path,
    dialect: Dialect | None,
    streams: Iterable[str],
    *,
    poses: bool,
    allow_external: Iterable[Path] = (),
) -> Contents | None:
    """Return the contents of a sequence, or None where it cannot be opened, which its record says.

    Parameters
    ----------
    streams
        Those whose content is to be digested.
    poses
        Whether to read the poses.
    """
    try:
        sequence = open_sequence(path, dialect, allow_external=allow_external)
    except UnreadableFileError:
        return None
    with sequence:
        digests = {stream: _stream_digest(sequence, stream) for stream in streams}
        return Contents(
            streams=sequence.layout.streams,
            absent=sequence.layout.absent,
            cameras=sequence.declared.cameras,
            digests={stream: digest for stream, digest in digests.items() if digest},
            poses=_pose_digests(sequence) if poses else frozenset(),
        )


def _stream_digest(sequence: Sequence, stream: str) -> str | None:
    """Return a digest of a stream's values without its timestamps, which sequences of one rate may share.

    None where the stream is not there, cannot be decoded, or never changes: a grey wall is alike everywhere.
    """
    if stream not in sequence.layout.streams:
        return None
    digest, changes = hashlib.sha256(), False
    try:
        for spec in datasets_of(stream):
            if spec.is_timestamps:
                continue
            # Key and shape are digested too: the same bytes in another dataset or shape are other content.
            digest.update(f"{spec.key} {sequence.layout.bindings[spec.key].shape}".encode())
            first: NDArray[Any] | None = None
            for block in _blocks(sequence, spec):
                first = block[:1] if first is None else first
                # As bytes, because NaN, which marks invalid depth, is not equal to itself.
                changes = changes or block.tobytes() != np.broadcast_to(first, block.shape).tobytes()
                digest.update(np.ascontiguousarray(block).tobytes())
    except UnreadableRowsError:
        return None
    return digest.hexdigest() if changes else None


def _blocks(sequence: Sequence, spec: DatasetSpec) -> Iterator[NDArray[Any]]:
    """Yield blocks of a dataset, evenly spread: chunks of the canonical layout, however the file is stored."""
    rows = sequence.layout.bindings[spec.key].rows
    count = -(-rows // spec.chunk_rows)
    for number in np.unique(np.linspace(0, max(count - 1, 0), _BLOCKS).astype(int)).tolist():
        start = number * spec.chunk_rows
        yield sequence.rows(spec.key, start, min(start + spec.chunk_rows, rows))


def _pose_digests(sequence: Sequence) -> frozenset[bytes]:
    if "pose" not in sequence.layout.streams:
        return frozenset()
    rows = sequence.layout.bindings["path/pose/position"].rows
    try:
        positions_world_m = sequence.rows("path/pose/position", 0, rows)
        orientations_xyzw = sequence.rows("path/pose/orientation", 0, rows)
    except UnreadableRowsError:
        return frozenset()
    poses = np.unique(np.hstack([positions_world_m, orientations_xyzw]), axis=0)
    return frozenset(hashlib.sha256(pose.tobytes()).digest()[:16] for pose in poses)
