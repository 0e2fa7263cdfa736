"""Check every file of a corpus, in several processes, and store what each result says.

Stored are the failed checks, their measurements, and the diagnoses, so that a stopped study can go on.
"""

import hashlib
import json
import signal
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from math import inf
from multiprocessing import get_context
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter

from fedora_qa import __version__
from fedora_qa.config import RULESET_VERSION
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.tasks import check_file
from fedora_qa.errors import FedoraError, MisuseError
from fedora_qa.judgement.materiality import Materiality
from fedora_qa.power.detection_power import estimators_digest
from fedora_qa.power.manifest import CorpusItem, Manifest
from fedora_qa.record.atomic import write_text
from fedora_qa.record.documents import read_json
from fedora_qa.record.types import DiagnosisStatus, FileRecord, Measurement, Result, Side
from fedora_qa.storage.digest import file_digest


@dataclass(frozen=True, slots=True)
class MeasuredDeviation:
    """One measurement: its deviation from what is expected, its limit, and its detection limit, all in ``unit``.

    ``least_detectable_range`` is that of the most and of the least sensitive place or time, as in the record; None
    where all are alike, and in results that were stored before ranges were.
    """

    check: str
    name: str
    unit: str
    side: Side
    deviation: float
    limit: float | None
    least_detectable: float | None
    least_detectable_range: tuple[float, float] | None = None

    @property
    def stated_limits(self) -> tuple[float, float] | None:
        """The detection limits at the most and at the least sensitive place or time; None where none is stated.

        A fault of at least the higher one is detected wherever it is; one below the lower one is detected nowhere.
        """
        if not self.least_detectable:
            return None
        return self.least_detectable_range or (self.least_detectable, self.least_detectable)

    @property
    def exceeds(self) -> bool:
        """Whether the deviation is beyond its limit."""
        return self.limit is not None and self.harm(self.deviation) > self.limit

    def harm(self, deviation: float) -> float:
        """Return how far a deviation goes to the side that has a limit; negative on the other."""
        return {"both": abs(deviation), "upper": deviation, "lower": -deviation}[self.side]


@dataclass(frozen=True, slots=True)
class NamedCause:
    """A diagnosis, as far as a study needs it."""

    name: str
    """``stream:cause``."""
    magnitude: float | None
    unit: str
    standard_error: float | None
    status: DiagnosisStatus = "suggested"


@dataclass(frozen=True, slots=True)
class CheckedFile:
    """One file after all checks.

    Attributes
    ----------
    failed, crashed
        Names of checks.
    material
        Names of failed checks with a deviation that is material to a release.
    measurements
        Of the checks that came to a verdict.
    diagnoses
        Most probable first.
    """

    sha256: str
    failed: tuple[str, ...]
    crashed: tuple[str, ...]
    material: tuple[str, ...]
    measurements: tuple[MeasuredDeviation, ...]
    diagnoses: tuple[NamedCause, ...]

    @property
    def is_found(self) -> bool:
        """Whether any check failed."""
        return bool(self.failed)

    @property
    def exceeded(self) -> Iterator[MeasuredDeviation]:
        """The measurements beyond their limits."""
        return (measurement for measurement in self.measurements if measurement.exceeds)


def checked_from(file: FileRecord) -> CheckedFile:
    """Return what a study stores of a record of the profile ``strict``."""
    duration_s = file.statistics.get("sequence", {}).get("duration_s")
    release = Materiality("release", duration_s if isinstance(duration_s, float) else 0.0)
    measurements = tuple(
        MeasuredDeviation(
            result.check,
            measurement.name,
            measurement.unit,
            measurement.side,
            measurement.value - measurement.expected,
            measurement.limit,
            measurement.least_detectable,
            measurement.least_detectable_range,
        )
        for result in file.results
        if result.outcome in {"passed", "warned", "failed"}
        for measurement in result.measurements
        if measurement.value is not None and measurement.expected is not None
    )
    return CheckedFile(
        sha256=file.sha256,
        failed=tuple(result.check for result in file.results if result.outcome == "failed"),
        crashed=tuple(result.check for result in file.results if result.outcome == "crashed"),
        material=tuple(result.check for result in file.results if _is_material(result, release)),
        measurements=measurements,
        diagnoses=tuple(
            NamedCause(
                f"{diagnosis.stream}:{diagnosis.cause}",
                diagnosis.magnitude,
                diagnosis.unit,
                diagnosis.standard_error,
                diagnosis.status,
            )
            for diagnosis in file.diagnoses
        ),
    )


def _is_material(result: Result, release: Materiality) -> bool:
    """Return whether a check failed by a deviation that exceeds its limit by a size that matters to a release."""
    return result.outcome == "failed" and any(
        _excess(m) > release.size(m.code, m.unit, m.expected or 0.0, m.effect_px) for m in result.measurements
    )


def _excess(measurement: Measurement) -> float:
    """Return how far a deviation exceeds its limit, in the unit of the measurement; infinite where it is no number."""
    if measurement.value is None or measurement.expected is None or measurement.limit is None:
        return inf
    deviation = measurement.value - measurement.expected
    counted = {"both": abs(deviation), "upper": deviation, "lower": -deviation}[measurement.side]
    return counted - measurement.limit


@dataclass(frozen=True, slots=True)
class Trial:
    """One file of the corpus, and its result."""

    item: CorpusItem
    checked: CheckedFile


@dataclass(frozen=True, slots=True)
class _StoredResult:
    key: str
    checked: CheckedFile


_STORED: Final = TypeAdapter(_StoredResult)


@dataclass(frozen=True, slots=True)
class State:
    """A folder of results, one small file each. ``measured_with`` identifies the way of checking."""

    folder: Path
    corpus: Path
    measured_with: str

    def load(self, item: CorpusItem) -> CheckedFile | None:
        """Return the stored result of a file; None without one, or where file, tool or configuration have changed."""
        try:
            stored = read_json(self._path(item), _STORED, "a stored result", "it is measured again")
        except MisuseError:
            return None
        return stored.checked if stored.key == self._key(item) else None

    def store(self, item: CorpusItem, checked: CheckedFile) -> None:
        """Store the result of a file, entirely or not at all."""
        path = self._path(item)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, _STORED.dump_json(_StoredResult(self._key(item), checked)).decode() + "\n")

    def _path(self, item: CorpusItem) -> Path:
        return self.folder / f"{item.file}.json"

    def _key(self, item: CorpusItem) -> str:
        """Return the digest of all that the result depends on: the content of the file, and the way of checking."""
        # The digest of the manifest saves reading the file; ``_check_file`` compares it with the digest of the record.
        content = item.sha256 or file_digest(self.corpus / item.file).sha256
        parts = [content, self.measured_with]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def state_folder(corpus: Path, within: Path | None = None) -> Path:
    """Return the folder of a study: in the folder asked for, or beside the corpus, never in it."""
    whole = corpus.resolve()
    return (within or whole.parent) / f"{whole.name}.power"


def measured_with(config_digest: str) -> str:
    """Return the digest of a way of checking: of tool, rules, the code that measures, and the configuration."""
    parts = [__version__, RULESET_VERSION, estimators_digest(), config_digest]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def run_study(
    manifest: Manifest, state: State, options: CheckOptions, jobs: int, report: Progress
) -> tuple[Trial, ...]:
    """Check the files without a stored result, and return every trial in the manifest's order.

    Parameters
    ----------
    manifest, state
        Of the corpus: its files, and the results stored before.
    options
        Of each check; the same for all files.
    jobs
        Number of processes.

    Raises
    ------
    MisuseError
        A file is not the one that the manifest lists.
    FedoraError
        A process ended abruptly. Results stored until then remain.
    """
    checked_before = {item.file: checked for item in manifest.items if (checked := state.load(item)) is not None}
    missing = [item for item in manifest.items if item.file not in checked_before]
    total = len(manifest.items)
    report("known", total - len(missing), total)
    if jobs == 1 or len(missing) < 2:
        for item in missing:
            checked_before[item.file] = _check_file(item, state, options)
            report(item.file, len(checked_before), total)
    else:
        # The parent handles the interrupt: it starts no further file, and those being checked still store their
        # results.
        ignore = (signal.SIGINT, signal.SIG_IGN)
        with ProcessPoolExecutor(jobs, get_context("spawn"), initializer=signal.signal, initargs=ignore) as pool:
            try:
                work = {pool.submit(_check_file, item, state, options): item for item in missing}
                for done in as_completed(work):
                    checked_before[work[done].file] = done.result()
                    report(work[done].file, len(checked_before), total)
            except BrokenProcessPool:
                raise FedoraError(
                    "Expected every process to end by itself, one ended abruptly (out of memory?); "
                    "run again, with fewer --jobs, to go on where it was"
                ) from None
            finally:
                pool.shutdown(cancel_futures=True)
    return tuple(Trial(item, checked_before[item.file]) for item in manifest.items)


def _check_file(item: CorpusItem, state: State, options: CheckOptions) -> CheckedFile:
    """Check one file and store its result."""
    record = check_file(state.corpus / item.file, options).record
    if item.sha256 is not None and record.digest_kind == "full" and record.sha256 != item.sha256:
        raise MisuseError(
            f"Expected {item.file} with the SHA-256 {item.sha256[:16]} of its manifest, got {record.sha256[:16]}; "
            "make the corpus again"
        )
    checked = checked_from(record)
    state.store(item, checked)
    return checked
