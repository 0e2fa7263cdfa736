"""One pass over some windows of a surveyed file, in whichever process, and how passes are put together."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from fedora_qa.engine.progress import MEASURING, Progress
from fedora_qa.engine.stopwatch import Stopwatch
from fedora_qa.engine.stream import Accumulator, PassState, measure, merge, start
from fedora_qa.engine.survey import OpenSurvey, Survey
from fedora_qa.sequence.facts import Facts
from fedora_qa.storage.traffic import NO_TRAFFIC, Traffic

STAGE: Final = MEASURING
"""As the stopwatch and the pass itself call it."""


@dataclass(frozen=True, slots=True)
class PartialPass:
    """What some windows have shown, and what that took."""

    states: PassState
    seconds: float
    decoded_bytes: int
    traffic: Traffic = NO_TRAFFIC


def measure_open(
    survey: Survey, file: OpenSurvey, windows: Sequence[int], progress: Progress, before: PartialPass | None = None
) -> PartialPass:
    """Hand windows of a survey, named by their place in it, to what sees them.

    ``before`` is what the windows just before them have shown. It is added to, and what both have shown is returned.
    """
    watch = Stopwatch()
    ready, decoded_before = file.ready, file.ready.decoder.decoded_bytes
    with watch.stage(STAGE):
        states = measure(
            file.accumulators,
            [file.windows[window] for window in windows],
            ready.facts,
            ready.decoder,
            survey.plan.sampling,
            progress,
            ready.images,
            file.audience,
            before.states if before else None,
        )
    measured = PartialPass(states, watch.seconds[STAGE], ready.decoder.decoded_bytes - decoded_before)
    return (
        replace(
            measured,
            seconds=measured.seconds + before.seconds,
            decoded_bytes=measured.decoded_bytes + before.decoded_bytes,
            traffic=before.traffic,
        )
        if before
        else measured
    )


def together(parts: Iterable[PartialPass], accumulators: Sequence[Accumulator], facts: Facts) -> PartialPass:
    """Merge passes over stretches of windows, in the order of time: the same as one pass over all, bit for bit."""
    whole: PartialPass | None = None
    for part in parts:
        whole = part if whole is None else _merged(whole, part, accumulators)
    return whole or PartialPass(start(accumulators, facts), 0.0, 0)


def _merged(earlier: PartialPass, later: PartialPass, accumulators: Sequence[Accumulator]) -> PartialPass:
    return PartialPass(
        merge(accumulators, earlier.states, later.states),
        seconds=earlier.seconds + later.seconds,
        decoded_bytes=earlier.decoded_bytes + later.decoded_bytes,
        traffic=earlier.traffic + later.traffic,
    )
