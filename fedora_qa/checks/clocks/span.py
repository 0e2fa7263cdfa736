"""The begin and end of each stream."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from fedora_qa.checks.clocks.streams import (
    all_timestamps,
    clocks_of,
    extent_ns,
    fits_of,
    part_in_other_unit,
    placed_streams,
)
from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic
from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.estimators.clocks.regular_clock import FEWEST_TIMESTAMPS
from fedora_qa.features import Feature
from fedora_qa.layout.canonical import flow_rate_hz
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts, StrayEvents, has_place

_LONGEST_PERIOD_NS: Final = NS_PER_S // 10
"""Period that a stream of two samples or fewer may have, ns. No sampled stream of the known datasets is slower than
10 Hz."""

_CUT_RATIO: Final = 0.1
"""Largest share of a shift by which a shifted stream may be shorter as well."""


@dataclass(frozen=True, slots=True)
class StreamEnds(Feature):
    """Ends of a stream against the median of all streams.

    Attributes
    ----------
    begins_later_ns
        Start of the stream less the median start, ns.
    ends_earlier_ns
        Median end less the end of the stream, ns.
    median_duration_ns
        Median end less median start, ns.
    """

    begins_later_ns: float
    ends_earlier_ns: float
    median_duration_ns: float

    @property
    def shift_ns(self) -> float:
        """By how much later the stream lies, ns: a shift s begins it s later and ends it -s earlier."""
        return (self.begins_later_ns - self.ends_earlier_ns) / 2

    @property
    def missing_ns(self) -> float:
        """By how much shorter than the others the stream is, ns."""
        return self.begins_later_ns + self.ends_earlier_ns

    @property
    def is_shift(self) -> bool:
        """Whether both ends are moved equally, up to a tenth that may be cut off."""
        moved_alike = self.begins_later_ns * self.ends_earlier_ns < 0
        return moved_alike and abs(self.missing_ns) < _CUT_RATIO * abs(self.shift_ns)


@dataclass(frozen=True, slots=True)
class CutOfSeveralRates(Feature):
    """Two or more rates of flow are cut at this end, and no other rate has a period short enough to detect the cut.

    Attributes
    ----------
    rates
        The streams that are cut.
    """

    rates: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class FewSamples(Feature):
    """A stream with fewer samples than any rate gives in the span of the other streams.

    Attributes
    ----------
    samples
        Number of its samples.
    uncovered_ratio
        Share of the span of the other streams without it, 0 to 1.
    """

    samples: int
    uncovered_ratio: float


class ClocksSpan(FactsCheck):
    """Do the streams begin and end together?

    For each sampled stream, in ms: how much later than the median stream it begins, and how much earlier it ends. The
    number of its samples that are missing at either end.

    Why it matters
    --------------
    A stream that ends early is absent from the rest of the sequence, which is noticed only where it is needed. A stream
    that is shifted as a whole has another origin: its timestamps were counted from zero, or from another epoch.

    How
    ---
    The first and last instant of each stream (for flow, the start of the first and the end of the last interval) are
    compared with the median over all streams, on which one deviating stream has no influence. A stream that begins as
    much later as it ends later has an offset; any other is cut off. A sample is missing at an end where one would have
    been due at an instant that at least half of the streams cover.

    The period of a stream of two samples or fewer cannot be fitted. Sampled streams have at least 10 Hz, so that three
    samples are due within 0.3 s of the other streams, and three fields of flow within four of their intervals.

    Noise model
    -----------
    No random error. A stream begins, and ends, less than its own period P inside the recording, because another sample
    would have been taken otherwise. The same holds for the median stream and its period. The model error bound is the
    sum of both periods. It includes one sample that was not yet written when the recorder stopped: such a sample is
    noted by the stricter rule, and is no finding.

    Cannot detect
    -------------
    Streams that all begin late or end early together. Events may begin late and end early, because a still scene gives
    none: without frames, which show whether light changes, more than 0.1 s are a warning, and ``event_stream.gaps``
    compares them with the motion of the camera. It is required that some of them lie within the span of the other
    streams, and that none lie far from it beyond a silence. A stream without any event is noted where frames show
    whether events are due, and is a finding without.

    Sources
    -------
    First principles; that both ends are written is from the canonical layout, version 1.0 (Instants).
    """

    name = "clocks.span"

    def not_applicable(self, facts: Facts) -> str:
        """Require two sampled streams, or one of few samples beside another stream."""
        few_beside_others = streams_of_few_samples(facts) and _others_ns(facts)
        comparable = len(placed_streams(facts)) > 1 or few_beside_others
        return "" if comparable else "fewer than two streams have three timestamps in order"

    def examine(self, facts: Facts) -> Observation:
        """Measure how much later each stream begins, and how much earlier it ends."""
        fits = dict(fits_of(facts))
        ends = {stream: extent_ns(facts.clocks[stream]) for stream in fits}
        # One stray stream does not move a median.
        begin, finish = (float(np.median(instants)) for instants in zip(*_others_ns(facts), strict=True))
        usual_ns = float(np.median([fit.period_ns for fit in fits.values()])) if fits else 0.0
        statistics = list(_of_few_samples(facts, begin, finish))
        is_recorded = facts.declared.kind == "recorded"
        inferred: dict[str, str | float] = {}
        for stream, (start, stop) in ends.items():
            # Recorders begin and end one after another.
            if is_recorded and not StreamEnds(start - begin, finish - stop, finish - begin).is_shift:
                later_ns, earlier_ns = start - min(ends.values())[0], max(last for _, last in ends.values()) - stop
                if max(later_ns, earlier_ns) > fits[stream].period_ns + usual_ns:
                    inferred[f"{stream}.begins_later_ms"] = later_ns / NS_PER_MS
                    inferred[f"{stream}.ends_earlier_ms"] = earlier_ns / NS_PER_MS
                continue
            # A stream ends less than one of its own periods before the recording does, the median stream likewise by
            # its period.
            statistics += _of_ends(facts, stream, begin, finish, fits[stream].period_ns + usual_ns)
        statistics = _over_several_rates(statistics, facts.flow_streams)
        statistics += _of_events(facts, begin, finish) if ends else ()
        failed = {m.where.stream for m in statistics if abs(m.value) > m.model_error_bound}
        notices: list[Notice] = []
        if facts.events is not None and not facts.events.count and "rgb" in facts.clocks:
            message = f"there are no events in {(finish - begin) / NS_PER_S:.3g} s, which only a still scene explains"
            notices.append(Notice("clocks.span.no_events", message, Where(stream="events")))
        notices += _silent_ends(facts, begin, finish) if ends else ()
        # Streams whose next sample would have been due before, or at, the instant where half of the streams end.
        for stream, (start, stop) in ends.items():
            if stream in failed or is_recorded:
                continue
            period_ns = fits[stream].period_ns
            counts = ((start - begin) / period_ns, (finish - stop) / period_ns)
            # A sample whose timestamp has no place in time is counted by integrity.finite.
            placed = has_place(facts.clocks[stream].times_ns[[0, -1]])
            for count, rule, end, is_placed in zip(counts, ("first", "last"), ("begin", "end"), placed, strict=True):
                # A sample is due within the jitter of its time; 1e-6 covers the rounding of the division.
                if is_placed and count >= 1 - fits[stream].jitter_ns / period_ns - 1e-6:
                    missing = f"{stream} lacks {int(count + 0.5)} of its samples at its {end}"
                    message = f"{missing}: most other streams cover the time at which the {rule} one is due"
                    notices.append(Notice(f"clocks.span.{rule}_missing", message, Where(stream=stream)))
        why = "" if statistics or notices or not is_recorded else "recorders need not begin and end together"
        return Observation(
            all_timestamps(facts), tuple(statistics), tuple(notices), unobservable=why, inferred=inferred
        )


def streams_of_few_samples(facts: Facts) -> list[str]:
    """Return the sampled streams that have fewer rows than a regular clock can be fitted to."""
    return [stream for stream, clock in clocks_of(facts) if len(clock.times_ns) < FEWEST_TIMESTAMPS]


def _others_ns(facts: Facts) -> list[tuple[int, int]]:
    """Return first and last instant, ns, of the streams that can be placed in time; without any those of the events."""
    extents = [extent_ns(facts.clocks[stream]) for stream in placed_streams(facts)]
    if not extents and facts.events is not None and facts.events.count >= FEWEST_TIMESTAMPS:
        extents = [(facts.events.first_ns, facts.events.last_ns)]
    return extents


def _of_few_samples(facts: Facts, begin: float, finish: float) -> Iterator[Statistic]:
    """Yield the samples that streams of few samples lack in the span of the others; else their ends against it."""
    for stream in streams_of_few_samples(facts):
        clock = facts.clocks[stream]
        samples = int(np.count_nonzero(clock.advancing))
        start, stop = extent_ns(clock) if samples else (0, 0)
        if clock.ends_ns is None:
            due, period_ns = max(1, int((finish - begin) / _LONGEST_PERIOD_NS)), float(_LONGEST_PERIOD_NS)
        else:
            # Of a whole number of intervals a span of any phase holds one less. Fields state which part they cover, so
            # that a few may be enough.
            rate_hz = flow_rate_hz(stream)
            due, period_ns = int((finish - begin) * rate_hz / NS_PER_S) - 1, NS_PER_S / rate_hz
            due = 0 if samples else due
        lacking = max(min(FEWEST_TIMESTAMPS, due) - samples, 0)
        yield count_of_faults(
            name=f"{stream}.few_samples",
            value=lacking,
            unit="samples",
            statement=f"{stream} has {samples or 'no'} sample{'' if samples == 1 else 's'}; the other streams last "
            f"{(finish - begin) / NS_PER_S:.3g} s.",
            code="clocks.span.few_samples",
            where=Where(stream=stream),
            features=(FewSamples(samples, 1.0 - (stop - start) / max(finish - begin, 1.0)),),
        )
        if samples and not lacking:
            period_ns = float(clock.times_ns[-1] - clock.times_ns[0]) if samples > 1 else period_ns
            yield from _of_ends(facts, stream, begin, finish, max(2 * period_ns, _LONGEST_PERIOD_NS))


def _of_events(facts: Facts, begin: float, finish: float) -> Iterator[Statistic]:
    """Yield whether all events lie apart from the other streams, some of them far from the rest, or none are there.

    All events before, or behind, the other streams have a clock of another origin.
    """
    if facts.events is None:
        return
    if "rgb" not in facts.clocks:
        # Frames show whether light changes; without them no scene is known to be still.
        lacking = max(FEWEST_TIMESTAMPS - facts.events.count, 0)
        yield count_of_faults(
            name="events.few_samples",
            value=lacking,
            unit="events",
            statement=f"events has {facts.events.count or 'no'} row{'' if facts.events.count == 1 else 's'}; the other "
            f"streams last {(finish - begin) / NS_PER_S:.3g} s.",
            code="clocks.span.few_samples",
            where=Where(stream="events"),
            features=(FewSamples(facts.events.count, 1.0),),
        )
    if facts.events.count == facts.events.unplaced:
        return
    first_ns, last_ns = facts.events.first_ns, facts.events.last_ns
    apart_ns = max(begin - last_ns, first_ns - finish)
    yield count_of_faults(
        name="events.apart",
        value=int(apart_ns > 0),
        unit="streams",
        statement=f"no event lies within the span of the other streams: the gap is {abs(apart_ns) / NS_PER_S:.6g} s.",
        code="clocks.span.apart",
        where=Where(stream="events", start_us=facts.to_file_us(first_ns), stop_us=facts.to_file_us(last_ns)),
        features=(StreamEnds(first_ns - begin, finish - last_ns, finish - begin),),
    )
    if apart_ns <= 0 and facts.declared.kind != "recorded":
        yield from _of_strays(facts, facts.events.strays(begin, finish))


def _silent_ends(facts: Facts, begin: float, finish: float) -> Iterator[Notice]:
    """Yield how long there is no event at an end of the other streams, where no frames show whether light changes."""
    events = facts.events
    if events is None or events.count == events.unplaced or "rgb" in facts.clocks:
        return
    ends = (("begin", "late", "after", events.first_ns - begin), ("end", "early", "before", finish - events.last_ns))
    for verb, when, side, silent_ns in ends:
        if _LONGEST_PERIOD_NS < silent_ns < finish - begin:
            message = (
                f"events {verb} {silent_ns / NS_PER_S:.3g} s {side} the other streams: the scene did not change, or "
                "events are missing"
            )
            yield Notice(f"clocks.span.events_{verb}_{when}", message, Where(stream="events"))


def _of_strays(facts: Facts, strays: Sequence[StrayEvents]) -> Iterator[Statistic]:
    """Yield the events that lie far from the other streams, and from all other events."""
    for stray in strays:
        is_before = stray.distance_ns < 0
        end, side = ("first", "before") if is_before else ("last", "behind")
        instant_us = facts.to_file_us(stray.step.before_ns if is_before else stray.step.after_ns)
        of = f"{stray.count} events lie" if stray.count > 1 else "event lies"
        yield count_of_faults(
            name=f"events.{end}_far",
            value=stray.count,
            unit="events",
            statement=f"the {end} {of} {abs(stray.distance_ns) / NS_PER_S:.6g} s {side} the other streams, and "
            f"{stray.step.length_ns / NS_PER_S:.6g} s from the other events.",
            code="clocks.span.far",
            where=Where(stream="events", start_us=instant_us, stop_us=instant_us),
            features=(stray,),
        )


def _of_ends(
    facts: Facts, stream: str, begin: float, finish: float, model_error_bound_ns: float
) -> Iterator[Statistic]:
    """Yield how much later a stream begins than the others, and how much earlier it ends."""
    start, stop = extent_ns(facts.clocks[stream])
    part = part_in_other_unit(facts, stream)
    features: list[Feature] = [StreamEnds(start - begin, finish - stop, finish - begin)]
    if part is not None:
        features.append(part)
    where = Where(stream=stream, start_us=facts.to_file_us(start), stop_us=facts.to_file_us(stop))
    for rule, value_ns, clause in (
        ("begins_late", start - begin, "begins {:.6g} ms after"),
        ("ends_early", finish - stop, "ends {:.6g} ms before"),
    ):
        value_ms = value_ns / NS_PER_MS
        # Extents count from the origin in ns: minus the origin is zero on the file's own clock.
        zero = rule == "begins_late" and value_ms < 0 and start == -round(facts.origin_us * 1000)
        yield Statistic(
            name=f"{stream}.{rule}",
            value=value_ms,
            unit="ms",
            standard_error=0.0,
            model_error_bound=model_error_bound_ns / NS_PER_MS,
            # Timestamps are whole microseconds; the value is in ms.
            resolution=1e-3,
            statement=f"{stream} {clause.format(value_ms)} the other streams"
            f"{': its timestamps begin at zero, theirs do not' if zero else ''}.",
            code=f"clocks.span.{rule}",
            where=where,
            features=tuple(features),
        )


def _over_several_rates(statistics: Sequence[Statistic], rates: Sequence[str]) -> list[Statistic]:
    """Add the feature ``CutOfSeveralRates`` where two or more rates are cut and no other rate contradicts the cut."""
    completed = list(statistics)
    for code in {m.code for m in statistics}:
        of_flow = [i for i, m in enumerate(statistics) if m.code == code and m.where.stream in rates]
        cut = [i for i in of_flow if statistics[i].value > statistics[i].model_error_bound]
        uncut = [statistics[i] for i in of_flow if i not in cut]
        largest = max((statistics[i].value for i in cut), default=0.0)
        # Every uncut rate must be compatible with the largest cut within its own bound, which is about its period.
        if len(cut) > 1 and all(m.value > 0 and largest <= m.value + m.model_error_bound for m in uncut):
            feature = CutOfSeveralRates(tuple(statistics[i].where.stream or "" for i in cut))
            for i in cut:
                completed[i] = replace(statistics[i], features=(*statistics[i].features, feature))
    return completed
