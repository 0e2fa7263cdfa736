"""Hypotheses for events that are sharper under another flow than under the stored one."""

from typing import Final

from fedora_qa.checks.flow_events.sharpness import SharpestFlow
from fedora_qa.diagnosis.flow import CAUSES_OF_TRANSFORM, gain_hypothesis, spreads_over
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

_GAIN_TOLERANCE: Final = 0.1
"""Largest relative difference of a gain from a sign or a unit that counts as such."""


def propose_sharpness(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for one rate against the events, best supported first."""
    (sharpest,) = (feature for feature in alarm.statistic.features if isinstance(feature, SharpestFlow))
    flow = spreads_over(sharpest.rate, sharpest.deviates_by_rate)
    interval_s = sharpest.interval_s
    if alarm.finding.code == "flow_events.sharpness.other":
        # Values in px/s are too large by the reciprocal of the interval, values in px s by the interval.
        size = {"times_interval": 1 / interval_s, "divided_by_interval": interval_s}.get(sharpest.transform)
        (cause,) = CAUSES_OF_TRANSFORM[sharpest.transform]
        return (Hypothesis(cause, flow, support("flow_events.other_flow"), size, "1" if size else ""),)
    # From percent to a share. The sign of the model error is unknown, so its bound adds to the error.
    error = 0.01 * (alarm.statistic.standard_error + alarm.statistic.model_error_bound)
    return (
        gain_hypothesis(flow, sharpest.gain - 1, error, support("flow_events.gain"), interval_s, _GAIN_TOLERANCE),
        Hypothesis("intrinsics_focal", flow, support("flow_events.focal_length")),
        Hypothesis("flow_rate_mixed", flow, support("flow_events.rate_mixed")),
    )
