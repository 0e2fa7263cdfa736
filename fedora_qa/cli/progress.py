"""Progress on stderr, where a terminal is there to show it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from fedora_qa.cli.terminal import stderr_console
from fedora_qa.record.wording import printable

Report = Callable[[str, int, int], None]
"""Called with what is going on, how much is done, and of how much."""


@contextmanager
def progress_bar(title: str) -> Iterator[Report]:
    """Yield a function that moves a bar; it shows nothing where stderr is not a terminal."""
    console = stderr_console()
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f}%"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(printable(title))

        def report(what: str, done: int, of: int) -> None:
            bar.update(task, description=f"{printable(title)}: {what}", completed=done, total=max(of, 1))

        yield report
