"""One pass over some windows of a surveyed file, in whichever process, and how passes are put together."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce

from fedora_qa.engine.progress import Progress
from fedora_qa.engine.stopwatch import Stopwatch
from fedora_qa.engine.stream import Accumulator, States, measure, merge, start
from fedora_qa.engine.survey import Survey, opened
from fedora_qa.sequence.facts import Facts

STAGE = "measuring"


@dataclass(frozen=True, slots=True)
class Measured:
    """What some windows have shown, and what that took."""

    states: States
    seconds: float
    decoded_bytes: int


def measure_windows(survey: Survey, windows: Sequence[int], progress: Progress) -> Measured:
    """Hand windows of the survey, named by their place in it, to the checks and collectors that see them."""
    watch = Stopwatch()
    with watch.stage(STAGE), opened(survey) as file:
        ready = file.ready
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
        decoded_bytes = ready.decoder.decoded_bytes
    return Measured(states, watch.seconds[STAGE], decoded_bytes)


def together(parts: Iterable[Measured], accumulators: Sequence[Accumulator], facts: Facts) -> Measured:
    """Merge passes over stretches of windows, in the order of time: the same as one pass over all, bit for bit."""
    parts = tuple(parts)
    states = [part.states for part in parts] or [start(accumulators, facts)]
    return Measured(
        reduce(lambda earlier, later: merge(accumulators, earlier, later), states),
        seconds=sum(part.seconds for part in parts),
        decoded_bytes=sum(part.decoded_bytes for part in parts),
    )
