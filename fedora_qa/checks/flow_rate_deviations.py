"""Deviations by rate of flow: an equal fault of all rates is one fault of the flow."""

from collections.abc import Iterable, Set
from dataclasses import dataclass, replace

from fedora_qa.checks.protocol import Statistic
from fedora_qa.features import Feature


@dataclass(frozen=True, slots=True)
class FlowRateDeviations(Feature):
    """All deviating statistics of a check, with the measured rates of flow.

    Attributes
    ----------
    rates
        The flow streams that the check measured.
    deviations
        Every statistic of the check above zero, of any stream.
    """

    rates: frozenset[str]
    deviations: tuple[Statistic, ...]


def with_flow_rate_deviations(statistics: Iterable[Statistic], rates: Set[str]) -> tuple[Statistic, ...]:
    """Return the statistics, each with the feature ``FlowRateDeviations`` where there are two or more rates.

    Parameters
    ----------
    statistics
        Counts of one check.
    rates
        Streams of flow that the check measured.

    Returns
    -------
    tuple
        Unchanged where none deviates, or with fewer than two rates.
    """
    statistics = tuple(statistics)
    deviations = tuple(statistic for statistic in statistics if statistic.value > 0)
    # A single rate shares no fault with others.
    if not deviations or len(rates) < 2:
        return statistics
    feature = FlowRateDeviations(frozenset(rates), deviations)
    return tuple(replace(statistic, features=(*statistic.features, feature)) for statistic in statistics)
