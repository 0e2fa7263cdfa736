"""Contrast thresholds of the event sensor."""

from collections.abc import Sequence
from math import hypot
from typing import Final

from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import why_frames_and_events_do_not_meet
from fedora_qa.views.level_samples import WeighedSums, weighed_sums
from fedora_qa.views.threshold_fit import CAPTURE_RANGE_S, Answer, answer, level_coverage, surer

EVENTS: Final = Where(stream="events")

EXPOSURE_BIAS: Final = 0.05
EXPOSURE_OF_BIAS_US: Final = 5_000.0
"""A frame exposed for 5 ms takes 5% off the threshold; the loss of contrast grows with the square of the time."""

DOMAIN_PREFERRED: Final = 3.0
"""Standard errors by which the other domain must fit better to be suspected (after an alarm only)."""


class EventResponseThreshold(WindowCheck[WeighedSums]):
    """Do events step by the declared thresholds?

    C+ and C- are estimated apart, in percent of what is declared: in nat for the log model, in DN for the linear one.

    Why it matters
    --------------
    Reconstruction from events integrates them times the threshold, and simulators are compared by it: a threshold
    that is 10% off makes every brightness change 10% off. Fault and cause are often a unit or a default that was not
    written.

    How
    ---
    Between two events of one polarity a pixel's level is known to a fraction of the threshold (a cubic through four
    events). At frame times at which that holds, the change of L (of luma for the linear model) between two samples of
    a pixel is regressed robustly on the events in between, fractions included, with the delay of events as a
    nuisance. Frames are averaged over the footprints of the event camera's pixels in linear intensity. Where an edge
    runs through a frame pixel that a footprint's border cuts, its share is not known, and contrast seems lost. So all
    is fitted twice: all samples alike, those of the shortest gaps; and each weighed by how far two readings of it lie
    apart, even and sharp frame pixels, straight lines and cubics between events (``sureness``). The fit of the
    smaller error and bound is stated.

    Noise model
    -----------
    Standard errors are the larger of the formal one and the spread between quarters of the image and windows
    (delete-one jackknife). Allowances, each on the samples as they are weighed: 0.7 of what the even reconstruction
    of footprints moves (derivation beside ``LEFT_BY_SHARP``); what straight lines between events move in place of
    cubics; attenuation if all residuals were errors of the counts (Fuller 1987); declared spread of thresholds, by up
    to six times its relative square, as pixels of low threshold fire more; declared exposure. A step of the linear
    model exceeds C by half a value and by half of what the signal moves in a rendered step. Measured on clean
    sequences (270x200, 1 s, draft, C = 0.2; bias and limit): smooth wall 0.01 and 1%, wall of checkers of contrast
    19:1 0.5 and 3%, park by day 1.3 and 3 to 5%, at C = 0.1 1.3 and 3%; park at 720x540, standard, 0.4 and 1.8%. In a
    closed-form world of contrast 19:1 and C from 0.1 to 0.5 within 0.5%.

    Cannot see
    ----------
    Gamma and threshold apart: gamma must be declared. Scenes of fewer than 100 level samples (hovering, night, slow
    motion). Thresholds of single pixels.

    Sources
    -------
    First principles (event_levels, event_fit). Huber 1964; Geman and McClure 1985 (weights); Fuller 1987,
    "Measurement Error Models", eq. 1.1.12; Efron and Stein 1981.
    """

    name = "event_response.threshold"
    needs = ("events", "rgb")
    _MATTERS_PERCENT: Final = 25.0

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def measure(self, window: Window) -> WeighedSums | None:
        """Sum the window's level samples by both weightings."""
        return weighed_sums(window)

    def conclude(self, state: Sequence[WeighedSums], facts: Facts) -> Observation:
        """State both thresholds in percent of what is declared, by the weighting that tells them better."""
        alike, sure = [sums.alike for sums in state], [sums.sure for sums in state]
        declared, coverage = facts.declared.events, level_coverage(sure)
        found = surer(answer(alike, facts), answer(sure, facts))
        if isinstance(found, str) or declared is None:
            return Observation(coverage, unobservable=str(found))
        return Observation(coverage, tuple(self._one(found, declared, facts, side) for side in (0, 1)))

    def _one(self, found: Answer, declared: EventModel, facts: Facts, side: int) -> Statistic:
        name, word = (("threshold_on", "Brighter"), ("threshold_off", "Darker"))[side]
        nominal = (declared.threshold_on, declared.threshold_off)[side]
        fitted = (found.fit.threshold_on, found.fit.threshold_off)[side]
        expected, model_error = _expected_step(declared, nominal, found.overshoot)
        unit = "DN" if declared.model == "linear" else "nat"
        errors, bounds = found.fit.standard_errors, found.model_errors
        error = (errors.threshold_on, errors.threshold_off)[side]
        bound = (bounds.threshold_on, bounds.threshold_off)[side] + model_error
        bound += _relative_bound(declared, facts) * expected
        percent = 100 / expected
        return Statistic(
            name=name,
            value=percent * (fitted - expected),
            unit="%",
            standard_error=percent * error,
            model_error_bound=percent * bound,
            material=self._MATTERS_PERCENT,
            statement=f"{word} events step by {fitted:.4g} +/- {error:.2g} {unit}; {expected:.4g} {unit} is due with "
            f"the declared threshold of {nominal:.4g} {unit}.",
            code="event_response.threshold.size",
            where=EVENTS,
            suspects=_threshold_suspects(found, expected, fitted, hypot(error, bound)),
        )


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
    late = abs(found.fit.delay_s) > CAPTURE_RANGE_S
    percent = 100 * (expected / fitted - 1) if ratio > 0 else None
    uncertainty = 100 * expected / fitted**2 * error if ratio > 0 else None
    return (
        Suspect("threshold_misdeclared", "events", 0.3 if other_model else 0.9, percent, "percent", uncertainty),
        Suspect("event_model_misdeclared", "events", 0.9 if other_model else 0.1),
        Suspect("time_offset", "events", 0.85 if late else 0.1),
        Suspect("time_offset", "rgb", 0.75 if late else 0.1),
        Suspect("exposure_or_gamma", "rgb", 0.3),
        Suspect("dropped_samples", "events", 0.2),
        Suspect("duplicated_samples", "events", 0.2),
    )
