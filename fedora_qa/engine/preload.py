"""Importing this loads the engine into the process that worker processes are forked from; checks are loaded after it.

No file is open here, and no library has started threads of its own.
"""

import gc
import os
import signal

signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process of the command handles it
# Modules stay loaded: to scan them for garbage while more are loaded would take a fifth of the time.
gc.disable()

# OpenBLAS reads its number of threads when NumPy loads it. A worker has one core and small matrices.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from numba.core.registry import cpu_target  # noqa: E402
from numcodecs import blosc  # noqa: E402

import fedora_qa.engine.compilation.kernels  # noqa: E402
import fedora_qa.engine.executors.processes  # noqa: E402
import fedora_qa.engine.tasks  # noqa: E402, F401

# The codec of images creates a lock that it never takes without threads. If each worker created its own, the tracker of
# resources would warn of the lock of every worker that is ended. Since numcodecs 0.17 it is no lock of processes.
if hasattr(blosc, "get_mutex"):
    blosc.get_mutex()

# What Numba knows of functions and types: each worker would load it with its first compiled loop, in 0.25 s.
cpu_target.target_context.refresh()
