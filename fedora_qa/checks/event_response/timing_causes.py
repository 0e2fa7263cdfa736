"""What a delay of events over time looks like: an offset, another clock rate, or a late stretch; and whose it is."""

from dataclasses import dataclass
from math import hypot
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Suspect
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.clock_resets import ClockReset
from fedora_qa.views.event_clock_offset import Lateness, Local

Float64 = NDArray[np.float64]

_EITHER: Final = (0.9, 0.8)
"""Weights of an offset of the events and of the frames where nothing tells them apart."""


@dataclass(frozen=True, slots=True)
class Shapes:
    """Probabilities that delays are one offset, grow with time, or are those of a stretch only."""

    constant: float = 0.8
    drift: float = 0.1
    stretch: float = 0.1


def shapes_of(local: Local, times_s: Float64, expected_s: float) -> Shapes:
    """Compare three courses of the delay over the windows, in proportion to exp(-BIC / 2) (Schwarz 1978).

    An offset and a rate (delay 0 at the origin of the file) have one parameter each, a stretch has its ends besides.
    Residuals of the best course count as noise.
    """
    known = np.isfinite(local.values_s) & np.isfinite(local.errors_s)
    late, errors, at = (local.values_s - expected_s)[known], local.errors_s[known], times_s[known]
    inside = local.step.chosen[known]
    count = len(late)
    courses = ((np.ones(count), 1), (at, 1), (inside.astype(np.float64), 3))
    squares = np.array([_left(late / errors, course / errors) for course, _ in courses])
    noise = max(1.0, float(squares.min()) / max(count - 1, 1))
    criteria = squares / noise + np.array([free for _, free in courses]) * np.log(count)
    shares = np.exp(-0.5 * (criteria - criteria.min()))
    shares /= shares.sum()
    return Shapes(*(float(share) for share in shares))


def with_steps(shapes: Shapes, local: Local, was_set: ClockReset | None) -> Shapes:
    """Tell a stretch that is late from one whose clock gains, by the steps of stamps where the clock was set back.

    Without a step forwards a stretch that reaches to an end of what is known was late at once; others can only have
    gained.
    """
    known = np.flatnonzero(np.isfinite(local.values_s) & np.isfinite(local.errors_s))
    one_sided = bool(local.step.chosen[known[0]] or local.step.chosen[known[-1]])
    if was_set is None or (was_set.forwards is None and one_sided):
        return shapes
    gains, late = was_set.drift_agreement, was_set.offset_agreement
    moved = shapes.stretch * gains / (gains + late) if gains > 0 else 0.0
    return Shapes(shapes.constant, shapes.drift + moved, shapes.stretch - moved)


def whose_offset(offset_ms: float, facts: Facts) -> tuple[float, float]:
    """Return the weights of an offset of the events, and of the frames: do those keep in step with depth and flow?

    A renderer draws colour, depth and flow at common times. Frames that leave them by the offset are moved themselves,
    and frames that still meet them were not.
    """
    clocks = [facts.clocks[stream] for stream in ("depth", *facts.flow_streams) if stream in facts.clocks]
    common_ns = np.unique(np.concatenate([clock.times_ns for clock in clocks])) if clocks else np.zeros(0, np.int64)
    frames_ns = facts.clocks["rgb"].times_ns
    if len(common_ns) < 2 or not len(frames_ns):
        return _EITHER
    near_ns = abs(offset_ms) * 1e6 / 4
    as_timestamped = _median_distance(frames_ns, common_ns) < near_ns
    moved_back = _median_distance(frames_ns + round(1e6 * offset_ms), common_ns) < near_ns
    if as_timestamped == moved_back:
        return _EITHER
    return _EITHER[::-1] if moved_back else (_EITHER[0], _EITHER[1] / 2)


def _left(values: Float64, course: Float64) -> float:
    """Return the sum of squares that a multiple of a course leaves of values."""
    share = float(values @ course) / max(float(course @ course), 1e-300)
    return float(np.sum((values - share * course) ** 2))


def _median_distance(times_ns: NDArray[np.int64], grid_ns: NDArray[np.int64]) -> float:
    """Return the median distance of stamps from the nearest of a sorted grid of two or more."""
    after = np.clip(np.searchsorted(grid_ns, times_ns), 1, len(grid_ns) - 1)
    return float(np.median(np.minimum(np.abs(times_ns - grid_ns[after - 1]), np.abs(grid_ns[after] - times_ns))))


def offset_suspects(
    offset_ms: float, error_ms: float, facts: Facts, share: float, *, told: bool = True
) -> tuple[Suspect, ...]:
    """Return an offset of the events and of the frames as causes, with its size where that is ``told``."""
    of_events, of_frames = (share * weight for weight in whose_offset(offset_ms, facts))
    if not told:
        return Suspect("time_offset", "events", of_events), Suspect("time_offset", "rgb", of_frames)
    return (
        Suspect("time_offset", "events", of_events, offset_ms, "ms", error_ms),
        Suspect("time_offset", "rgb", of_frames, -offset_ms, "ms", error_ms),
    )


def rate_suspects(found: Lateness, share: float) -> tuple[Suspect, ...]:
    """Return a clock rate of the events and of the frames as causes, with its size."""
    ppm, error = 1e6 * found.rate, 1e6 * hypot(found.rate_error, found.rate_bound)
    return (
        Suspect("clock_rate", "events", 0.9 * share, ppm, "ppm", error),
        Suspect("clock_rate", "rgb", 0.8 * share, -ppm, "ppm", error),
    )
