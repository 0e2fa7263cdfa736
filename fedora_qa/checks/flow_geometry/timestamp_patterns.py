"""In what way stamps leave the frames that they should lie on: by a constant, by a drift, or onto a grid of their own.

Each way is fitted to the offsets of the stamps from their nearest frames, and weighed by the share of the offsets that
it takes away. Where several take away all but the rounding of stamps, the one with the fewest numbers is meant.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS

Int64 = NDArray[np.int64]
Float64 = NDArray[np.float64]

_ROUNDING_NS: Final = 1_000
"""Stamps are whole microseconds: an offset of two rounded stamps errs by at most one."""

_FEWEST_ON_A_GRID: Final = 3
"""Instants from which on a common divisor of their steps means something."""

_UNITS: Final = (1e-6, 1e-3, 1e3, 1e6)
_SAME_UNIT: Final = 0.02


@dataclass(frozen=True, slots=True)
class TimestampPattern:
    """A cause, its size in the cause's unit, and the share of the offsets that it explains, 0 to 1."""

    cause: str
    magnitude: float
    weight: float


def timestamp_patterns(instants_ns: Int64, frames_ns: Int64) -> tuple[TimestampPattern, ...]:
    """Return the ways in which instants (n,) may have left the frames (m,), n and m at least 1, best first.

    Offsets are seen modulo the frame step. Magnitudes are those of the instants: positive where they are too late.
    """
    offsets_ns = offsets_from_nearest(frames_ns, instants_ns)
    steps_ns = np.diff(np.sort(frames_ns))
    step_ns = float(np.median(steps_ns)) if len(steps_ns) else np.inf
    if np.median(np.abs(offsets_ns)) > step_ns:
        return _another_unit(instants_ns, step_ns)
    before = _typical(offsets_ns)
    patterns = []
    for fit in (_constant, _drift, _grid):
        cause, magnitude, left_ns = fit(instants_ns, offsets_ns)
        left_ns = np.abs(left_ns)
        left_ns = np.minimum(left_ns % step_ns, -left_ns % step_ns) if np.isfinite(step_ns) else left_ns
        left = _typical(np.maximum(left_ns - _ROUNDING_NS, 0.0))
        patterns.append(TimestampPattern(cause, magnitude, max(1.0 - left / before, 0.0) if before > 0 else 0.0))
    return tuple(sorted(patterns, key=lambda pattern: -round(pattern.weight, 2)))


def _another_unit(instants_ns: Int64, frame_step_ns: float) -> tuple[TimestampPattern, ...]:
    """Return another unit of time where instants that lie beyond all frames step by a thousand times as much, or less.

    Anything else that far away is no offset: these are seen modulo the frame step.
    """
    steps_ns = np.diff(np.unique(instants_ns))
    ratio = float(np.median(steps_ns)) / frame_step_ns if len(steps_ns) else 0.0
    unit = next((unit for unit in _UNITS if abs(ratio / unit - 1) < _SAME_UNIT), None)
    return () if unit is None else (TimestampPattern("time_unit", unit, 1.0),)


def offsets_from_nearest(frames_ns: Int64, instants_ns: Int64) -> Float64:
    """Return how much later each instant (n,) is than the frame nearest to it, ns."""
    ordered = np.sort(frames_ns)
    after = np.clip(np.searchsorted(ordered, instants_ns), 1, max(len(ordered) - 1, 1))
    around = np.stack((ordered[after - 1], ordered[np.minimum(after, len(ordered) - 1)]))
    offsets = (instants_ns - around).astype(np.float64)
    nearest: Float64 = np.where(np.abs(offsets[0]) <= np.abs(offsets[1]), offsets[0], offsets[1])
    return nearest


def _constant(_: Int64, offsets_ns: Float64) -> tuple[str, float, Float64]:
    middle_ns = float(np.median(offsets_ns))
    return "time_offset", middle_ns / NS_PER_MS, offsets_ns - middle_ns


def _grid(instants_ns: Int64, offsets_ns: Float64) -> tuple[str, float, Float64]:
    """Instants that are whole multiples of a grid explain offsets of up to half of it."""
    steps_ns = np.diff(np.unique(instants_ns))
    grid_ns = int(np.gcd.reduce(steps_ns)) if len(steps_ns) >= _FEWEST_ON_A_GRID - 1 else 0
    left_ns = np.maximum(np.abs(offsets_ns) - grid_ns / 2, 0.0) if grid_ns > 2 * _ROUNDING_NS else offsets_ns
    return "quantised_time", grid_ns / NS_PER_MS, left_ns


def _drift(instants_ns: Int64, offsets_ns: Float64) -> tuple[str, float, Float64]:
    """Draw a line through the offsets: from the median of steps, so that a step across a frame does not count."""
    order = np.argsort(instants_ns, kind="stable")
    steps_ns, rises_ns = np.diff(instants_ns[order]), np.diff(offsets_ns[order])
    advancing = steps_ns > 0
    slope = float(np.median(rises_ns[advancing] / steps_ns[advancing])) if advancing.any() else 0.0
    drifted_ns = offsets_ns - slope * (instants_ns - instants_ns.min())
    return "clock_rate", 1e6 * slope, drifted_ns - np.median(drifted_ns)


def _typical(values_ns: Float64) -> float:
    return float(np.sqrt(np.mean(values_ns**2)))
