"""Sums over sampled pixels, small enough to be kept for every window."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any, Final

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.causes import in_families
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.images.luma import LUMA_WEIGHTS, sampled_luma
from fedora_qa.sequence.window import USUAL_PIXELS, Window

_STRIDE: Final = 4
_SMALL_IMAGE_PX: Final = 128

_ENOUGH: Final = 14_000
"""Approximate number of sampled pixels of a large image: that of 540x405.

Larger images use every second, third ... row and column of the sample, unless all is used (``exhaustive``, ``fedora-qa
stats``): one ninth of 1440x1080. Histograms are as smooth with a ninth of 5 million values a second. Over 1 s of
park-day, means differ by 3 in 10,000 at most from those of the whole sample, the greatest flow and the least depth by 9
in 1000.
"""


@dataclass(frozen=True, slots=True)
class ValueMoments:
    """Sums over sampled values.

    Attributes
    ----------
    sampled
        Number of sampled values.
    count
        Number of valid values among them.
    total, squares
        Sum and sum of squares of the valid values.
    least, greatest
        Extremes of the valid values; infinite where there are none.
    """

    sampled: int = 0
    count: int = 0
    total: float = 0.0
    squares: float = 0.0
    least: float = inf
    greatest: float = -inf

    @classmethod
    def of(cls, values: NDArray[np.floating[Any]], *, positive: bool = False) -> "ValueMoments":
        """Sum the valid values of an array, in double precision.

        Parameters
        ----------
        values
            Of any shape and unit.
        positive
            Whether only values above zero are valid; values that are not finite never are.
        """
        flat = np.ascontiguousarray(values).ravel()
        return cls(flat.size, *_sums_of(flat, positive))

    @property
    def mean(self) -> float | None:
        """Mean of the valid values; None where there are none."""
        return self.total / self.count if self.count else None

    @property
    def variance(self) -> float | None:
        """Variance of the valid values about their mean; None where there are none."""
        # E[x^2] - E[x]^2; rounding can leave a small negative number of values that are all alike.
        return max(self.squares / self.count - (self.total / self.count) ** 2, 0.0) if self.count else None

    @property
    def valid_share(self) -> float | None:
        """Share of the sampled values that are valid; None where there are none."""
        return self.count / self.sampled if self.sampled else None


def added(parts: Iterable[ValueMoments]) -> ValueMoments:
    """Add moments in the order given."""
    total = ValueMoments()
    for part in parts:
        total = ValueMoments(
            sampled=total.sampled + part.sampled,
            count=total.count + part.count,
            total=total.total + part.total,
            squares=total.squares + part.squares,
            least=min(total.least, part.least),
            greatest=max(total.greatest, part.greatest),
        )
    return total


def sampled_depth_m(window: Window, frame: int) -> NDArray[np.float32]:
    """Return the depth at the sampled pixels of a frame (h, w), m; NaN where invalid.

    These are every fourth column of every fourth row, all pixels of small images, and fewer of large ones.
    """
    depth_m = window.depth_m(frame)
    first, stride = _lattice(depth_m, window)
    return np.ascontiguousarray(depth_m[first::stride, first::stride])


def sampled_speeds_px(window: Window, stream: str, field: int) -> NDArray[np.float32]:
    """Return the length of flow at the sampled pixels of a field (h, w), px over its interval; NaN where invalid."""
    flow_px = window.flow_px(stream, field)
    return _lengths_at(np.ascontiguousarray(flow_px, dtype=np.float32), *_lattice(flow_px, window))


def sampled_luma_dn(window: Window, frame: int) -> NDArray[np.float32]:
    """Return the luma of the stored codes at the sampled pixels of a colour frame (h, w), DN."""
    rgb = window.rgb(frame)
    return sampled_luma(np.ascontiguousarray(rgb), *_lattice(rgb, window), LUMA_WEIGHTS)


def readable_samples(
    window: Window,
    stream: str,
    sample: Callable[..., NDArray[np.float32]],
    *arguments: str,
    families: frozenset[str] | None,
) -> Iterator[NDArray[np.float32]]:
    """Yield the samples of the images of a stream that a window owns and that can be decoded.

    Parameters
    ----------
    stream
        Any stream of images; none of a stream that the file does not have.
    sample, *arguments
        A function of this module, and what it takes between the window, which keeps the result, and the row.
    families
        Streams that are read (``flow`` is every rate); None: all.
    """
    if stream not in window.facts.streams or not in_families(stream, families):
        return
    for row in window.owned(stream):
        try:
            yield window.derived(sample, *arguments, row)
        except UnreadableRowsError:
            continue


def _lattice(image: NDArray[Any], window: Window) -> tuple[int, int]:
    """Return the first sampled row and column of an image, and the step to the next."""
    height, width = image.shape[:2]
    if min(height, width) < _SMALL_IMAGE_PX:
        return 0, 1
    fewer = height * width > USUAL_PIXELS and window.sampling.tile_share < 1.0
    # A whole multiple of the usual stride: about _ENOUGH pixels of the image are left.
    stride = _STRIDE * (max(1, round(sqrt(height * width / _STRIDE**2 / _ENOUGH))) if fewer else 1)
    # The lattice begins half a stride from the edge, so that it is centred in the image.
    return stride // 2, stride


@njit(cache=True)
def _sums_of(values: NDArray[np.floating[Any]], positive: bool) -> tuple[int, float, float, float, float]:
    """Return count, sum, sum of squares, least and greatest of the values (n,) that are finite, and positive if asked.

    Sums are taken in double precision, of blocks of 1024 first, so that rounding does not pile up.
    """
    count, total, squares, least, greatest = 0, 0.0, 0.0, np.inf, -np.inf
    for start in range(0, len(values), 1024):
        block_total, block_squares = 0.0, 0.0
        for i in range(start, min(start + 1024, len(values))):
            value = np.float64(values[i])
            if abs(value) < np.inf and (value > 0.0 or not positive):
                count += 1
                block_total += value
                block_squares += value * value
                least = value if value < least else least
                greatest = value if value > greatest else greatest
        total, squares = total + block_total, squares + block_squares
    return count, total, squares, least, greatest


@njit(cache=True)
def _lengths_at(flow_px: NDArray[np.float32], first: int, stride: int) -> NDArray[np.float32]:
    """Return the length of a flow (H, W, 2) at every ``stride``-th row and column from ``first`` on, (h, w)."""
    rows, columns = len(range(first, flow_px.shape[0], stride)), len(range(first, flow_px.shape[1], stride))
    lengths = np.empty((rows, columns), np.float32)
    for row in range(rows):
        line = flow_px[first + row * stride]
        for column in range(columns):
            u, v = line[first + column * stride, 0], line[first + column * stride, 1]
            lengths[row, column] = np.sqrt(u * u + v * v)
    return lengths
