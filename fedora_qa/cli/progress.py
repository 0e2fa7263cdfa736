"""Progress on stderr, where that is a terminal."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as ProgressDisplay

from fedora_qa.cli.console import stderr_console
from fedora_qa.engine.progress import Progress, ProgressTally, Report
from fedora_qa.record.wording import printable

# 30 days in s, longer than any run; the default of rich, 30 s, is shorter than a step may take.
_WHOLE_RUN_S: Final = 30 * 86400.0


@contextmanager
def progress_bar(title: str) -> Iterator[Progress]:
    """Yield a function that moves a bar; it shows nothing where stderr is not a terminal."""
    with _bar(TimeElapsedColumn()) as bar:
        task = bar.add_task(printable(title))

        def report(what: str, done: int, of: int) -> None:
            bar.update(task, description=f"{printable(title)}: {what}", completed=done, total=max(of, 1))

        yield report


@contextmanager
def files_progress(file_count: int) -> Iterator[Report]:
    """Yield a function that shows the progress of a run over files, and the remaining time at the rate so far.

    Parameters
    ----------
    file_count
        Files that were complete before; they are counted, but do not enter the rate.
    """
    counts = TextColumn("{task.fields[counts]}", markup=False)
    with _bar(counts, DownloadColumn(), TimeRemainingColumn()) as bar:
        # Invisible until the first report, which states the total.
        task = bar.add_task("", total=None, counts="", visible=False)

        def report(tally: ProgressTally) -> None:
            bar.update(
                task,
                description=printable(tally.doing),
                completed=tally.bytes_done,
                total=tally.bytes,
                counts=counts_words(tally, file_count),
                visible=True,
            )

        yield report


def counts_words(tally: ProgressTally, file_count: int) -> str:
    """Return how many files and windows are done; of files not yet opened the number of windows is unknown."""
    files = f"files {tally.files_done + file_count}/{tally.files + file_count}"
    return f"{files}, windows {tally.windows_done}/{tally.windows}" if tally.windows else files


def _bar(*columns: ProgressColumn) -> ProgressDisplay:
    """Return a bar on stderr; the rate is that of the whole run, because steps are few and long."""
    console = stderr_console()
    is_visible = console.is_terminal
    return ProgressDisplay(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f}%"),
        *columns,
        console=console if is_visible else Console(quiet=True),  # rich 13.7 ends what it hides with a line
        transient=True,
        disable=not is_visible,
        speed_estimate_period=_WHOLE_RUN_S,
    )
