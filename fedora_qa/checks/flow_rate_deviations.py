"""Which rates of flow deviate: a fault of all of them is one fault of the flow."""

from collections.abc import Iterable, Set
from dataclasses import dataclass, replace

from fedora_qa.checks.protocol import Statistic
from fedora_qa.features import Feature


@dataclass(frozen=True, slots=True)
class FlowRateDeviations(Feature):
    """All statistics of a check that deviate, beside the rates of flow that could.

    Attributes
    ----------
    rates
        The flow streams that the check measured.
    deviations
        Every statistic of the check above zero, of whatever stream.
    """

    rates: frozenset[str]
    deviations: tuple[Statistic, ...]


def with_flow_rate_deviations(statistics: Iterable[Statistic], rates: Set[str]) -> tuple[Statistic, ...]:
    """Return the statistics, each with the feature ``FlowRateDeviations`` of all of them where there are rates."""
    statistics = tuple(statistics)
    deviations = tuple(statistic for statistic in statistics if statistic.value > 0)
    # A single rate shares no fault with others.
    if not deviations or len(rates) < 2:
        return statistics
    feature = FlowRateDeviations(frozenset(rates), deviations)
    return tuple(replace(statistic, features=(*statistic.features, feature)) for statistic in statistics)
