"""Other units in which the timestamps of a whole stream may be, by its span: ticks of a counter, or any factor.

A stream that was cut off is short as well. What tells both apart is the content: with the right factor undone, the
stream agrees with the others over the whole sequence (``conclusion.is_unit_by_chance``).
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.causes import stream_family
from fedora_qa.checks.clocks.span import StreamEnds
from fedora_qa.checks.clocks.streams import durations_ns
from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.clocks.regular_clock import FEWEST_TIMESTAMPS
from fedora_qa.faults.clocks import TimeUnit
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.clock_resets import TICK_FACTORS, UNIT_FACTORS, UNIT_WITHIN

_TICKS_HZ: Final = (
    1e2, 250.0, 300.0, 1e4, 32768.0, 44.1e3, 48e3, 90e3, 1e5, 1e7, 12e6, 16e6, 19.2e6, 24e6, 25e6, 27e6, 40e6, 48e6,
    50e6, 62.5e6, 72e6, 80e6, 1e8, 125e6, 168e6, 2e8,
)  # fmt: skip
"""Rates of counters that timestamps are read from: jiffies, the quartz of a watch, audio, MPEG, powers of ten, and the
clocks of processors, buses and microcontrollers. The values are not derived; a factor beside them is tried as it is
measured."""

_TICKS_PER_US: Final = 1e-6
"""Factor of timestamps, which are read as microseconds, for a tick rate of 1 Hz."""

_DIGITS: Final = (1, 2)
"""Significant digits of the rates in Hz that sensors mostly have. The values are not derived."""

_BRIEF: Final = 0.1
"""Share of the duration of the other streams below which events do not last as long as those of any sequence. Sensors
give events while the camera moves, and the sequences of a dataset last about as long. The value is not derived."""

_COMPARED: Final = {
    "imu": {"imu.timing"},
    "pose": {"imu.timing", "depth.consistency"},
    "depth": {"depth.consistency"},
    "rgb": {"flow_photometric.residual", "event_response.timing"},
    "flow": {"flow_photometric.residual", "flow_geometry.endpoint"},
}
"""Checks that compare the content of a stream with others over its time, and pass only where the motion shows it."""


def is_known_unit(factor: float) -> bool:
    """Whether a factor is one that durations identify by themselves, beside no other cause."""
    return factor in UNIT_FACTORS


def is_tick_factor(factor: float) -> bool:
    """Whether a factor is that of a counter whose rate is in use."""
    return factor in TICK_FACTORS or factor in _factors_of_ticks()


def checks_that_compare(stream: str) -> set[str]:
    """Return the names of the checks that compare the content of a stream with others over its time."""
    return _COMPARED.get(stream_family(stream), set())


def units_of_brief_events(facts: Facts) -> tuple[TimeUnit, ...]:
    """Return the units that events may have which last less than a tenth as long as the other streams, likeliest first.

    A sequence mostly ends with an event. It begins with a silence, until the first change exceeds a threshold. So where
    the counter began with the file's clock, the factor is the last timestamp over the duration of the others; elsewhere
    it is the ratio of the durations. Empty for events that last longer, and for those of a single instant.
    """
    durations = durations_ns(facts)
    events_ns = durations.pop("events", 0.0)
    reference_ns = float(np.median(list(durations.values()))) if durations else 0.0
    if facts.events is None or reference_ns <= 0:
        return ()
    factor = events_ns / reference_ns
    if not 0 < factor < _BRIEF:
        return ()
    zero_ns = facts.from_file_us(0.0)
    first_ns, last_ns = facts.events.first_ns - zero_ns, facts.events.last_ns - zero_ns
    # Behind a silence of more than half of the events' time, the counter began elsewhere.
    begins_with_file = 0 <= 2 * first_ns < last_ns
    units = []
    # Times that were cut off lie half a tick before the middle of theirs. The sequence ends within the last tick, or
    # with it; of rounded times it ends with the last one.
    for ticks_to_end, early_ticks in ((0.5, 0.5), (1.0, 0.5), (0.0, 0.0)):
        begin_ns = 0.0
        if begins_with_file:
            factor = (last_ns + ticks_to_end * NS_PER_US) / reference_ns
        else:
            others_ns = [clock.times_ns[0] for clock in facts.clocks.values() if clock.usable]
            begin_ns = float(np.median(others_ns)) - zero_ns - first_ns / factor
        # t' = p + (t - p) / f is later by d if the pivot p is moved by d / (1 - 1 / f).
        later_ns = begin_ns + early_ticks * NS_PER_US / factor
        units.append(TimeUnit("events", factor, zero_ns + round(later_ns / (1 - 1 / factor))))
    return tuple(units)


def factors_of_span(stream: str, ends: StreamEnds, facts: Facts) -> tuple[float, ...]:
    """Return the factors by which the timestamps of a stream may be too large, best first.

    Both ends leave the factor open by the period of the stream, with the factor undone, and that of the others. In
    this range the first is that of a counter in use; else those with which the stream has a round rate in Hz; last the
    measured ratio of the spans.

    Parameters
    ----------
    stream
        A sampled stream.
    ends
        Its ends against those of the other streams.
    facts
        With the clocks of all streams.

    Returns
    -------
    tuple of float
        Three at most; empty where the stream is too short, or as long as the others but for a fifth.
    """
    clock = facts.clocks.get(stream)
    if clock is None or np.count_nonzero(clock.advancing) < FEWEST_TIMESTAMPS or ends.median_duration_ns <= 0:
        return ()
    ratio = 1 - ends.missing_ns / ends.median_duration_ns
    if ratio <= 0 or abs(ratio - 1) <= UNIT_WITHIN:
        return ()
    period_ns = _period_ns(facts, stream)
    usual_ns = float(np.median([_period_ns(facts, other) for other in facts.clocks if other != stream] or [0.0]))
    within = (period_ns / ratio + usual_ns) / ends.median_duration_ns
    if within >= UNIT_WITHIN:
        return ()
    nearest = min(_factors_of_ticks(), key=lambda factor: abs(factor / ratio - 1))
    if abs(nearest / ratio - 1) <= within:
        return (nearest,)
    rate_hz = NS_PER_S * ratio / period_ns
    rounded_hz = (float(f"{rate_hz:.{digits - 1}e}") for digits in _DIGITS)
    factors = (period_ns * hz / NS_PER_S for hz in rounded_hz)
    return tuple(dict.fromkeys((*(factor for factor in factors if abs(factor / ratio - 1) <= within), ratio)))


def unit_by_factor(stream: str, factor: float, ends: StreamEnds, facts: Facts) -> TimeUnit:
    """Return the fault of a factor, with the times from which a regular clock was rounded where there is one.

    Undone about zero of the file's clock, the stream begins elsewhere than the others if its counter began with it:
    then its first timestamp stays.

    Parameters
    ----------
    stream, ends, facts
        As of ``factors_of_span``.
    factor
        Stored over correct number.
    """
    clock = facts.clocks[stream]
    times_ns = clock.times_ns[clock.advancing]
    start_ns, zero_ns = int(times_ns[0]), facts.from_file_us(0.0)
    others_ns = start_ns - ends.begins_later_ns
    elsewhere_ns = zero_ns + (start_ns - zero_ns) / factor - others_ns
    pivot_ns = start_ns if abs(ends.begins_later_ns) < abs(elsewhere_ns) else None
    about_ns = zero_ns if pivot_ns is None else pivot_ns
    undone_ns = about_ns + (times_ns - about_ns) / factor
    return TimeUnit(stream, factor, pivot_ns, regular_ns=_regular_clock_ns(undone_ns, NS_PER_US / factor, others_ns))


def _regular_clock_ns(times_ns: NDArray[np.float64], tick_ns: float, others_ns: float) -> tuple[float, float] | None:
    """Return the start and the period, ns, of a regular clock whose times were rounded to ticks; None without one.

    Times of a regular clock are off it by one range of a tick after rounding, up or down or to the nearest, and by no
    more. Which of these it was is unknown: a clock that may have begun with the others has.
    """
    steps = len(times_ns) - 1
    mean_ns = float(times_ns[-1] - times_ns[0]) / steps
    if tick_ns <= NS_PER_US or 2 * tick_ns >= mean_ns:
        return None
    of_whole_hz, of_whole_us = NS_PER_S / max(round(NS_PER_S / mean_ns), 1), NS_PER_US * round(mean_ns / NS_PER_US)
    for period_ns in (of_whole_hz, of_whole_us):
        rows = np.rint((times_ns - times_ns[0]) / period_ns)
        starts_ns = times_ns - rows * period_ns
        # The times themselves are whole microseconds.
        if np.ptp(starts_ns) <= tick_ns + NS_PER_US:
            middle_ns = float(starts_ns.max() + starts_ns.min()) / 2
            return (others_ns if abs(others_ns - middle_ns) <= tick_ns else middle_ns), period_ns
    return None


def _factors_of_ticks() -> tuple[float, ...]:
    return tuple(round(hz * _TICKS_PER_US, 9) for hz in _TICKS_HZ)


def _period_ns(facts: Facts, stream: str) -> float:
    clock = facts.clocks[stream]
    times_ns = clock.times_ns[clock.advancing]
    return float(times_ns[-1] - times_ns[0]) / (len(times_ns) - 1) if len(times_ns) > 1 else 0.0
