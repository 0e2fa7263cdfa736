"""Check every file of a corpus, in several processes, and store each result, so that a stopped study can go on."""

import hashlib
import json
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter

from fedora_qa import __version__
from fedora_qa.config import RULESET_VERSION
from fedora_qa.engine.run import CheckOptions, check_file
from fedora_qa.errors import FedoraError, MisuseError
from fedora_qa.power.checked_file import CheckedFile, checked_from
from fedora_qa.power.detection_power import estimators_digest
from fedora_qa.power.manifest import CorpusItem, Manifest
from fedora_qa.record.atomic import write_text
from fedora_qa.record.documents import read_json
from fedora_qa.storage.digest import file_digest

Report = Callable[[str, int, int], None]
"""Receives the name of the file that was checked, how many are done, and of how many."""


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


def run_study(manifest: Manifest, state: State, options: CheckOptions, jobs: int, report: Report) -> tuple[Trial, ...]:
    """Check the files without a stored result, and return every trial in the manifest's order.

    Parameters
    ----------
    manifest, state
        Of the corpus: its files, and the results stored before.
    options
        Of each check; the same for all files.
    jobs
        Number of processes.
    report
        Called after each file.

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
