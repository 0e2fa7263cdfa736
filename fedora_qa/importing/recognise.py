"""Recognise the format of a recording by its first bytes."""

import re
from pathlib import Path
from typing import Final, Literal

from fedora_qa.errors import MisuseError
from fedora_qa.storage.signature import OTHER_FORMATS

RecordingForm = Literal["prophesee", "aedat4", "bag"]

READABLE: Final = "a recording (Prophesee EVT2, EVT3 or DAT, AEDAT 4.0, or a ROS bag)"
"""What can be brought in, in words."""

_BEGINNINGS: Final[tuple[tuple[bytes, RecordingForm], ...]] = (
    (b"% ", "prophesee"),
    (b"#!AER-DAT4.0\r\n", "aedat4"),
    (b"#ROSBAG V2.0\n", "bag"),
    (b"\x89MCAP0\r\n", "bag"),
    (b"SQLite format 3\0", "bag"),
)

_BAG_METADATA: Final = "metadata.yaml"
"""File that makes a folder a bag of ROS 2."""

_BAG_ENDINGS: Final = {b"#ROSBAG V2.0\n": ".bag", b"\x89MCAP0\r\n": ".mcap", b"SQLite format 3\0": ".db3"}
"""The package ``rosbags`` chooses the format by the name."""

_LONGEST: Final = 16


def recognise(path: Path) -> RecordingForm:
    """Return the form of a recording.

    Raises
    ------
    MisuseError
        There is no such file, it cannot be read, or it begins like no recording that can be brought in.
    """
    if not path.exists():
        raise MisuseError(f"Expected {READABLE}, got a path that does not exist: {path}")
    if (path / _BAG_METADATA).is_file():
        return "bag"
    if not path.is_file():
        raise MisuseError(
            f"Expected {READABLE}, got a folder without {_BAG_METADATA}, or a device: {path}; give the file"
        )
    try:
        with path.open("rb") as file:
            start = file.read(_LONGEST)
    except OSError as error:
        raise MisuseError(f"Expected a readable file, got {error.strerror or error}: {path}") from error
    for beginning, form in _BEGINNINGS:
        if start.startswith(beginning):
            ending = _BAG_ENDINGS.get(beginning)
            if ending and path.suffix != ending:
                raise MisuseError(f"Expected a bag of this format to be named *{ending}, got {path}; rename it")
            return form
    if not start:
        raise MisuseError(f"Expected {READABLE}, got an empty file: {path}; record or copy it again")
    if start.startswith(b"\x89HDF"):
        raise MisuseError(
            f"Expected {READABLE}, got an HDF5 file: {path}; check it as it is, or draft a dialect with "
            f"fedora-qa layout {path} --draft-dialect mine.toml"
        )
    version = re.match(rb"#!AER-DAT([0-9.]+)", start)
    if version:
        raise MisuseError(
            f"Expected AEDAT 4.0, got AEDAT {version[1].decode()}: {path}; convert it to 4.0 with iniVation's software"
        )
    other = next((words for beginning, words in OTHER_FORMATS if start.startswith(beginning)), "something else")
    raise MisuseError(f"Expected {READABLE}, got {other} (by its first bytes): {path}; give the recording itself")
