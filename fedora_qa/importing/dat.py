"""Prophesee DAT, version 2: decoded events of eight bytes.

Source: "DAT File Format", Metavision documentation (docs.prophesee.ai). An event is a time of 32 bits in us, then
14 bits of column, 14 bits of row and 4 bits of polarity, from the lowest bit on.
"""

from typing import BinaryIO, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.errors import MisuseError
from fedora_qa.importing.prophesee_file import Header, WordDecoder

_VERSION: Final = "2"
_EVENT_TYPES: Final = {0x00: "Event2d", 0x0C: "EventCD"}
_EVENT_BYTES: Final = 8

_HALF_US: Final = 1 << 31
_PERIOD_US: Final = 1 << 32
"""Time has 32 bits: it begins anew every 71.6 min."""

# Places in the state.
_LAST_US, _OVERFLOW_US = range(2)


@njit(cache=True, nogil=True)
def decode_words(
    words: NDArray[np.uint64],
    state: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    t_us: NDArray[np.int64],
    p: NDArray[np.uint8],
) -> int:
    """Decode events (n,), and return their number n.

    Parameters
    ----------
    state
        (2,) the time of the event before, as stored, and what is added to it; changed.
    x, y, t_us, p
        (n,) column, row, time in us and polarity of the events; written.
    """
    last_us, overflow_us = state[_LAST_US], state[_OVERFLOW_US]
    for k in range(len(words)):
        word = words[k]
        stored_us = np.int64(word & np.uint64(0xFFFFFFFF))
        if last_us - stored_us > _HALF_US:
            overflow_us += _PERIOD_US
        last_us = stored_us
        t_us[k] = overflow_us + stored_us
        x[k] = (word >> np.uint64(32)) & np.uint64(0x3FFF)
        y[k] = (word >> np.uint64(46)) & np.uint64(0x3FFF)
        p[k] = (word >> np.uint64(60)) != 0
    state[_LAST_US], state[_OVERFLOW_US] = last_us, overflow_us
    return len(words)


DAT: Final = WordDecoder(
    name="DAT",
    word_dtype="<u8",
    initial_state=(0, 0),
    events_per_word=1,
    decode=decode_words,
    counts={},
)


def require_events(header: Header, file: BinaryIO) -> None:
    """Read the two bytes before the events, their type and size; raises ``MisuseError`` where they are no events."""
    version = header.entries.get("version", "none")
    if version != _VERSION:
        raise MisuseError(
            f"Expected DAT of version {_VERSION}, got version {version}: {header.path}; convert it with Metavision"
        )
    stated = file.read(2)
    if len(stated) < 2:
        raise MisuseError(f"Expected events after the header, got the end of the file: {header.path}; copy it again")
    kind, size = stated
    if kind not in _EVENT_TYPES or size != _EVENT_BYTES:
        types = " or ".join(f"{number} ({name})" for number, name in _EVENT_TYPES.items())
        raise MisuseError(
            f"Expected events of type {types} and {_EVENT_BYTES} bytes, got type {kind} and {size} bytes: "
            f"{header.path}; convert it with Metavision"
        )
