"""Events against log intensity: thresholds, sensor model, time."""

from collections.abc import Sequence
from math import hypot, pi
from typing import Final

from fedora_qa.checks.event_levels import Answer, LevelSums, answer, level_sums
from fedora_qa.checks.event_stream import tick_ns
from fedora_qa.checks.event_view import why_frames_and_events_do_not_meet
from fedora_qa.checks.protocol import Measured, Observation, Suspect, WindowCheck
from fedora_qa.conventions import NS_PER_US
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

EVENTS: Final = Where(stream="events")

EXPOSURE_BIAS: Final = 0.05
EXPOSURE_OF_BIAS_US: Final = 5_000.0
"""A frame exposed for 5 ms takes 5% off the threshold; the loss of contrast grows with the square of the time."""

DRIFT_KNOWN: Final = 5.0
"""Standard errors of the clock rate beyond which an offset is suspected to be part of it (after an alarm only)."""

DOMAIN_PREFERRED: Final = 3.0
"""Standard errors by which the other domain must fit better to be suspected (after an alarm only)."""


class _Levels(WindowCheck[LevelSums]):
    """A check of the levels that events tell at frame times."""

    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> LevelSums | None:
        """Sum the window's level samples."""
        return level_sums(window)

    def conclude(self, state: Sequence[LevelSums], facts: Facts) -> Observation:
        """Fit, and state."""
        coverage = _coverage(state, facts)
        declared = facts.declared.events
        found = answer(state, facts)
        if isinstance(found, str) or declared is None:
            return Observation(coverage, unobservable=str(found))
        return Observation(coverage, self.state(found, declared, facts))

    def state(self, found: Answer, declared: EventModel, facts: Facts) -> tuple[Measured, ...]:
        """Turn the fits into measurements."""
        raise NotImplementedError


class Threshold(_Levels):
    """Do events step by the declared thresholds?

    The change of L (of rint(luma) for the linear model) between two frame times at which the events themselves tell
    a pixel's level is regressed on the events in between, robustly, C+ and C- apart, with the time offset as a
    nuisance (``event_levels``). Standard errors are the larger of the formal and the spread between quarters of the
    image and windows. Allowances: what the frames' pixels do not tell of the footprint (two reconstructions bracket
    it), attenuation by errors of the regressors, declared spread of thresholds (pixels of low threshold fire more,
    by up to six times the squared relative spread), exposure. For the linear model a step goes beyond the threshold
    by half of what the signal moves in a rendered step. Gamma cannot be told from the threshold: it must be declared.
    """

    name = "event_response.threshold"
    _MATTERS_PERCENT: Final = 25.0

    def state(self, found: Answer, declared: EventModel, facts: Facts) -> tuple[Measured, ...]:
        """State both thresholds in percent of what is declared."""
        return tuple(self._one(found, declared, facts, side) for side in (0, 1))

    def _one(self, found: Answer, declared: EventModel, facts: Facts, side: int) -> Measured:
        name, word = (("threshold_on", "Brighter"), ("threshold_off", "Darker"))[side]
        nominal = (declared.threshold_on, declared.threshold_off)[side]
        fitted = (found.sharp.threshold_on, found.sharp.threshold_off)[side]
        plain = (found.even.threshold_on, found.even.threshold_off)[side]
        expected, model_error = _expected_step(declared, nominal, found.overshoot)
        unit = "DN" if declared.model == "linear" else "nat"
        errors, bounds = found.sharp.standard_errors, found.sharp.attenuation
        error = (errors.threshold_on, errors.threshold_off)[side]
        bound = abs(fitted - plain) + (bounds.threshold_on, bounds.threshold_off)[side] + model_error
        bound += _relative_bound(declared, facts) * expected
        percent = 100 / expected
        return Measured(
            name=name,
            value=percent * (fitted - expected),
            unit="%",
            standard_error=percent * error,
            allowance=percent * bound,
            matters=self._MATTERS_PERCENT,
            statement=f"{word} events step by {fitted:.4g} +/- {error:.2g} {unit}; {expected:.4g} {unit} is due with "
            f"the declared threshold of {nominal:.4g} {unit}.",
            code="event_response.threshold.size",
            where=EVENTS,
            suspects=_threshold_suspects(found, expected, fitted, error),
        )


class Model(_Levels):
    """Do events follow the declared sensor model, of log intensity or of grey values?

    The same level samples are fitted in L and in luma. The domain in which events follow leaves the smaller residual
    in thresholds. The value is the logarithm of the ratio, declared over other, its standard error the spread between
    quarters of the image and windows. A scene of one brightness cannot tell the domains apart.
    """

    name = "event_response.model"

    def state(self, found: Answer, declared: EventModel, facts: Facts) -> tuple[Measured, ...]:
        """State how much better the other domain fits."""
        value, error = found.preference
        other = "linear" if declared.model == "log" else "log"
        ours, theirs = found.sharp.relative_sigma, found.other.relative_sigma if found.other else float("inf")
        return (
            Measured(
                name="log_residual_ratio",
                value=value,
                unit="1",
                standard_error=error,
                side="upper",
                matters=1.0,
                statement=f"Events follow the {other} model: its residual is {theirs:.3g} thresholds, that of the "
                f"declared {declared.model} model {ours:.3g}.",
                code="event_response.model.domain",
                where=EVENTS,
                suspects=(
                    Suspect("event_model_misdeclared", "events", 0.95),
                    Suspect("exposure_or_gamma", "rgb", 0.3),
                ),
            ),
        )


class Timing(_Levels):
    """Are events and frames stamped by one clock?

    The coefficient of the level's slope in the regression of ``event_response.threshold`` is the time by which events
    are stamped late. Expected is the mean lateness that is declared: half a tick of the stamps (a stamp is the first
    tick not before the crossing; a sensor that takes its reference at the tick is not late), and the delay of a
    declared low-pass. Allowance: what the frames' pixels do not tell of the footprint. The offset is that at the middle
    of the sequence; its growth is the difference of the clocks' rates. Offsets of more than about half a frame interval
    are read too small, and leave no agreement at all beyond (``event_response.orientation``).
    """

    name = "event_response.timing"
    _MATTERS_MS: Final = 2.0
    _MATTERS_PPM: Final = 1_000.0

    def state(self, found: Answer, declared: EventModel, facts: Facts) -> tuple[Measured, ...]:
        """State the offset in ms, and the rate in ppm."""
        return (self._offset(found, declared, facts), self._rate(found))

    def _offset(self, found: Answer, declared: EventModel, facts: Facts) -> Measured:
        expected, tick_error = _expected_delay_ms(declared, facts)
        late, error = 1e3 * found.sharp.delay_s, 1e3 * found.sharp.standard_errors.delay_s
        bound = 1e3 * (abs(found.sharp.delay_s - found.even.delay_s) + found.sharp.attenuation.delay_s) + tick_error
        offset = late - expected
        drift = found.sharp.delay_rate / found.sharp.standard_errors.delay_rate
        return Measured(
            name="time_offset",
            value=late,
            unit="ms",
            standard_error=error,
            expected=expected,
            allowance=bound,
            matters=self._MATTERS_MS,
            statement=f"Events are {abs(offset):.3g} +/- {hypot(error, bound):.2g} ms "
            f"{'late' if offset > 0 else 'early'} against the colour frames.",
            code="event_response.timing.offset",
            where=EVENTS,
            suspects=(
                Suspect("time_offset", "events", 0.9, offset, "ms", error),
                Suspect("time_offset", "rgb", 0.8, -offset, "ms", error),
                Suspect("clock_rate", "events", 0.85 if abs(drift) > DRIFT_KNOWN else 0.1),
            ),
        )

    def _rate(self, found: Answer) -> Measured:
        ppm, error = 1e6 * found.sharp.delay_rate, 1e6 * found.sharp.standard_errors.delay_rate
        bound = 1e6 * abs(found.sharp.delay_rate - found.even.delay_rate)
        return Measured(
            name="clock_rate",
            value=ppm,
            unit="ppm",
            standard_error=error,
            allowance=bound,
            matters=self._MATTERS_PPM,
            statement=f"The clock of the events runs {abs(ppm):.3g} +/- {error:.2g} ppm too "
            f"{'fast' if ppm > 0 else 'slow'} against that of the colour frames.",
            code="event_response.timing.rate",
            where=EVENTS,
            suspects=(
                Suspect("clock_rate", "events", 0.9, ppm, "ppm", error),
                Suspect("clock_rate", "rgb", 0.8, -ppm, "ppm", error),
            ),
        )


def _coverage(state: Sequence[LevelSums], facts: Facts) -> Coverage:
    del facts
    pairs = sum(sums.pairs for sums in state)
    return Coverage(pairs, pairs, "level samples")


def _expected_step(declared: EventModel, nominal: float, overshoot: float) -> tuple[float, float]:
    """Return the mean step of an event, and the error of that expectation.

    Linear model: whole values exceed the threshold strictly, so a slow signal steps by C + 1. A signal that moves r
    in a rendered step goes beyond the crossing at C + 1/2 by r / 2 on average. With r = overshoot times the step,
    ``step = (C + 1/2) (1 + overshoot / 2)``, at most half a value less than what rounding makes of it. The mean of
    tick over gap stands for the overshoot of all events to half its size.
    """
    if declared.model == "log":
        return nominal, 0.0
    beyond = 0.5 * overshoot * (nominal + 0.5)
    return nominal + 0.5 + beyond, 0.5 + 0.5 * beyond


def _relative_bound(declared: EventModel, facts: Facts) -> float:
    """Return the relative error of a threshold that declared effects cause."""
    spread = declared.threshold_sigma / min(declared.threshold_on, declared.threshold_off)
    exposure_us = facts.declared.cameras["rgb"].exposure_us
    return 6 * spread**2 + EXPOSURE_BIAS * (exposure_us / EXPOSURE_OF_BIAS_US) ** 2


def _threshold_suspects(found: Answer, expected: float, fitted: float, error: float) -> tuple[Suspect, ...]:
    ratio = fitted / expected
    if ratio < -0.5:
        return (Suspect("polarity_inverted", "events", 0.95),)
    preference, spread = found.preference
    other_model = preference > DOMAIN_PREFERRED * spread
    percent = 100 * (expected / fitted - 1) if ratio > 0 else None
    uncertainty = 100 * expected / fitted**2 * error if ratio > 0 else None
    return (
        Suspect("threshold_misdeclared", "events", 0.3 if other_model else 0.9, percent, "percent", uncertainty),
        Suspect("event_model_misdeclared", "events", 0.9 if other_model else 0.1),
        Suspect("exposure_or_gamma", "rgb", 0.3),
        Suspect("dropped_samples", "events", 0.2),
        Suspect("duplicated_samples", "events", 0.2),
    )


def _expected_delay_ms(declared: EventModel, facts: Facts) -> tuple[float, float]:
    """Return the mean lateness of events, and the error of that expectation."""
    low_pass_ms = 1e3 / (2 * pi * declared.bandwidth_hz) if declared.bandwidth_hz > 0 else 0.0
    tick_ms = tick_ns(facts) / 1e6
    if declared.model == "linear":
        return low_pass_ms, 0.0
    declared_ms = max(declared.packet_interval_us, 1) * NS_PER_US / 1e6
    # A grid that nobody declared may come from rounding up, down or to the nearest tick.
    return declared_ms / 2 + low_pass_ms, max(tick_ms - declared_ms, 0.0)
