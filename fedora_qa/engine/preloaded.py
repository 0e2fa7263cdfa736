"""Importing this loads everything that measures: into the process that worker processes are forked from.

No file is open here, and no library has started threads of its own.
"""

import gc
import signal
import sys
from typing import Any

signal.signal(signal.SIGINT, signal.SIG_IGN)  # the process of the command handles it
# Modules stay loaded: to scan them for garbage while more are loaded would take a fifth of the time.
gc.disable()

# Before NumPy: OpenBLAS reads its number of threads when loaded, and threads do not survive a fork.
from fedora_qa.engine.worker import use_one_thread_of_blas  # noqa: E402  (loads nothing that has threads)

use_one_thread_of_blas()

from numba.core.registry import CPUDispatcher  # noqa: E402

import fedora_qa.engine.steps  # noqa: E402, F401  (as the tasks name it)


def load_compiled_loops(package: str) -> int:
    """Load the compiled loops that Numba caches on disk, of the imported modules of a package; return how many.

    Loops that only other loops call are left out: their callers contain their machine code. Nothing is compiled here: a
    loop that is not cached, or was compiled for another machine or version, is compiled at its first call. The cache of
    Numba is no public interface; where it has changed, no loop is loaded, and each is still compiled at its first call.
    """
    modules = [module for name, module in sorted(sys.modules.items()) if name.split(".")[0] == package]
    # Only in the module that defines it: others import the same loop under its name.
    loops: list[Any] = [
        value
        for module in modules
        for value in vars(module).values()
        if isinstance(value, CPUDispatcher) and value.py_func.__module__ == module.__name__
    ]
    # What the code of a loop names of its module, other loops among it.
    serving = {
        id(loop.py_func.__globals__.get(name))
        for loop in loops
        for name in loop.py_func.__code__.co_names
        if name != loop.py_func.__name__
    }
    loaded = 0
    for loop in loops:
        if id(loop) in serving:
            continue
        try:
            cache, codegen = loop._cache, loop.targetctx.codegen()
            # Keys hold signature, CPU and digest of the bytecode: another key was compiled for another machine or
            # version.
            kept = [key[0] for key in cache._cache_file._load_index() if key == cache._index_key(key[0], codegen)]
            for signature in kept:
                # With a signature that is in the cache this only reads machine code.
                loop.compile(signature)
        except Exception:  # noqa: BLE001 - another process may be writing it; the first call compiles then
            continue
        loaded += len(kept)
    return loaded


load_compiled_loops("fedora_qa")
# A collection writes into each object that it scans, and would copy its page in every forked worker.
gc.freeze()
gc.enable()
