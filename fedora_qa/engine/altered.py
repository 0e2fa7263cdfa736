"""Measure some windows of a sequence with its rows altered: a canary planted, or a fault undone."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from typing import Any

import numpy as np

from fedora_qa.checks.protocol import Check, Observation
from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.effort import Effort
from fedora_qa.engine.measure import PassState, conclude, follow_up, measure, merge, start
from fedora_qa.engine.plan import make_plan, sampling_of
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.survey import Prepared, prepare
from fedora_qa.faults.fault import Fault, FaultySequence
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.layout.canonical import spec_of
from fedora_qa.record.types import Result
from fedora_qa.sequence.sequence import SequenceRows
from fedora_qa.sequence.window import Span
from fedora_qa.views.storage_steps import stored_steps


@dataclass(frozen=True, slots=True)
class WindowPass:
    """A pass of checks over neighbouring windows of the plan, which a pass over more windows around them continues.

    Attributes
    ----------
    judged
        The strict results of the checks.
    spans
        The windows, in the order of time.
    states
        Of the checks after these windows.
    observations
        By check.
    """

    judged: tuple[Judged, ...]
    spans: Sequence[Span]
    states: PassState
    observations: Mapping[str, Observation]

    @property
    def crashes(self) -> Mapping[str, str]:
        """The traceback of each check that crashed."""
        return self.states.crashes


@dataclass(frozen=True, slots=True)
class PlainRun:
    """The run of a file, unaltered or with faults undone: its rows, what the checks observed on them, and the options.

    ``strict`` holds the results by the limits alone, by check: altered rows are judged by these.
    """

    sequence: SequenceRows
    ready: Prepared
    observations: Mapping[str, Observation]
    strict: Mapping[str, Result]
    effort: Effort
    memory_bytes: int
    false_alarm_rate: float

    def planned(self, ready: Prepared) -> list[Span]:
        """Return the windows of the plan among those of a prepared sequence."""
        plan = make_plan(self.effort, len(ready.spans), ready.scanned.cell_ns)
        return [ready.spans[number] for number in plan.chosen]

    def altered(self, fault: Fault) -> Prepared:
        """Prepare the view of the sequence with a fault planted or undone."""
        view = FaultySequence(self.sequence, fault)
        if fault.moves_time:
            return prepare(view, self.memory_bytes)
        ready = self.ready
        facts = replace(ready.facts, declared=view.declared, layout=view.layout)
        # Altered values are stored in other steps.
        altered = {spec_of(key).stream for key in fault.rows}
        kept = {key: step for key, step in facts.steps.items() if spec_of(key).stream not in altered}
        facts = replace(facts, steps=kept | stored_steps(view, facts, altered))
        # Blocks and images of the plain run hold values without the alteration, so none may be reused.
        decoder = BlockDecoder(view, ready.scanned, ready.decoder.leases.limit_bytes)
        return replace(ready, scanned=replace(ready.scanned, facts=facts), decoder=decoder)

    def without(
        self,
        undoing: Fault,
        checks: Sequence[Check[Any]],
        affected: Sequence[Check[Any]],
        inner: WindowPass | None = None,
    ) -> "PlainRun":
        """Return the run of the sequence with a fault undone.

        Parameters
        ----------
        undoing
            Gives the rows without the fault.
        checks
            All that were asked.
        affected
            Those that measure again, in all windows of the plan and in those that they name for a second look.
        inner
            As for ``judged``: a pass of ``affected`` with the fault undone.
        """
        # Both runs are kept: only the one that measures holds decoded rows.
        self.ready.decoder.leases.forget()
        ready = self.altered(undoing)
        facts, spans = ready.facts, self.planned(ready)
        states = self._measured(affected, spans, ready, inner)
        follow_up(affected, states, spans, facts, ready.decoder, sampling_of(self.effort, ready.frame_pixels), quiet)
        observations = {**self.observations, **conclude(affected, states, facts)}
        strict = {each.result.check: each.result for each in judge(observations, checks, self.false_alarm_rate)}
        view = FaultySequence(self.sequence, undoing)
        ready.decoder.leases.forget()
        return replace(self, sequence=view, ready=ready, observations=observations, strict=strict)

    def judged(
        self, checks: Sequence[Check[Any]], spans: Sequence[Span], altered: Prepared, inner: WindowPass | None = None
    ) -> WindowPass:
        """Measure windows of an altered sequence, and judge what some checks observe in them.

        Only the first pass counts: follow-ups serve to name causes.

        Parameters
        ----------
        checks
            What measures.
        spans
            The windows, in the order of time.
        altered
            The altered sequence.
        inner
            A pass of the same checks over some neighbours among these windows of the same sequence, which are not
            measured again: states merge to the same bits. It must not be continued twice.
        """
        states = self._measured(checks, spans, altered, inner)
        # By the limits of the plain run, whose comparisons share one false-alarm rate.
        observed = conclude(checks, states, altered.facts)
        measured = [check for check in checks if check.name in observed]
        judged = judge({**self.observations, **observed}, measured, self.false_alarm_rate)
        return WindowPass(judged, spans, states, observed)

    def _measured(
        self, checks: Sequence[Check[Any]], spans: Sequence[Span], altered: Prepared, inner: WindowPass | None
    ) -> PassState:
        sampling = sampling_of(self.effort, altered.frame_pixels)
        before, after = _outside(spans, inner)
        parts = [
            measure(checks, part, altered.facts, altered.decoder, sampling, quiet) for part in (before, after) if part
        ]
        if inner is not None:
            parts.insert(1 if before else 0, inner.states)
        return reduce(partial(merge, checks), parts) if parts else start(checks, altered.facts)


def _outside(spans: Sequence[Span], inner: WindowPass | None) -> tuple[Sequence[Span], Sequence[Span]]:
    """Return the windows before and after those of a pass; all of them as ``after`` without a pass."""
    if inner is None or not inner.spans:
        return (), spans
    first = [span.index for span in spans].index(inner.spans[0].index)
    return spans[:first], spans[first + len(inner.spans) :]


def growing(chosen: Sequence[Span], place_ns: int) -> Iterator[Sequence[Span]]:
    """Yield the window of the place, then twice as many around it, and so on until all."""
    centre = int(np.argmin([abs((span.start_ns + span.stop_ns) / 2 - place_ns) for span in chosen])) if chosen else 0
    count = 1
    while count < len(chosen):
        # Clamped at both ends of the sequence, so that there are always ``count`` windows.
        first = min(max(centre - count // 2, 0), len(chosen) - count)
        yield chosen[first : first + count]
        count *= 2
    yield chosen
