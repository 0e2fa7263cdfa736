"""Events in the order of their pixels, and of time within each: what is asked of one pixel then lies together."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.event_pixel_kernels import count_sorted, count_within, follow_sorted, sort_by_pixel

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

    starts: Int64
    stamped: Int64

    def __len__(self) -> int:
        return len(self.stamped)

    def later_than(self, after_ns: int, until_ns: int) -> int:
        """Return the number of events in (after, until]."""
        return int(count_within(self.stamped, after_ns, until_ns))

    def counts_between(self, frame_times_ns: Int64, shape: tuple[int, int]) -> NDArray[np.int32]:
        """Return the darker and brighter events in (frame i, frame i + 1], (n - 1, 2, h, w), n at least one."""
        counts = np.zeros((len(frame_times_ns) - 1, 2, shape[0] * shape[1]), np.int32)
        count_sorted(self.starts, self.stamped, frame_times_ns, counts)
        return counts.reshape(-1, 2, *shape)

    def followed(self, start_ns: int, stop_ns: int) -> tuple[Int64, int]:
        """Return what every pixel did in [start, stop), (h * w,) as ``follow_sorted`` packs it.

        And how many events share pixel and stamp with one before.
        """
        followed = np.empty(len(self.starts) - 1, np.int64)
        repeats = follow_sorted(self.starts, self.stamped, start_ns, stop_ns, followed)
        return followed, int(repeats)


def by_pixel(
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    times_ns: Int64,
    p: NDArray[np.uint8],
    shape: tuple[int, int],
) -> PixelEvents:
    """Return the events, sorted by time and all on a sensor (rows, columns), by pixel."""
    starts, stamped = np.empty(shape[0] * shape[1] + 1, np.int64), np.empty(len(times_ns), np.int64)
    sort_by_pixel(x, y, times_ns, p, shape, starts, stamped)
    return PixelEvents(starts, stamped)
