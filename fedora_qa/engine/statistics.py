"""The statistics of a file alone, without its checks."""

from pathlib import Path

from fedora_qa.engine.prepare import prepare
from fedora_qa.engine.progress import Progress
from fedora_qa.engine.stream import attempt, measure
from fedora_qa.layout.dialect import Dialect
from fedora_qa.sequence.sequence import open_sequence
from fedora_qa.sequence.window import Sampling
from fedora_qa.statistics.collector import Statistics, StatisticsCollector


def collect_statistics(path: Path, dialect: Dialect | None, memory_bytes: int, progress: Progress) -> Statistics:
    """Hand every window of a file to the collector.

    Raises
    ------
    FedoraError
        The file cannot be opened.
    RuntimeError
        The collector itself failed.
    """
    collector = StatisticsCollector()
    with open_sequence(path, dialect) as sequence:
        ready = prepare(sequence, memory_bytes)
        states = measure([collector], ready.spans, ready.facts, ready.decoder, Sampling(), progress)
        tables = attempt(states, collector.name, lambda: collector.conclude(states.states[collector.name], ready.facts))
    if tables is None:
        raise RuntimeError(states.crashes[collector.name].strip().splitlines()[-1])
    return tables
