"""Progress on stderr, where a terminal is there to show it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from rich.console import Console
from rich.progress import (
    BarColumn,
    DownloadColumn,
    Progress,
    ProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from fedora_qa.cli.terminal import stderr_console
from fedora_qa.engine.progress import ProgressTally
from fedora_qa.engine.progress import Report as FilesReport
from fedora_qa.record.wording import printable

_WHOLE_RUN_S: Final = 30 * 86400.0

Report = Callable[[str, int, int], None]
"""Called with what is going on, how much is done, and of how much."""


@contextmanager
def progress_bar(title: str) -> Iterator[Report]:
    """Yield a function that moves a bar; it shows nothing where stderr is not a terminal."""
    with _bar(TimeElapsedColumn()) as bar:
        task = bar.add_task(printable(title))

        def report(what: str, done: int, of: int) -> None:
            bar.update(task, description=f"{printable(title)}: {what}", completed=done, total=max(of, 1))

        yield report


@contextmanager
def files_progress(file_count: int) -> Iterator[FilesReport]:
    """Yield a function that shows how far a run over files has come, and how long it will take at the rate so far.

    Parameters
    ----------
    known
        How many files were done before; they are counted, and tell nothing of the rate.
    """
    counts = TextColumn("{task.fields[counts]}", markup=False)
    with _bar(counts, DownloadColumn(), TimeRemainingColumn()) as bar:
        task = bar.add_task("", total=None, counts="")

        def report(tally: ProgressTally) -> None:
            bar.update(
                task,
                description=printable(tally.doing),
                completed=tally.bytes_done,
                total=tally.bytes,
                counts=counts_words(tally, file_count),
            )

        yield report


def counts_words(tally: ProgressTally, file_count: int) -> str:
    """Say how many files and windows are done; windows of files that nobody has read yet are not known."""
    files = f"files {tally.files_done + file_count}/{tally.files + file_count}"
    return f"{files}, windows {tally.windows_done}/{tally.windows}" if tally.windows else files


def _bar(*columns: ProgressColumn) -> Progress:
    """Return a bar on stderr; the rate is taken over the whole run, as steps are few and long."""
    console = stderr_console()
    is_visible = console.is_terminal
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f}%"),
        *columns,
        console=console if is_visible else Console(quiet=True),  # rich 13.7 ends what it hides with a line
        transient=True,
        disable=not is_visible,
        speed_estimate_period=_WHOLE_RUN_S,
    )
