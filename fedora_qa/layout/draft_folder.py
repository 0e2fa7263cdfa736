"""Draft a dialect for a folder: what each file is, is guessed as for datasets (``draft``)."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Final

import h5py
import numpy as np

from fedora_qa.conventions import NS_PER_S
from fedora_qa.errors import FedoraError
from fedora_qa.layout.array_forms import is_flow
from fedora_qa.layout.canonical import datasets_of, spec_of
from fedora_qa.layout.dialect import FORMS, NS_PER_TIME_UNIT
from fedora_qa.layout.draft_cameras import constant_cameras, document_cameras, image_sizes, lines_to_fill_in
from fedora_qa.layout.draft_lines import camera_lines, comment, draft_lines, in_order, quoted
from fedora_qa.layout.file_groups import MOST_SINGLE, FileGroup, by_form_of_name, file_groups, pattern_of
from fedora_qa.layout.guesses import Guess, guess_places, item_of, rate_of, span_of_events_ns, unit_of_timestamps
from fedora_qa.layout.inventory import HEAD_ROWS, Fields, StoredObject, take_inventory
from fedora_qa.sources.arrays import arrays_of, npz_names
from fedora_qa.sources.images import images_of, numbers_of
from fedora_qa.sources.source import OutsideRows, SourceError
from fedora_qa.sources.text import number_table
from fedora_qa.storage.folder import list_files
from fedora_qa.storage.signature import require_signature

_LEAST_TIME: Final = 1_000_000
"""Numbers in the names of images from which on they are times: a count of frames is lower."""

_MOST_FILES: Final = 200
"""Roles whose files are opened for a draft."""

_TIMED: Final = frozenset({"rgb", "depth", "pose", "imu"})
"""Streams that are placed although nothing states their times: a person can write them down."""

_ANGLES: Final = ("orient", "euler", "rpy", "attitude")
"""Words in the names of tables of three angles."""


def draft_folder(folder: Path, name: str) -> str:
    """Return the text of a dialect for a folder, with every guess and its reason, and what nothing was guessed for."""
    groups = file_groups(folder)
    items: list[StoredObject] = []
    unread: list[str] = []
    for group in list(groups.values())[:_MOST_FILES]:
        if group.form == "text" and len(group.paths) > 1:
            unread.append(f"  {group.pattern}: {len(group.paths)} tables, but a role has one file of text")
            continue
        try:
            items += _inventory(group, unread)
        except (SourceError, FedoraError, OSError) as error:
            unread.append(f"  {group.pattern}: {error}")
    if len(groups) > _MOST_FILES:
        unread.append(f"  {len(groups) - _MOST_FILES} more files, after the first {_MOST_FILES}")
    unread += _other_formats(folder)
    # Of two views the rectified one: that of the sensor has a distortion.
    items.sort(key=lambda item: "rect" not in item.path.lower())
    guesses = {guess.key: guess for guess in guess_places(items)}
    # Timestamps in names of images override other guesses: a table of as many rows may belong to any stream.
    guesses |= {guess.key: guess for guess in tuple(_times_of_names(groups, guesses))}
    guesses |= {guess.key: guess for guess in tuple(_flow_between_frames(items, guesses))}
    to_write = _times_to_write(items, guesses)
    guesses |= {guess.key: guess for guess in to_write}
    ordered = in_order(guesses)
    cameras = _each_key_once((*camera_lines(item for item in items if item.form == "hdf5"), *document_cameras(groups)))
    used = list(dict.fromkeys(str(guess.fields["file"]) for guess in ordered))
    used += [role for role in groups if any(f'file = "{role}"' in line for line in cameras) and role not in used]
    # The first role identifies the dialect, and is that of a file that is given by itself: HDF5 where there is any.
    used.sort(key=lambda role: (role not in groups, role not in groups or groups[role].form != "hdf5"))
    lines = [
        "# A draft, guessed from names, shapes, types and first values. Verify every line before you use it:",
        "# a wrong unit here is a finding about the draft, not about the files. In [files], replace what differs from",
        "# sequence to sequence by *.",
        f"name = {quoted(name)}",
        'description = "drafted"',
        "",
        "[files]",
        *(f"{role} = {quoted(groups[role].pattern)}" for role in used if role in groups),
        *_files_to_write([role for role in used if role not in groups], span_of_events_ns(items) / NS_PER_S),
        "",
        *draft_lines(ordered, items),
    ]
    lines += ["# Not read:", *map(comment, unread)] if unread else []
    lines += [
        comment(f"A document without a camera that is known: {group.pattern}")
        for role, group in groups.items()
        if group.form == "document" and role not in used
    ]
    lines += [*map(comment, _remarks(groups, items, guesses))]
    declared = [*cameras, *constant_cameras(items), *lines_to_fill_in(image_sizes(items, guesses), guesses, cameras)]
    lines += ["", "[metadata]", *declared] if declared else []
    return "\n".join(lines).rstrip() + "\n"


def _other_formats(folder: Path) -> list[str]:
    """Return the files whose names end in no format that is read, together where they end alike."""
    names: dict[str, list[str]] = {}
    for file in list_files(folder):
        suffix = Path(file.name).suffix
        if suffix.lower() not in FORMS:
            names.setdefault(suffix or file.name, []).append(file.name)
    return [
        f"  {alike[0] if len(alike) == 1 else f'*{suffix}, {len(alike)} files'}: a format that is not read"
        for suffix, alike in names.items()
    ]


def _each_key_once(lines: Sequence[str]) -> list[str]:
    """Return lines of declarations, of which those after the first of a key are remarks: TOML has each key once."""
    keys: set[str] = set()
    once: list[str] = []
    for line in lines:
        key = line.partition(" = ")[0]
        once.append(comment(line) if key in keys else line)
        keys |= set() if line.startswith("#") else {key}
    return once


def _inventory(group: FileGroup, unread: list[str]) -> Iterator[StoredObject]:
    """Yield what the files of a role hold, with first rows; raises ``SourceError``, ``FedoraError`` or ``OSError``.

    Arrays of an NPZ that cannot be read are added to ``unread``.
    """
    first, names = group.paths[0], [path.name for path in group.paths]
    if group.form == "hdf5":
        require_signature(first)
        with closing(h5py.File(first, "r", locking="best-effort")) as file:
            for item in take_inventory(file):
                yield replace(item, role=group.role)
        return
    sources: list[tuple[str, OutsideRows | None]] = []
    if group.form == "images":
        sources = [("", images_of(first.parent, names))]
    elif group.form == "text":
        sources = [("", number_table(first))]
    elif group.form == "array":
        for member in _patterns_of_members(npz_names(first)) if group.is_npz else [""]:
            try:
                is_joined = len(names) > 1 and _differ_in_length(group, member)
                sources.append((member, arrays_of(first.parent, names, member, is_joined=is_joined)))
            except (SourceError, OSError) as error:
                unread.append(f"  {group.pattern}{f'/{member}' if member else ''}: {error}")
    for member, source in sources:
        if source is not None and source.shape and 0 not in source.shape:
            rows = 1 if len(source.shape) > 2 else min(HEAD_ROWS, source.shape[0])
            path = f"{group.pattern}/{member}" if member else group.pattern
            tail = source.rows(source.shape[0] - 1, source.shape[0])[0] if len(source.shape) < 3 else None
            head = source.rows(0, rows)
            yield StoredObject(path, source.shape, source.dtype, head, group.role, group.form, member, tail=tail)


def _patterns_of_members(names: Sequence[str]) -> list[str]:
    """Return the names of arrays in NPZ, and one pattern for many that differ in their numbers alone."""
    patterns: list[str] = []
    for form_of_name, members in by_form_of_name(names).items():
        patterns += [pattern_of(form_of_name, members, names)] if len(members) > MOST_SINGLE else members
    return patterns


def _differ_in_length(group: FileGroup, member: str) -> bool:
    """Whether arrays of several files have unequal numbers of rows, as the events of each frame have."""
    some = {group.paths[at] for at in (0, len(group.paths) // 2, len(group.paths) - 1)}
    sources = [arrays_of(path.parent, [path.name], member, is_joined=False) for path in some]
    return len({source.shape[:1] for source in sources if source is not None}) > 1


def _flow_between_frames(items: Sequence[StoredObject], guesses: Mapping[str, Guess]) -> Iterator[Guess]:
    """Guess that fields of flow without intervals reach from each frame to the next, where their number fits."""
    if any(key.startswith("path/flow/") for key in guesses):
        return
    for item, key in product(filter(is_flow, items), ("path/rgb_ts", "path/depth_ts")):
        times = item_of(items, guesses, key)
        if times is not None and times.columns and times.shape[0] - item.shape[0] in {0, 1}:
            fields = guesses[key].fields
            head = times.columns[_column_of(fields)]
            rate = rate_of(float(np.median(np.diff(head))) * NS_PER_TIME_UNIT[str(fields["time_unit"])] / NS_PER_S)
            if rate:
                yield Guess(f"path/flow/{rate}hz", item.place, "two float components, as many as steps between frames")
                reason = f"no intervals are stated; those of {key} are assumed, from each frame to the next"
                yield Guess(f"path/flow/{rate}hz_ts", {**fields, "convert": "until_next"}, reason)
                return


def _column_of(fields: Fields) -> int:
    columns = fields.get("columns", [0])
    return columns[0] if isinstance(columns, list) and isinstance(columns[0], int) else 0


def _times_to_write(items: Sequence[StoredObject], guesses: Mapping[str, Guess]) -> list[Guess]:
    """Return places for the times of streams that have none: a file that is still to be written."""
    rows: dict[str, int] = {}
    for key in guesses:
        stream = spec_of(key).stream
        timestamps = next(spec.key for spec in datasets_of(stream) if spec.is_timestamps) if stream in _TIMED else key
        item = item_of(items, guesses, key)
        if timestamps not in guesses and item is not None:
            rows.setdefault(timestamps, item.shape[0])
    reason = "there are no times for it; it is read once the file is written"
    return [Guess(key, {"file": f"times_{count}", "time_unit": "us"}, reason) for key, count in rows.items()]


def _files_to_write(roles: Sequence[str], events_s: float) -> list[str]:
    """Return the lines of files with times that are still to be written, and how."""
    lasting = f" The events last {events_s:.4g} s." if events_s else ""
    lines: list[str] = []
    for role in roles:
        count = int(role.rpartition("_")[2])
        lines += [
            comment(f"There is no such file yet. Write {count} times in microseconds, one a line.{lasting}"),
            comment("At 20 Hz from 0 on, in the folder of the sequence:"),
            comment(f"  seq 0 50000 {50000 * (count - 1)} > {role}.txt"),
            f'{role} = "{role}.txt"',
        ]
    return lines


def _remarks(
    groups: Mapping[str, FileGroup], items: Sequence[StoredObject], guesses: Mapping[str, Guess]
) -> Iterator[str]:
    """Yield what is needed for data that look like a stream and have no place."""
    for item in items:
        rows = item.shape[0] if item.shape else 0
        if is_flow(item) and not any(key.startswith("path/flow/") for key in guesses):
            place = ", ".join(f"{name} = {quoted(str(value))}" for name, value in item.place.items())
            yield f"{item.path} looks like flow, whose intervals nobody states. Write {rows} lines, each with the times"
            yield "at which an interval begins and ends. Then add to [files], and to [datasets] with the rate as RATE:"
            if not any(guess.fields.get("file") == item.role for guess in guesses.values()):
                yield f"{item.role} = {quoted(groups[item.role].pattern)}"
            yield 'flow_times = "flow_times.txt"'
            yield f'"path/flow/RATEhz" = {{ {place} }}'
            yield '"path/flow/RATEhz_ts" = { file = "flow_times", time_unit = "us" }'
            yield from _strided_intervals(items, guesses, rows)
            for role in (f"times_{rows}", f"times_{rows + 1}"):
                if any(guess.fields.get("file") == role for guess in guesses.values()):
                    yield f"If they reach from each frame to the next, {role}.txt suffices:"
                    yield f'"path/flow/RATEhz_ts" = {{ file = "{role}", time_unit = "us", convert = "until_next" }}'
        is_table = item.shape[1:] == (3,) and item.dtype.kind == "f" and len(item.shape) == 2
        if is_table and any(word in item.name for word in _ANGLES) and "path/pose/orientation" not in guesses:
            yield f"{item.path} looks like three angles. Orientations are read as quaternions or matrices: write four"
            yield "columns x, y, z, w, as Rotation.from_euler('xyz', angles).as_quat() of SciPy returns them, in the"
            yield "order and unit of your angles. Then add, in [files] and in [datasets]:"
            yield 'orientation = "orientation_xyzw.txt"'
            yield '"path/pose/orientation" = { file = "orientation" }'


def _strided_intervals(items: Sequence[StoredObject], guesses: Mapping[str, Guess], rows: int) -> Iterator[str]:
    """Yield how intervals of several frames each are written, where the number of frames fits."""
    for key in ("path/rgb_ts", "path/depth_ts"):
        item = item_of(items, guesses, key)
        steps = item.shape[0] - 1 if item is not None and item.form == "text" else 0
        if item is None or steps <= rows or steps % rows:
            continue
        stride, fields = steps // rows, guesses[key].fields
        column = _column_of(fields)
        length = float(np.median(np.diff(item.columns[column]))) * stride * NS_PER_TIME_UNIT[str(fields["time_unit"])]
        rate = rate_of(length / NS_PER_S) or "RATE"
        yield f"Of {steps + 1} frames, {rows} intervals may be {stride} steps long each, which is {rate} Hz:"
        yield (
            f"  awk 'NR % {stride} == 1 {{ if (NR > 1) print before, ${column + 1}; before = ${column + 1} }}' "
            f"{item.path} > flow_times.txt"
        )
        return


def _times_of_names(groups: Mapping[str, FileGroup], guesses: Mapping[str, Guess]) -> Iterator[Guess]:
    """Guess that large numbers in the names of images are their timestamps."""
    for key in ("path/rgb", "path/depth"):
        guess = guesses.get(key)
        group = groups.get(str(guess.fields.get("file", ""))) if guess else None
        paths = group.paths if group and group.form == "images" else ()
        numbers = numbers_of(paths[0].parent, [path.name for path in paths]) if len(paths) > 1 else None
        if guess is None or numbers is None:
            continue
        head = numbers.rows(0, min(HEAD_ROWS, len(numbers.numbers))).astype(np.float64)
        if head[-1] >= _LEAST_TIME or numbers.dtype.kind == "f":
            unit, why = unit_of_timestamps(head, "frames")
            fields: Fields = {"file": guess.fields["file"], "time_unit": unit}
            yield Guess(f"{key}_ts", fields, f"the numbers in their names; {why}")
