"""Effects of a real event pixel: mismatch of thresholds, finite bandwidth, spurious events.

Sources: Hu, Liu and Delbruck, "v2e: From Video Frames to Realistic DVS Events" (2021), for mismatch, bandwidth, leak
and shot noise; Rebecq, Gehrig and Scaramuzza, "ESIM" (2018), for the refractory period. Unlike v2e, thresholds and
bandwidth do not depend on light here, so that what a file declares holds everywhere in it.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_generator.events.keys import KeyLayout
from fedora_qa.conventions import US_PER_S

Floats = NDArray[np.float64]

THRESHOLD_FLOOR: Final = 0.1
"""A pixel's threshold is at least this share of the nominal one: the tail of a normal distribution reaches below 0."""

_BLOCK_US: Final = 50_000
"""Spurious events are drawn in blocks of this length, each from a stream of its own, whatever the steps are."""


def draw_thresholds(nominal: float, sigma: float, shape: tuple[int, int], rng: np.random.Generator) -> Floats:
    """Thresholds (H, W), fixed for the whole recording, normal about ``nominal`` with a floor; one row without spread.

    A row that all rows share stays in the first cache.

    Parameters
    ----------
    nominal
        Mean of the thresholds.
    sigma
        Their standard deviation, in the same unit.
    shape
        (H, W) of the sensor.
    rng
        Source of the draw.

    Returns
    -------
    thresholds
        (H, W), at least a tenth of the nominal one; (1, W) without spread.
    """
    if sigma == 0:
        return np.full((1, shape[1]), nominal)
    return np.maximum(rng.normal(nominal, sigma, shape), THRESHOLD_FLOOR * nominal)


def draw_hot_pixels(count: int, pixels: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return ``count`` different pixel numbers in ascending order."""
    return np.sort(rng.choice(pixels, size=count, replace=False)).astype(np.int64)


class LowPass:
    """First-order low-pass, exact for an input that is a straight line between samples.

    ``tau y' = x - y`` with tau = 1 / (2 pi bandwidth). Where x = x0 + s t the solution is
    ``y(t) = x(t) - s tau + (y0 - x0 + s tau) exp(-t / tau)``: cutting a step in two changes nothing but rounding.
    """

    def __init__(self, bandwidth_hz: float, initial: Floats) -> None:
        self._tau_s = 1 / (2 * math.pi * bandwidth_hz)
        self._input = initial.copy()
        self._output = initial.copy()

    def advance(self, step_s: float, value: Floats) -> None:
        """Replace ``value``, the input at the end of the step, by the output there."""
        lag = (value - self._input) * (self._tau_s / step_s)
        output = value - lag + (self._output - self._input + lag) * math.exp(-step_s / self._tau_s)
        np.copyto(self._input, value)
        np.copyto(self._output, output)
        np.copyto(value, output)


@dataclass(slots=True)
class PoissonEvents:
    """Spurious events of random polarity: each of ``among`` fires as a Poisson process of ``rate_hz``.

    The reference of the pixel does not move: a spurious event is added to the stream and hides no true one, so that
    the declared rate is the rate of events that no brightness explains.
    """

    rate_hz: float
    among: NDArray[np.int64]
    """Places of the pixels, as in a key"""
    layout: KeyLayout
    seed: np.random.SeedSequence
    _drawn_blocks: int = 0
    _waiting: NDArray[np.int64] | None = None

    def take_until(self, stop_us: int) -> NDArray[np.int64]:
        """Return the sorted keys, not returned before, of events up to and including ``stop_us``."""
        waiting = [] if self._waiting is None else [self._waiting]
        while self._drawn_blocks * _BLOCK_US < stop_us:
            block = self._drawn_blocks
            spawn_key = (*self.seed.spawn_key, block)
            rng = np.random.default_rng(np.random.SeedSequence(self.seed.entropy, spawn_key=spawn_key))
            count = rng.poisson(self.rate_hz * self.among.size * _BLOCK_US / US_PER_S)
            timestamps_us = block * _BLOCK_US + rng.integers(1, _BLOCK_US, count, endpoint=True)
            places = rng.choice(self.among, count)
            polarities = rng.integers(0, 1, count, endpoint=True)
            waiting.append(np.sort((timestamps_us << self.layout.timestamp_shift) | (places << 1) | polarities))
            self._drawn_blocks += 1
        keys = np.concatenate([np.empty(0, np.int64), *waiting])
        split = int(np.searchsorted(keys, self.layout.first_key_after(stop_us)))
        self._waiting = keys[split:]
        return keys[:split]
