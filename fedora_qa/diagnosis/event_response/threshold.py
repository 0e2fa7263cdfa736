"""Hypotheses for events whose steps are not the declared thresholds."""

from typing import Final

from fedora_qa.checks.event_response.threshold import DomainPreference, EventStepSize
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.level_samples import CAPTURE_RANGE_S

_REVERSED_BELOW: Final = -0.5
"""Step over expected step below which events step the other way, with half the contrast at least."""

_DOMAIN_PREFERRED: Final = 3.0
"""Standard errors by which the other domain must fit better to be suspected (after an alarm only)."""


def propose_threshold(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Propose a misdeclared threshold with its size, and what else moves the step of events."""
    step = next(feature for feature in alarm.statistic.features if isinstance(feature, EventStepSize))
    domains = next(feature for feature in alarm.statistic.features if isinstance(feature, DomainPreference))
    ratio = step.fitted / step.expected
    if ratio < _REVERSED_BELOW:
        return (Hypothesis("polarity_inverted", "events", support("event_response.polarity_of_reversed_steps")),)
    threshold, model = (
        ("threshold_where_other_model_fits", "model_where_other_model_fits")
        if domains.log_residual_ratio > _DOMAIN_PREFERRED * domains.standard_error
        else ("threshold_where_declared_model_fits", "model_where_declared_model_fits")
    )
    # Beyond the capture range of the fit an offset spoils thresholds.
    offset, offset_rgb = (
        ("gross_offset_spoils_thresholds", "gross_offset_of_frames_spoils_thresholds")
        if abs(step.delay_s) > CAPTURE_RANGE_S
        else ("small_offset_spoils_thresholds", "small_offset_spoils_thresholds")
    )
    # The declared threshold over the true one, less 1; its error by the derivative of 1 / fitted.
    percent = 100 * (step.expected / step.fitted - 1) if ratio > 0 else None
    uncertainty = 100 * step.expected / step.fitted**2 * step.error if ratio > 0 else None
    of_threshold = support(f"event_response.{threshold}")
    return (
        Hypothesis("threshold_misdeclared", "events", of_threshold, percent, "percent", uncertainty),
        Hypothesis("event_model_misdeclared", "events", support(f"event_response.{model}")),
        Hypothesis("time_offset", "events", support(f"event_response.{offset}")),
        Hypothesis("time_offset", "rgb", support(f"event_response.{offset_rgb}")),
        Hypothesis("exposure_or_gamma", "rgb", support("event_response.transfer_spoils_thresholds")),
        Hypothesis("dropped_samples", "events", support("event_response.lost_events_spoil_thresholds")),
        Hypothesis("duplicated_samples", "events", support("event_response.lost_events_spoil_thresholds")),
    )
