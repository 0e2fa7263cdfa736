"""Prophesee EVT 3.0: words of 16 bits that change a state of time, row and column, from which events follow.

Source: "EVT 3.0 Format", Metavision documentation (docs.prophesee.ai). The upper four bits are the type of a word.
"""

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.importing.prophesee_file import WordDecoder

_ADDR_Y: Final = 0x0
_ADDR_X: Final = 0x2
_VECT_BASE_X: Final = 0x3
_VECT_12: Final = 0x4
_VECT_8: Final = 0x5
_TIME_LOW: Final = 0x6
_TIME_HIGH: Final = 0x8
_EXT_TRIGGER: Final = 0xA

# Words without events: extra data of vendors, and what masters and slaves tell each other.
_CONTINUED_4: Final = 0x7
_OTHERS: Final = 0xE
_CONTINUED_12: Final = 0xF

_HALF: Final = 1 << 11
_PERIOD_US: Final = 1 << 24
"""Time has 24 bits: it begins anew every 16.8 s."""

_LAST_COLUMN: Final = 0xFFFF

_PLACE_OF_BIT: Final = np.zeros((1 << 11) + 1, np.uint8)
_PLACE_OF_BIT[1 << np.arange(12)] = np.arange(12)

# Places in the state.
_HIGH, _LOW, _OVERFLOW_US, _Y, _BASE_X, _POLARITY, _DROPPED, _TRIGGERS, _UNKNOWN = range(9)


@njit(cache=True, nogil=True)
def decode_words(
    words: NDArray[np.uint16],
    state: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    t_us: NDArray[np.int64],
    p: NDArray[np.uint8],
) -> int:
    """Decode words (n,), and return how many events were written.

    Parameters
    ----------
    state
        (9,) what the words before have set, and the counts; changed.
    x, y, t_us, p
        (12 n,) column, row, time in us and polarity of the events; written.
    """
    count = 0
    high, low, overflow_us = state[_HIGH], state[_LOW], state[_OVERFLOW_US]
    row, base_x, polarity = state[_Y], state[_BASE_X], state[_POLARITY]
    for word in words:
        kind = word >> 12
        if kind == _ADDR_X:
            if high >= 0 and row >= 0:
                x[count] = word & 0x7FF
                y[count] = row
                t_us[count] = overflow_us + (high << 12) + low
                p[count] = (word >> 11) & 1
                count += 1
            else:
                state[_DROPPED] += 1
        elif kind in (_VECT_12, _VECT_8):
            length = 12 if kind == _VECT_12 else 8
            mask = np.int64(word) & ((1 << length) - 1)
            is_placed = high >= 0 and row >= 0 and base_x >= 0
            time_us = overflow_us + (high << 12) + low
            # From set bit to set bit: whether each of twelve is set cannot be foreseen, and a wrong guess takes longer
            # than an event.
            while mask:
                lowest = mask & -mask
                mask ^= lowest
                if not is_placed:
                    state[_DROPPED] += 1
                    continue
                # Damaged words may lead beyond 16 bits, where a column would be wrapped onto the sensor.
                x[count] = min(base_x + _PLACE_OF_BIT[lowest], _LAST_COLUMN)
                y[count] = row
                t_us[count] = time_us
                p[count] = polarity
                count += 1
            if base_x >= 0:
                base_x = min(base_x + length, _LAST_COLUMN)
        elif kind == _ADDR_Y:
            row = np.int64(word) & 0x7FF
        elif kind == _VECT_BASE_X:
            base_x = np.int64(word) & 0x7FF
            polarity = (np.int64(word) >> 11) & 1
        elif kind == _TIME_LOW:
            low = np.int64(word) & 0xFFF
        elif kind == _TIME_HIGH:
            new = np.int64(word) & 0xFFF
            if high - new > _HALF:
                overflow_us += _PERIOD_US
            if new != high:
                # The low part follows in a word of its own; until then the old one would lie in the future.
                low = np.int64(0)
            high = new
        elif kind == _EXT_TRIGGER:
            state[_TRIGGERS] += 1
        elif kind not in (_CONTINUED_4, _OTHERS, _CONTINUED_12):
            state[_UNKNOWN] += 1
    state[_HIGH], state[_LOW], state[_OVERFLOW_US] = high, low, overflow_us
    state[_Y], state[_BASE_X], state[_POLARITY] = row, base_x, polarity
    return count


EVT3: Final = WordDecoder(
    name="EVT3",
    word_dtype="<u2",
    # Time, row and column are unknown until the first word that sets them.
    initial_state=(-1, 0, 0, -1, -1, 0, 0, 0, 0),
    events_per_word=12,
    decode=decode_words,
    counts={
        "events before the first time and row": _DROPPED,
        "triggers": _TRIGGERS,
        "words of no known type": _UNKNOWN,
    },
)
