"""Images as rows: a folder of them, in the order of the numbers in their names; and PNG, JPEG and OpenEXR files.

What an image states is known, and its bytes are whole, before OpenCV decodes it. OpenCV fills what is missing of a
damaged image with grey and states nothing. So the checksums of PNG, and the end of JPEG, are tested here.
"""

import re
import struct
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sources import exr
from fedora_qa.sources.source import SourceError

LARGEST_PIXELS: Final = 1 << 25
"""An image of 7680 x 4320 fits, as in HDF5 (``layout.decodable``)."""

LARGEST_BYTES: Final = 512 << 20
"""Largest file of one image."""

_PNG: Final = b"\x89PNG\r\n\x1a\n"
_CHANNELS: Final = {0: 1, 2: 3, 3: 3, 4: 4, 6: 4}
"""Channels that are decoded, by the colour type of PNG: OpenCV turns palettes into colours, and adds colours to grey
with transparency (PNG 1.2, 4.1.1)."""

_FRAME_MARKERS: Final = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
"""Markers of JPEG whose segment states the size of the image (ITU T.81, table B.1)."""

_LONGEST_JPEG_HEADER: Final = 1 << 20

_NUMBER: Final = re.compile(r"\d+(?:\.\d+)?$")
"""The number that ends the name of an image: a count (``000123``), or a time (``1504645177.25``)."""

_LONGEST_NUMBER: Final = 32
"""Digits of such a number; nanoseconds since 1970 have 19."""


@dataclass(frozen=True, slots=True)
class ImageForm:
    """Size and type of a decoded image: (H, W) grey, (H, W, channels) else."""

    shape: tuple[int, ...]
    dtype: str

    def __str__(self) -> str:
        height, width, *channels = self.shape
        count = channels[0] if channels else 1
        kind = {1: "grey", 3: "colour", 4: "colour with transparency"}.get(count, f"in {count} channels")
        return f"{width} x {height} pixels, {8 * np.dtype(self.dtype).itemsize}-bit {kind}"


@dataclass(frozen=True, slots=True)
class Images:
    """Images of one size and type, which is that of the first; each is read when its row is.

    Attributes
    ----------
    path
        Their folder.
    names
        (n,) names in the order of rows.
    form
        Size and type of each.
    """

    path: Path
    names: tuple[str, ...]
    form: ImageForm

    @property
    def shape(self) -> tuple[int, ...]:
        """(n, H, W) grey, (n, H, W, channels) else."""
        return (len(self.names), *self.form.shape)

    @property
    def dtype(self) -> np.dtype[Any]:
        """Whole numbers of 8 or 16 bits; of OpenEXR floats of 16 or 32 bits."""
        return np.dtype(self.form.dtype)

    @property
    def rows_together(self) -> int:
        """One image."""
        return 1

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Decode images; raises ``SourceError`` or ``OSError``."""
        decoded = np.empty((stop - start, *self.form.shape), self.dtype)
        for row in range(start, stop):
            decoded[row - start] = read_image(self.path / self.names[row], self.form)
        return decoded


@dataclass(frozen=True, slots=True)
class NumbersOfNames:
    """The numbers in the names of images as rows: their timestamps, where the names state them."""

    path: Path
    numbers: tuple[float | int, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """(n,)."""
        return (len(self.numbers),)

    @property
    def dtype(self) -> np.dtype[Any]:
        """int64 for whole numbers, else float64."""
        return np.dtype(np.int64 if all(isinstance(number, int) for number in self.numbers) else np.float64)

    @property
    def rows_together(self) -> int:
        """Any number."""
        return 0

    def rows(self, start: int, stop: int) -> NDArray[Any]:
        """Return numbers."""
        return np.array(self.numbers[start:stop], self.dtype)


def images_of(folder: Path, names: Iterable[str]) -> Images:
    """Return the images of a folder by their names; only the header of the first is read.

    Raises
    ------
    SourceError, OSError
        The header cannot be read.
    """
    ordered = in_order(names)
    return Images(folder, tuple(ordered), image_form(folder / ordered[0]))


def numbers_of(folder: Path, names: Iterable[str]) -> NumbersOfNames | None:
    """Return the numbers in names of files, ascending; None where a name has none or two have the same."""
    numbers = [number_in(name) for name in names]
    exact = sorted(number for number in numbers if number is not None)
    if len(set(exact)) < len(numbers):
        return None
    return NumbersOfNames(folder, tuple(int(number) if number == int(number) else float(number) for number in exact))


def in_order(names: Iterable[str]) -> list[str]:
    """Return names in the order of the numbers in them, of the names themselves where some have none."""
    by_name = sorted(names)
    numbers = [number_in(name) for name in by_name]
    if None in numbers:
        return by_name
    # Names without leading zeros: as text, 10 would come before 9. The sort is stable.
    order = sorted(range(len(by_name)), key=lambda place: numbers[place] or 0)
    return [by_name[place] for place in order]


def number_in(name: str) -> int | Fraction | None:
    """Return the number at the end of a name without its suffix; None where there is none."""
    match = _NUMBER.search(name.rpartition(".")[0] or name)
    if not match or len(match[0]) > _LONGEST_NUMBER:
        return None
    return int(match[0]) if match[0].isdecimal() else Fraction(match[0])


def left_out(numbers: NDArray[Any]) -> int | None:
    """Return the first number that a numbering in equal steps leaves out; None where it leaves out none.

    Parameters
    ----------
    numbers
        (n,) whole numbers, ascending.
    """
    steps = np.diff(numbers)
    if not len(steps) or numbers.dtype.kind != "i":
        return None
    # The usual step, not the smallest: DSEC counts every second image.
    usual = int(np.median(steps))
    longer = np.flatnonzero(steps != usual)
    return int(numbers[longer[0]]) + usual if len(longer) and usual else None


def image_form(path: Path) -> ImageForm:
    """Return size and type of an image from its header; raises ``SourceError`` or ``OSError``."""
    with path.open("rb") as file:
        if file.read(len(exr.MAGIC)) != exr.MAGIC:
            file.seek(0)
            return _form(path.name, file)
    header = exr.exr_header(path)
    _require_size(path.name, header.width, header.height)
    return ImageForm(header.shape, header.dtype)


def read_image(path: Path, expected: ImageForm) -> NDArray[Any]:
    """Decode an image, channels in the order R, G, B.

    Raises
    ------
    SourceError
        It is damaged, too large, or of another size or type than expected.
    OSError
        The file cannot be read.
    """
    size = path.stat().st_size
    if size > LARGEST_BYTES:
        raise SourceError(
            "too_large", "wrong_shape", f"Expected {path.name} in {LARGEST_BYTES} bytes at most, got {size}"
        )
    content = path.read_bytes()
    if not content.startswith(exr.MAGIC):
        return decoded_image(path.name, content, expected)
    _require_form(path.name, image_form(path), expected)
    return exr.read_exr(path)


def decoded_image(name: str, content: bytes, expected: ImageForm | None = None) -> NDArray[Any]:
    """Decode the bytes of a PNG or JPEG image, channels in the order R, G, B.

    Parameters
    ----------
    name
        Of the image, for errors.
    content
        Its bytes.
    expected
        Size and type; None: any.

    Raises
    ------
    SourceError
        It is damaged, too large, or of another size or type than expected.
    """
    import cv2  # noqa: PLC0415 - slow to load, and few sequences need it here

    form = _form(name, BytesIO(content))
    # First: a damaged header may state another size.
    (_require_sound_png if content.startswith(_PNG) else _require_sound_jpeg)(name, content)
    if expected is not None:
        _require_form(name, form, expected)
    stored = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_UNCHANGED)
    if stored is None or stored.shape != form.shape or stored.dtype != np.dtype(form.dtype):
        raise SourceError("unreadable", "corrupt_chunk", f"Expected {name} to decode, got a damaged image")
    if stored.ndim == 3:
        # OpenCV returns B, G, R and transparency last.
        order = cv2.COLOR_BGR2RGB if stored.shape[2] == 3 else cv2.COLOR_BGRA2RGBA
        stored = cv2.cvtColor(stored, order)
    return np.asarray(stored)


def _require_form(name: str, form: ImageForm, expected: ImageForm) -> None:
    if form != expected:
        raise SourceError("wrong_shape", "wrong_shape", f"Expected {name} of {expected}, got {form}")


def _require_size(name: str, width: int, height: int) -> None:
    if not 0 < width * height <= LARGEST_PIXELS:
        message = f"Expected {name} in {LARGEST_PIXELS} pixels at most, got {width} x {height}"
        raise SourceError("too_large", "wrong_shape", message)


def _form(name: str, file: BinaryIO) -> ImageForm:
    start = file.read(33)
    if start.startswith(_PNG):
        if len(start) < 33 or start[12:16] != b"IHDR":
            raise SourceError(
                "unreadable", "truncated", f"Expected the header of a PNG in {name}, got {len(start)} bytes"
            )
        width, height, bits, colour = struct.unpack(">IIBB", start[16:26])
        channels = _CHANNELS.get(colour, 0)
        dtype = "uint16" if bits == 16 else "uint8"
    elif start.startswith(b"\xff\xd8"):
        file.seek(0)
        width, height, channels = _jpeg_size(name, file.read(_LONGEST_JPEG_HEADER))
        dtype = "uint8"
    else:
        raise SourceError(
            "unreadable", "corrupt_chunk", f"Expected a PNG, JPEG or OpenEXR image, got something else: {name}"
        )
    if not channels:
        message = f"Expected {name} as a grey or colour image, got channels that are not read; convert it to RGB"
        raise SourceError("wrong_shape", "wrong_shape", message)
    _require_size(name, width, height)
    return ImageForm((height, width) if channels == 1 else (height, width, channels), dtype)


def _jpeg_size(name: str, content: bytes) -> tuple[int, int, int]:
    at = 2
    while at + 10 <= len(content) and content[at] == 0xFF:
        marker, length = content[at + 1], int.from_bytes(content[at + 2 : at + 4], "big")
        if marker in _FRAME_MARKERS:
            # Precision, height, width, number of components (ITU T.81, B.2.2).
            height, width, components = struct.unpack(">HHB", content[at + 5 : at + 10])
            return width, height, {1: 1, 3: 3}.get(components, 0)
        at += 2 + length
    raise SourceError("unreadable", "truncated", f"Expected the size of the image in {name}, got no such segment")


def _require_sound_png(name: str, content: bytes) -> None:
    """Refuse a PNG whose chunks do not reach its end, or differ from their checksums (PNG 1.2, 3.2)."""
    at, part = len(_PNG), b""
    while part != b"IEND":
        length = int.from_bytes(content[at : at + 4], "big")
        stop = at + 12 + length
        part = content[at + 4 : at + 8]
        if len(part) < 4 or stop > len(content):
            raise SourceError(
                "unreadable", "truncated", f"Expected {name} to be complete, got an image that is cut off"
            )
        if zlib.crc32(memoryview(content)[at + 4 : stop - 4]) != int.from_bytes(content[stop - 4 : stop], "big"):
            message = f"Expected {name} to match its checksums, got another in its part {ascii(part)[2:-1]}"
            raise SourceError("unreadable", "corrupt_chunk", message)
        at = stop


def _require_sound_jpeg(name: str, content: bytes) -> None:
    # Cameras pad with zeros behind the marker of the end.
    if not content.rstrip(b"\0").endswith(b"\xff\xd9"):
        raise SourceError("unreadable", "truncated", f"Expected {name} to be complete, got an image that is cut off")
