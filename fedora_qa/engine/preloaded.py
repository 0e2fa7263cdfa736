"""Importing this loads everything that measures: into the process that worker processes are forked from.

No file is open here, and no library has started threads of its own.
"""

import gc
import signal

signal.signal(signal.SIGINT, signal.SIG_IGN)  # the interrupt is for who has started all this
gc.disable()  # what is loaded stays: to look through it again and again takes a fifth of the time

from fedora_qa.engine.worker import use_one_thread_of_blas  # noqa: E402  (loads nothing that has threads)

use_one_thread_of_blas()

import fedora_qa.engine.steps  # noqa: E402, F401  (as the tasks name it)
from fedora_qa.engine.compiled_loops import load_compiled_loops  # noqa: E402

load_compiled_loops("fedora_qa")
gc.freeze()  # what is held for good is not looked at again, and so its pages stay shared
gc.enable()
