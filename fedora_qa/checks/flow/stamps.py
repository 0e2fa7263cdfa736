"""The intervals of flow, held against the stamps of the frames that they lead from and to."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.checks.protocol import Measured, Suspect
from fedora_qa.conventions import NS_PER_S
from fedora_qa.record.types import Where
from fedora_qa.sequence.facts import Clock, Facts

Int64 = NDArray[np.int64]

_NS_PER_MS: Final = 1e6


def stamp_measurements(facts: Facts) -> list[Measured]:
    """Count, for each rate, interval ends that lie on no depth frame, gaps, and lengths that are not the rate's."""
    measured = [one for stream in facts.flow_streams for one in _of_stream(facts, stream)]
    spread = {
        code for code in {one.code for one in measured} if all(one.value > 0 for one in measured if one.code == code)
    }
    return [_of_all_rates(one) if one.code in spread else one for one in measured]


def _of_all_rates(measured: Measured) -> Measured:
    """Suspect flow as a whole: every rate has the same fault."""
    suspects = tuple(
        replace(suspect, stream="flow") if stream_family(suspect.stream) == "flow" else suspect
        for suspect in measured.suspects
    )
    return replace(measured, suspects=suspects)


def _of_stream(facts: Facts, stream: str) -> list[Measured]:
    clock = facts.clocks[stream]
    if clock.ends_ns is None or not len(clock.times_ns):
        return []
    frames = facts.clocks["depth"]
    off_frames = np.flatnonzero(~(_on(frames, clock.times_ns) & _on(frames, clock.ends_ns)))
    gaps = np.flatnonzero(clock.times_ns[1:] != clock.ends_ns[:-1]) + 1
    lengths_ns = clock.ends_ns - clock.times_ns
    nominal_ns = NS_PER_S / int(stream.removeprefix("flow/").removesuffix("hz"))
    wrong_length = np.flatnonzero(np.abs(lengths_ns - nominal_ns) > _frame_step_ns(frames) / 2)
    return [
        _count(facts, stream, "off_frames", off_frames, "start or end on no depth frame",
               _suspects_off_frames(facts, stream, clock, off_frames)),
        _count(facts, stream, "not_abutting", gaps, "do not begin where the one before them ends",
               _suspects_of_gaps(stream, clock, gaps)),
        _count(facts, stream, "wrong_length", wrong_length, f"do not last {nominal_ns / _NS_PER_MS:g} ms",
               _suspects_of_length(facts, stream, lengths_ns, wrong_length)),
    ]  # fmt: skip


def _count(
    facts: Facts, stream: str, rule: str, wrong: NDArray[np.intp], what: str, suspects: tuple[Suspect, ...]
) -> Measured:
    clock = facts.clocks[stream]
    where = Where(stream=stream)
    if len(wrong):
        first, last = int(wrong[0]), int(wrong[-1])
        start_us, stop_us = (facts.to_file_us(float(clock.times_ns[row])) for row in (first, last))
        where = Where(stream, start_us, stop_us, index_start=first, index_stop=last + 1)
    return Measured(
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
    """Tell a constant offset from a drift and from single missing frames, and ask the colour frames whose fault it is.

    Offsets are seen modulo the frame step: the nearest frame decides.
    """
    if not len(off):
        return ()
    if _outlasts(facts.clocks["depth"], clock, off):
        return (Suspect("truncated", "depth", 0.6), Suspect("time_offset", stream, 0.5))
    if len(off) < len(clock.times_ns) / 2:
        return (Suspect("dropped_samples", "depth", 0.8), Suspect("quantised_time", stream, 0.3))
    frames_ns = facts.clocks["depth"].times_ns[facts.clocks["depth"].advancing]
    offsets_ms = _offsets_ns(frames_ns, clock.times_ns) / _NS_PER_MS
    offset_ms = float(np.median(offsets_ms))
    spread_ms = float(np.median(np.abs(offsets_ms - offset_ms)))
    name = "time_offset" if spread_ms <= 0.1 * abs(offset_ms) else "clock_rate"
    rgb = facts.clocks.get("rgb")
    depth_late = rgb is not None and bool(_on(rgb, clock.times_ns).all())
    unit = CAUSES[name].unit
    size = offset_ms if name == "time_offset" else _drift_ppm(clock.times_ns, offsets_ms)
    return (
        Suspect(name, stream, 0.3 if depth_late else 0.9, size, unit),
        Suspect(name, "depth", 0.9 if depth_late else 0.3, -size, unit),
    )


def _outlasts(frames: Clock, clock: Clock, off: NDArray[np.intp]) -> bool:
    """Whether all intervals that are off begin before the first frame or end after the last."""
    if clock.ends_ns is None or not len(frames.times_ns):
        return False
    before, after = clock.times_ns[off] < frames.times_ns.min(), clock.ends_ns[off] > frames.times_ns.max()
    return bool(np.all(before | after))


def _offsets_ns(frames_ns: Int64, times_ns: Int64) -> NDArray[np.float64]:
    """Return how much later each instant is than the frame nearest to it."""
    after = np.clip(np.searchsorted(frames_ns, times_ns), 1, max(len(frames_ns) - 1, 1))
    around = np.stack((frames_ns[after - 1], frames_ns[np.minimum(after, len(frames_ns) - 1)]))
    offsets = (times_ns - around).astype(np.float64)
    nearest: NDArray[np.float64] = np.where(np.abs(offsets[0]) <= np.abs(offsets[1]), offsets[0], offsets[1])
    return nearest


def _drift_ppm(times_ns: Int64, offsets_ms: NDArray[np.float64]) -> float:
    """Return the slope of the offsets over time, from the median of steps (a step across a frame does not count)."""
    steps_ms = np.diff(times_ns) / _NS_PER_MS
    advancing = steps_ms > 0
    if not advancing.any():
        return 0.0
    return float(np.median(np.diff(offsets_ms)[advancing] / steps_ms[advancing]) * 1e6)


def _suspects_of_gaps(stream: str, clock: Clock, gaps: NDArray[np.intp]) -> tuple[Suspect, ...]:
    if not len(gaps) or clock.ends_ns is None:
        return ()
    behind_ns = clock.times_ns[gaps] - clock.ends_ns[gaps - 1]
    forward = int(np.count_nonzero(behind_ns > 0))
    missing = Suspect("dropped_samples", stream, 0.9 * forward / len(gaps), float(forward), "samples")
    repeated = len(gaps) - forward
    return (
        (missing, Suspect("duplicated_samples", stream, 0.9 * repeated / len(gaps), float(repeated), "samples"))
        if repeated
        else (missing,)
    )


def _suspects_of_length(facts: Facts, stream: str, lengths_ns: Int64, wrong: NDArray[np.intp]) -> tuple[Suspect, ...]:
    if not len(wrong):
        return ()
    typical_ns = float(np.median(lengths_ns[wrong]))
    rates_hz = [int(other.removeprefix("flow/").removesuffix("hz")) for other in facts.flow_streams]
    mixed = any(abs(typical_ns - NS_PER_S / rate) < 0.02 * typical_ns for rate in rates_hz)
    name = "flow_rate_mixed" if mixed else "time_unit"
    return (Suspect(name, stream, 0.8), Suspect("dropped_samples", stream, 0.3))
