"""Compile the loops that most tests run: ``python -m tests.compiled checks`` and ``... generator``.

Numba keeps each compiled loop beside its source, where every process finds it. Without this step, processes of a test
run that need a loop at the same time compile it each, and so do the processes that tests start. The two parts can run
at the same time: the first needs the loops of the other only at its end, when they are compiled as a rule.
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from fedora_generator.faults import plant_fault
from fedora_qa.engine.compilation.kernel_groups import listed_groups
from fedora_qa.engine.compilation.kernels import compile_group
from fedora_qa.engine.executors.executor import OpenFile, Worker
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from tests.support.handmade import write_handmade
from tests.support.sequences import CLEAN_PART_S, make_sequence


def compile_checks(folder: Path) -> None:
    """Compile what is listed, check a file that no generator wrote, with canaries, a flight, and its flow with a fault.

    Undoing a fault gives arrays that can be written to, for which loops are compiled once more.
    """
    for group in listed_groups():
        compile_group(group, Worker(OpenFile(keeps=False)))
    check_file(write_handmade(folder / "a.h5"), CheckOptions(canary=True))
    clean, faulty = folder / "clean.h5", folder / "faulty.h5"
    make_sequence(clean, "park-day", CLEAN_PART_S["exact"], 198, 147)
    plant_fault(clean, faulty, "flow_gain", "flow", 10.0)
    check_file(clean, CheckOptions())
    check_file(faulty, CheckOptions(select=("flow_geometry", "flow_photometric", "flow_rates")))


def compile_generator(folder: Path) -> None:
    """Generate small sequences, of moving objects and of every noise."""
    for scene in ("park-traffic", "park-noisy"):
        make_sequence(folder / f"{scene}.h5", scene, 0.1, 72, 54)


if __name__ == "__main__":
    with TemporaryDirectory() as temporary:
        {"checks": compile_checks, "generator": compile_generator}[sys.argv[1]](Path(temporary))
