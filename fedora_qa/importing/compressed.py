"""Decompress the packets of recordings, into no more memory than is allowed. The codecs are optional packages."""

from typing import Any, Final

from fedora_qa.errors import MisuseError

LARGEST_PACKET_BYTES: Final = 64 << 20
"""Decompressed; a colour frame of 12 megapixels has 36 MB, a packet of a million events 16 MB."""


class DamagedPacketError(Exception):
    """A packet does not decompress, or to more bytes than are allowed."""


def lz4_frame(data: bytes) -> bytes:
    """Decompress one frame of LZ4."""
    try:
        from lz4.frame import LZ4FrameDecompressor  # noqa: PLC0415 - an extra
    except ImportError as missing:
        raise _not_installed("LZ4", missing) from None
    return _all_of(LZ4FrameDecompressor(), data, (RuntimeError, EOFError))


def zstd_frame(data: bytes) -> bytes:
    """Decompress one frame of Zstandard."""
    try:
        # Part of Python from 3.14 on.
        from compression import zstd  # type: ignore[import-not-found, unused-ignore]  # noqa: PLC0415
    except ImportError:
        try:
            from backports import zstd  # noqa: PLC0415 - an extra
        except ImportError as missing:
            raise _not_installed("Zstandard", missing) from None
    return _all_of(zstd.ZstdDecompressor(), data, (zstd.ZstdError, EOFError))


def _all_of(decompressor: Any, data: bytes, errors: tuple[type[Exception], ...]) -> bytes:
    try:
        plain: bytes = decompressor.decompress(data, max_length=LARGEST_PACKET_BYTES)
    except errors as error:
        raise DamagedPacketError(str(error)) from error
    if not decompressor.eof:
        is_long = len(plain) >= LARGEST_PACKET_BYTES
        raise DamagedPacketError(f"more than {LARGEST_PACKET_BYTES} bytes" if is_long else "a frame that does not end")
    return plain


def _not_installed(codec: str, missing: ImportError) -> MisuseError:
    return MisuseError(
        f"Expected what decompresses {codec}, got: {missing}; install it with pip install 'fedora-qa[aedat]'"
    )
