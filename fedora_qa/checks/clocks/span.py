"""Where the streams begin and end."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from fedora_qa.causes import stream_family
from fedora_qa.checks.clocks.streams import all_timestamps, extent_ns, fits_of, placed_streams
from fedora_qa.checks.clocks.unit import suspect_of_part
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic, Suspect
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.estimators.clocks.regular_clock import RegularClock
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.timestamp_unit import unit_factor


class ClocksSpan(FactsCheck):
    """Do the streams begin and end together?

    How much later each sampled stream begins, and how much earlier it ends, than the median stream; and how many of its
    samples are missing at either end.

    Why it matters
    --------------
    A stream that stops early leaves the rest of the sequence without it, which shows only where it is first needed; one
    that lies elsewhere as a whole has another origin: its stamps were counted from zero, or from another epoch.

    How
    ---
    First and last instant of each stream (of flow, the start of the first and the end of the last interval) are held
    against the median over all streams, which one stray stream cannot move. A stream that begins as much later as it
    ends has an offset; any other is cut off. A sample is missing at an end where one would have been due at an instant
    that at least half of the streams cover.

    Noise model
    -----------
    None at random. A stream begins, and ends, less than a period P of its own inside the recording, since one more
    sample would have been taken otherwise; so does the median stream, by its own period. The allowance is the sum of
    both. It also leaves room for one sample that was under way when the recorder stopped: such a one is noted, by the
    stricter rule, and does not fail.

    Cannot see
    ----------
    Streams that all begin late or end early together. Events are not held to it, since a still scene gives none.

    Sources
    -------
    First principles; that both ends are written is from the canonical layout, version 1.0 (Instants).
    """

    name = "clocks.span"

    def not_applicable(self, facts: Facts) -> str:
        """Need two sampled streams."""
        return "" if len(placed_streams(facts)) > 1 else "fewer than two streams have three stamps in order"

    def examine(self, facts: Facts) -> Observation:
        """Measure how much later each stream begins and how much earlier it ends."""
        fits = dict(fits_of(facts))
        ends = {stream: extent_ns(facts.clocks[stream]) for stream in fits}
        begin, finish = (float(np.median(instants)) for instants in zip(*ends.values(), strict=True))
        usual_ns = float(np.median([fit.period_ns for fit in fits.values()]))
        measured: list[Statistic] = []
        for stream, (start, stop) in ends.items():
            model_error_bound_ns = fits[stream].period_ns + usual_ns
            late, early = start - begin, finish - stop
            suspects = (*suspect_of_part(facts, stream), *_suspects(stream, late, early, finish - begin))
            for rule, value in (("begins_late", late), ("ends_early", early)):
                measured.append(_one(facts, stream, rule, value, model_error_bound_ns, suspects))
        measured = _of_all_rates(measured, facts.flow_streams)
        failed = {one.where.stream for one in measured if abs(one.value) > one.model_error_bound}
        notices = [notice for stream, notice in _incomplete(fits, ends, begin, finish) if stream not in failed]
        return Observation(all_timestamps(facts), tuple(measured), tuple(notices))


def _one(
    facts: Facts, stream: str, rule: str, value_ns: float, model_error_bound_ns: float, suspects: tuple[Suspect, ...]
) -> Statistic:
    value_ms = value_ns / NS_PER_MS
    said = "begins {:.6g} ms after" if rule == "begins_late" else "ends {:.6g} ms before"
    start, stop = extent_ns(facts.clocks[stream])
    zero = rule == "begins_late" and value_ms < 0 and start == -round(facts.origin_us * 1000)
    return Statistic(
        name=f"{stream}.{rule}",
        value=value_ms,
        unit="ms",
        standard_error=0.0,
        model_error_bound=model_error_bound_ns / NS_PER_MS,
        resolution=1e-3,
        statement=f"{stream} {said.format(value_ms)} the other streams"
        f"{': its stamps begin at zero, theirs do not' if zero else ''}.",
        code=f"clocks.span.{rule}",
        where=Where(stream=stream, start_us=facts.to_file_us(start), stop_us=facts.to_file_us(stop)),
        suspects=suspects,
    )


def _of_all_rates(measured: Sequence[Statistic], rates: Sequence[str]) -> list[Statistic]:
    """Name flow as a whole where two rates or more are cut, and no other could show it at its own slower pace."""
    named = list(measured)
    for code in {one.code for one in measured}:
        places = [i for i, one in enumerate(measured) if one.code == code and one.where.stream in rates]
        cut = [i for i in places if measured[i].value > measured[i].model_error_bound]
        rest = [measured[i] for i in places if i not in cut]
        largest = max((measured[i].value for i in cut), default=0.0)
        if len(cut) > 1 and all(one.value > 0 and largest <= one.value + one.model_error_bound for one in rest):
            for i in cut:
                named[i] = replace(measured[i], suspects=tuple(_of_flow(one) for one in measured[i].suspects))
    return named


def _of_flow(suspect: Suspect) -> Suspect:
    return replace(suspect, stream=stream_family(suspect.stream))


def _suspects(stream: str, late_ns: float, early_ns: float, span_ns: float) -> tuple[Suspect, ...]:
    """Name an offset where both ends moved alike, up to a tenth that may be cut off; a cut otherwise."""
    shift_ns = (late_ns - early_ns) / 2
    if late_ns * early_ns < 0 and abs(late_ns + early_ns) < 0.1 * abs(shift_ns):
        return (Suspect("time_offset", stream, 0.9, shift_ns / NS_PER_MS, "ms"),)
    cut = Suspect("truncated", stream, 0.8, 100 * (late_ns + early_ns) / max(span_ns, 1.0), "percent")
    factor = unit_factor(1 - (late_ns + early_ns) / max(span_ns, 1.0))
    return (cut,) if factor == 1.0 else (Suspect("time_unit", stream, 0.9, factor, "1"), cut)


def _incomplete(
    fits: Mapping[str, RegularClock], ends: Mapping[str, tuple[int, int]], begin_ns: float, finish_ns: float
) -> Iterator[tuple[str, Notice]]:
    """Note streams whose next sample would have been due before, or at, the instant where half of the streams end."""
    for stream, (start, stop) in ends.items():
        period_ns = fits[stream].period_ns
        counts = ((start - begin_ns) / period_ns, (finish_ns - stop) / period_ns)
        for count, rule, end in zip(counts, ("first", "last"), ("begin", "end"), strict=True):
            if count >= 1 - fits[stream].jitter_ns / period_ns - 1e-6:
                missing = f"{stream} lacks {int(count + 0.5)} of its samples at its {end}"
                message = f"{missing}: most other streams go on to where the {rule} one is due"
                yield stream, Notice(f"clocks.span.{rule}_missing", message, Where(stream=stream))
