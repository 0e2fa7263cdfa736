"""What is done for one file: by ``check_file`` in this process, or by the tasks of workers."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

from fedora_qa.catalogue import select_checks
from fedora_qa.checks.protocol import Check
from fedora_qa.engine.assemble import assemble, distributions_of
from fedora_qa.engine.executors.executor import Kept, OpenFile, Worker
from fedora_qa.engine.file_work import PackedSurvey
from fedora_qa.engine.measure import Accumulator, PassState, attempt, measure
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.engine.survey import OpenSurvey, Survey, opened, prepare, survey_of
from fedora_qa.errors import MisuseError, UnreadableFileError, UnrecognisedError
from fedora_qa.evidence.distributions import DistributionsCollector
from fedora_qa.layout.dialect import DialectChoice
from fedora_qa.record.wording import not_recognised
from fedora_qa.sequence.sequence import open_sequence
from fedora_qa.sequence.window import Sampling
from fedora_qa.statistics.collector import Statistics, StatisticsCollector
from fedora_qa.storage.place import Place
from fedora_qa.storage.server import NO_TRAFFIC, Traffic

Asked = tuple[Check[Any], ...] | None
"""The checks of a file; None: those that the options select."""

Audience = Literal["planned", "steady", "sampled"]
"""Who gets a window: all whom the plan gives it to; checks that get every window, whatever the plan; all others."""


def check_file(path: Place, options: CheckOptions, progress: Progress = quiet) -> FileRun:
    """Check one file.

    Raises
    ------
    MisuseError
        There is no such file, it is not HDF5, or the options name an unknown check, or a budget of time, which
        only ``check_files`` supports.
    """
    if options.budget_s is not None:
        raise MisuseError(
            f"Expected no budget of time in check_file, got {options.budget_s:g} s; use check_files, which keeps to it"
        )
    return check_whole(path, None, options, Worker(OpenFile(keeps=False), progress))


def check_whole(path: Place, checks: Asked, options: CheckOptions, worker: Worker) -> FileRun:
    """Check a file from beginning to end in one process, so that follow-ups find rows that are still decoded."""
    survey = _survey(path, checks, options, worker)
    return survey if isinstance(survey, FileRun) else measure_and_assemble(survey, worker.progress)


def measure_and_assemble(survey: Survey, progress: Progress) -> FileRun:
    """Measure all windows of a survey, and judge the file."""
    with opened(survey) as file:
        measured = measure_open(survey, file, survey.windows, progress)
        return assemble(survey, file, [measured], [], progress)


def open_and_close(path: Place, dialect: DialectChoice, allow_external: Iterable[Path], _: Worker) -> bool:
    """Open a file as later tasks do, and return whether HDF5 does; one that it refuses is theirs to report."""
    try:
        open_sequence(path, dialect, allow_external=allow_external).close()
    except UnreadableFileError:
        return False
    return True


def survey_file(path: Place, checks: Asked, options: CheckOptions, worker: Worker) -> PackedSurvey | FileRun:
    """Scan the timestamps of a file and plan its windows; its whole run where HDF5 refuses to open it."""
    survey = _survey(path, checks, options, worker)
    return survey if isinstance(survey, FileRun) else PackedSurvey.of(survey)


def _survey(path: Place, checks: Asked, options: CheckOptions, worker: Worker) -> Survey | FileRun:
    # Rows of another file are of no use any more.
    worker.open_file.close()
    asked = select_checks(options.select, options.ignore) if checks is None else checks
    return survey_of(path, asked, options, worker.progress)


def measure_windows(
    packed: PackedSurvey | Kept, windows: Sequence[int], audience: Audience, before: Kept | None, worker: Worker
) -> PassState:
    """Measure windows of a file, by their numbers on its grid.

    Parameters
    ----------
    packed
        The survey of the file, or where it is kept.
    audience
        Who gets them.
    before
        The pass over the windows just before them, which is extended; None for a new pass.
    """
    survey = _loaded(packed)
    with worker.open_file.opened(survey) as file:
        states = measure_open(survey, file, windows, worker.progress, audience, before.load() if before else None)
        # A file behind a URL is opened for each task alone, so that this counts no request twice.
        states.traffic += file.sequence.traffic
        return states


def measure_open(
    survey: Survey,
    file: OpenSurvey,
    windows: Sequence[int],
    progress: Progress,
    audience: Audience = "planned",
    before: PassState | None = None,
) -> PassState:
    """Measure windows of an open file; parameters as of ``measure_windows``."""
    ready, steady = file.ready, file.steady
    accumulators: Sequence[Accumulator] = file.accumulators
    if audience == "steady":
        accumulators = steady
    elif audience == "sampled":
        accumulators = [each for each in file.accumulators if each not in steady]
    return measure(
        accumulators,
        [ready.spans[number] for number in windows],
        ready.facts,
        ready.decoder,
        survey.plan.sampling,
        progress,
        file.audience if audience == "planned" else None,
        before,
    )


def finish_file(packed: PackedSurvey | Kept, parts: Sequence[Kept], lost: Sequence[int], worker: Worker) -> FileRun:
    """Judge a file by the passes over its batches of windows, in the order of time, and the numbers of lost windows."""
    survey = _loaded(packed)
    with worker.open_file.opened(survey) as file:
        # Decoded rows make place for the states of all workers, which are merged here.
        file.ready.decoder.leases.forget()
        run = assemble(survey, file, (part.load() for part in parts), lost, worker.progress)
    worker.open_file.close()
    return run


def traffic_of(parts: Sequence[Kept], _: Worker) -> Traffic:
    """Return the requests to a server for passes over windows."""
    return sum((part.load().traffic for part in parts), NO_TRAFFIC)


def _loaded(packed: PackedSurvey | Kept) -> Survey:
    survey: PackedSurvey = packed.load() if isinstance(packed, Kept) else packed
    return survey.load()


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
        The file cannot be opened, or no dialect describes it.
    RuntimeError
        A collector itself failed.
    """
    statistics = StatisticsCollector()
    with open_sequence(path, dialect, allow_external=allow_external) as sequence:
        if not sequence.layout.is_recognised:
            raise UnrecognisedError(not_recognised(path))
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
