"""Events without company: how often a pixel fires once while its neighbours are silent, by tile of the image.

Noise of a sensor fires at random: everywhere, at any time, in pixels of any brightness. Of n blocks of 3 x 3 pixels
without another event in an interval of time, noise of r events a second leaves n exp(-r s) silent in the middle and
n r s exp(-r s) with one event there: their ratio is r s, whatever happens elsewhere. Edges leave lone events too, where
they begin and end, but only in the tiles that they cross. So the rate of the quieter tiles is that of the noise.

A spatiotemporal neighbour as what tells a signal from background activity: T. Delbruck, Frame-free dynamic digital
vision, Int. Symp. Secure-Life Electronics (2008), section 5.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S

Int64 = NDArray[np.int64]
Int32 = NDArray[np.int32]

TILES = 8
"""Tiles a side of the image."""

_QUIET = 0.25
"""Quantile of the rates of tiles: three quarters of an image with noise have at least its rate."""


@dataclass(frozen=True, slots=True)
class LoneEvents:
    """Pixels of all intervals with silent neighbours, by tile.

    Attributes
    ----------
    lone
        (TILES, TILES) with one event, of either polarity.
    silent
        (TILES, TILES) without an event.
    weighted_ns
        (TILES, TILES) sum of the intervals' lengths over the silent pixels, ns: whole numbers, so that sums do not
        depend on their order.
    """

    lone: Int64
    silent: Int64
    weighted_ns: Int64

    def __add__(self, other: "LoneEvents") -> "LoneEvents":
        """Add those of other intervals."""
        return LoneEvents(self.lone + other.lone, self.silent + other.silent, self.weighted_ns + other.weighted_ns)

    @property
    def quiet_rate_hz(self) -> float:
        """Rate of lone events of a pixel, 1/s, that three quarters of the tiles reach; a tile never silent has none."""
        rates_hz = np.divide(
            NS_PER_S * self.lone, self.weighted_ns, out=np.zeros((TILES, TILES)), where=self.weighted_ns > 0
        )
        return float(np.quantile(rates_hz, _QUIET))

    @property
    def mean_rate_hz(self) -> float:
        """Rate of lone events of a pixel in all tiles, 1/s; 0 where none was seen."""
        seconds = float(self.weighted_ns.sum()) / NS_PER_S
        return float(self.lone.sum()) / seconds if seconds else 0.0


def count_lone_events(counts: Int32, intervals_ns: Int64) -> LoneEvents:
    """Count pixels with one event and with none, of those whose neighbours have none.

    Parameters
    ----------
    counts
        (n, 2, h, w) darker and brighter events of n intervals.
    intervals_ns
        (n,) their lengths, ns.

    Returns
    -------
    LoneEvents
        By tile.
    """
    lone, silent = np.zeros((2, TILES, TILES), np.int64)
    weighted_ns = np.zeros((TILES, TILES), np.int64)
    for between, length_ns in zip(counts, intervals_ns, strict=True):
        of_interval = np.zeros((2, TILES, TILES), np.int64)
        _count(between, of_interval)
        lone += of_interval[0]
        silent += of_interval[1]
        # The ratio of lone to silent pixels is r s: sum(lone) estimates r sum(s silent).
        weighted_ns += length_ns * of_interval[1]
    return LoneEvents(lone, silent, weighted_ns)


@njit(cache=True)
def _count(between: Int32, totals: Int64) -> None:
    """Add the pixels with one event, and those with none, whose eight neighbours have none, by tile."""
    height, width = between.shape[1], between.shape[2]
    tiles_down, tiles_across = totals.shape[1], totals.shape[2]
    # Events of both polarities in the last three rows, and in three rows together.
    recent, together = np.zeros((3, width), np.int32), np.empty(width, np.int32)
    for row in range(height):
        line, off, on = recent[row % 3], between[0, row], between[1, row]
        for column in range(width):
            line[column] = off[column] + on[column]
        if row < 2:
            continue
        for column in range(width):
            together[column] = recent[0, column] + recent[1, column] + recent[2, column]
        middle, of_row = recent[(row - 1) % 3], totals[:, (row - 1) * tiles_down // height]
        for tile in range(tiles_across):
            # Columns c with c * tiles_across // width == tile, without those at the border.
            first = max(-(-tile * width // tiles_across), 1)
            stop = min(-(-(tile + 1) * width // tiles_across), width - 1)
            if first >= stop:
                continue
            own, left, here, right = (middle[first:stop], together[first - 1 : stop - 1], together[first:stop],
                                      together[first + 1 : stop + 1])  # fmt: skip
            lone, silent = np.int32(0), np.int32(0)
            for column in range(len(own)):
                of_block = left[column] + here[column] + right[column]
                silent += np.int32(of_block == 0)
                lone += np.int32((of_block == 1) & (own[column] == 1))
            of_row[0, tile] += lone
            of_row[1, tile] += silent
