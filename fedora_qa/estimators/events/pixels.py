"""Events in the order of their pixels, and of time within each: what is asked of one pixel then lies together."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.pixel_kernels import count_within, sort_by_pixel

Int64 = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class PixelEvents:
    """Events by pixel.

    Attributes
    ----------
    starts
        (h * w + 1,) where the events of each pixel begin, row * width + column, and the number of all.
    stamped
        (m,) twice the instant of an event, ns, plus its polarity (1 brighter, 0 darker).
    """

    starts: NDArray[np.int32]
    timestamped: Int64

    def __len__(self) -> int:
        return len(self.timestamped)

    def later_than(self, after_ns: int, until_ns: int) -> int:
        """Return the number of events in (after, until]."""
        return int(count_within(self.timestamped, after_ns, until_ns))


def by_pixel(
    x: NDArray[np.uint16], y: NDArray[np.uint16], times_ns: Int64, p: NDArray[np.uint8], shape: tuple[int, int]
) -> PixelEvents:
    """Return the events, sorted by time and all on a sensor (rows, columns), by pixel."""
    starts, timestamped = np.empty(shape[0] * shape[1] + 1, np.int32), np.empty(len(times_ns), np.int64)
    sort_by_pixel(x, y, times_ns, p, shape, starts, timestamped)
    return PixelEvents(starts, timestamped)
