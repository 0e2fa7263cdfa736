"""Contrast thresholds of the event sensor."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Final

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import why_frames_and_events_do_not_meet
from fedora_qa.views.level_samples import (
    LIMIT_ERRORS,
    ThresholdFit,
    WeightedLevelSums,
    fit_thresholds,
    level_coverage,
    lower_variance_fit,
    weighted_level_sums,
)

EXPOSURE_BIAS: Final = 0.05
EXPOSURE_OF_BIAS_US: Final = 5_000.0
"""An exposure of 5 ms reduces the fitted threshold by 5%; the loss of contrast grows with the square of the time."""


@dataclass(frozen=True, slots=True)
class EventStepSize(Feature):
    """Step of the events of one polarity, in nat (``log``) or DN (``linear``).

    Attributes
    ----------
    expected, fitted
        Expected and fitted step.
    error
        Error of the fitted step, with bounds.
    delay_s
        Delay of events, s, fitted together with the steps.
    """

    expected: float
    fitted: float
    error: float
    delay_s: float


@dataclass(frozen=True, slots=True)
class DomainPreference(Feature):
    """Comparison of the fits in both domains.

    Attributes
    ----------
    log_residual_ratio
        ln of the residual over threshold in the declared domain, less that in the other.
    standard_error
        Its standard error.
    """

    log_residual_ratio: float
    standard_error: float


class EventResponseThreshold(WindowCheck[WeightedLevelSums]):
    """Do events have the declared contrast thresholds?

    The differences of C+ and of C- from the declared thresholds, in percent. The unit of a threshold is nat for the log
    model and DN for the linear one. Where no response is declared, as of most real sensors, the thresholds are stated
    and not judged, in the domain that the events follow better.

    Why it matters
    --------------
    Reconstruction multiplies the sum of events by the threshold, and simulators are compared by it: a threshold that is
    wrong by 10% makes every change of brightness wrong by 10%. Frequent reasons are a wrong unit, and a default value
    that was not declared.

    How
    ---
    Between two events of one polarity, the level of a pixel is interpolated to a fraction of the threshold (a cubic
    through four events). At frame times at which this is possible, the change of L (of luma for the linear model)
    between two samples of a pixel is regressed robustly on the events in between, including fractions, with the delay
    of events as a nuisance parameter. Frames are averaged over the footprints of the event camera's pixels in linear
    intensity. Where an edge crosses a frame pixel that the border of a footprint cuts, its share is uncertain, and
    contrast appears too small. The fit is therefore made twice. In the first fit, all samples of the shortest gaps have
    equal weight. In the second, a sample has less weight the more two estimates of it differ: by uniform and edge-aware
    footprints, or by straight lines and cubics between events (``precision_weights``). The fit with the smaller sum of
    error and bound is stated.

    Noise model
    -----------
    The standard error is the larger of the formal one and the spread between quarters of the image and windows
    (delete-one jackknife). The model error bound is the sum of these terms, with the weights of the samples: 0.7 of the
    change by uniform footprints (derivation beside ``LEFT_BY_SHARP``); the change by straight lines between events in
    place of cubics; attenuation if all residuals were errors of the counts (Fuller 1987); up to six times the squared
    relative spread of declared thresholds, because pixels of low threshold give more events; declared exposure. The
    step of the linear model exceeds C by half a value, and by half of the change of the signal in a rendered step.
    Measured on clean sequences (270x200, 1 s, draft, C = 0.2; bias and limit): smooth wall 0.01 and 1%; wall of
    checkers of contrast 19:1, 0.5 and 3%; park by day 1.3 and 3 to 5%, at C = 0.1 1.3 and 3%; park at 720x540,
    standard, 0.4 and 1.8%. In a closed-form world of contrast 19:1 and C from 0.1 to 0.5 the bias is at most 0.5%.

    Cannot detect
    -------------
    Gamma and threshold separately: gamma must be declared. Scenes with fewer than 100 level samples (hovering, night,
    slow motion). Thresholds of single pixels.

    Sources
    -------
    First principles (``estimators/events/levels.py``, ``threshold_fit.py``). Huber 1964; Geman and McClure 1985
    (weights); Fuller 1987, "Measurement Error Models", eq. 1.1.12; Efron and Stein 1981.
    """

    name = "event_response.threshold"
    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras at one place, and positive thresholds where a response is declared."""
        return why_frames_and_events_do_not_meet(facts, needs_response=facts.declared.events is not None)

    def measure(self, window: Window) -> WeightedLevelSums | None:
        """Sum the window's level samples by both weightings."""
        return weighted_level_sums(window)

    def conclude(self, state: Sequence[WeightedLevelSums], facts: Facts) -> Observation:
        """Compare both thresholds with the declared ones, or state them; by the weighting with the smaller errors."""
        by_precision = [sums.by_precision for sums in state]
        declared, coverage = facts.declared.events, level_coverage(by_precision)
        fitted = lower_variance_fit(
            fit_thresholds([sums.equal for sums in state], facts), fit_thresholds(by_precision, facts)
        )
        if isinstance(fitted, str):
            return Observation(coverage, unobservable=fitted)
        if declared is None:
            return _undeclared(fitted, coverage)
        fit, errors, bounds = fitted.fit, fitted.fit.standard_errors, fitted.model_errors
        unit = "DN" if declared.model == "linear" else "nat"
        # Pixels of low threshold have more events: a bias of up to six times the squared relative spread of thresholds.
        spread = declared.threshold_sigma / min(declared.threshold_on, declared.threshold_off)
        exposure_us = facts.declared.cameras["rgb"].exposure_us
        statistics = []
        for name, word, nominal, step, error, model_error in (
            ("threshold_on", "Brighter", declared.threshold_on, fit.threshold_on, errors.threshold_on,
             bounds.threshold_on),
            ("threshold_off", "Darker", declared.threshold_off, fit.threshold_off, errors.threshold_off,
             bounds.threshold_off),
        ):  # fmt: skip
            expected, expectation_error = nominal, 0.0
            if declared.model != "log":
                # Linear model: whole values exceed the threshold strictly, so a slow signal steps by C + 1. A signal
                # that changes by r in a rendered step exceeds the crossing at C + 1/2 by r / 2 on average. With r =
                # overshoot times the step, step = (C + 1/2) (1 + overshoot / 2); rounding adds half a DN at most. The
                # mean of tick over gap is the overshoot of all events within half its size.
                beyond = 0.5 * fitted.overshoot * (nominal + 0.5)
                expected, expectation_error = nominal + 0.5 + beyond, 0.5 + 0.5 * beyond
            # The errors of the fit and of the expected step may have the same sign.
            bound = model_error + expectation_error
            # Exposure reduces contrast with the square of its time (EXPOSURE_BIAS).
            bound += (6 * spread**2 + EXPOSURE_BIAS * (exposure_us / EXPOSURE_OF_BIAS_US) ** 2) * expected
            percent = 100 / expected
            statistics.append(
                Statistic(
                    name=name,
                    value=percent * (step - expected),
                    unit="%",
                    standard_error=percent * error,
                    model_error_bound=percent * bound,
                    statement=f"{word} events have a step of {step:.4g} +/- {error:.2g} {unit}; {expected:.4g} {unit} "
                    f"follows from the declared threshold of {nominal:.4g} {unit}.",
                    code="event_response.threshold.size",
                    where=Where(stream="events"),
                    features=(
                        EventStepSize(expected, step, hypot(error, bound), fit.delay_s),
                        DomainPreference(*fitted.preference),
                    ),
                )
            )
        return Observation(coverage, tuple(statistics))


def _undeclared(fitted: ThresholdFit, coverage: Coverage) -> Observation:
    """State the thresholds of a sensor that declares no response, in the domain that its events follow."""
    response, unit = "log", "nat"
    on, off = fitted.fit.threshold_on, fitted.fit.threshold_off
    preference, error = fitted.preference
    if fitted.other_domain is not None and preference > LIMIT_ERRORS * error:
        response, unit = "linear", "DN"
        # The step is (C + 1/2) (1 + overshoot / 2), as where the linear model is declared.
        on, off = (
            step / (1 + 0.5 * fitted.overshoot) - 0.5
            for step in (fitted.other_domain.threshold_on, fitted.other_domain.threshold_off)
        )
    if not min(on, off) > 0:
        reason = (
            "events do not follow the frames: a fitted threshold is not above zero (see event_response.orientation)"
        )
        return Observation(coverage, unobservable=reason)
    reason = (
        f"the response of the event sensor is not declared: events fit the {response} model with thresholds of "
        f"{on:.3g} {unit} (brighter) and {off:.3g} {unit} (darker)"
    )
    inferred: dict[str, str | float] = {
        "events.response": response,
        f"events.threshold_on_{unit.lower()}": on,
        f"events.threshold_off_{unit.lower()}": off,
    }
    return Observation(coverage, unobservable=reason, inferred=inferred)
