"""Importing this loads everything that measures: into the process that worker processes are forked from.

No file is open here, and no library has started threads of its own.
"""

import gc
import signal

signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process of the command handles it
# Modules stay loaded: to scan them for garbage while more are loaded would take a fifth of the time.
gc.disable()

# Before NumPy: OpenBLAS reads its number of threads when loaded, and threads do not survive a fork.
from fedora_qa.engine.worker import use_one_thread_of_blas  # noqa: E402  (loads nothing that has threads)

use_one_thread_of_blas()

import fedora_qa.engine.steps  # noqa: E402, F401  (as the tasks name it)
from fedora_qa.engine.compiled_loops import load_compiled_loops  # noqa: E402

load_compiled_loops("fedora_qa")
# A collection writes into each object that it scans, and would copy its page in every forked worker.
gc.freeze()
gc.enable()
