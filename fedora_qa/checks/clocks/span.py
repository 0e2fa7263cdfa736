"""Where the streams begin and end."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fedora_qa.checks.clocks.streams import all_timestamps, extent_ns, fits_of, part_in_other_unit, placed_streams
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.features import Feature
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts


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


@dataclass(frozen=True, slots=True)
class CutOfSeveralRates(Feature):
    """Two or more rates of flow are cut at this end, and no other rate has a period short enough to detect the cut.

    Attributes
    ----------
    rates
        The streams that are cut.
    """

    rates: tuple[str, ...]


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
        """Require two sampled streams."""
        return "" if len(placed_streams(facts)) > 1 else "fewer than two streams have three stamps in order"

    def examine(self, facts: Facts) -> Observation:
        """Measure how much later each stream begins and how much earlier it ends."""
        fits = dict(fits_of(facts))
        ends = {stream: extent_ns(facts.clocks[stream]) for stream in fits}
        # One stray stream does not move a median.
        begin, finish = (float(np.median(instants)) for instants in zip(*ends.values(), strict=True))
        usual_ns = float(np.median([fit.period_ns for fit in fits.values()]))
        statistics: list[Statistic] = []
        for stream, (start, stop) in ends.items():
            # A stream ends less than one of its own periods before the recording does, the median stream likewise by
            # its period.
            model_error_bound_ns = fits[stream].period_ns + usual_ns
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
                statistics.append(
                    Statistic(
                        name=f"{stream}.{rule}",
                        value=value_ms,
                        unit="ms",
                        standard_error=0.0,
                        model_error_bound=model_error_bound_ns / NS_PER_MS,
                        # Timestamps are whole microseconds; the value is in ms.
                        resolution=1e-3,
                        statement=f"{stream} {clause.format(value_ms)} the other streams"
                        f"{': its stamps begin at zero, theirs do not' if zero else ''}.",
                        code=f"clocks.span.{rule}",
                        where=where,
                        features=tuple(features),
                    )
                )
        statistics = _over_several_rates(statistics, facts.flow_streams)
        failed = {m.where.stream for m in statistics if abs(m.value) > m.model_error_bound}
        # Streams whose next sample would have been due before, or at, the instant where half of the streams end.
        notices: list[Notice] = []
        for stream, (start, stop) in ends.items():
            if stream in failed:
                continue
            period_ns = fits[stream].period_ns
            counts = ((start - begin) / period_ns, (finish - stop) / period_ns)
            for count, rule, end in zip(counts, ("first", "last"), ("begin", "end"), strict=True):
                # A sample is due within the jitter of its time; 1e-6 covers the rounding of the division.
                if count >= 1 - fits[stream].jitter_ns / period_ns - 1e-6:
                    missing = f"{stream} lacks {int(count + 0.5)} of its samples at its {end}"
                    message = f"{missing}: most other streams go on to where the {rule} one is due"
                    notices.append(Notice(f"clocks.span.{rule}_missing", message, Where(stream=stream)))
        return Observation(all_timestamps(facts), tuple(statistics), tuple(notices))


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
