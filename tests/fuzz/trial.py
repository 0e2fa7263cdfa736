"""One mutant: what became of checking it, and whether a clean verdict was true."""

import hashlib
import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Final

import numpy as np

from fedora_qa.checks import CHECKS
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.run import check_file
from fedora_qa.errors import FedoraError, MisuseError
from fedora_qa.layout.canonical import DATASETS
from fedora_qa.sequence.sequence import open_sequence
from tests.fuzz.mutants import mutate

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


def tried(clean: bytes, true: Digests, seed: int, path: Path) -> Trial:
    """Write a mutant, check it, and tell what became of it; one that should not be is kept beside the path.

    An object that is gone may have been promised by nothing: there a clean verdict is no fault. Other values under a
    clean verdict are one where a checksum guards them: in damaged chunks, and what is left of a truncated file.
    """
    started = time.process_time()
    kind = mutate(clean, seed, path)
    became, said = _checked(path, seed, kind, {} if kind == "absent" else true)
    trial = Trial(seed, kind, became, said, time.process_time() - started)
    if became in {"traceback", "crashed", "wrongly clean"}:
        shutil.copy(path, path.with_name(f"offender-{seed}.h5"))
    return trial


def digests(path: Path) -> Digests:
    """Return a digest of every stream's values in canonical units; raises where something cannot be read."""
    with open_sequence(path) as sequence:
        return {
            key: hashlib.sha256(np.ascontiguousarray(sequence.rows(key, 0, binding.rows)).tobytes()).hexdigest()
            for key, binding in sequence.layout.bindings.items()
        }


def _checked(path: Path, seed: int, kind: str, true: Digests) -> tuple[str, str]:
    others = Random(seed).sample([check.name for check in CHECKS], AT_A_TIME)
    try:
        record = check_file(path, CheckOptions(select=(*ALWAYS, *others), evidence=None)).record
        crashed = [result for result in record.results if result.outcome == "crashed"]
        if crashed:
            return "crashed", crashed[0].traceback or crashed[0].reason
        failed = any(result.outcome in {"failed", "warned"} for result in record.results)
        unseen = [] if failed else _unseen(path, true, GUARDED if kind in DAMAGES else frozenset())
        return ("wrongly clean", ", ".join(unseen)) if unseen else (record.verdict, "")
    except MisuseError as error:
        return "refused", str(error)
    except FedoraError as error:
        return "findings", str(error)
    except Exception as error:  # noqa: BLE001 - this is what is looked for
        return "traceback", f"{type(error).__name__}: {error}"


def _unseen(path: Path, true: Digests, guarded: frozenset[str]) -> list[str]:
    """Return the streams that are gone although nothing was found, and those of ``guarded`` with other values."""
    try:
        found = digests(path)
    except FedoraError as error:
        return [str(error)]
    return sorted(key for key in true if key not in found or (key in guarded and found[key] != true[key]))
