"""OpenEXR images: size and type from the header, and pixels by the package ``OpenEXR``, which is an extra.

Renderers store depth and motion in them. The header is read here, so that nothing is decoded to list a folder, and a
file that is cut off is refused before the package prints its own messages about it.

Source: the OpenEXR file layout, version 2 (attributes, table of chunk offsets, scan line blocks).
"""

import struct
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import MisuseError
from fedora_qa.sources.source import SourceError

MAGIC: Final = b"\x76\x2f\x31\x01"

_OTHER_LAYOUTS: Final = {0x200: "tiles", 0x800: "deep samples", 0x1000: "several parts"}
"""By bit of the version: how pixels lie that are not read."""

_DTYPES: Final = {0: "uint32", 1: "float16", 2: "float32"}
"""By the number of a pixel type."""

_LINES: Final = {0: 1, 1: 1, 2: 1, 3: 16, 4: 32, 5: 16, 6: 32, 7: 32, 8: 32, 9: 256}
"""By the number of a compression: lines of a block (none, RLE, ZIPS, ZIP, PIZ, PXR24, B44, B44A, DWAA, DWAB)."""

_LONGEST_HEADER: Final = 1 << 20

_COLOURS: Final = ("R", "G", "B")


@dataclass(frozen=True, slots=True)
class ExrHeader:
    """What the header of an image states.

    Attributes
    ----------
    width, height
        px.
    channels
        Names of the channels that are read: R, G, B where it has them, else all in the order of their names.
    dtype
        Type of each.
    """

    width: int
    height: int
    channels: tuple[str, ...]
    dtype: str

    @property
    def shape(self) -> tuple[int, ...]:
        """(H, W) of one channel, (H, W, channels) else."""
        return (self.height, self.width, *([len(self.channels)] if len(self.channels) > 1 else []))


def exr_header(path: Path) -> ExrHeader:
    """Read the header.

    Raises
    ------
    SourceError
        It is damaged, or of a form that is not read.
    MisuseError
        The package that decodes images is not installed.
    OSError
        The file cannot be read.
    """
    if find_spec("OpenEXR") is None:
        raise MisuseError(
            f"Expected the package that decodes {path.name}, got none; install it with pip install 'fedora-qa[exr]'"
        )
    with path.open("rb") as file:
        return _parsed(path, file.read(_LONGEST_HEADER))[0]


def read_exr(path: Path) -> NDArray[Any]:
    """Decode an image.

    Raises
    ------
    SourceError
        It is damaged, or of a form that is not read.
    OSError
        The file cannot be read.
    """
    import OpenEXR  # noqa: PLC0415 - an extra

    content = path.read_bytes()
    header, offsets_at = _parsed(path, content)
    _require_whole(path, content, offsets_at)
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = file.channels()
            decoded = np.stack([channels[name].pixels for name in header.channels], axis=-1)
    except (RuntimeError, ValueError, KeyError) as error:
        message = f"Expected {path.name} to decode, got a damaged image ({error})"
        raise SourceError("unreadable", "corrupt_chunk", message) from error
    pixels = np.asarray(decoded, header.dtype)
    return pixels.reshape(header.shape)


def _parsed(path: Path, content: bytes) -> tuple[ExrHeader, range]:
    """Return the header, and the places of the offsets of blocks."""
    attributes: dict[str, bytes] = {}
    try:
        (flags,) = struct.unpack_from("<I", content, 4)
        for bit, layout in _OTHER_LAYOUTS.items():
            if flags & bit:
                message = f"Expected the scan lines of one image in {path.name}, got {layout}; convert it"
                raise SourceError("wrong_shape", "wrong_shape", message)
        at = 8
        while content[at]:
            name_stop = content.index(0, at)
            type_stop = content.index(0, name_stop + 1)
            (length,) = struct.unpack_from("<I", content, type_stop + 1)
            start = type_stop + 5
            if start + length >= len(content):
                raise ValueError("an attribute behind the end")
            attributes[content[at:name_stop].decode("utf-8", "replace")] = content[start : start + length]
            at = start + length
        left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
        lines = _LINES[attributes["compression"][0]]
        channels = _channels(path, attributes["channels"])
    except SourceError:
        raise
    except (struct.error, ValueError, IndexError, KeyError) as error:
        message = f"Expected the header of an OpenEXR image in {path.name}, got one of another form or cut off"
        raise SourceError("unreadable", "truncated", message) from error
    if attributes["dataWindow"] != attributes.get("displayWindow"):
        message = f"Expected pixels of the whole image in {path.name}, got those of a part; render it without a region"
        raise SourceError("wrong_shape", "wrong_shape", message)
    width, height = right - left + 1, bottom - top + 1
    names = _COLOURS if set(_COLOURS) <= channels.keys() else tuple(sorted(channels))
    dtypes = {channels[name] for name in names}
    if len(dtypes) != 1:
        message = f"Expected channels of one type in {path.name}, got {', '.join(sorted(dtypes))}; convert it"
        raise SourceError("wrong_shape", "wrong_shape", message)
    first = at + 1
    blocks = -(-max(height, 0) // lines)
    return ExrHeader(width, height, names, dtypes.pop()), range(first, first + 8 * blocks, 8)


def _channels(path: Path, listed: bytes) -> dict[str, str]:
    """Return the type of each channel by its name."""
    channels: dict[str, str] = {}
    at = 0
    while listed[at]:
        stop = listed.index(0, at)
        kind, _, *sampling = struct.unpack_from("<iIii", listed, stop + 1)
        name = listed[at:stop].decode("utf-8", "replace")
        if sampling != [1, 1]:
            message = f"Expected every pixel of the channel {name} in {path.name}, got some of them; convert it"
            raise SourceError("wrong_shape", "wrong_shape", message)
        channels[name] = _DTYPES[kind]
        at = stop + 17
    if not channels:
        raise ValueError("no channels")
    return channels


def _require_whole(path: Path, content: bytes, offsets_at: range) -> None:
    """Refuse an image of which a block does not reach its end (a line number, a size, and as many bytes)."""
    for place in offsets_at:
        try:
            (offset,) = struct.unpack_from("<Q", content, place)
            (size,) = struct.unpack_from("<I", content, offset + 4)
        except (struct.error, OverflowError):  # an offset of 2^63 or more is no index
            offset, size = len(content), 0
        if not place < offset <= len(content) - 8 - size:
            raise SourceError(
                "unreadable", "truncated", f"Expected {path.name} to be complete, got an image that is cut off"
            )
