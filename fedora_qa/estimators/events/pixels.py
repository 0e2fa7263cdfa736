"""Events sorted by pixel, and by time within each pixel: all events of a pixel are contiguous in memory.

An event is stored as one number: twice its timestamp plus its polarity.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Columns = NDArray[np.uint16]
Polarities = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class PixelEvents:
    """m events by pixel.

    Attributes
    ----------
    starts
        (h * w + 1,) index of the first event of each pixel, row * width + column; the last value is m.
    timestamped
        (m,) twice the timestamp of each event, ns, plus its polarity (1 brighter, 0 darker).
    """

    starts: NDArray[np.int32]
    timestamped: Int64

    def __len__(self) -> int:
        return len(self.timestamped)

    def later_than(self, after_ns: int, until_ns: int) -> int:
        """Return the number of events in an interval.

        Parameters
        ----------
        after_ns, until_ns
            The interval (after, until], ns.

        Returns
        -------
        int
            Events of all pixels.
        """
        return int(_count_within(self.timestamped, after_ns, until_ns))


def by_pixel(
    x: NDArray[np.uint16], y: NDArray[np.uint16], times_ns: Int64, p: NDArray[np.uint8], shape: tuple[int, int]
) -> PixelEvents:
    """Sort events by pixel.

    Parameters
    ----------
    x, y
        (m,) columns and rows, px; all events lie on the sensor.
    times_ns
        (m,) sorted timestamps, ns.
    p
        (m,) polarities: 1 brighter, 0 darker.
    shape
        Rows and columns of the sensor.

    Returns
    -------
    PixelEvents
        The events of each pixel in the order of time.
    """
    starts, timestamped = np.empty(shape[0] * shape[1] + 1, np.int32), np.empty(len(times_ns), np.int64)
    _sort_by_pixel(x, y, times_ns, p, shape, starts, timestamped)
    return PixelEvents(starts, timestamped)


@njit(cache=True)
def _sort_by_pixel(
    x: Columns, y: Columns, t: Int64, p: Polarities, shape: tuple[int, int], starts: Int32, timestamped: Int64
) -> None:
    """Write the fields of ``PixelEvents``: ``starts`` (h * w + 1,), and ``timestamped`` (m,), 2 t + p of each event.

    Events are counted, then distributed in the order of time. Indices are unsigned, because Numba tests signed ones for
    negative values at each access.
    """
    height, width = shape
    row_px = np.uint64(width)
    # Distribution counting (D. E. Knuth, TAOCP vol. 3, algorithm 5.2D): stable, so that time order is kept.
    starts[:] = 0
    for i in range(len(t)):
        starts[np.uint64(y[i]) * row_px + np.uint64(x[i])] += 1
    before = np.int32(0)
    for pixel in range(height * width):
        count = starts[pixel]
        starts[pixel] = before
        before += count
    for i in range(len(t)):
        pixel_of_event = np.uint64(y[i]) * row_px + np.uint64(x[i])
        timestamped[np.uint64(starts[pixel_of_event])] = 2 * t[i] + p[i]
        starts[pixel_of_event] += 1
    # Each start has advanced to that of the next pixel.
    for pixel in range(height * width, 0, -1):
        starts[pixel] = starts[pixel - 1]
    starts[0] = 0


@njit(cache=True)
def _count_within(timestamped: Int64, after: int, until: int) -> int:
    """Return the number of events that are later than ``after`` and not later than ``until``, ns."""
    # 2 t + p > 2 after + 1 exactly if t > after, for both polarities p; likewise for ``until``.
    count, least, most = 0, 2 * after + 1, 2 * until + 1
    for i in range(len(timestamped)):
        count += (timestamped[i] > least) & (timestamped[i] <= most)
    return count
