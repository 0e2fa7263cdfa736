"""Turn images of ROS, plain and compressed, into frames of colour and of depth.

Sources: the definitions of ``sensor_msgs``; REP 118 (depth images are metres in 32FC1 and millimetres in 16UC1); the
sources of ``compressed_image_transport`` (JPEG or PNG, which OpenCV wrote) and ``compressed_depth_image_transport``
(PNG behind a header of 12 bytes).
"""

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.importing.recording import Block
from fedora_qa.importing.ros_header import UnreadableMessageError, header_time_us
from fedora_qa.sources.images import decoded_image
from fedora_qa.sources.source import SourceError

IMAGES: Final = frozenset({"sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"})

_COLOURS: Final[Mapping[str, tuple[int, tuple[int, int, int]]]] = {
    "rgb8": (3, (0, 1, 2)), "bgr8": (3, (2, 1, 0)), "rgba8": (4, (0, 1, 2)), "bgra8": (4, (2, 1, 0)),
    "8UC3": (3, (2, 1, 0)), "mono8": (1, (0, 0, 0)), "8UC1": (1, (0, 0, 0)),
}  # fmt: skip
"""By encoding: how many channels there are, and which of them are R, G, B."""

_DEPTHS: Final[Mapping[str, tuple[str, float]]] = {
    "32FC1": ("f4", MM_PER_M),
    "16UC1": ("u2", 1.0),
    "mono16": ("u2", 1.0),
}
"""By encoding: stored type, and millimetres in its unit."""

_PNG: Final = b"\x89PNG"

_DEPTH_HEADER_BYTES: Final = 12
"""Bytes before the PNG of a compressed depth image: the kind of its values, and two parameters of inverse depth."""


def colour_block(message: Any) -> Block:
    """Return a frame of ``Image`` or ``CompressedImage`` as R, G, B."""
    if hasattr(message, "format"):
        stored = _decompressed(bytes(message.data))
        pixels = stored[..., np.newaxis] if stored.ndim == 2 else stored
        if pixels.dtype != np.uint8:
            raise UnreadableMessageError(f"colour of {8 * pixels.itemsize} bits, where 8 are read")
        rgb: tuple[int, ...] = (0, 0, 0) if pixels.shape[2] == 1 else (0, 1, 2)
    else:
        encoding = str(message.encoding)
        if encoding not in _COLOURS:
            raise UnreadableMessageError(f"colour in the encoding {encoding!r}, where {', '.join(_COLOURS)} are read")
        channels, rgb = _COLOURS[encoding]
        pixels = _pixels(message, np.dtype("u1"), channels)
    return Block(
        {
            "path/rgb": np.ascontiguousarray(pixels[np.newaxis][..., list(rgb)]),
            "path/rgb_ts": np.array([header_time_us(message.header)], np.int64),
        }
    )


def depth_block(message: Any) -> Block:
    """Return a frame of ``Image`` or ``CompressedImage`` in mm; what is not finite, or not above 0, is invalid."""
    if hasattr(message, "format"):
        stored, mm_per_unit = _decompressed_depth(message).astype(np.float32), 1.0
    else:
        encoding = str(message.encoding)
        if encoding not in _DEPTHS:
            raise UnreadableMessageError(f"depth in the encoding {encoding!r}, where {', '.join(_DEPTHS)} are read")
        form, mm_per_unit = _DEPTHS[encoding]
        item = np.dtype((">" if message.is_bigendian else "<") + form)
        stored = _pixels(message, item, 1)[..., 0].astype(np.float32)
    is_valid = np.isfinite(stored) & (stored > 0)
    depth_mm = np.where(is_valid, stored * np.float32(mm_per_unit), np.float32(np.nan))
    return Block(
        {"path/depth": depth_mm[np.newaxis], "path/depth_ts": np.array([header_time_us(message.header)], np.int64)}
    )


def _decompressed_depth(message: Any) -> NDArray[Any]:
    """Return the millimetres (height, width) of a compressed depth image.

    Depth in 32FC1 is refused: the package stores inverse depth in whole steps, so that depth is rounded by an amount
    that grows with its square and that no file of the layout states.
    """
    form, content = str(message.format), bytes(message.data)
    if form.startswith("32FC1"):
        raise UnreadableMessageError(f"depth in the format {form!r}, whose values are rounded by their square")
    stored = _decompressed(content if content.startswith(_PNG) else content[_DEPTH_HEADER_BYTES:])
    if stored.dtype != np.uint16 or stored.ndim != 2:
        raise UnreadableMessageError(f"depth in the format {form!r} that is no grey image of 16 bits")
    return stored


def _decompressed(content: bytes) -> NDArray[Any]:
    """Return the pixels of a PNG or JPEG image: (height, width) grey, (height, width, channels) R, G, B else."""
    try:
        return decoded_image("the image", content)
    except SourceError as error:
        raise UnreadableMessageError(f"an image that is not decoded ({error})") from error


def _pixels(message: Any, item: np.dtype[Any], channels: int) -> NDArray[Any]:
    """Return the pixels (height, width, channels) of an image whose lines may be padded."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.frombuffer(np.asarray(message.data, np.uint8), np.uint8)
    line_bytes = width * channels * item.itemsize
    if height <= 0 or width <= 0 or step < line_bytes or len(data) < height * step:
        raise UnreadableMessageError(f"an image of {width} x {height} with {len(data)} bytes in lines of {step}")
    lines = data[: height * step].reshape(height, step)[:, :line_bytes]
    return np.ascontiguousarray(lines).view(item).reshape(height, width, channels)
