"""From the runs over files to one record, and the arrays beside it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from fedora_qa import __version__
from fedora_qa.cli.host import host_facts, peak_memory_mib
from fedora_qa.config import RULESET_VERSION, CheckConfig
from fedora_qa.engine.options import FileRun
from fedora_qa.record.types import RECORD_VERSION, Record, Run, Scalar, Tool
from fedora_qa.storage.traffic import NO_TRAFFIC


def record_of(runs: Sequence[FileRun], settings: CheckConfig, started: str, facts: Mapping[str, Scalar]) -> Record:
    """Return the record of all files together; names of evidence of several files start with the file's number.

    Parameters
    ----------
    facts
        Of the run, beside those of the machine.
    """
    apart = len(runs) > 1
    files = [
        replace(run.record, evidence={_named(name, i, apart): title for name, title in run.record.evidence.items()})
        for i, run in enumerate(runs)
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
    )


def gathered_arrays(runs: Sequence[FileRun]) -> dict[str, Any]:
    """Return the evidence of all files, under the names that the record uses."""
    apart = len(runs) > 1
    return {_named(name, i, apart): array for i, run in enumerate(runs) for name, array in run.arrays.items()}


def _named(name: str, file: int, apart: bool) -> str:
    return f"{file}/{name}" if apart else name
