"""Decompress the packets of recordings, into no more memory than is allowed. The codecs are optional packages."""

from typing import Any, Final

from fedora_qa.errors import MisuseError

LARGEST_PACKET_BYTES: Final = 64 << 20
"""Decompressed; a colour frame of 12 megapixels has 36 MB, a packet of a million events 16 MB."""


class DamagedPacketError(Exception):
    """A packet does not decompress, or to more bytes than are allowed."""


def lz4_frame(data: bytes) -> bytes:
    """Decompress one frame of LZ4."""
    return decompressed(lz4_decompressor(), data, (RuntimeError, EOFError), LARGEST_PACKET_BYTES)


def lz4_decompressor() -> Any:
    """Return what decompresses a frame of LZ4."""
    try:
        from lz4.frame import LZ4FrameDecompressor  # noqa: PLC0415 - an extra
    except ImportError as missing:
        raise _not_installed("LZ4", missing) from None
    return LZ4FrameDecompressor()


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
    return decompressed(zstd.ZstdDecompressor(), data, (zstd.ZstdError, EOFError), LARGEST_PACKET_BYTES)


def decompressed(decompressor: Any, data: bytes, errors: tuple[type[Exception], ...], most: int) -> bytes:
    """Return all that a decompressor makes of some bytes.

    Raises
    ------
    DamagedPacketError
        It raises one of ``errors``, it makes more than ``most`` bytes, or they do not end.
    """
    try:
        # A byte more than is allowed: a decompressor that has made all it may does not look for the end.
        plain: bytes = decompressor.decompress(data, max_length=most + 1)
    except errors as error:
        raise DamagedPacketError(str(error)) from error
    if len(plain) > most or not decompressor.eof:
        raise DamagedPacketError(f"more than {most} bytes" if len(plain) > most else "a frame that does not end")
    return plain


def _not_installed(codec: str, missing: ImportError) -> MisuseError:
    return MisuseError(
        f"Expected what decompresses {codec}, got: {missing}; install it with pip install 'fedora-qa[aedat]'"
    )
