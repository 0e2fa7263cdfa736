"""Check every file of a corpus, in several processes, and store each result as soon as it is known."""

import hashlib
import json
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from fedora_qa import __version__
from fedora_qa.config import RULESET_VERSION
from fedora_qa.engine.run import CheckOptions, check_file
from fedora_qa.errors import FedoraError, MisuseError
from fedora_qa.power.checked_file import CheckedFile, checked_from
from fedora_qa.power.manifest import CorpusItem, Manifest
from fedora_qa.power.sources import estimators_digest
from fedora_qa.power.state import State

Report = Callable[[str, int, int], None]
"""Receives the name of the file that was checked, how many are done, and of how many."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One file of the corpus, and what was found of it."""

    item: CorpusItem
    checked: CheckedFile


def state_folder(corpus: Path, within: Path | None = None) -> Path:
    """Return the folder of a study: in the folder asked for, or beside the corpus, never in it."""
    whole = corpus.resolve()
    return (within or whole.parent) / f"{whole.name}.power"


def measured_with(config_digest: str) -> str:
    """Return what identifies a way of checking: tool, rules, the code that measures, and the configuration."""
    parts = [__version__, RULESET_VERSION, estimators_digest(), config_digest]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def run_study(manifest: Manifest, state: State, options: CheckOptions, jobs: int, report: Report) -> tuple[Trial, ...]:
    """Check what is not known yet, and return every trial in the manifest's order.

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
            checked_before[item.file] = _check_one(item, state, options)
            report(item.file, len(checked_before), total)
    else:
        # The parent handles the interrupt: it starts no further file, and those being checked still store their
        # results.
        ignore = (signal.SIGINT, signal.SIG_IGN)
        with ProcessPoolExecutor(jobs, get_context("spawn"), initializer=signal.signal, initargs=ignore) as pool:
            try:
                work = {pool.submit(_check_one, item, state, options): item for item in missing}
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


def _check_one(item: CorpusItem, state: State, options: CheckOptions) -> CheckedFile:
    """Check one file and keep what was found, in whichever process."""
    record = check_file(state.corpus / item.file, options).record
    if item.sha256 is not None and record.digest_kind == "full" and record.sha256 != item.sha256:
        raise MisuseError(
            f"Expected {item.file} with the SHA-256 {item.sha256[:16]} of its manifest, got {record.sha256[:16]}; "
            "make the corpus again"
        )
    checked = checked_from(record)
    state.store(item, checked)
    return checked
