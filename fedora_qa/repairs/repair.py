"""Repair a file: choose what is confirmed and mechanical, undo it in a copy, check that, keep it if it is better."""

import json
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from typing import Final

import h5py

from fedora_qa import __version__
from fedora_qa.conventions import NS_PER_US
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.plan import window_length_ns
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.tasks import check_file
from fedora_qa.errors import (
    MisuseError,
    NotRepairableError,
    UnreadableFileError,
    UnreadableRowsError,
    UnrecognisedError,
)
from fedora_qa.faults.clocks import TimeUnit
from fedora_qa.faults.fault import FaultySequence, InapplicableError, ReversibleFault
from fedora_qa.layout.canonical import spec_of
from fedora_qa.layout.dialect import DialectChoice, split_choice
from fedora_qa.layout.hdf5_objects import walk
from fedora_qa.record.atomic import replacing
from fedora_qa.record.types import Diagnosis, FileRecord
from fedora_qa.record.wording import NOT_RECOGNISED, why_incomplete
from fedora_qa.repairs.mechanical import ROW_FAULTS, UNIT_FAULTS, exact, why_not_mechanical
from fedora_qa.repairs.result import Omission, Repair, RepairStep, why_not_better
from fedora_qa.repairs.write import (
    DatasetChange,
    changed_declarations,
    copy_bytes,
    open_copy,
    require_known_rows,
    require_whole,
    rewrite,
    write_declaration,
    writing,
)
from fedora_qa.sequence.canonical_copy import canonical_file
from fedora_qa.sequence.scan import scan
from fedora_qa.sequence.sequence import SequenceRows, open_sequence
from fedora_qa.storage.digest import whole_digest
from fedora_qa.storage.folder import is_folder, local_version

PROVENANCE: Final = "provenance/repairs"
"""Group of a repaired file with one text for each repair, named by its number: JSON with what was done."""


def repair(
    source: Path,
    target: Path | None,
    options: CheckOptions,
    progress: Progress,
    *,
    only: Collection[str] = (),
    check: Callable[[Path, CheckOptions, Progress], FileRun] = check_file,
) -> Repair:
    """Repair a sequence. ``target`` is written entirely, and only if it is better; the sequence is only read.

    Parameters
    ----------
    source
        A file, or a folder that is a sequence: this is written as one canonical file first.
    target
        The repaired file; None: nothing is written, and the result states what would be.
    options
        How the file is checked, and by the limits alone the repaired one.
    only
        Identifiers of the diagnoses to repair, which may be only supported; empty: all that are confirmed.
    check
        Checks a file.

    Raises
    ------
    MisuseError
        There is no such file, it is not HDF5, or ``only`` names a diagnosis that has no tested fault.
    UnrecognisedError
        No dialect describes anything in the file.
    """
    options = replace(options, evidence=None, canary=False)
    version = local_version(source)
    run = check(source, options, progress)
    if (reason := why_incomplete(run.record)).startswith(NOT_RECOGNISED):
        raise UnrecognisedError(reason)
    chosen, omissions = choose(run.record.diagnoses, run.faults, only)
    result = Repair((), omissions, run.record)
    if not chosen:
        return replace(result, refusal=_why_nothing(run.record))
    try:
        with ExitStack() as opened:
            file, choice, before = source, options.dialect, run.record
            if is_folder(source):
                beside = target.resolve().parent if target else None
                file, choice = opened.enter_context(canonical_file(source, choice, beside, progress))
                if target is not None:  # what has no place in the canonical layout is no loss by the repair
                    before = check(file, replace(options, dialect=choice), progress).record
            if target is None:
                return _with(result, _undo(file, None, choice, chosen, progress))
            temporary = opened.enter_context(replacing(target))
            digest = copy_bytes(file, temporary)
            with open_copy(temporary) as copy:
                done = _undo(file, copy, choice, chosen, progress)
                with writing(PROVENANCE):
                    digest = digest if file == source else whole_digest(source)
                    _write_provenance(copy, source, digest, choice, done)
            result = _with(result, done)
            if local_version(source) != version:
                raise NotRepairableError(
                    f"Expected {source} to stay as it is, got a change meanwhile; repair it again."
                )
            after = check(temporary, replace(options, dialect=choice, profile="strict"), progress).record
            result = replace(result, after=after)
            if reason := why_not_better(before, after, result.steps):
                raise NotRepairableError(reason)
            return result
    except (NotRepairableError, InapplicableError, UnreadableFileError, UnreadableRowsError) as refused:
        return replace(result, refusal=str(refused))


def _why_nothing(record: FileRecord) -> str:
    """Return why no fault of a file is repaired, as a sentence."""
    if record.diagnoses:
        return "Nothing that is confirmed can be repaired."
    if any(result.outcome == "failed" for result in record.results):
        return "No cause of the findings is known; `fedora-qa check` lists them."
    reason = why_incomplete(record)
    incomplete = f", but the check is incomplete: {reason}" if reason else ""
    return f"No check fails: the file has no finding to repair{incomplete}."


@dataclass(frozen=True, slots=True)
class _Changes:
    """What undoing altered; attributes as in ``Repair``."""

    steps: tuple[RepairStep, ...]
    datasets: tuple[DatasetChange, ...]
    attributes: tuple[str, ...]
    beside: tuple[str, ...]


def _with(result: Repair, done: _Changes) -> Repair:
    return replace(result, steps=done.steps, datasets=done.datasets, attributes=done.attributes, beside=done.beside)


def choose(
    diagnoses: Sequence[Diagnosis], faults: Mapping[str, ReversibleFault], only: Collection[str] = ()
) -> tuple[tuple[tuple[Diagnosis, ReversibleFault], ...], tuple[Omission, ...]]:
    """Return which faults to undo, in the order of the diagnoses, and why others are left alone.

    Parameters
    ----------
    faults
        The fault that was undone for a diagnosis, by its identifier.
    only
        As for ``repair``.

    Raises
    ------
    MisuseError
        ``only`` names no diagnosis, or one for which no fault was undone.
    """
    tested = {d.id: d for d in diagnoses if d.id in faults and d.status in {"confirmed", "supported"}}
    for name in only:
        if name not in tested:
            available = ", ".join(f"{d.id} ({d.stream}:{d.cause}, {d.status})" for d in tested.values()) or "none"
            kind = "a diagnosis without a tested fault" if any(d.id == name for d in diagnoses) else "no diagnosis"
            raise MisuseError(f"Expected a diagnosis that can be undone ({available}), got {name!r}, {kind}")
    chosen: list[tuple[Diagnosis, ReversibleFault]] = []
    omissions = []
    for diagnosis in diagnoses:
        if diagnosis.id not in tested:
            omissions.append(Omission(diagnosis, "No fault was undone that clears what it explains."))
        elif reason := why_not_mechanical(faults[diagnosis.id]):
            omissions.append(Omission(diagnosis, reason))
        elif only and diagnosis.id not in only:
            omissions.append(Omission(diagnosis, "It was not chosen."))
        elif not only and diagnosis.status != "confirmed":
            omissions.append(Omission(diagnosis, f"It is supported, not confirmed; --only {diagnosis.id} chooses it."))
        elif missing := [name for name in diagnosis.after if name not in {other.id for other, _ in chosen}]:
            names = " ".join(f"--only {name}" for name in (*diagnosis.after, diagnosis.id))
            omissions.append(
                Omission(diagnosis, f"It was tried with {' and '.join(missing)} undone; {names} chooses all.")
            )
        else:
            chosen.append((diagnosis, exact(faults[diagnosis.id])))
    return tuple(chosen), tuple(omissions)


def _undo(
    source: Path,
    copy: h5py.File | None,
    choice: DialectChoice,
    chosen: Iterable[tuple[Diagnosis, ReversibleFault]],
    progress: Progress,
) -> _Changes:
    """Undo faults one after the other, and write into the copy of a file what differs then; None: write nothing.

    Each fault is undone in the view without those before it, as it was tried.
    """
    with open_sequence(source, choice) as sequence, h5py.File(source, "r", locking="best-effort") as file:
        require_whole(file)
        bindings = sequence.layout.bindings
        view: SequenceRows = sequence
        steps, keys, converted, moved = [], set[str](), set[str](), set[str]()
        for diagnosis, fault in chosen:
            # Timestamps are read to a nanosecond: seconds that are read as microseconds would come to a millisecond.
            read_to_us = 1 / (NS_PER_US * fault.factor) if isinstance(fault, TimeUnit) else 0.0
            undoing = fault.undo(scan(view, window_length_ns(view)).facts, view)
            steps.append(RepairStep(diagnosis, undoing.description, repr(fault)))
            if read_to_us > 1 and any(bindings[key].dtype.kind == "f" for key in undoing.rows):
                raise NotRepairableError(
                    f"Expected timestamps of {fault.stream} that keep a microsecond, got {read_to_us:g} us of their "
                    "fractions; read the file by a dialect with their time_unit."
                )
            # Index maps follow timestamps and rows, and have no unit.
            of_stream = {key for key in undoing.rows if key.startswith("path/")}
            keys |= undoing.rows.keys()
            converted |= of_stream if isinstance(fault, UNIT_FAULTS) else set()
            if isinstance(fault, ROW_FAULTS) and not getattr(fault, "timestamps_only", False):
                moved |= {spec_of(key).stream for key in of_stream}
            view = FaultySequence(view, undoing)
        if moved:
            require_known_rows(file, sequence.layout, moved)
        datasets = rewrite(file, sequence, view, keys, copy, progress)
        declared = changed_declarations(sequence.declared, view.declared, sequence.layout.supplied)
        if not datasets and not declared:
            raise NotRepairableError("Expected undoing to change a stored value, but it changes none.")
        # A label of another unit was true of the values as they were.
        labels = {
            bindings[key].path: spec_of(key).units
            for key in sorted(converted)
            if bindings[key].is_stored_canonically
            and sequence.declared.units.get(key, spec_of(key).units) != spec_of(key).units
        }
        if copy is not None:
            for declaration in declared:
                with writing(declaration.owner):
                    write_declaration(copy, sequence.layout, declaration)
            for path, units in labels.items():
                with writing(path):
                    copy[path].attrs["units"] = units
        used = {binding.path for binding in bindings.values()}
        beside = tuple(path for path in walk(file).paths if path not in used and not path.startswith(PROVENANCE))
    attributes = [f"{each.owner or '/'}.{each.name} = {each.value}" for each in declared]
    attributes += [f"{path}.units = {units}" for path, units in labels.items()]
    return _Changes(tuple(steps), datasets, tuple(attributes), beside)


def _write_provenance(copy: h5py.File, source: Path, digest: str, choice: DialectChoice, done: _Changes) -> None:
    """Add what was done to the file: one text for each repair, in JSON."""
    _, side = split_choice(choice)
    document = {
        "tool": {"name": "fedora-qa", "version": __version__},
        "repaired": datetime.now(UTC).isoformat(timespec="seconds"),
        "source": {"name": source.name, "sha256": digest},
        **({"metadata": side.name} if side else {}),
        "steps": [
            {
                "done": step.done,
                "fault": step.fault,
                "cause": f"{step.diagnosis.stream}:{step.diagnosis.cause}",
                "magnitude": _finite(step.diagnosis.magnitude),
                "standard_error": _finite(step.diagnosis.standard_error),
                "unit": step.diagnosis.unit,
                "status": step.diagnosis.status,
            }
            for step in done.steps
        ],
        "datasets": [asdict(each) for each in done.datasets],
        "attributes": done.attributes,
    }
    repairs = copy.require_group(PROVENANCE)
    repairs[str(len(repairs) + 1)] = json.dumps(document, indent=1)


def _finite(size: float | None) -> float | None:
    # NaN is no JSON.
    return size if size is not None and isfinite(size) else None
