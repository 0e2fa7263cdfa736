"""Columns or rows at the right or lower border of a sensor, of which no pixel has an event.

A declared size that is too large adds columns on the right and rows at the bottom, because coordinates count from 0. A
view without edges, such as an even floor, leaves a border silent as well. The pixels with events are counted in strips
parallel to the border. As the counts of a rate that differs between strips, they follow a gamma-Poisson distribution,
and the silent border is one more strip, which is empty with the probability of ``log_chance_of_empty_bin``.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri_exp

from fedora_qa.estimators.events.rates import BINS, log_chance_of_empty_bin

_FEWEST_STRIPS: Final = 4
"""Least number of strips, and number of the nearest that are also compared by themselves."""


@dataclass(frozen=True, slots=True)
class SilentBorder:
    """Columns or rows at a border without events.

    Attributes
    ----------
    width_px
        Their number, 1 at least.
    expected
        Number of pixels with events that are expected in as many of them as a strip has.
    z
        Deviate of a standard normal distribution with the same tail probability; 0 at least.
    """

    width_px: int
    expected: float
    z: float


def silent_border(active: NDArray[np.int64]) -> SilentBorder | None:
    """Compare the last columns, or rows, without events with those beside them.

    Parameters
    ----------
    active
        (n,) number of pixels with events in each column, or row.

    Returns
    -------
    SilentBorder or None
        None where the last one has events, or fewer than four strips have any.
    """
    reach = int(np.flatnonzero(active)[-1]) + 1 if active.any() else 0
    width_px = len(active) - reach
    # A strip is as wide as the border, or less where as many would not fit beside it: its silence is the more probable.
    strip_px = min(width_px, max(reach // BINS, 1))
    if width_px == 0 or reach < _FEWEST_STRIPS * strip_px:
        return None
    count = reach // strip_px
    strips = active[reach - count * strip_px : reach].reshape(count, strip_px).sum(axis=1)
    nearest = np.arange(count) >= count - _FEWEST_STRIPS
    # As for silences in time: by all strips, or by the nearest four, whichever makes it more probable.
    means, log_chances = log_chance_of_empty_bin(np.stack([strips, strips]), np.stack([nearest | True, nearest]))
    likeliest = int(np.argmax(log_chances))
    z = max(float(-ndtri_exp(log_chances[likeliest])), 0.0)
    return SilentBorder(width_px, float(means[likeliest]), z)
