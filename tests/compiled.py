"""Compile the loops that most tests run: ``python -m tests.compiled``.

Numba keeps each compiled loop beside its source, where every process finds it. Without this step, processes of a test
run that need a loop at the same time compile it each, and so do the processes that tests start.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

from fedora_qa.engine.run import CheckOptions, check_file
from tests.support.sequences import make_sequence


def compile_loops(folder: Path) -> None:
    """Generate two small sequences, of moving objects and of every noise, and check them with canaries."""
    for scene in ("park-traffic", "park-noisy"):
        path = make_sequence(folder / f"{scene}.h5", scene, 0.5, 180, 136)
        check_file(path, CheckOptions(canary=True))


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        compile_loops(Path(temporary))
