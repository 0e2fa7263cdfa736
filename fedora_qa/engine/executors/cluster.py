"""Tasks on a Dask cluster: the same as elsewhere, done by any of its workers that is free.

The files must lie under the same path on every worker, and the same version of this package must be installed there.
A task whose worker dies is given to another by the cluster itself, and is lost where it kills several of them.
"""

import socket
import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, replace
from functools import cache
from types import TracebackType
from typing import Any, Final, Self

from fedora_qa.code_digest import code_digest
from fedora_qa.engine.executors.executor import Kept, OpenFile, Task, Worker
from fedora_qa.engine.progress import Progress
from fedora_qa.errors import FedoraError, MisuseError, WorkerLostError

_CONNECT_S: Final = 10
_COUNTED_FOR_S: Final = 5.0
"""For how long a count of the workers holds; clusters grow and shrink."""

_code_here = cache(code_digest)
"""Digest of the code of this process: read once, as it is when its first task loads it."""

_WITHOUT_WORKERS_S: Final = 60.0
"""How long to wait for a worker, as clusters replace those that died."""


@dataclass(frozen=True, slots=True)
class _Remote(Kept):
    """A result that stays on the worker that computed it, and moves from there to another that needs it.

    Where that worker dies before, the cluster computes it again.
    """

    _: KW_ONLY
    future: Any
    address: str

    def load(self) -> Any:
        """Return the value; raises as ``_errors_of_cluster``."""
        with _errors_of_cluster(self.address):
            return self.future.result().load()

    def discard(self) -> None:
        """Let the worker drop it."""
        self.future.release()


class DaskExecutor:
    """Does as many tasks at once as the cluster's workers have threads.

    Parameters
    ----------
    address
        Of the scheduler, such as ``tcp://host:8786``.

    Raises
    ------
    MisuseError
        Dask is not installed, or no cluster answers at the address.
    FedoraError
        The cluster has no worker.
    """

    def __init__(self, address: str) -> None:
        try:
            import distributed  # noqa: PLC0415 - an extra
            from distributed.comm.addressing import get_address_host_port  # noqa: PLC0415 - an extra
        except ImportError:
            raise MisuseError("Expected Dask for --dask; install it: pip install 'fedora-qa[dask]'") from None
        self.peak_memory_mib = 0
        self._address = address
        try:
            # A plain connection first, which raises ``OSError`` or ``ValueError`` where nothing listens: a Dask client
            # that could not connect logs its failure again at exit.
            socket.create_connection(get_address_host_port(address), timeout=_CONNECT_S).close()
            client = distributed.Client(address, timeout=_CONNECT_S, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as problem:
            raise MisuseError(f"Expected a Dask scheduler at {address}, got: {problem}") from None
        self._client: Any = client
        self._code = code_digest()
        self._remote: dict[Future[Any], Any] = {}
        self._threads: tuple[int, ...] = ()
        self._counted_at = self._seen_at = time.monotonic()
        self._count()
        if not self._threads:
            client.close()  # type: ignore[no-untyped-call]
            raise FedoraError(f"Expected workers in the cluster at {address}, got none; start some and run again")

    @property
    def capacity(self) -> int:
        """How many threads the workers have."""
        if time.monotonic() - self._counted_at > _COUNTED_FOR_S:
            self._count()
        return max(sum(self._threads), 1)

    @property
    def sharing(self) -> int:
        """How many tasks share the memory of one worker."""
        return max(self._threads, default=1)

    def submit(self, task: Task, progress: Progress) -> Future[Any]:
        """Give the task to the cluster; its progress is not reported."""
        future: Future[Any] = Future()
        # Dask resolves futures in arguments only, not within an object. Not pure: Dask would otherwise answer a task
        # that is done again with the result of the first time, as it has the same arguments.
        remote = self._client.submit(
            do_if_same_code, self._code, replace(task, arguments=()), _with_futures(task.arguments), pure=False
        )
        self._remote[future] = remote
        remote.add_done_callback(lambda done: self._settle(future, done, keeps_result=task.keeps_result))
        return future

    def require_workers(self) -> None:
        """Raise ``FedoraError`` where the scheduler is gone, or has had no worker for a minute."""
        self._count()
        if time.monotonic() - self._seen_at > _WITHOUT_WORKERS_S:
            raise FedoraError(f"Expected workers in the cluster at {self._address}, got none for a minute")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._client.cancel(list(self._remote.values()))
        self._client.close()

    def _count(self) -> None:
        try:
            self._threads = tuple(self._client.nthreads().values())
        except OSError as problem:
            raise FedoraError(f"Expected the Dask scheduler at {self._address} to answer, got: {problem}") from None
        self._counted_at = time.monotonic()
        if self._threads:
            self._seen_at = self._counted_at

    def _settle(self, future: Future[Any], remote: Any, *, keeps_result: bool) -> None:
        self._remote.pop(future, None)
        try:
            stays = keeps_result and remote.status == "finished"
            with _errors_of_cluster(self._address):
                future.set_result(_Remote(future=remote, address=self._address) if stays else remote.result())
        except Exception as error:  # noqa: BLE001 - raised where the result is requested
            future.set_exception(error)


@contextmanager
def _errors_of_cluster(address: str) -> Iterator[None]:
    """Raise ``WorkerLostError`` where a task has ended its workers, and ``FedoraError`` where the scheduler is gone."""
    from distributed import CancelledError, KilledWorker  # noqa: PLC0415 - an extra

    try:
        yield
    # Raised after ``allowed-failures`` deaths: the cluster itself has tried other workers before.
    except KilledWorker as death:
        raise WorkerLostError(f"Expected a worker to end its task, got: {death}") from death
    except CancelledError as end:
        raise FedoraError(f"Expected the Dask scheduler at {address} to stay, got its end") from end


def do_if_same_code(code: str, task: Task, arguments: tuple[Any, ...]) -> Any:
    """Do a task, in a worker, with its arguments, which come apart from it.

    Raises
    ------
    MisuseError
        The worker has other code than the process that sent the task.
    """
    # The record shall be the same to the last bit whoever measures; other code could differ without any error.
    if _code_here() != code:
        raise MisuseError("Expected the same fedora-qa on every worker, got another; install the same version on all")
    return replace(task, arguments=arguments).do(Worker(OpenFile(keeps=False)))


def _with_futures(arguments: Any) -> Any:
    """Return arguments with the futures of Dask in place of results that stay on workers."""
    if isinstance(arguments, _Remote):
        return arguments.future
    if isinstance(arguments, list | tuple):
        return type(arguments)(_with_futures(argument) for argument in arguments)
    return arguments
