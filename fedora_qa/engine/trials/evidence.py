"""Evidence of trials: what undoing a fault changes, for a reader of the report.

Kept for the first diagnoses whose fault clears findings: deviations, arrays of checks and pictures without and with the
fault undone, and how far out the deviations lie where more or less of the fault is undone. The latter takes work that
the trials have left over, and is kept only where there is some.
"""

from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import replace
from itertools import islice
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.diagnosis.conclusion import DeviationChange, UndoTrial
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.engine.trials.altered import PlainRun, busiest
from fedora_qa.engine.trials.deviations import check_of
from fedora_qa.engine.trials.trial import TrialBench
from fedora_qa.evidence.options import EvidenceOptions
from fedora_qa.evidence.pictures import block_px, mean_values
from fedora_qa.evidence.snapshot import (
    EVENTS_NS,
    Snapshot,
    fitting_width_px,
    keep_snapshot,
    snapshot_times_ns,
    take_snapshot,
)
from fedora_qa.evidence.titled_arrays import TitledArrays, merged
from fedora_qa.evidence.worst_locations import WHOLE, busiest_box, cut_out, nearest_span
from fedora_qa.faults.fault import ReversibleFault
from fedora_qa.record.evidence import AFTER_UNDOING, BEFORE_UNDOING, DEVIATIONS, TRIALS, named
from fedora_qa.record.types import Diagnosis
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import RowSource, Sampling, Span, Window

_SHARES: Final = (0.0, 0.5, 1.0, 1.5, 2.0)
"""Parts of a fault's size that are undone for the course of the deviation."""

_FEWEST_POINTS: Final = 3
"""Points that a course has at least: where the deviation is least is visible from three on."""

_MOST_WINDOWS: Final = 16
"""Windows that are measured for each point of a course."""

_DISPLACEMENTS: Final = frozenset({"time_offset", "clock_rate", "spatial_offset"})
"""Causes that displace by a few pixels, which only pictures without averaging show."""

_CUT_OUT_PX: Final = 200
"""Width of the part of the widest picture that is kept where no pixels are averaged."""

_EDGE_NS: Final = 5 * NS_PER_MS
"""Time over which events of a displacement are counted, ns: so short that they mark an edge and not its path."""

_UNLIMITED_PX: Final = 1 << 20
"""A width of pictures, px, with which none is averaged."""

_MOST_SAMPLES: Final = 500
"""Points of a series that are kept: more than a small drawing resolves."""


def keep_trials(
    diagnoses: Iterable[Diagnosis],
    trials: Mapping[str, UndoTrial],
    benches: Mapping[str, TrialBench],
    options: EvidenceOptions,
) -> TitledArrays:
    """Return what undoing the faults of the first diagnoses changed.

    Parameters
    ----------
    diagnoses
        Of a file, in the order of the record.
    trials
        By the id of the diagnosis.
    benches
        On which the faults were undone, by the id of the diagnosis.
    options
        Number of diagnoses, and size of the pictures.
    """
    helpful = (diagnosis for diagnosis in diagnoses if diagnosis.id in trials and trials[diagnosis.id].cleared)
    parts: list[TitledArrays] = []
    for diagnosis in islice(helpful, options.trials):
        group, trial, bench = named(TRIALS, diagnosis.id), trials[diagnosis.id], benches[diagnosis.id]
        parts += [
            _deviations(group, trial.deviations),
            _size_course(group, diagnosis, trial, bench),
            _pictures(group, diagnosis, trial.fault, bench.run, options),
            _of_checks(group, trial, options.picture_width_px),
        ]
    return merged(parts)


def _deviations(group: str, changes: Iterable[DeviationChange]) -> TitledArrays:
    entries = {
        named(group, DEVIATIONS, change.check, change.name): (
            np.array([[change.before, change.limit_before], [change.after, change.limit_after]]),
            f"{change.name} of {change.check}, deviation and limit, before and after undoing [{change.unit}]",
        )
        for change in changes
    }
    return TitledArrays.titled(entries)


def _size_course(group: str, diagnosis: Diagnosis, trial: UndoTrial, bench: TrialBench) -> TitledArrays:
    """Return the largest deviation over its limit by the size that is undone: least at the size of the fault."""
    if not diagnosis.magnitude:
        return TitledArrays()
    faults = [_resized(share, diagnosis, trial, bench) for share in _SHARES]
    alarms = [alarm for alarm in bench.alarms if alarm.finding.id in trial.cleared]
    names = {check_of(alarm) for alarm in alarms}
    checks = [check for check in bench.checks if check.name in names]
    # A fault that the proposals size by other measurements is the same for every size.
    if None in faults[1:] or len(set(faults)) < len(faults):
        return TitledArrays()
    count = bench.affordable(len(faults), len(checks), min(_MOST_WINDOWS, trial.windows))
    if not count:
        return TitledArrays()
    observed = _observed(trial, names) if bench.windows.get(trial.fault) == trial.windows == count else None
    ratios = [
        bench.ratios(fault, alarms, checks, count, observed if fault == trial.fault else None) or [np.nan] * len(alarms)
        for fault in faults
    ]
    sizes = diagnosis.magnitude * np.array(_SHARES)
    course = _worst_by_size(sizes, np.array(ratios))
    across = f"x {diagnosis.cause} of {diagnosis.stream} that is undone [{diagnosis.unit}]"
    title = f"Deviation by the size that is undone; {across}; y largest deviation, in limits [1]"
    entry = {named(group, "size"): (course, title)}
    return TitledArrays.titled(entry) if len(course) >= _FEWEST_POINTS else TitledArrays()


def _observed(trial: UndoTrial, names: Set[str]) -> dict[str, Observation] | None:
    """Return what a trial observed of some checks with its fault undone; None where it did not keep all of them."""
    if not names <= trial.observations.keys():
        return None
    return {name: trial.observations[name][1] for name in names}


def _resized(share: float, diagnosis: Diagnosis, trial: UndoTrial, bench: TrialBench) -> ReversibleFault | None:
    """Return the fault of a trial with a part of its size; None for nothing, or where it cannot be sized."""
    size, facts = diagnosis.magnitude or 0.0, bench.run.ready.facts

    def proposed(magnitude: float) -> list[ReversibleFault]:
        return list(faults_for(diagnosis.cause, diagnosis.stream, magnitude, bench.alarms, bench.run.strict, facts))

    whole = proposed(size)
    resized = proposed(share * size) if share else []
    # Mechanisms are proposed in one order for every size.
    if len(resized) != len(whole) or trial.fault not in whole:
        return None
    return resized[whole.index(trial.fault)]


def _worst_by_size(sizes: NDArray[np.float64], ratios: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return size and largest ratio (n, 2) over the deviations that can be told at the same sizes.

    Parameters
    ----------
    sizes
        (s,) in the unit of the cause.
    ratios
        (s, d) deviations over their limits, NaN where the checks state none.
    """
    # Deviations that are told at most sizes, so that all points compare the same ones.
    finite = np.isfinite(ratios)
    numbers = finite.sum(axis=0)
    compared = ratios[:, numbers == numbers.max(initial=0)]
    rows = np.isfinite(compared).all(axis=1) & (compared.shape[1] > 0)
    return np.stack([sizes[rows], compared[rows].max(axis=1, initial=0.0)], axis=1)


def _of_checks(group: str, trial: UndoTrial, width_px: int) -> TitledArrays:
    """Return the arrays that checks keep of the file as it is and with the fault undone, where these differ."""
    entries: dict[str, tuple[NDArray[Any], str]] = {}
    for check, (before, after) in trial.observations.items():
        for name, array in before.evidence.items():
            changed = after.evidence.get(name)
            if changed is None or _same(array, changed):
                continue
            for when, kept, titles in (
                (BEFORE_UNDOING, array, before.titles),
                (AFTER_UNDOING, changed, after.titles),
            ):
                small, averaged = _bounded(kept, width_px)
                title = titles.get(name, name.replace("_", " "))
                entries[named(group, when, check, name)] = small, f"{title}{averaged}"
    return TitledArrays.titled(entries)


def _bounded(array: NDArray[Any], width_px: int) -> tuple[NDArray[Any], str]:
    """Return a series with fewer points or a map with fewer pixels, and what was done to it in words."""
    if array.ndim == 2 and array.shape[1] == 2:
        return array[:: -(-len(array) // _MOST_SAMPLES) or 1], ""
    if array.ndim == 2 and (block := block_px(array.shape[1], width_px)) > 1:
        return mean_values(array, block), f", averaged over {block}x{block} pixels"
    return array, ""


def _pictures(
    group: str, diagnosis: Diagnosis, fault: ReversibleFault, run: PlainRun, options: EvidenceOptions
) -> TitledArrays:
    """Return the pictures that undoing a fault changes, before and after; with events, the frame below them."""
    spans = run.planned(run.ready)
    if not spans:
        return TitledArrays()
    facts = run.ready.facts
    altered = run.altered_by(fault.undo(facts, run.sequence))
    span, time_ns = _instant(diagnosis, spans, facts)
    displaced = diagnosis.cause in _DISPLACEMENTS
    width_px = _UNLIMITED_PX if displaced else fitting_width_px(facts, options, 2 * options.trials)
    events_ns = _EDGE_NS if displaced else EVENTS_NS
    before = take_snapshot(_window(span, facts, run.ready.decoder), time_ns, width_px, events_ns=events_ns)
    later = nearest_span(time_ns, altered.spans) or span
    after = take_snapshot(_window(later, altered.facts, altered.decoder), time_ns, width_px, events_ns=events_ns)
    box = busiest_box(before, _CUT_OUT_PX) if displaced else WHOLE
    before, after = cut_out(before, box), cut_out(after, box)
    families = {
        family
        for family in before.pictures.keys() & after.pictures.keys()
        if not _same(before.pictures[family].image, after.pictures[family].image)
    }
    if not families:
        return TitledArrays()
    # Events are drawn over the frame, so that both are needed to see either move.
    if families & {"events", "rgb"}:
        families |= {"events", "rgb"}
    place = "Left, top, right and bottom of these pictures as shares of the image"
    return merged(
        [
            keep_snapshot(named(group, BEFORE_UNDOING), _only(before, families), facts, width_px),
            keep_snapshot(named(group, AFTER_UNDOING), _only(after, families), altered.facts, width_px),
            TitledArrays.titled({named(group, "box"): (np.array(box), place)}),
        ]
    )


def _instant(diagnosis: Diagnosis, spans: Sequence[Span], facts: Facts) -> tuple[Span, int]:
    """Return the window and the time of the pictures: the middle of the place, or of the window with most events."""
    where = diagnosis.where
    if where.start_us is not None:
        stop_us = where.start_us if where.stop_us is None else where.stop_us
        time_ns = facts.from_file_us((where.start_us + stop_us) / 2)
        if (span := nearest_span(time_ns, spans)) is not None:
            return span, time_ns
    span = busiest(spans)
    times_ns = snapshot_times_ns([span], facts, 1).get(span.index, ((span.start_ns + span.stop_ns) // 2,))
    return span, times_ns[0]


def _window(span: Span, facts: Facts, source: RowSource) -> Window:
    return Window(span, facts, source, Sampling())


def _only(snapshot: Snapshot, families: Set[str]) -> Snapshot:
    pictures = {family: picture for family, picture in snapshot.pictures.items() if family in families}
    return replace(snapshot, pictures=pictures)


def _same(first: NDArray[Any], second: NDArray[Any]) -> bool:
    """Whether two arrays hold the same numbers, NaN in the same places."""
    return np.array_equal(first, second, equal_nan=first.dtype.kind == "f" and second.dtype.kind == "f")
