"""The contents of a sequence that rules of a release compare: streams, cameras, and digests of the data."""

import hashlib
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US
from fedora_qa.engine.executors.executor import Executor, Task, Worker, opening_test
from fedora_qa.engine.progress import quiet
from fedora_qa.errors import UnreadableFileError, UnreadableRowsError, WorkerLostError
from fedora_qa.gating.policy import Policy, each_stream
from fedora_qa.gating.release import Release
from fedora_qa.layout.canonical import datasets_of, timestamps_of
from fedora_qa.layout.dialect import DialectChoice, load_choice
from fedora_qa.record.types import FileRecord, Result
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.sequence import Sequence, open_sequence
from fedora_qa.storage.place import Place

_SAME_SEQUENCE_STREAMS: Final = ("rgb", "depth", "events", "imu", "pose")
"""Streams by which files of one declared sequence are compared; flow follows from depth and pose."""

_SPLIT_STREAMS: Final = ("rgb", "depth", "events", "imu", "pose", "flow")
"""Streams that no two splits may share."""

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
        When each distinct pose first occurs, us on the file's clock, by its digest: to find segments of one flight in
        two files. NaN where the timestamps cannot be read.
    sequence, world, illumination
        Names of the sequence, of its world and of the light, as declared; empty where they are not.
    """

    streams: frozenset[str]
    absent: Mapping[str, str]
    cameras: Mapping[str, Camera]
    digests: Mapping[str, str]
    poses: Mapping[bytes, float]
    sequence: str = ""
    world: str = ""
    illumination: str = ""


def read_contents(
    path: Place,
    dialect: DialectChoice,
    streams: Iterable[str],
    poses: bool,
    allow_external: Iterable[Path],
    _: Worker,
) -> Contents | None:
    """Return the contents of a sequence; None where it cannot be opened, which its record states.

    Parameters
    ----------
    streams
        The streams whose content is to be digested; ``flow`` is every rate of the sequence.
    poses
        Whether to read the poses.
    """
    try:
        sequence = open_sequence(path, dialect, allow_external=allow_external)
    except UnreadableFileError:
        return None
    with sequence:
        looked_for = {*sequence.layout.streams, *sequence.layout.absent}
        digests = {stream: _stream_digest(sequence, stream) for stream in each_stream(streams, looked_for)}
        first_us: dict[bytes, float] = {}
        if poses and "pose" in sequence.layout.streams:
            rows = sequence.layout.bindings["path/pose/position"].rows
            with suppress(UnreadableRowsError):
                positions_world_m = sequence.rows("path/pose/position", 0, rows)
                orientations_xyzw = sequence.rows("path/pose/orientation", 0, rows)
                poses_in_rows = np.hstack([positions_world_m, orientations_xyzw])
                distinct, first_rows = np.unique(poses_in_rows, axis=0, return_index=True)
                times_us = np.full(rows, np.nan)
                with suppress(UnreadableRowsError):
                    times_ns = sequence.rows(timestamps_of("pose"), 0, rows)
                    times_us = (sequence.origin_ns + times_ns) / NS_PER_US
                # 16 bytes a pose: enough that two poses do not share a digest by chance.
                digests_of_poses = (hashlib.sha256(pose.tobytes()).digest()[:16] for pose in distinct)
                first_us = dict(zip(digests_of_poses, times_us[first_rows].tolist(), strict=True))
        return Contents(
            streams=sequence.layout.streams,
            absent=sequence.layout.absent,
            cameras=sequence.declared.cameras,
            digests={stream: digest for stream, digest in digests.items() if digest},
            poses=first_us,
            sequence=sequence.declared.sequence,
            world=sequence.declared.world,
            illumination=sequence.declared.illumination,
        )


def _stream_digest(sequence: Sequence, stream: str) -> str | None:
    """Return a digest of a stream's values without its timestamps, which sequences of one rate may share.

    None where the stream is absent, cannot be decoded, or never changes: grey walls are equal in all sequences.
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
            # Blocks evenly spread over the rows: chunks of the canonical layout, however the file is stored.
            rows = sequence.layout.bindings[spec.key].rows
            count = -(-rows // spec.chunk_rows)
            first: NDArray[Any] | None = None
            for number in np.unique(np.linspace(0, max(count - 1, 0), _BLOCKS).astype(int)).tolist():
                start = number * spec.chunk_rows
                block = sequence.rows(spec.key, start, min(start + spec.chunk_rows, rows))
                first = block[:1] if first is None else first
                # As bytes, because NaN, which marks invalid depth, is not equal to itself.
                changes = changes or block.tobytes() != np.broadcast_to(first, block.shape).tobytes()
                digest.update(np.ascontiguousarray(block).tobytes())
    except UnreadableRowsError:
        return None
    return digest.hexdigest() if changes else None


def contents_of(
    policy: Policy, release: Release, files: Iterable[FileRecord], executor: Executor
) -> tuple[dict[str, Contents], list[FileRecord]]:
    """Read the contents that the policy needs of each sequence, in the executor's processes.

    Parameters
    ----------
    files
        The records of the sequences, in the release's order.

    Returns
    -------
    The contents of each sequence that can be opened, by name; and the records of all. A record is incomplete where the
    process that read the file has died. Files whose checks all crashed are not opened again.
    """
    needs = policy.required_streams, policy.same_intrinsics, policy.distinct_streams, policy.splits
    if policy.same_sequence and not any(needs):
        return {}, list(files)
    dialect = load_choice(policy.check.dialect, policy.check.metadata)
    names = (
        *policy.distinct_streams,
        *(_SPLIT_STREAMS if policy.splits else ()),
        *(() if policy.same_sequence else _SAME_SEQUENCE_STREAMS),
    )
    streams = tuple(dict.fromkeys(names))
    folders = tuple(map(Path, policy.check.allow_external))
    contents_by_name, records_read = dict[str, Contents](), list[FileRecord]()
    for sequence, file in zip(release.sequences, files, strict=True):
        # A file whose checks all crashed would probably end the next process that opens it as well.
        died = file.results and all(result.outcome == "crashed" for result in file.results)
        task = Task(read_contents, (sequence.path, dialect, streams, bool(policy.splits), folders))
        opening = opening_test(sequence.path, dialect, folders)
        contents = None
        try:
            if opening and not died:
                executor.submit(opening, quiet).result()
            if not died:
                contents = executor.submit(task, quiet).result()
        except WorkerLostError as lost:
            crash = Result(
                "release.contents",
                "crashed",
                "Can be read what the rules of the release need?",
                reason=f"the process that read the file has died: {lost}",
            )
            records_read.append(replace(file, verdict="incomplete", results=(*file.results, crash)))
            continue
        records_read.append(file)
        if contents:
            contents_by_name[sequence.name] = contents
    return contents_by_name, records_read
