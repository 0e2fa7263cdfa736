"""Do the work of many files in processes."""

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_processes(
    processes: int, work: Callable[[Item], Result], items: Iterable[Item], report: Callable[[str, Result], None]
) -> list[Result]:
    """Return the results in the order of the items; each is reported when it comes, with its number of all."""
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        futures = [pool.submit(work, item) for item in items]
        for count, future in enumerate(as_completed(futures), start=1):
            report(f"{count}/{len(futures)}", future.result())
        return [future.result() for future in futures]
