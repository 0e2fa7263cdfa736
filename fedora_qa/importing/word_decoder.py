"""Read a file of words of one size, block by block, through a compiled loop that carries its state."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import MisuseError
from fedora_qa.importing.recording import BLOCK_BYTES, Block, Recording, event_block


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
