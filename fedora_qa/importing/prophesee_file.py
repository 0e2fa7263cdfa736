"""What the files of Prophesee share: lines of ``% keyword value``, then words of one size, read in blocks.

Sources: "RAW File Format" and "DAT File Format", Metavision documentation (docs.prophesee.ai).
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import MisuseError
from fedora_qa.importing.recording import BLOCK_BYTES, Block, Recording, Resolution, event_block

_LONGEST_LINE: Final = 4096
_MOST_LINES: Final = 1024
_LARGEST_SIDE: Final = 1 << 14
"""Columns or rows that the widest coordinate of these formats, 14 bits in DAT, can address."""

_KEPT: Final = ("date", "serial_number", "sensor_generation", "generation", "plugin_name", "system_ID")
"""Entries that are kept as provenance."""


@dataclass(frozen=True, slots=True)
class Header:
    """The head of a recording.

    Attributes
    ----------
    path
        The recording, for messages.
    entries
        Values by keyword, in lower case; the last of equals counts.
    end
        Bytes before the data.
    """

    path: Path
    entries: Mapping[str, str]
    end: int

    @property
    def options(self) -> dict[str, str]:
        """Return what follows the name of the encoding: ``EVT3;height=720;width=1280``."""
        pairs = (option.partition("=") for option in self.entries.get("format", "").split(";")[1:])
        return {name.strip().lower(): value.strip() for name, _, value in pairs}

    @property
    def encoding(self) -> str:
        """The name of the encoding in upper case, such as ``EVT3``, or ``DAT``; empty where the header has none."""
        if "data" in self.entries and self.entries["data"].startswith("file containing"):
            return "DAT"
        named = self.entries.get("format", "").split(";")[0].strip().upper()
        version = re.fullmatch(r"(\d)(?:\.(\d))?", self.entries.get("evt", ""))
        if named or not version:
            return named
        return f"EVT{version[1]}" if version[2] in {None, "0"} else f"EVT{version[1]}{version[2]}"

    @property
    def facts(self) -> dict[str, str | int]:
        """Return what is kept as provenance."""
        return {f"header.{name}": self.entries[name.lower()] for name in _KEPT if name.lower() in self.entries}

    def resolution(self, given: Resolution | None) -> Resolution:
        """Return width and height: those given, or else those of the header; raises ``MisuseError`` without both."""
        if given is not None:
            return given
        options = self.options
        geometry = re.fullmatch(r"(\d+)\s*x\s*(\d+)", self.entries.get("geometry", ""))
        stated = [
            (options.get("width", ""), options.get("height", "")),
            geometry.groups() if geometry else ("", ""),
            (self.entries.get("width", ""), self.entries.get("height", "")),
        ]
        sizes = [(int(width), int(height)) for width, height in stated if _is_number(width) and _is_number(height)]
        if not sizes:
            raise MisuseError(
                f"Expected the resolution in the header of {self.path}, got none; give it with --resolution WxH"
            )
        if not all(0 < side <= _LARGEST_SIDE for side in sizes[0]):
            width, height = sizes[0]
            raise MisuseError(
                f"Expected a resolution of 1 to {_LARGEST_SIDE} px each way in the header of {self.path}, got "
                f"{width} x {height}; give it with --resolution WxH"
            )
        return sizes[0]


def read_header(path: Path, file: BinaryIO) -> Header:
    """Read the head of an open recording, which then stands at the first byte of its data.

    The head ends with the line ``% end``, or before the first line that does not begin with ``% ``. Data may begin with
    these two bytes by chance; a line that is not text belongs to the data.

    Raises
    ------
    MisuseError
        The head does not end, or not all of it is there.
    """
    entries: dict[str, str] = {}
    for _ in range(_MOST_LINES):
        start = file.tell()
        line = file.readline(_LONGEST_LINE)
        text = line[:-1].rstrip(b"\r")
        is_text = line.endswith(b"\n") and all(0x20 <= code < 0x7F or code == 0x09 or code >= 0x80 for code in text)
        if not line.startswith(b"% ") or not is_text:
            file.seek(start)
            return Header(path, entries, start)
        keyword, _, value = text[2:].decode("utf-8", "replace").strip().partition(" ")
        if keyword.lower() == "end":
            return Header(path, entries, file.tell())
        entries[keyword.lower()] = value.strip()
    raise MisuseError(f"Expected a header of at most {_MOST_LINES} lines, got more: {path}; is it a recording at all?")


def _is_number(text: str) -> bool:
    return re.fullmatch(r"[0-9]{1,6}", text) is not None


@dataclass(frozen=True, slots=True)
class WordDecoder:
    """An encoding of events in words.

    Attributes
    ----------
    name
        Of the encoding.
    word_dtype
        NumPy name of a word.
    initial_state
        The state before the first word.
    events_per_word
        The most events that follow from a word.
    decode
        The compiled loop: words, state, and the columns x, y, t, p that it writes; returns the number of events.
    counts
        What is counted in the state, in words, and where.
    """

    name: str
    word_dtype: str
    initial_state: tuple[int, ...]
    events_per_word: int
    decode: Callable[..., int]
    counts: Mapping[str, int]

    def blocks(self, file: BinaryIO, recording: Recording) -> Iterator[Block]:
        """Yield the events from the present position of a file on; progress and counts go into ``recording``.

        Raises
        ------
        MisuseError
            The file ends within a word.
        """
        word = np.dtype(self.word_dtype)
        state = np.array(self.initial_state, np.int64)
        most = BLOCK_BYTES // word.itemsize * self.events_per_word
        x, y = np.empty(most, np.uint16), np.empty(most, np.uint16)
        t_us, p = np.empty(most, np.int64), np.empty(most, np.uint8)
        while data := file.read(BLOCK_BYTES):
            recording.done += len(data)
            rest = len(data) % word.itemsize
            if rest:
                raise MisuseError(
                    f"Expected whole words of {word.itemsize} bytes, got {rest} bytes after the last; the recording is "
                    "cut short: copy it again, or remove these bytes from its end"
                )
            words: NDArray[np.unsignedinteger] = np.frombuffer(data, word)
            count = self.decode(words, state, x, y, t_us, p)
            if count:
                yield event_block(x[:count], y[:count], t_us[:count], p[:count])
            for name, place in self.counts.items():
                recording.facts[name] = int(state[place])
