"""One pass over some windows of a surveyed file, in whichever process, and how passes are put together."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Final

from fedora_qa.engine.progress import MEASURING, Progress
from fedora_qa.engine.stopwatch import Stopwatch
from fedora_qa.engine.stream import Accumulator, States, measure, merge, start
from fedora_qa.engine.survey import OpenSurvey, Survey
from fedora_qa.sequence.facts import Facts
from fedora_qa.storage.traffic import NO_TRAFFIC, Traffic

STAGE: Final = MEASURING
"""As the stopwatch and the pass itself call it."""


@dataclass(frozen=True, slots=True)
class Measured:
    """What some windows have shown, and what that took."""

    states: States
    seconds: float
    decoded_bytes: int
    traffic: Traffic = NO_TRAFFIC


def measure_open(survey: Survey, file: OpenSurvey, windows: Sequence[int], progress: Progress) -> Measured:
    """Hand windows of a survey, named by their place in it, to what sees them."""
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
        )
    return Measured(states, watch.seconds[STAGE], ready.decoder.decoded_bytes - decoded_before)


def together(parts: Iterable[Measured], accumulators: Sequence[Accumulator], facts: Facts) -> Measured:
    """Merge passes over stretches of windows, in the order of time: the same as one pass over all, bit for bit."""
    parts = tuple(parts)
    states = [part.states for part in parts] or [start(accumulators, facts)]
    return Measured(
        reduce(lambda earlier, later: merge(accumulators, earlier, later), states),
        seconds=sum(part.seconds for part in parts),
        decoded_bytes=sum(part.decoded_bytes for part in parts),
        traffic=sum((part.traffic for part in parts), NO_TRAFFIC),
    )
