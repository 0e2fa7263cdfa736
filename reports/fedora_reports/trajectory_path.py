"""The path of a flight as drawings need it: the poses that can be drawn, and a box of round metres around them."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_reports.colour_maps import SEQUENTIAL
from fedora_reports.scales import Axis

Float64 = NDArray[np.float64]

_STILL_M: Final = 1e-6
"""A path within this length is a point; it gets a box of a metre."""
_STILL_M_S: Final = 1e-6
_LEAST_SHARES: Final = np.array([0.4, 0.4, 0.15])
"""Least sides of the box as shares of its longest side, so that a straight or a vertical flight has a ground."""


@dataclass(frozen=True, slots=True)
class FlownPath:
    """Poses whose positions are finite, in the order of time; speeds and directions may be NaN.

    Attributes
    ----------
    times_us
        (n,), on the file's clock.
    positions_world_m, forward_world
        (n, 3): positions, and the body's X axis.
    speeds_m_s
        (n,).
    runs
        Half-open ranges of rows between which positions are missing.
    """

    times_us: Float64
    positions_world_m: Float64
    speeds_m_s: Float64
    forward_world: Float64
    runs: tuple[tuple[int, int], ...]

    @property
    def speed_range_m_s(self) -> tuple[float, float] | None:
        """The least and the greatest finite speed; None where there is none."""
        finite = self.speeds_m_s[np.isfinite(self.speeds_m_s)]
        return (float(finite.min()), float(finite.max())) if finite.size else None

    @property
    def speed_varies(self) -> bool:
        """Whether speeds differ by more than a thousandth of the greatest speed, and by more than rounding."""
        low, high = self.speed_range_m_s or (0.0, 0.0)
        return high - low > max(1e-3 * max(abs(low), abs(high)), _STILL_M_S)


@dataclass(frozen=True, slots=True)
class Box:
    """The space of a drawing, metres in the world: whole steps of a round size, ``low`` to ``high`` (3,)."""

    low_m: Float64
    high_m: Float64

    @property
    def centre_m(self) -> Float64:
        """Its centre (3,)."""
        return self.low_m / 2 + self.high_m / 2

    @property
    def span_m(self) -> float:
        """Its longest side."""
        return float(np.max(self.high_m - self.low_m))

    def ticks(self, axis: int, most: int = 7) -> tuple[tuple[float, str], ...]:
        """Return round metres along an axis (0 X, 1 Y, 2 Z) with their labels; short sides get fewer."""
        low, high = float(self.low_m[axis]), float(self.high_m[axis])
        # Far from the origin (1e17 m) metres are below the resolution of float64, and all sides are zero.
        wanted = max(1, round(most * (high - low) / self.span_m)) if self.span_m > 0 else 1
        return tuple((low + tick.share * (high - low), tick.label) for tick in Axis(low, high).ticks(wanted))


def flown_path(times_us: Any, positions_world_m: Any, speeds_m_s: Any, forward_world: Any, *, most: int) -> FlownPath:
    """Keep the poses that can be drawn.

    Parameters
    ----------
    times_us
        (n,), on the file's clock.
    positions_world_m
        (n, 3); a pose whose position is not finite is left out.
    speeds_m_s
        (n,).
    forward_world
        (n, 3), the body's X axis.
    most
        Largest number of poses; more are thinned evenly.

    Raises
    ------
    ValueError
        Where the arrays are not (n,), (n, 3), (n,) and (n, 3).
    """
    times, speeds = np.asarray(times_us, dtype=np.float64), np.asarray(speeds_m_s, dtype=np.float64)
    places, forward = np.asarray(positions_world_m, dtype=np.float64), np.asarray(forward_world, dtype=np.float64)
    shapes = (times.shape, places.shape, speeds.shape, forward.shape)
    n = len(times) if times.ndim == 1 else -1
    if shapes != ((n,), (n, 3), (n,), (n, 3)):
        raise ValueError(f"Expected shapes (n,), (n, 3), (n,) and (n, 3), got {', '.join(map(str, shapes))}")
    thin = np.unique(np.linspace(0, n - 1, most).round().astype(np.intp)) if n > most else np.arange(n)
    kept = thin[np.isfinite(places[thin]).all(axis=1)]
    breaks = np.flatnonzero(np.diff(np.searchsorted(thin, kept)) > 1) + 1
    edges = [0, *breaks.tolist(), len(kept)] if len(kept) else []
    return FlownPath(times[kept], places[kept], speeds[kept], forward[kept], tuple(pairwise(edges)))


def box_around(positions_world_m: Float64) -> Box:
    """Return a box of round metres around finite positions (n, 3), n > 0. A thin side is widened."""
    low, high = positions_world_m.min(axis=0), positions_world_m.max(axis=0)
    span = float(np.max(high - low))
    span = span if span > _STILL_M else 1.0
    sides = np.maximum(high - low, _LEAST_SHARES * span)
    flat_step = round_step_m(span / 10)
    steps = np.array([flat_step, flat_step, round_step_m(sides[2] / 4)])
    middle = low / 2 + high / 2
    return Box(np.floor((middle - sides / 2) / steps) * steps, np.ceil((middle + sides / 2) / steps) * steps)


def speed_colours(n: int) -> tuple[str, ...]:
    """Return n colours from slow to fast, without the darkest and brightest: lines are visible on any background."""
    return tuple("#" + bytes(SEQUENTIAL[level]).hex() for level in np.linspace(64, 250, n).astype(int))


def round_step_m(rough_m: float) -> float:
    """Return the least 1, 2 or 5 times a power of ten that is not below ``rough_m``."""
    power = 10.0 ** np.floor(np.log10(rough_m))
    return float(next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough_m * (1 - 1e-9)))
