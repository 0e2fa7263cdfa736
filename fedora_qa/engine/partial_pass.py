"""One pass over some windows of a surveyed file, in whichever process, and how passes are merged."""

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
"""Name of the stage, for the stopwatch and for progress."""


@dataclass(frozen=True, slots=True)
class PartialPass:
    """States of all checks after some windows, and the seconds, decoded bytes and traffic that they took."""

    states: PassState
    seconds: float
    decoded_bytes: int
    traffic: Traffic = NO_TRAFFIC


def measure_open(
    survey: Survey, file: OpenSurvey, windows: Sequence[int], progress: Progress, before: PartialPass | None = None
) -> PartialPass:
    """Hand windows of a survey, given by their place in it, to the checks and collectors that need them.

    ``before`` is the pass over the windows just before them. It is extended, and the pass over both is returned.
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
            # The task adds its own traffic once it is done with the file (``steps.measure_windows``).
            traffic=before.traffic,
        )
        if before
        else measured
    )


def together(parts: Iterable[PartialPass], accumulators: Sequence[Accumulator], facts: Facts) -> PartialPass:
    """Merge passes over batches of windows, in the order of time: the same as one pass over all, bit for bit."""
    whole: PartialPass | None = None
    # Parts are unpickled one at a time, so that memory holds the merged pass and one part.
    for part in parts:
        if whole is None:
            whole = part
        else:
            whole = PartialPass(
                merge(accumulators, whole.states, part.states),
                seconds=whole.seconds + part.seconds,
                decoded_bytes=whole.decoded_bytes + part.decoded_bytes,
                traffic=whole.traffic + part.traffic,
            )
    return whole or PartialPass(start(accumulators, facts), 0.0, 0)
