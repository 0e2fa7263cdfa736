"""How loops run: equal shares in threads, compiled without counting references."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, TypeVar

import numba

UNCOUNTED: Final[dict[str, Any]] = {"_nrt": False}
"""Options of ``numba.njit`` for a loop that makes no arrays, and whose callees make none.

Numba counts the references to each array, atomically, wherever compiled code passes it on. In the loops over pixels
that costs more than their arithmetic (``adaptive/README.md``). Numba does not compile such a loop if it makes an array.
"""


Result = TypeVar("Result")

NUMBA_CONFIG: Final[Any] = numba.config
"""Settings that Numba reads from the environment; without types."""


def thread_count() -> int:
    """Return the number of threads: the usable cores, or what ``NUMBA_NUM_THREADS`` states."""
    return int(NUMBA_CONFIG.NUMBA_NUM_THREADS)


def in_threads(share: Callable[[int, int, int], Result], count: int) -> list[Result]:
    """Cut ``range(count)`` into a consecutive share for each thread, and return what each of them returns.

    A compiled loop that is called by several threads runs at the same time where it is compiled with ``nogil=True``.
    Numba compiles the body of a parallel loop four times; this compiles it once.

    Parameters
    ----------
    share
        Is called with the number of the thread, and the first and the stop of its share.
    count
        Length of the loop.
    """
    threads = thread_count()
    bounds = [count * thread // threads for thread in range(threads + 1)]
    if threads == 1:
        return [share(0, 0, count)]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(share, range(threads), bounds[:-1], bounds[1:]))


def fill_in_threads(kernel: Callable[..., None], count: int, *arguments: object) -> None:
    """Call ``kernel(*arguments, first, stop)`` for the share of each thread, as ``in_threads`` cuts it."""
    in_threads(lambda _, first, stop: kernel(*arguments, first, stop), count)
