"""One mutant: what became of checking it, and whether a clean verdict was true."""

import hashlib
import shutil
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Final

import numpy as np

from fedora_qa.catalogue import select_checks
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.survey import survey_of
from fedora_qa.engine.tasks import check_file, measure_and_assemble
from fedora_qa.errors import FedoraError, MisuseError
from fedora_qa.layout.canonical import DATASETS
from fedora_qa.sequence.sequence import OpeningFacts, open_sequence
from tests.fuzz.mutants import mutate
from tests.support.all_checks import CHECKS

ALWAYS: Final = ("integrity", "metadata.complete", "clocks.order")
AT_A_TIME: Final = 3
"""Other checks that one mutant sees; they take turns."""

DAMAGES: Final = frozenset({"chunk", "truncated"})
GUARDED: Final = frozenset(DATASETS) - {"metadata/depth_range"}
"""Every other dataset of the clean file carries Fletcher's checksum."""

Digests = Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Trial:
    """What became of a mutant: ``clean``, ``findings``, ``incomplete``, ``refused``, or what should never be."""

    seed: int
    kind: str
    became: str
    said: str = ""
    seconds: float = 0.0


def tried(clean: bytes, true: Digests, seed: int, path: Path, out: Path) -> Trial:
    """Write a mutant, check it, and tell what became of it; one that should not be is kept in the folder ``out``.

    An object that is gone may have been promised by nothing: there a clean verdict is no fault. Other values under a
    clean verdict are one where a checksum guards them: in damaged chunks, and what is left of a truncated file.
    """
    started = time.process_time()
    kind = mutate(clean, seed, path)
    became, said = _checked(path, seed, kind, {} if kind == "absent" else true)
    trial = Trial(seed, kind, became, said, time.process_time() - started)
    if became in {"traceback", "crashed", "wrongly clean"}:
        shutil.copy(path, offender(out, seed))
    return trial


def offender(out: Path, seed: int) -> Path:
    """Return where a mutant is kept that did what none may."""
    return out / f"offender-{seed}.h5"


def digests(path: Path, known: OpeningFacts | None = None) -> Digests:
    """Return a digest of every stream's values in canonical units; raises where something cannot be read."""
    with open_sequence(path, opening_facts=known) as sequence:
        return {
            key: hashlib.sha256(np.ascontiguousarray(sequence.rows(key, 0, binding.rows)).tobytes()).hexdigest()
            for key, binding in sequence.layout.bindings.items()
        }


def _checked(path: Path, seed: int, kind: str, true: Digests) -> tuple[str, str]:
    """Check a mutant as ``check_whole`` does, keeping what opening it has found out."""
    others = Random(seed).sample([check.name for check in CHECKS], AT_A_TIME)
    options = CheckOptions(select=(*ALWAYS, *others), evidence=None)
    try:
        survey = survey_of(path, select_checks(options.select, options.ignore), options, quiet)
        if isinstance(survey, FileRun):
            return _judged(survey, lambda: [])
        run = measure_and_assemble(survey, quiet)
        became, said = _judged(
            run, lambda: _unseen(path, survey.opening_facts, true, GUARDED if kind in DAMAGES else frozenset())
        )
        if became == "wrongly clean" and _found_by_all(path):
            return "findings", f"{said}: by a check that had no turn"
        return became, said
    except MisuseError as error:
        return "refused", str(error)
    except FedoraError as error:
        return "findings", str(error)
    except Exception as error:  # noqa: BLE001 - this is what is looked for
        return "traceback", f"{type(error).__name__}: {error}"


def _found_by_all(path: Path) -> bool:
    results = check_file(path, CheckOptions(evidence=None)).record.results
    return any(result.outcome in {"failed", "warned"} for result in results)


def _judged(run: FileRun, unseen: Callable[[], list[str]]) -> tuple[str, str]:
    results = run.record.results
    crashed = [result for result in results if result.outcome == "crashed"]
    if crashed:
        return "crashed", crashed[0].traceback or crashed[0].reason
    failed = any(result.outcome in {"failed", "warned"} for result in results)
    missed = [] if failed else unseen()
    return ("wrongly clean", ", ".join(missed)) if missed else (run.record.verdict, "")


def _unseen(path: Path, known: OpeningFacts, true: Digests, guarded: frozenset[str]) -> list[str]:
    """Return the streams that are gone although nothing was found, and those of ``guarded`` with other values."""
    try:
        found = digests(path, known)
    except FedoraError as error:
        return [str(error)]
    return sorted(key for key in true if key not in found or (key in guarded and found[key] != true[key]))
