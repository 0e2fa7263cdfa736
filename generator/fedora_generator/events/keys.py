"""Keys: an event as one int64 of timestamp, row, column and polarity, in this order.

Sorting keys is sorting events by (t, y, x, p). Timestamps are microseconds since the start; at 640x480 the bits
beside row and column hold 278 years of them.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

POLARITY_BITS: Final = 1


@dataclass(frozen=True, slots=True)
class KeyLayout:
    """Bits of a key on a sensor of ``height`` x ``width`` pixels.

    A pixel's place is ``row << column_bits | column``. A key is
    ``timestamp << timestamp_shift | place << 1 | polarity``.
    """

    height: int
    width: int
    column_bits: int = field(init=False)
    """Bits of a column, the lowest of a place"""
    timestamp_shift: int = field(init=False)
    """Bits below the timestamp"""

    def __post_init__(self) -> None:
        column_bits = (self.width - 1).bit_length()
        object.__setattr__(self, "column_bits", column_bits)
        object.__setattr__(self, "timestamp_shift", (self.height - 1).bit_length() + column_bits + POLARITY_BITS)

    @property
    def places(self) -> int:
        """One more than the largest place."""
        return self.height << self.column_bits

    def places_of(self, pixels: NDArray[np.int64]) -> NDArray[np.int64]:
        """Places (n,) of pixels numbered in raster order."""
        rows, columns = np.divmod(pixels, self.width)
        return (rows << self.column_bits) | columns

    def first_key_after(self, timestamp_us: int) -> int:
        """Least key whose timestamp is later than ``timestamp_us``."""
        return (timestamp_us + 1) << self.timestamp_shift

    def with_timestamp(self, keys: NDArray[np.int64], timestamp_us: int) -> NDArray[np.int64]:
        """Return the keys with all timestamps equal to ``timestamp_us``."""
        return (keys & ((1 << self.timestamp_shift) - 1)) | (timestamp_us << self.timestamp_shift)
