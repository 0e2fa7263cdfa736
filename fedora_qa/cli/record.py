"""Make one record of the runs over files, and the arrays beside it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

from fedora_qa import __version__
from fedora_qa.cli.host import host_facts
from fedora_qa.config import RULESET_VERSION, CheckConfig
from fedora_qa.engine.executors.executor import peak_memory_mib
from fedora_qa.engine.options import FileRun
from fedora_qa.record.types import RECORD_VERSION, Record, Run, Scalar, Tool
from fedora_qa.storage.server import NO_TRAFFIC


def record_of(runs: Sequence[FileRun], settings: CheckConfig, started: str, facts: Mapping[str, Scalar]) -> Record:
    """Return the record of all files together; names of evidence of several files start with the file's number.

    Parameters
    ----------
    facts
        Of the run, beside those of the machine.
    """
    files = [
        replace(run.record, evidence={f"{prefix}{name}": title for name, title in run.record.evidence.items()})
        for prefix, run in zip(_prefixes(runs), runs, strict=True)
    ]
    # A dict, not a set: stages stay in the order in which they ran.
    stages = dict.fromkeys(stage for run in runs for stage in run.seconds)
    host: dict[str, Scalar] = {
        **host_facts(),
        "peak_memory_mib": peak_memory_mib(),
        "decoded_bytes": sum(run.decoded_bytes for run in runs),
    }
    # Bytes and requests from servers, where there were any.
    traffic = sum((run.traffic for run in runs), NO_TRAFFIC)
    if traffic.requests:
        host |= {"transferred_bytes": traffic.transferred_bytes, "requests": traffic.requests}
    # How far a budget of time has carried, in the order of the files; nothing without a budget.
    reached = [run.reached for run in runs if run.reached]
    if reached:
        host["budget_reached"] = "; ".join(reached)
    return Record(
        record_version=RECORD_VERSION,
        ruleset_version=RULESET_VERSION,
        tool=Tool("fedora-qa", __version__),
        config_digest=settings.digest,
        run=Run(
            started=started,
            seconds={stage: sum(run.seconds.get(stage, 0.0) for run in runs) for stage in stages},
            host={**host, **facts},
        ),
        files=tuple(files),
        effort=settings.effort,
        profile=settings.profile,
    )


def evidence_arrays(runs: Sequence[FileRun]) -> Mapping[str, NDArray[Any]]:
    """Return the evidence of all files, under the names that the record uses."""
    return _ArraysOfRuns(
        {
            f"{prefix}{name}": (run, name)
            for prefix, run in zip(_prefixes(runs), runs, strict=True)
            for name in run.arrays
        }
    )


class _ArraysOfRuns(Mapping[str, NDArray[Any]]):
    """Arrays of several runs, each of which may read its own from a file when asked for."""

    def __init__(self, runs: Mapping[str, tuple[FileRun, str]]) -> None:
        self._runs = runs

    def __getitem__(self, name: str) -> NDArray[Any]:
        run, own_name = self._runs[name]
        return run.arrays[own_name]

    def __contains__(self, name: object) -> bool:
        return name in self._runs

    def __iter__(self) -> Iterator[str]:
        return iter(self._runs)

    def __len__(self) -> int:
        return len(self._runs)


def _prefixes(runs: Sequence[FileRun]) -> list[str]:
    """Return the start of the names of evidence for each file: its number where there are several."""
    return [f"{number}/" if len(runs) > 1 else "" for number in range(len(runs))]
