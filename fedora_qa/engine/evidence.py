"""Gather the evidence of a file: arrays of the checks, of the pass over its windows, and of the worst places."""

from collections.abc import Iterable, Mapping, Sequence

from fedora_qa.checks.protocol import Observation
from fedora_qa.engine.plan import FOLLOW_UP_SHARE
from fedora_qa.engine.prepare import Prepared
from fedora_qa.engine.stream import PassState, attempt
from fedora_qa.evidence.collector import EvidenceCollector
from fedora_qa.evidence.distributions import DistributionsCollector
from fedora_qa.evidence.follow_up import images_of, keep_worst_locations
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.titled_arrays import TitledArrays, merged
from fedora_qa.evidence.trajectory import keep_trajectory
from fedora_qa.record.evidence import named
from fedora_qa.record.types import Finding
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Span


def evidence_of_checks(observations: Mapping[str, Observation]) -> TitledArrays:
    """Return the arrays that checks keep, under ``<check>/<name>``; one without a title is called by its name."""
    return merged(
        TitledArrays.titled(
            {
                named(check, name): (array, observation.titles.get(name, name.replace("_", " ")))
                for name, array in observation.evidence.items()
            }
        )
        for check, observation in observations.items()
    )


def evidence_of_pass(
    collector: EvidenceCollector,
    states: PassState,
    findings: Iterable[Finding],
    ready: Prepared,
    chosen: Sequence[Span],
    options: EvidenceOptions,
    looked_again: int,
) -> TitledArrays:
    """Return evidence of the pass, the trajectory, and the worst places. A crash is noted, and costs all that follows.

    Parameters
    ----------
    chosen
        The windows that were measured.
    looked_again
        How many of them were measured again for checks: the worst places share one budget with these follow-ups.
    """
    facts, source = ready.facts, ready.decoder
    # Images that may still be read again: the share of follow-ups less those done, and at least those of one window.
    mean = images_of(chosen) / max(len(chosen), 1)
    images = round(mean * max(1.0, FOLLOW_UP_SHARE * len(chosen) - looked_again))
    parts = (
        attempt(states, collector.name, lambda: collector.conclude(states.states[collector.name], facts)),
        attempt(states, collector.name, lambda: keep_trajectory(facts, source, options.trajectory_points)),
        attempt(
            states, collector.name, lambda: keep_worst_locations(findings, ready.spans, facts, source, options, images)
        ),
    )
    return merged(part for part in parts if part is not None)


def distributions_of(collector: DistributionsCollector, states: PassState, facts: Facts) -> TitledArrays:
    """Return what was counted by block of time; nothing, and a note among the crashes, where that failed."""
    counted = attempt(states, collector.name, lambda: collector.conclude(states.states[collector.name], facts))
    return counted or TitledArrays()
