"""Load the compiled loops that Numba caches on disk, before their first call."""

import sys
from collections.abc import Iterable, Iterator
from typing import Any

from numba.core.registry import CPUDispatcher


def load_compiled_loops(package: str) -> int:
    """Load what earlier runs have compiled of the modules of a package that are imported; return how many.

    Loops that only other loops call are left out: their callers contain their machine code. Nothing is compiled here: a
    loop that is not cached, or was compiled for another machine or version, is compiled at its first call. The cache of
    Numba is no public interface; where it has changed, no loop is loaded, and each is still compiled at its first call.
    """
    loops = tuple(_loops(package))
    serving = {id(called) for loop in loops for called in _called_by(loop)}
    return sum(_load(loop) for loop in loops if id(loop) not in serving)


def _loops(package: str) -> Iterator[CPUDispatcher]:
    modules = [module for name, module in sorted(sys.modules.items()) if name.split(".")[0] == package]
    for module in modules:
        for value in vars(module).values():
            # Only in the module that defines it: others import the same loop under its name.
            if isinstance(value, CPUDispatcher) and value.py_func.__module__ == module.__name__:
                yield value


def _called_by(loop: Any) -> Iterable[Any]:
    """Return what a loop names of its module: other loops among it."""
    function = loop.py_func
    return (function.__globals__.get(name) for name in function.__code__.co_names if name != function.__name__)


def _load(loop: Any) -> int:
    try:
        cache, codegen = loop._cache, loop.targetctx.codegen()
        # Keys hold signature, CPU and digest of the bytecode: another key was compiled for another machine or version.
        kept = [key[0] for key in cache._cache_file._load_index() if key == cache._index_key(key[0], codegen)]
        for signature in kept:
            # With a signature that is in the cache this only reads machine code.
            loop.compile(signature)
    except Exception:  # noqa: BLE001 - another process may be writing it; the first call compiles then
        return 0
    return len(kept)
