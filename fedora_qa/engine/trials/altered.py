"""Measure some windows of a sequence with its rows altered: a canary planted, or a fault undone."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial, reduce
from typing import Any

from fedora_qa.checks.protocol import Check, Observation
from fedora_qa.engine.measure import PassState, conclude, follow_up, measure, merge, start
from fedora_qa.engine.options import Effort
from fedora_qa.engine.plan import cut_windows, make_plan, sampling_of, window_length_ns
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.survey import Prepared, frame_pixels
from fedora_qa.engine.trials.views import SequenceViews
from fedora_qa.faults.fault import Fault, FaultySequence
from fedora_qa.judgement.judge import Judged, judge
from fedora_qa.layout.canonical import spec_of
from fedora_qa.record.types import Result
from fedora_qa.sequence.inputs import Inputs
from fedora_qa.sequence.scan import scan
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

    Attributes
    ----------
    strict
        The results by the limits alone, by check: altered rows are judged by these.
    views
        What altered views of the file share.
    altered
        Keys of the datasets that differ from those of the file.
    """

    sequence: SequenceRows
    ready: Prepared
    observations: Mapping[str, Observation]
    strict: Mapping[str, Result]
    effort: Effort
    false_alarm_rate: float
    views: SequenceViews
    altered: Inputs = frozenset()

    def planned(self, ready: Prepared) -> list[Span]:
        """Return the windows of the plan among those of a prepared sequence."""
        plan = make_plan(self.effort, len(ready.spans), ready.scanned.cell_ns)
        return [ready.spans[number] for number in plan.chosen]

    def altered_by(self, fault: Fault) -> Prepared:
        """Prepare the view of the sequence with a fault planted or undone."""
        view, ready = FaultySequence(self.sequence, fault), self.ready
        streams = {spec_of(key).stream for key in fault.rows}
        kept = {key: step for key, step in ready.facts.steps.items() if spec_of(key).stream not in streams}
        if fault.moves_time:
            scanned = scan(view, window_length_ns(view))
            ready = replace(ready, scanned=scanned, spans=cut_windows(scanned), frame_pixels=frame_pixels(view.layout))
        facts = replace(ready.facts, declared=view.declared, layout=view.layout)
        # Altered values are stored in other steps.
        facts = replace(facts, steps=kept | stored_steps(view, facts, streams & facts.streams))
        ready = replace(ready, scanned=replace(ready.scanned, facts=facts))
        return self.views.prepared(view, ready, self._rows_altered_by(fault))

    def _rows_altered_by(self, fault: Fault) -> Inputs:
        bindings = self.sequence.layout.bindings
        bound = (fault.layout or self.sequence.layout).bindings
        return self.altered.union(fault.rows, (key for key in bound if bound[key] is not bindings.get(key)))

    def without(
        self,
        undoing: Fault,
        checks: Sequence[Check[Any]],
        affected: Sequence[Check[Any]],
    ) -> "PlainRun":
        """Return the run of the sequence with a fault undone.

        Parameters
        ----------
        undoing
            Gives the rows without the fault.
        affected
            Those that measure again, in all windows of the plan and in those that they name for a second look. Passes
            of trials are of no use here: they measure no features, by which further causes are proposed.
        """
        # Both runs are kept: only the one that measures holds decoded rows.
        self.ready.decoder.leases.forget()
        ready = self.altered_by(undoing)
        facts, spans = ready.facts, self.planned(ready)
        sampling = sampling_of(self.effort, ready.frame_pixels)
        states = measure(affected, spans, facts, ready.decoder, sampling, quiet)
        follow_up(affected, states, spans, facts, ready.decoder, sampling, quiet)
        observations = {**self.observations, **conclude(affected, states, facts)}
        strict = {each.result.check: each.result for each in judge(observations, checks, self.false_alarm_rate)}
        view = FaultySequence(self.sequence, undoing)
        ready.decoder.leases.forget()
        altered = self._rows_altered_by(undoing)
        return replace(self, sequence=view, ready=ready, observations=observations, strict=strict, altered=altered)

    def judged(
        self, checks: Sequence[Check[Any]], spans: Sequence[Span], altered: Prepared, inner: WindowPass | None = None
    ) -> WindowPass:
        """Measure windows of an altered sequence, and judge what some checks observe in them.

        Only the first pass counts: follow-ups serve to name causes.

        Parameters
        ----------
        spans
            The windows, in the order of time.
        inner
            A pass of the same checks over some neighbours among these windows of the same sequence, which are not
            measured again: states merge to the same bits. It must not be continued twice.
        """
        states = self._measured(checks, spans, altered, inner)
        observed = conclude(checks, states, altered.facts)
        return WindowPass(self.judge_observed(checks, observed), spans, states, observed)

    def widened(
        self, part: WindowPass, others: Sequence[Check[Any]], checks: Sequence[Check[Any]], altered: Prepared
    ) -> WindowPass:
        """Return the pass of some checks, of which a part has measured its windows and the others have not yet."""
        states = merge(checks, part.states, self._measured(others, part.spans, altered, None))
        observed = {**part.observations, **conclude(others, states, altered.facts)}
        return WindowPass(self.judge_observed(checks, observed), part.spans, states, observed)

    def judge_observed(self, checks: Sequence[Check[Any]], observed: Mapping[str, Observation]) -> tuple[Judged, ...]:
        """Judge what some checks observe by the limits of the plain run: all share one false-alarm rate."""
        measured = [check for check in checks if check.name in observed]
        return judge({**self.observations, **observed}, measured, self.false_alarm_rate)

    def _measured(
        self, checks: Sequence[Check[Any]], spans: Sequence[Span], altered: Prepared, inner: WindowPass | None
    ) -> PassState:
        sampling = replace(sampling_of(self.effort, altered.frame_pixels), features=False)
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
    count = 1
    while count < len(chosen):
        yield around(chosen, place_ns, count)
        count *= 2
    yield chosen


def around(spans: Sequence[Span], place_ns: int, count: int) -> Sequence[Span]:
    """Return ``count`` neighbouring windows around that of a place; all where there are no more."""
    middles = [abs((span.start_ns + span.stop_ns) / 2 - place_ns) for span in spans]
    centre = min(range(len(spans)), key=middles.__getitem__, default=0)
    # Clamped at both ends of the sequence, so that there are always ``count`` windows.
    first = min(max(centre - count // 2, 0), max(len(spans) - count, 0))
    return spans[first : first + count]


def busiest(spans: Sequence[Span]) -> Span:
    """Return the window with most events of at least one; without events, the middle one."""
    events = [stop - start for start, stop in (span.owned.get("events", (0, 0)) for span in spans)]
    return spans[events.index(max(events)) if any(events) else len(spans) // 2]
