"""Are samples missing?"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.clocks.streams import all_timestamps, clock_set_back, file_us, fits_of
from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import FactsCheck, Notice, Observation, Statistic
from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.features import Feature
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts, has_place


@dataclass(frozen=True, slots=True)
class DisorderedTimestamps(Feature):
    """Timestamps out of order that could fill all gaps.

    Attributes
    ----------
    count
        Number of distinct timestamps that are earlier than one before them.
    """

    count: int


@dataclass(frozen=True, slots=True)
class ClockJump(Feature):
    """The first step that is no whole number of periods.

    Attributes
    ----------
    offset_ms
        Excess of the step over a whole number of periods, ms.
    rounding_ms
        Error of the excess by rounding of timestamps, ms.
    """

    offset_ms: float
    rounding_ms: float


class ClocksGaps(FactsCheck):
    """Are samples missing, or was a clock set?

    The number of missing samples, estimated from the steps between timestamps. The number of steps that are no whole
    number of periods, for a clock that is otherwise exact.

    Why it matters
    --------------
    One lost IMU sample removes 1 ms of motion from every integral across it. A clock that was set by 6 ms shifts all
    later samples relative to every other stream.

    How
    ---
    A regular clock is fitted to each stream (``fedora_qa/estimators/clocks/regular_clock.py``). A step of about k
    periods (the median step) means k - 1 missing samples. Double steps that are spread evenly, m of them in m equal
    parts of the stream, are a clock that was rounded to a coarse grid: by chance this has the probability m!/m^m, 4e-4
    for the required ten steps. Where at most two steps of an exact clock, and at most a tenth of all steps, deviate by
    more than the rounding of their two timestamps to a microsecond, the clock was set, or one sample has a late
    timestamp.

    Noise model
    -----------
    Counts are exact for regular streams. A gap differs from a normal step by a period. Jitter of less than a tenth of
    the period is five standard deviations away from half a period, at which a gap and a normal step would be confused.
    Streams with more jitter are noted and not judged.

    Cannot detect
    -------------
    Samples lost at the ends (``clocks.span``), among events (``event_stream.gaps``), or from a stream whose timestamps
    were written again after the loss: there the content is compared (``images.order``, ``imu.timing``).

    Sources
    -------
    First principles; the derivations are in ``fedora_qa/estimators/clocks/regular_clock.py``.
    """

    name = "clocks.gaps"

    def examine(self, facts: Facts) -> Observation:
        """Count missing samples and jumps over all streams."""
        statistics: list[Statistic] = []
        notices: list[Notice] = []
        for stream, fit in fits_of(facts):
            # With jitter above a tenth of the period or half a grid, a late sample is not distinguishable from a
            # missing one.
            if not fit.regular:
                jitter = f"jitter {fit.jitter_ns / NS_PER_US:.3g} us of a period of {fit.period_ns / NS_PER_US:.4g} us"
                message = f"{stream} is irregular ({jitter}): gaps cannot be detected"
                notices.append(Notice("clocks.gaps.irregular", message, Where(stream)))
                continue
            # Samples at another place leave a gap at their own place, as missing ones do. Rows that were written twice
            # have one timestamp and fill one gap at most.
            clock = facts.clocks[stream]
            distinct = len(np.unique(clock.times_ns[~clock.advancing]))
            features: tuple[Feature, ...] = ()
            # Fewer displaced samples than missing ones do not explain all gaps: some are lost.
            if fit.missing and distinct >= fit.missing:
                set_back = clock_set_back(clock, np.flatnonzero(np.diff(clock.times_ns) < 0))
                features = (DisorderedTimestamps(distinct), *((set_back,) if set_back is not None else ()))
            first, where = _behind(facts, stream, fit.gap_after)
            # Samples without a valid timestamp are not missing; integrity.finite counts them.
            missing = max(fit.missing - int(np.count_nonzero(~has_place(clock.times_ns))), 0)
            statistics.append(
                count_of_faults(
                    name=f"{stream}.missing",
                    value=missing,
                    unit="samples",
                    statement=f"{missing} samples of {stream} are missing in {len(fit.gap_after)} gaps, "
                    f"the first after row {first}.",
                    code="clocks.gaps.missing",
                    where=where,
                    features=features,
                )
            )
            first, where = _behind(facts, stream, fit.jump_after)
            jump_ms = float(fit.jumps_ns[0]) / NS_PER_MS if len(fit.jumps_ns) else 0.0
            # Both timestamps of a step are rounded to a microsecond.
            rounding_ms = 1 / NS_PER_MS * NS_PER_US
            period_us = fit.period_ns / NS_PER_US
            statistics.append(
                count_of_faults(
                    name=f"{stream}.jumps",
                    value=len(fit.jump_after),
                    unit="steps",
                    statement=f"{len(fit.jump_after)} steps of {stream} are no whole number of periods, the first "
                    f"after row {first} is {jump_ms:+.4g} ms off; all others keep the period of {period_us:.6g} us.",
                    code="clocks.gaps.jump",
                    where=where,
                    features=(ClockJump(jump_ms, rounding_ms),),
                )
            )
        empty = "" if statistics or notices else "no stream has three timestamps in order"
        return Observation(all_timestamps(facts), tuple(statistics), tuple(notices), unobservable=empty)


def _behind(facts: Facts, stream: str, steps: NDArray[np.intp]) -> tuple[int | None, Where]:
    """Return the row before the first of some steps between advancing timestamps, and its place."""
    clock = facts.clocks[stream]
    # Steps are counted between advancing timestamps; flatnonzero gives back their rows in the file.
    first = int(np.flatnonzero(clock.advancing)[steps[0]]) if len(steps) else None
    stop = None if first is None else first + 1
    start_us, stop_us = file_us(facts, clock.times_ns, first), file_us(facts, clock.times_ns, stop)
    return first, Where(stream, start_us, stop_us, index_start=first, index_stop=stop)
