"""Prophesee EVT 2.0: words of 32 bits, of which one is one event, or the upper part of the time.

Source: "EVT 2.0 Format", Metavision documentation (docs.prophesee.ai). The upper four bits are the type of a word.
"""

from typing import Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.importing.prophesee_file import WordDecoder

_CD_OFF: Final = 0x0
_CD_ON: Final = 0x1
_TIME_HIGH: Final = 0x8
_EXT_TRIGGER: Final = 0xA

# Words without events: extensions of vendors.
_OTHERS: Final = 0xE
_CONTINUED: Final = 0xF

_HALF: Final = 1 << 27
_PERIOD_US: Final = 1 << 34
"""Time has 34 bits: it begins anew every 4.8 h."""

# Places in the state.
_HIGH, _OVERFLOW_US, _DROPPED, _TRIGGERS, _UNKNOWN = range(5)


@njit(cache=True, nogil=True)
def decode_words(
    words: NDArray[np.uint32],
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
        (5,) what the words before have set, and the counts; changed.
    x, y, t_us, p
        (n,) column, row, time in us and polarity of the events; written.
    """
    count = 0
    high, overflow_us = state[_HIGH], state[_OVERFLOW_US]
    for word in words:
        kind = word >> 28
        if kind in (_CD_OFF, _CD_ON):
            if high < 0:
                state[_DROPPED] += 1
                continue
            t_us[count] = overflow_us + (high << 6) + ((np.int64(word) >> 22) & 0x3F)
            x[count] = (word >> 11) & 0x7FF
            y[count] = word & 0x7FF
            p[count] = kind
            count += 1
        elif kind == _TIME_HIGH:
            new = np.int64(word) & 0xFFFFFFF
            if high - new > _HALF:
                overflow_us += _PERIOD_US
            high = new
        elif kind == _EXT_TRIGGER:
            state[_TRIGGERS] += 1
        elif kind not in (_OTHERS, _CONTINUED):
            state[_UNKNOWN] += 1
    state[_HIGH], state[_OVERFLOW_US] = high, overflow_us
    return count


EVT2: Final = WordDecoder(
    name="EVT2",
    word_dtype="<u4",
    # Time is unknown until the first word that sets it.
    initial_state=(-1, 0, 0, 0, 0),
    events_per_word=1,
    decode=decode_words,
    counts={"events before the first time": _DROPPED, "triggers": _TRIGGERS, "words of no known type": _UNKNOWN},
)
