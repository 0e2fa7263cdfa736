"""The intervals of flow, held against the stamps of the frames that they lead from and to."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.checks.flow_geometry.timestamp_patterns import offsets_from_nearest, timestamp_patterns
from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Clock, Facts

Int64 = NDArray[np.int64]

_MISSING: Final = 0.75
"""Share of the frame step beyond which the nearest frame is another one: stamps within a step are half of it off."""


def timestamp_measurements(facts: Facts) -> list[Statistic]:
    """Count, for each rate, interval ends that lie on no depth frame, gaps, and lengths that are not the rate's."""
    measured = [one for stream in facts.flow_streams for one in _of_stream(facts, stream)]
    spread = {
        code for code in {one.code for one in measured} if all(one.value > 0 for one in measured if one.code == code)
    }
    return [_of_all_rates(one) if one.code in spread else one for one in measured]


def _of_all_rates(measured: Statistic) -> Statistic:
    """Suspect flow as a whole: every rate has the same fault."""
    suspects = tuple(
        replace(suspect, stream="flow") if stream_family(suspect.stream) == "flow" else suspect
        for suspect in measured.suspects
    )
    return replace(measured, suspects=suspects)


def _of_stream(facts: Facts, stream: str) -> list[Statistic]:
    clock = facts.clocks[stream]
    if clock.ends_ns is None or not len(clock.times_ns):
        return []
    frames = facts.clocks["depth"]
    off_frames = np.flatnonzero(~(_on(frames, clock.times_ns) & _on(frames, clock.ends_ns)))
    gaps = np.flatnonzero(clock.times_ns[1:] != clock.ends_ns[:-1]) + 1
    lengths_ns = clock.ends_ns - clock.times_ns
    nominal_ns = NS_PER_S / int(stream.removeprefix("flow/").removesuffix("hz"))
    wrong_length = np.flatnonzero(np.abs(lengths_ns - nominal_ns) > _frame_step_ns(frames) / 2)
    suspects = _suspects_off_frames(facts, stream, clock, off_frames)
    return [
        _count(facts, stream, "off_frames", off_frames, "start or end on no depth frame", suspects),
        _count(facts, stream, "not_abutting", gaps, "do not begin where the one before them ends",
               _suspects_of_gaps(stream, clock, gaps, suspects)),
        _count(facts, stream, "wrong_length", wrong_length, f"do not last {nominal_ns / NS_PER_MS:g} ms",
               _suspects_of_length(facts, stream, lengths_ns, wrong_length, suspects)),
    ]  # fmt: skip


def _count(
    facts: Facts, stream: str, rule: str, wrong: NDArray[np.intp], what: str, suspects: tuple[Suspect, ...]
) -> Statistic:
    clock = facts.clocks[stream]
    where = Where(stream=stream)
    if len(wrong):
        first, last = int(wrong[0]), int(wrong[-1])
        start_us, stop_us = (facts.to_file_us(float(clock.times_ns[row])) for row in (first, last))
        where = Where(stream, start_us, stop_us, index_start=first, index_stop=last + 1)
    return Statistic(
        name=f"{stream} intervals_{rule}",
        value=float(len(wrong)),
        unit="intervals",
        standard_error=0.0,
        resolution=1.0,
        side="upper",
        statement=f"{len(wrong)} of {len(clock.times_ns)} intervals of {stream} {what}.",
        code=f"flow_geometry.validity.{rule}",
        where=where,
        suspects=suspects if len(wrong) else (),
    )


def _on(frames: Clock, times_ns: Int64) -> NDArray[np.bool_]:
    return np.isin(times_ns, frames.times_ns)


def _frame_step_ns(frames: Clock) -> float:
    steps_ns = np.diff(frames.times_ns[frames.advancing])
    return float(np.median(steps_ns)) if len(steps_ns) else float(NS_PER_S)


def _suspects_off_frames(facts: Facts, stream: str, clock: Clock, off: NDArray[np.intp]) -> tuple[Suspect, ...]:
    """Say in what way the stamps left the frames, and ask the colour frames whose fault it is."""
    if not len(off) or clock.ends_ns is None:
        return ()
    depth = facts.clocks["depth"]
    if _outlasts(depth, clock, off):
        return (Suspect("truncated", "depth", 0.6), Suspect("time_offset", stream, 0.5))
    frames_ns = depth.times_ns[depth.advancing]
    instants_ns = np.unique(np.concatenate((clock.times_ns[off], clock.ends_ns[off])))
    far_ns = np.abs(offsets_from_nearest(frames_ns, instants_ns[~_on(depth, instants_ns)]))
    if np.median(far_ns) > _MISSING * _frame_step_ns(depth):
        return (Suspect("dropped_samples", "depth", 0.8), *_of_patterns(stream, instants_ns, frames_ns, 0.3))
    rgb = facts.clocks.get("rgb")
    if rgb is not None and _on(rgb, instants_ns).all():
        alone = np.flatnonzero(~_on(rgb, frames_ns))
        astray_ns = frames_ns[alone[0] : alone[-1] + 1] if len(alone) else instants_ns[:0]
        by_depth = _of_patterns("depth", astray_ns, rgb.times_ns[rgb.advancing], 0.9) if len(alone) else ()
        return (*by_depth, *_of_patterns(stream, instants_ns, frames_ns, 0.3))
    return (*_of_patterns(stream, instants_ns, frames_ns, 0.9), *_of_patterns("depth", frames_ns, instants_ns, 0.3))


def _of_patterns(stream: str, instants_ns: Int64, frames_ns: Int64, weight: float) -> tuple[Suspect, ...]:
    return tuple(
        Suspect(pattern.cause, stream, weight * pattern.weight, pattern.magnitude, CAUSES[pattern.cause].unit)
        for pattern in timestamp_patterns(instants_ns, frames_ns)
        if pattern.weight > 0
    )


def _outlasts(frames: Clock, clock: Clock, off: NDArray[np.intp]) -> bool:
    """Whether all intervals that are off begin before the first frame or end after the last."""
    if clock.ends_ns is None or not len(frames.times_ns):
        return False
    before, after = clock.times_ns[off] < frames.times_ns.min(), clock.ends_ns[off] > frames.times_ns.max()
    return bool(np.all(before | after))


def _suspects_of_gaps(
    stream: str, clock: Clock, gaps: NDArray[np.intp], off_frames: tuple[Suspect, ...]
) -> tuple[Suspect, ...]:
    """Tell intervals that are missing, doubled, or in another order from stamps that merely left the frames."""
    if not len(gaps) or clock.ends_ns is None:
        return ()
    lengths_ns = clock.ends_ns - clock.times_ns
    if 2 * np.abs(clock.times_ns[gaps] - clock.ends_ns[gaps - 1]).max() < np.median(lengths_ns):
        return off_frames
    order = np.argsort(clock.times_ns, kind="stable")
    behind_ns = clock.times_ns[order][1:] - clock.ends_ns[order][:-1]
    displaced = int(np.count_nonzero(order != np.arange(len(order))))
    counts = {
        "dropped_samples": int(np.count_nonzero(behind_ns > 0)),
        "duplicated_samples": int(np.count_nonzero(behind_ns < 0)),
        "unsorted": (displaced + 1) // 2,
    }
    total = max(sum(counts.values()), 1)
    suspects = [Suspect(name, stream, 0.9 * n / total, float(n), "samples") for name, n in counts.items() if n]
    return (*sorted(suspects, key=lambda suspect: -suspect.weight), *off_frames)


def _suspects_of_length(
    facts: Facts, stream: str, lengths_ns: Int64, wrong: NDArray[np.intp], off_frames: tuple[Suspect, ...]
) -> tuple[Suspect, ...]:
    """Tell the length of another rate, and another unit, from stamps that merely left the frames."""
    if not len(wrong):
        return ()
    typical_ns = float(np.median(lengths_ns[wrong]))
    rates_hz = [int(other.removeprefix("flow/").removesuffix("hz")) for other in facts.flow_streams]
    if any(abs(typical_ns - NS_PER_S / rate) < 0.02 * typical_ns for rate in rates_hz):
        return (Suspect("flow_rate_mixed", stream, 0.8), *off_frames)
    thousands = typical_ns * int(stream.removeprefix("flow/").removesuffix("hz")) / NS_PER_S
    another_unit = thousands > 0 and any(abs(thousands / unit - 1) < 0.02 for unit in (1e-6, 1e-3, 1e3, 1e6))
    return (Suspect("time_unit", stream, 0.8 if another_unit else 0.2), *off_frames,
            Suspect("dropped_samples", stream, 0.3))  # fmt: skip
