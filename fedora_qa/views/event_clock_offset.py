"""How late events are: over a file, over each stretch of time, over each part of the image."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, isfinite, pi
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.events.delays import (
    Step,
    delays,
    delays_of_parts,
    latest_rectangle,
    latest_stretch,
)
from fedora_qa.estimators.events.footprint import LEFT_BY_SHARP
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.event_tick import tick_ns
from fedora_qa.views.event_tiles import GRID
from fedora_qa.views.frame_interpolation import KINDS, ReadingFits, ReadingSums, cell_sums, fit_all
from fedora_qa.views.level_samples import HELD_LEVEL_BIAS
from fedora_qa.views.threshold_fit import CAPTURE_RANGE_S, Answer

Float64 = NDArray[np.float64]

READ_WITHIN_S: Final = 10e-3
"""Half a frame interval at 50 Hz: where levels can be read between frames, their slope changes little in that time."""

READ_WELL: Final = 0.3
"""Residual, in thresholds, beyond which frames are too far apart to tell a level between them (or events do not follow
them): a level at random within its thresholds leaves 0.3 to 0.6."""

FEWEST_PARTS: Final = 4
"""Windows or tiles of known delay below which none stands out."""


@dataclass(frozen=True, slots=True)
class Lateness:
    """How late events are at the middle of a file, and how that grows; standard errors and bounds on bias.

    Beyond ``told_within_s`` the offset is read too small.
    """

    late_s: float
    error_s: float
    bound_s: float
    rate: float
    rate_error: float
    rate_bound: float
    capture_range_s: float


@dataclass(frozen=True, slots=True)
class Local:
    """A part that is late against the others; delays and errors (k,) of all parts."""

    step: Step
    values_s: Float64
    errors_s: Float64


def expected_delay_ms(declared: EventModel | None, facts: Facts) -> tuple[float, float]:
    """Return the mean lateness of events, and the error of that expectation."""
    if declared is None:
        return 0.0, 0.0
    low_pass_ms = 1e3 / (2 * pi * declared.bandwidth_hz) if declared.bandwidth_hz > 0 else 0.0
    tick_ms = tick_ns(facts) / 1e6
    if declared.model == "linear":
        return low_pass_ms, 0.0
    declared_ms = max(declared.packet_interval_us, 1) * NS_PER_US / 1e6
    # A grid that nobody declared may come from rounding up, down or to the nearest tick.
    return declared_ms / 2 + low_pass_ms, max(tick_ms - declared_ms, 0.0)


def told_error_ms(found: Lateness, offset_ms: float, bound_ms: float, facts: Facts) -> float:
    """Return the error of an offset as it is told: its own, that of ``bound_ms``, and by how much it is read too small.

    Light does not change evenly for long. A change of angular frequency w, moved by d, is read as sin(w d) / w in place
    of d. Frames an interval h apart show changes up to w = pi / h; half of that is taken for what edges are made of.
    Offsets that were searched for are undone before they are read.
    """
    interval_ms = float(np.median(np.diff(facts.clocks["rgb"].times_ns))) / 1e6
    read = (
        max(float(np.sinc(0.5 * offset_ms / max(interval_ms, 1e-6))), 0.0) if isfinite(found.capture_range_s) else 1.0
    )
    return hypot(1e3 * found.error_s, bound_ms, offset_ms * (1.0 - read))


def by_levels(found: Answer, declared: EventModel) -> Lateness:
    """Return what bracketed level samples say.

    Levels of the linear model jump at events and hold until the next where edges pass within a few rendered steps:
    such errors scatter about the fit, and may act as one by ``HELD_LEVEL_BIAS`` times their scatter.
    """
    fit, bounds = found.fit, found.model_errors
    held_s = HELD_LEVEL_BIAS * fit.coherent_delay_s if declared.model == "linear" else 0.0
    errors = fit.standard_errors
    return Lateness(
        fit.delay_s,
        errors.delay_s,
        bounds.delay_s + held_s,
        fit.delay_rate,
        errors.delay_rate,
        bounds.delay_rate,
        CAPTURE_RANGE_S,
    )


def by_readings(found: ReadingFits) -> Lateness | None:
    """Return what frames read at events say; None where events do not follow the frames."""
    fit, coarse, even = found.fit, found.coarse, found.even
    if fit.relative_sigma > READ_WELL or min(fit.threshold_on, fit.threshold_off) <= 0:
        return None

    def bound(name: str) -> float:
        own = getattr(fit, name)
        return float(abs(own - getattr(coarse, name)) + LEFT_BY_SHARP * abs(own - getattr(even, name)))

    errors = fit.standard_errors
    return Lateness(
        fit.delay_s,
        errors.delay_s,
        bound("delay_s"),
        fit.delay_rate,
        errors.delay_rate,
        bound("delay_rate"),
        READ_WITHIN_S,
    )


def late_stretch(state: Sequence[ReadingSums]) -> Local | None:
    """Return the stretch of windows that is late against the others; None where too few windows have a delay."""
    return _local(state, 1)


def late_region(state: Sequence[ReadingSums]) -> Local | None:
    """Return the rectangle of tiles that is late against the others; None where too few tiles have a delay."""
    return _local(state, 0)


def _local(state: Sequence[ReadingSums], summed: int) -> Local | None:
    fits = fit_all(state)
    if fits is None:
        return None
    kappas_s = fits.fit.kappa_s, fits.coarse.kappa_s, fits.even.kappa_s
    fine, coarse, even = (cell_sums(state, kind, kappa_s) for kind, kappa_s in zip(KINDS, kappas_s, strict=True))
    found = delays_of_parts(fine, summed)
    values = np.where(found.known & (found.relative_sigmas <= READ_WELL), found.seconds, np.nan)
    # What bounds the bias of a whole file differs from part to part, and is noise to their comparison.
    by_time = values - delays(coarse.over(summed)).seconds
    by_place = LEFT_BY_SHARP * (values - delays(even.over(summed)).seconds)
    errors = np.sqrt(found.errors_s**2 + by_time**2 + by_place**2)
    if np.count_nonzero(np.isfinite(values) & np.isfinite(errors)) < FEWEST_PARTS:
        return None
    windows = len(state) - 1.0
    step = latest_stretch(values, errors) if summed == 1 else latest_rectangle(values, errors, (GRID, GRID), windows)
    return Local(step, values, errors) if step is not None else None
