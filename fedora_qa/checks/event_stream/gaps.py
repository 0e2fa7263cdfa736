"""Intervals in which no pixel of the sensor gives an event."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_stream.event_rows import event_coverage, why_no_sensor
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.estimators.clocks.grid import crowded_step_ns
from fedora_qa.estimators.events.rates import BINS, EventSilence, least_probable_silence
from fedora_qa.estimators.events.silent_ends import Track, count_pairs, silent_end
from fedora_qa.features import Feature
from fedora_qa.geometry import so3
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import ImuSamples, PoseSamples, Window
from fedora_qa.views.clock_resets import clock_reset
from fedora_qa.views.motion_samples import join_poses, owned_imu, owned_poses
from fedora_qa.views.sensor_events import all_events, local_tick_ns, own, pixel_events, tick_ns

Int64 = NDArray[np.int64]

_SIGMA_INTERVALS: Final = 3.5
"""Standard error of the length of a silence, in mean intervals between events, where every tick holds an event. A
silence of w mean intervals has the probability e^-w (Poisson); this is that of six standard deviations, 1e-9, at w =
20.7."""


LONGEST_SILENT_END_NS: Final = NS_PER_S // 10
"""Time without events at an end of the file that is noted, ns: a sampled stream has at least 10 Hz."""

_BINS_OF_WINDOW: Final = 64
"""Bins of a window in which events are counted by motion: 3 ms of a usual window, a thirtieth of the shortest silence
at an end."""

_BURST: Final = 5.0
"""Ratio of the events under one timestamp to those of a tick beside it above which the rate has not just risen: in
rendered steps it changes less from one to the next. The value is not derived."""


@dataclass(frozen=True, slots=True)
class ExpectedEvents(Feature):
    """Events that are expected in an interval without events.

    Attributes
    ----------
    count
        Their number by the rate around the interval, 1 at least.
    """

    count: int


@dataclass(frozen=True, slots=True)
class EventsStampedTogether(Feature):
    """The events that an interval without events lacks have the timestamp at one end of it.

    Attributes
    ----------
    count
        Number of events with that timestamp.
    step_ms
        Distance of the timestamps at both ends, ms.
    """

    count: int
    step_ms: float


@dataclass(frozen=True, slots=True)
class SilenceCount:
    """The least probable interval without events that ends in a window.

    Attributes
    ----------
    events
        Number of events that the window owns.
    silences
        Number of intervals that were compared.
    least_probable
        The interval; None without one.
    at_ends
        Larger number of events with the timestamp at either end of the interval.
    """

    events: int
    silences: int
    least_probable: EventSilence | None
    at_ends: int = 0
    motion: "EventsByMotion | None" = None


@dataclass(frozen=True, slots=True)
class EventsByMotion:
    """Events of a window by time, and the motion of the body in it.

    Attributes
    ----------
    edges_ns
        (bins + 1,) edges of the bins, ns from the file's origin.
    pairs
        (lengths, bins) numbers of events that follow another of their pixel within each of ``PAIR_NS``.
    poses, imu
        Samples of the window; no IMU samples where the file has poses.
    """

    edges_ns: Int64
    pairs: Int64
    poses: PoseSamples | None
    imu: ImuSamples | None


@dataclass(frozen=True, slots=True)
class SilenceAtEnd(Feature):
    """A silence at the begin or the end of the file in which the camera moves.

    Attributes
    ----------
    silent_ratio
        Its share of the span of the motion, 0 to 1.
    """

    silent_ratio: float


class EventStreamGaps(WindowCheck[SilenceCount]):
    """Is there an interval without any event of the whole sensor that its neighbourhood makes improbable?

    The length, in ms, of the interval without events (silence) that is least probable given its own neighbourhood.

    Why it matters
    --------------
    A recorder or simulator that loses a packet leaves a gap of 0.2 to 2 ms, across which every edge jumps. Frame rates,
    event rates and histograms do not show it.

    How
    ---
    The longest silences of a window are examined, also those that began before it. Each is compared with the counts in
    sixteen bins of its own length on either side, and with the nearest four of them, because edges come and go in the
    view; what makes it most probable is used. Motion that comes to rest therefore gives no finding, because the bins
    after it are empty as well; a lost packet leaves both sides full. A silence that matches a step back of the
    timestamps (``clocks.order``) is a clock that was set, and no loss. Nor is one whose events have the timestamp at
    its end or at its beginning: they were stamped together, as a packet.

    Without colour, more than 0.1 s without events at the begin or the end of the file are compared with the rest of it
    by the motion of the body, from poses, or from the gyro where there are none: a camera that moves by a distance D
    sees as many pixels pass an edge as where it moves by D elsewhere. Only events that follow another of the same pixel
    within a path of D / 2 are counted, because at the begin no pixel fires before its light has changed by a threshold.
    Where turn and position both move, the measure with the fewer events counts. A camera at rest states nothing.

    Noise model
    -----------
    Counts in bins of a rate that itself fluctuates are gamma-Poisson. With mean m and a relative variance 1/r of the
    rate, both measured from the bins, a bin is empty with probability (1 + m / r)^-r. The standard error is the length
    at which this probability equals that of one standard deviation. Every silence counts as a test. The grid of the
    timestamps beside it is subtracted from each silence. At an end of the file the bins have equal paths instead of
    equal times. Six standard deviations of the noise of poses, measured from second differences, are subtracted from D.
    Of the gyro, D is half of the bend of its integral, which no bias changes.

    Cannot detect
    -------------
    Losses in a part of the image (``event_response.conservation``). Losses shorter than the usual silences of the
    scene. Losses in quiet scenes, or beside edges so few that the rate comes and goes with each (high thresholds):
    where 2 ms could not be detected, nothing is judged. A loss at the very end, after which no event comes, of less
    than 0.1 s. Losses at an end while the body rests, or, without poses, turns steadily.
    A camera that moves for more than 0.1 s before a view without any edge, at an end of the file, is taken for a loss.
    A loss within four of its own lengths after the first event, when the sensor only begins to
    give events.

    Sources
    -------
    M. Greenwood, G. U. Yule, J. R. Stat. Soc. 83 (1920) for counts of a gamma distributed rate; derivation in
    ``fedora_qa/estimators/events/rates.py``.
    """

    name = "event_stream.gaps"
    needs = ("events",)

    def measure(self, window: Window) -> SilenceCount:
        """Return the least probable silence that ends in this window; it may begin in an earlier one."""
        events = all_events(window)
        times_ns = events.times_ns
        start_ns, stop_ns = window.span.start_ns, window.span.stop_ns
        first_ns = window.facts.events.first_ns if window.facts.events is not None else 0
        if len(times_ns) and times_ns[0] >= start_ns > first_ns:
            # The silence began before the halo: its length is limited to the halo.
            times_ns = np.concatenate([[min(2 * start_ns - stop_ns, int(times_ns[0]) - 1)], times_ns])
        step_ns = local_tick_ns(window)
        motion = _by_motion(window) if _needs_motion(window.facts) else None
        silence, silences = least_probable_silence(times_ns, start_ns, stop_ns, step_ns, first_ns)
        # Beside the silence events may lie on a coarser grid than in the rest of the window.
        while silence is not None and (beside_ns := crowded_step_ns(_beside(times_ns, silence))) > step_ns:
            step_ns = beside_ns
            silence, silences = least_probable_silence(times_ns, start_ns, stop_ns, step_ns, first_ns)
        if silence is None:
            return SilenceCount(len(own(window, events)), silences, None, motion=motion)
        ends_ns = [silence.start_ns, silence.stop_ns]
        at_ends = np.searchsorted(times_ns, ends_ns, side="right") - np.searchsorted(times_ns, ends_ns)
        return SilenceCount(len(own(window, events)), silences, silence, int(at_ends.max()), motion)

    def conclude(self, state: Sequence[SilenceCount], facts: Facts) -> Observation:
        """State the least probable silence of all windows, in ms."""
        coverage = event_coverage(facts, sum(count.events for count in state))
        at_ends_of_file = tuple(_of_silent_ends([count.motion for count in state if count.motion is not None], facts))
        silences = [(count.least_probable, count.at_ends) for count in state if count.least_probable is not None]
        if not silences:
            if not any(count.silences for count in state):
                reason = "too few events to distinguish a gap from a quiet scene"
                return Observation(coverage, at_ends_of_file, unobservable="" if at_ends_of_file else reason)
            # Every tick holds events.
            events = facts.events
            mean_interval_ms = (
                (events.last_ns - events.first_ns) / 1e6 / max(events.count, 1) if events is not None else 0.0
            )
            none = Statistic(
                name="gap",
                value=0.0,
                unit="ms",
                standard_error=_SIGMA_INTERVALS * mean_interval_ms,
                side="upper",
                resolution=tick_ns(facts) / 1e6,
                statement="",
                code="event_stream.gaps.silence",
            )
            return Observation(coverage, (none, *at_ends_of_file))
        worst, at_ends = max(silences, key=lambda silence: silence[0].z)
        length_ms = worst.length_ns / 1e6
        start_us, stop_us = (facts.to_file_us(time) for time in (worst.start_ns, worst.stop_ns))
        expected = max(round(worst.expected), 1)
        reset = clock_reset(facts.events)
        # A clock reset explains only the silence that is its step forwards.
        of_reset = reset is not None and reset.has_step_between(worst.start_ns, worst.stop_ns)
        step_ns = worst.stop_ns - worst.start_ns
        together: tuple[Feature, ...] = ()
        # A timestamp has the events of its tick. Where it has half of those that the silence lacks, and far more than a
        # tick beside it, these were not lost, but stamped together.
        of_tick = worst.expected * (step_ns - worst.length_ns) / worst.length_ns
        if at_ends > max(worst.expected / 2, _BURST * of_tick):
            together = (EventsStampedTogether(at_ends, step_ns / NS_PER_MS),)
        statistic = Statistic(
            name="gap",
            value=length_ms,
            unit="ms",
            # Judgement compares the length with 0: in this unit the silence is z standard errors long.
            standard_error=length_ms / max(worst.z, 0.5),
            side="upper",
            tests=sum(count.silences for count in state),
            statement=f"No event for {length_ms:.4g} ms from {start_us:.0f} us, where about {expected} are expected.",
            code="event_stream.gaps.silence",
            where=Where(stream="events", start_us=start_us, stop_us=stop_us),
            features=(ExpectedEvents(expected), *((reset,) if reset is not None and of_reset else ()), *together),
        )
        return Observation(coverage, (statistic, *at_ends_of_file))


def _needs_motion(facts: Facts) -> bool:
    """Return whether the motion of the body decides if events may begin late or end early; with frames light does."""
    return (
        bool({"pose", "imu"} & set(facts.clocks))
        and "rgb" not in facts.clocks
        and facts.declared.kind != "recorded"
        and not why_no_sensor(facts)
    )


def _by_motion(window: Window) -> EventsByMotion:
    edges_ns = np.linspace(window.span.start_ns, window.span.stop_ns, _BINS_OF_WINDOW + 1).astype(np.int64)
    has_poses = "pose" in window.facts.clocks
    return EventsByMotion(
        edges_ns,
        count_pairs(pixel_events(window), edges_ns),
        owned_poses(window) if has_poses else None,
        None if has_poses else owned_imu(window),
    )


def _of_silent_ends(parts: Sequence[EventsByMotion], facts: Facts) -> Iterator[Statistic]:
    """Yield the silences at both ends of the file that are longer than a material gap between streams."""
    events = facts.events
    # A part of the windows leaves gaps in the counts.
    joined = all(before.edges_ns[-1] == after.edges_ns[0] for before, after in pairwise(parts))
    tracks = _tracks(parts) if parts and joined else []
    if not tracks or events is None:
        return
    edges_ns = np.concatenate([parts[0].edges_ns, *(part.edges_ns[1:] for part in parts[1:])])
    pairs = np.concatenate([part.pairs for part in parts], axis=1)
    begin_ns = max(int(track.times_ns[0]) for track in tracks)
    finish_ns = min(int(track.times_ns[-1]) for track in tracks)
    for verb, side, silence_ns, far_ns in (
        ("begin", "after", (begin_ns, events.first_ns), events.last_ns),
        ("end", "before", (events.last_ns, finish_ns), events.first_ns),
    ):
        length_ns = silence_ns[1] - silence_ns[0]
        if not LONGEST_SILENT_END_NS < length_ns < finish_ns - begin_ns:
            continue
        end = silent_end(silence_ns, far_ns, edges_ns, pairs, tracks)
        if end is None:
            continue
        start_us, stop_us = (facts.to_file_us(time_ns) for time_ns in silence_ns)
        length_ms = length_ns / NS_PER_MS
        motion = "poses" if "pose" in facts.clocks else "gyro"
        yield Statistic(
            name=f"silent_{verb}",
            value=length_ms,
            unit="ms",
            # As of gaps: in this unit the silence is z standard errors long.
            standard_error=length_ms / max(end.z, 0.5),
            side="upper",
            tests=2,
            statement=f"Events {verb} {length_ms:.4g} ms {side} the {motion}; the camera moves in that time, and at "
            f"least {max(round(end.expected), 1)} events follow such a motion in the rest of the file.",
            code="event_stream.gaps.silent_end",
            where=Where(stream="events", start_us=start_us, stop_us=stop_us),
            features=(SilenceAtEnd(length_ns / (finish_ns - begin_ns)),),
        )


def _tracks(parts: Sequence[EventsByMotion]) -> list[Track]:
    """Return the positions and orientations of the body, or its integrated turn where the file has no poses."""
    poses = join_poses([part.poses for part in parts if part.poses is not None])
    if len(poses.times_ns):
        q = so3.normalise(poses.orientations_xyzw)
        # q and -q are one rotation.
        signs = np.cumprod(np.where(np.sum(q[1:] * q[:-1], axis=1) < 0, -1.0, 1.0))
        q[1:] *= signs[:, np.newaxis]
        return [Track(poses.times_ns, poses.positions_world_m), Track(poses.times_ns, q)]
    samples = [part.imu for part in parts if part.imu is not None]
    if not samples:
        return []
    times_ns = np.concatenate([imu.times_ns for imu in samples])
    rates_rad_s = np.concatenate([imu.angular_velocities_body_rad_s for imu in samples])
    turns_rad = rates_rad_s[1:] * (np.diff(times_ns) / NS_PER_S)[:, np.newaxis]
    if not np.isfinite(turns_rad).all():
        return []
    return [Track(times_ns, np.concatenate([np.zeros((1, 3)), np.cumsum(turns_rad, axis=0)]), drifts=True)]


def _beside(times_ns: Int64, silence: EventSilence) -> Int64:
    """Return the timestamps in the bins beside a silence."""
    reach_ns = BINS * (silence.stop_ns - silence.start_ns)
    first, stop = np.searchsorted(times_ns, [silence.start_ns - reach_ns, silence.stop_ns + reach_ns])
    return times_ns[first:stop]
