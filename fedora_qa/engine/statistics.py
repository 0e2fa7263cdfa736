"""The statistics of a file without its checks."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from fedora_qa.engine.assemble import distributions_of
from fedora_qa.engine.measure import Accumulator, attempt, measure
from fedora_qa.engine.survey import prepare
from fedora_qa.engine.worker import Worker
from fedora_qa.evidence.distributions import DistributionsCollector
from fedora_qa.layout.dialect import DialectChoice
from fedora_qa.sequence.sequence import open_sequence
from fedora_qa.sequence.window import Sampling
from fedora_qa.statistics.collector import Statistics, StatisticsCollector


@dataclass(frozen=True, slots=True)
class FileStatistics:
    """The statistics of a file, and the arrays of its distributions by the names that a record gives them, if any."""

    statistics: Statistics
    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict)


def collect_statistics(
    path: Path,
    dialect: DialectChoice,
    memory_bytes: int,
    allow_external: Iterable[Path],
    with_distributions: bool,
    worker: Worker,
) -> FileStatistics:
    """Hand every window of a file to the collectors of statistics and, where asked for, of distributions.

    Raises
    ------
    FedoraError
        The file cannot be opened.
    RuntimeError
        A collector itself failed.
    """
    statistics = StatisticsCollector()
    with open_sequence(path, dialect, allow_external=allow_external) as sequence:
        ready = prepare(sequence, memory_bytes)
        distributions = DistributionsCollector(ready.spans)
        collectors: list[Accumulator] = [statistics, *([distributions] if with_distributions else [])]
        # The default sampling reads every tile and every field: statistics describe the whole file.
        states = measure(collectors, ready.spans, ready.facts, ready.decoder, Sampling(), worker.progress)
        tables = attempt(
            states, statistics.name, lambda: statistics.conclude(states.states[statistics.name], ready.facts)
        )
        arrays = distributions_of(distributions, states, ready.facts).arrays if with_distributions else {}
    if tables is None or states.crashes:
        raise RuntimeError(next(iter(states.crashes.values())).strip().splitlines()[-1])
    return FileStatistics(tables, arrays)
