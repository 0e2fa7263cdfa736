"""What runs in a worker process: it receives tasks, tells their progress, and answers with what they give.

It imports nothing heavy: a task brings what it needs, after the threads of the libraries have been set.
"""

import os
import pickle
import signal
import traceback
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any, Final

_OPENCV_THREADS: Final = "OPENCV_FOR_THREADS_NUM"
"""Read by OpenCV when it is loaded. Its images do not depend on it; sums of BLAS may, whose threads are left alone."""


@dataclass(frozen=True, slots=True)
class Told:
    """A task tells how far it has come."""

    what: str
    done: int
    of: int


@dataclass(frozen=True, slots=True)
class Done:
    """What a task gave."""

    result: Any


@dataclass(frozen=True, slots=True)
class Failed:
    """What a task raised, with its traceback as a note."""

    error: Exception


def serve(pipe: "Connection[Any, Any]", threads: int) -> None:
    """Do tasks until the other end of the pipe is closed, or gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the interrupt is the parent's to handle
    os.environ.setdefault(_OPENCV_THREADS, str(threads))
    while True:
        try:
            pickled = pipe.recv_bytes()
            pipe.send_bytes(_answer(pickled, pipe))
        except (EOFError, ConnectionError):
            return


def _answer(pickled: bytes, pipe: "Connection[Any, Any]") -> bytes:
    def tell(what: str, done: int, of: int) -> None:
        pipe.send(Told(what, done, of))

    try:
        return pickle.dumps(Done(pickle.loads(pickled)(tell)))
    except Exception as error:  # noqa: BLE001 - whoever asked for the result gets it
        return pickle.dumps(Failed(_that_travels(error)))


def _that_travels(error: Exception) -> Exception:
    """Return the error with its traceback as a note; one that cannot be pickled and unpickled, as what it said."""
    error.add_note("".join(traceback.format_exception(error)))
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001 - whatever it is that cannot be done
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error
