"""Compile the loops that most tests run: ``python -m tests.compiled checks`` and ``... generator``.

Numba keeps each compiled loop beside its source, where every process finds it. Without this step, processes of a test
run that need a loop at the same time compile it each, and so do the processes that tests start. The two parts share no
loops and can run at the same time.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from fedora_qa.engine.run import CheckOptions, check_file
from tests.support.handmade import write_handmade
from tests.support.sequences import make_sequence


def compile_checks(folder: Path) -> None:
    """Check a file that no generator wrote, with canaries."""
    check_file(write_handmade(folder / "a.h5"), CheckOptions(canary=True))


def compile_generator(folder: Path) -> None:
    """Generate small sequences, of moving objects and of every noise."""
    for scene in ("park-traffic", "park-noisy"):
        make_sequence(folder / f"{scene}.h5", scene, 0.1, 72, 54)


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        {"checks": compile_checks, "generator": compile_generator}[sys.argv[1]](Path(temporary))
