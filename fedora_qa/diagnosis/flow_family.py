"""Join equal faults of all rates of flow into one fault of the flow."""

from collections.abc import Callable
from dataclasses import replace

from fedora_qa.causes import stream_family
from fedora_qa.checks.flow_rate_deviations import FlowRateDeviations
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.hypothesis import Hypothesis


def over_all_rates(
    statistic: Statistic, hypotheses_of: Callable[[Statistic], tuple[Hypothesis, ...]]
) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for a statistic; with stream ``flow`` where all of several rates have the same cause.

    Parameters
    ----------
    statistic
        With the feature ``FlowRateDeviations`` where there is more than one rate.
    hypotheses_of
        Returns the hypotheses for one statistic of the check, each of its own rate.

    Returns
    -------
    tuple
        In the order of ``hypotheses_of``.
    """
    hypotheses = hypotheses_of(statistic)
    for feature in statistic.features:
        if isinstance(feature, FlowRateDeviations):
            streams_of_cause: dict[str, set[str]] = {}
            for hypothesis in (h for deviation in feature.deviations for h in hypotheses_of(deviation)):
                streams_of_cause.setdefault(hypothesis.cause, set()).add(hypothesis.stream)
            # If one measured rate does not have the cause, the fault is one of single rates.
            common = {cause for cause, streams in streams_of_cause.items() if feature.rates <= streams}
            return tuple(
                replace(h, stream="flow") if stream_family(h.stream) == "flow" and h.cause in common else h
                for h in hypotheses
            )
    return hypotheses
