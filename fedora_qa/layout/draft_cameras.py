"""Draft the declarations: cameras of documents, and the lines that a person fills in."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, Final

import numpy as np

from fedora_qa.layout.draft_lines import camera_line, comment, names_intrinsics, quoted, toml_table
from fedora_qa.layout.file_groups import FileGroup
from fedora_qa.layout.guesses import Guess, item_of
from fedora_qa.layout.inventory import StoredObject
from fedora_qa.layout.metadata import PINHOLE, pinhole_names
from fedora_qa.sources.source import SourceError
from fedora_qa.sources.text import document_value

_FORWARD: Final = "[[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]"
"""From a camera that looks along X of the body."""

_TO_CAMERA: Final = "[[0, -1, 0, 0], [0, 0, -1, 0], [1, 0, 0, 0], [0, 0, 0, 1]]"
"""Its inverse: from the body to this camera."""

_CALIBRATION_NUMBERS: Final = frozenset({4, 8, 9})
"""Of fx, fy, cx, cy alone, and with a distortion of 4 or 5 coefficients (rpg_dvs_ros)."""


def document_cameras(groups: Mapping[str, FileGroup]) -> list[str]:
    """Return the lines of cameras in documents: lists of four numbers, or 3 x 3 matrices, of telling names."""
    lines: list[str] = []
    for role, group in groups.items():
        if group.form != "document":
            continue
        cameras: list[tuple[str, Any]] = []
        with suppress(SourceError, OSError):
            cameras = [
                (keys, value)
                for keys, value in _leaves(document_value(group.paths[0], ""))
                if _is_of_intrinsics(keys, value)
            ]
        for keys, value in cameras:
            # The name of a document is that of its camera, if it has no other.
            words = f"{group.pattern}/{keys}" if len(cameras) == 1 else keys
            place = {"file": role, **({"path": keys} if keys else {})}
            convert = {} if np.shape(value) == (3, 3) else {"convert": "fx_fy_cx_cy"}
            of_matrix = camera_line(words, toml_table({**place, **convert}).strip("{} "))
            lines += of_matrix
            if isinstance(value, dict) and not of_matrix[-1].startswith("#"):
                owner = of_matrix[-1].partition("/K")[0]
                lines += [
                    f'{owner}/{size}" = {{ file = {quoted(role)}, path = {quoted(f"{keys}/{size}".lstrip("/"))} }}'
                    for size in ("width", "height")
                    if isinstance(value.get(size), int)
                ]
    return lines


def _is_of_intrinsics(keys: str, value: Any) -> bool:
    """Whether a part of a document is the matrix of a camera, four numbers of a telling name, or a table of these."""
    if isinstance(value, dict):
        return True
    numbers = np.asarray(value, np.float64)
    is_matrix = numbers.shape == (3, 3) and numbers[2].tolist() == [0, 0, 1] and bool(numbers[0, 0] > 1)
    return is_matrix or (numbers.shape == (len(PINHOLE),) and names_intrinsics(keys))


def _leaves(value: Any, keys: str = "") -> Iterator[tuple[str, Any]]:
    """Yield lists of numbers in a document, and tables that name intrinsics, with the keys that lead to them."""
    if isinstance(value, dict):
        if pinhole_names(value):
            yield keys, value
        for key, below in value.items():
            yield from _leaves(below, f"{keys}/{key}" if keys else str(key))
    elif isinstance(value, list) and value:
        with suppress(ValueError, TypeError):
            if np.asarray(value).dtype.kind in "iuf":
                yield keys, value
                return
        for number, below in enumerate(value):
            yield from _leaves(below, f"{keys}/{number}")


def constant_cameras(items: Sequence[StoredObject]) -> Iterator[str]:
    """Yield as remarks the cameras in text and arrays, from which no declaration is read: their numbers."""
    for item in items:
        if item.form not in {"text", "array"}:
            continue
        numbers = np.asarray(item.head, np.float64).reshape(-1)
        distortion: list[float] = []
        if item.shape == (3, 3) and numbers[6:].tolist() == [0, 0, 1] and numbers[0] > 1:
            K = numbers.reshape(3, 3).tolist()
        elif item.shape[:1] == (1,) and numbers.size in _CALIBRATION_NUMBERS and np.all(numbers[:4] > 1):
            fx, fy, cx, cy, *distortion = numbers.tolist()
            K = [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]
        else:
            continue
        yield comment(f"{item.path} may be a camera, but which?")
        yield comment(f'"metadata/cameras/.../K" = {K}')
        if np.any(distortion):
            yield comment(f'"metadata/cameras/.../distortion" = {distortion}, and the model of the lens')


def image_sizes(items: Sequence[StoredObject], guesses: Mapping[str, Guess]) -> dict[str, tuple[int, ...]]:
    """Return height and width in px of the images of each camera with data; empty for the event camera."""
    return {
        camera: item.shape[1:3] if camera != "events" else ()
        for camera, key in (("rgb", "path/rgb"), ("depth", "path/depth"), ("events", "path/events/x"))
        if (item := item_of(items, guesses, key)) is not None
    }


def lines_to_fill_in(
    sizes: Mapping[str, tuple[int, ...]], guesses: Mapping[str, Guess], cameras: Sequence[str]
) -> list[str]:
    """Return what a person declares of each camera, of the event sensor and of the poses, as remarks.

    Parameters
    ----------
    sizes
        Of each camera with data: height and width of its images, px; empty where they are not known.
    guesses
        The places that were guessed, by key.
    cameras
        Lines of cameras that the draft has.
    """
    if not sizes:
        return []
    lines: list[str] = []
    for camera, size in sizes.items():
        height, width = size or ("HEIGHT", "WIDTH")
        declared = {
            "width": f"{width}",
            "height": f"{height}",
            "K": "[[FX, 0, CX], [0, FY, CY], [0, 0, 1]]",
            "T_body_camera": _FORWARD,
        }
        lines += [
            f'"metadata/cameras/{camera}/{name}" = {value}'
            for name, value in declared.items()
            if not any(line.startswith(f'"metadata/cameras/{camera}/{name}"') for line in cameras)
        ]
    lines = [
        "What compares two streams needs their cameras. Fill in what is written in capitals, and remove the #.",
        "T_body_camera is that of a camera at the origin of the body, which looks along X, with Y left and Z up.",
        *lines,
    ]
    if "events" in sizes:
        lines += [
            "Without the response of the sensor, delays of less than a few frames and lost events are not detected.",
            "Rough thresholds suffice: how far they are off is a finding of its own.",
            '"metadata/events/model" = "log"',
            '"metadata/events/threshold_on" = ON',
            '"metadata/events/threshold_off" = OFF',
        ]
    if "path/pose/position" in guesses:
        lines += [
            "Noise of the poses, m and rad: 0 for exact ones. Depth is compared with poses of declared noise.",
            '"metadata/pose/position_sigma" = 0.0',
            '"metadata/pose/rotation_sigma" = 0.0',
            *_lines_of_posed_camera(guesses["path/pose/position"], guesses.get("path/pose/orientation")),
        ]
    return [comment(line) for line in lines]


def _lines_of_posed_camera(position: Guess, orientation: Guess | None) -> Iterator[str]:
    """Yield how poses of a camera, which many data sets have, become those of the body that looks along X."""
    yield "Where the poses are those of a camera with Z forward and Y down, this line makes them those of the body:"
    yield f'"metadata/T_posed_body" = {_TO_CAMERA}'
    if (
        orientation is None
        or "convert" in position.fields
        or position.fields.get("file") != orientation.fields.get("file")
    ):
        return
    columns = [entry for guess in (position, orientation) for entry in _columns_of(guess)]
    if len(columns) == 7:
        fields = {**position.fields, "columns": columns, "convert": "position_quaternion"}
        yield "and these in place of those above:"
        for guess in (position, orientation):
            yield f"{quoted(guess.key)} = {toml_table(fields)}"


def _columns_of(guess: Guess) -> list[int]:
    columns = guess.fields.get("columns")
    return [entry for entry in columns if isinstance(entry, int)] if isinstance(columns, list) else []
