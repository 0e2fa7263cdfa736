"""Which hypotheses each check's alarms give rise to: one function a check, in the module of its subject."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Final

from fedora_qa.diagnosis import clocks, event_stream, index_maps, integrity, metadata
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts

Propose = Callable[[Alarm, Facts], tuple[Hypothesis, ...]]
"""Gives the hypotheses for an alarm of one check, best supported first."""

PROPOSALS: Final[Mapping[str, Propose]] = MappingProxyType(
    {
        "integrity.layout": integrity.propose_layout,
        "integrity.readable": integrity.propose_readable,
        "integrity.finite": integrity.propose_finite,
        "metadata.complete": metadata.propose_complete,
        "metadata.units": metadata.propose_units,
        "metadata.cameras": metadata.propose_cameras,
        "metadata.profile": metadata.propose_profile,
        "clocks.order": clocks.propose_order,
        "clocks.unit": clocks.propose_unit,
        "clocks.rate": clocks.propose_rate,
        "clocks.gaps": clocks.propose_gaps,
        "clocks.span": clocks.propose_span,
        "clocks.resolution": clocks.propose_resolution,
        "index_maps.rgb": index_maps.propose_frame_to_event,
        "index_maps.depth": index_maps.propose_frame_to_event,
        "event_stream.bounds": event_stream.propose_bounds,
        "event_stream.duplicates": event_stream.propose_duplicates,
        "event_stream.gaps": event_stream.propose_gaps,
        "event_stream.rates": event_stream.propose_rates,
    }
)
"""By the name of the check."""


def propose(alarms: Sequence[Alarm], facts: Facts) -> dict[str, tuple[Hypothesis, ...]]:
    """Return the hypotheses for each alarm of one file, by the id of its finding."""
    return {alarm.finding.id: hypotheses_of(alarm, facts) for alarm in alarms}


def hypotheses_of(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm, best supported first; none where its check proposes none."""
    check = alarm.finding.code.rpartition(".")[0]
    if check in PROPOSALS:
        return PROPOSALS[check](alarm, facts)
    return tuple(
        Hypothesis(s.cause, s.stream, s.weight, s.magnitude, s.unit, s.standard_error) for s in alarm.statistic.suspects
    )
