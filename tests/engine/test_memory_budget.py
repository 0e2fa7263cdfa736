"""Blocks get what a process does not hold beside them."""

import mmap
import subprocess
import sys

import pytest

from fedora_qa.engine.memory_budget import MemoryBudget, own_bytes, return_unused_memory

SHARE = 400_000_000
EXPECTED = 100_000_000
HELD = 150_000_000
SLACK = 8_000_000
"""What else a process may get or give back meanwhile."""

measured = pytest.mark.skipif(sys.platform != "linux", reason="what a process holds is known on Linux alone")


def _begun(windows: int) -> MemoryBudget:
    memory_budget = MemoryBudget(SHARE, EXPECTED)
    for _ in range(windows):
        memory_budget.begin_window()
    return memory_budget


@pytest.fixture
def held() -> mmap.mmap:
    """So many bytes, written to."""
    pages = mmap.mmap(-1, HELD, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    for start in range(0, HELD, mmap.PAGESIZE):
        pages[start] = 1
    return pages


def test_at_first_there_is_room_for_what_is_expected() -> None:
    """Before the checks have shown what they need, blocks leave as much as is expected."""
    assert _begun(1).for_blocks(0) == SHARE - EXPECTED


@measured
def test_later_there_is_room_for_what_was_needed() -> None:
    """A process that needs next to nothing beside blocks has nearly all of its share for them."""
    assert SHARE - SLACK < _begun(10).for_blocks(0) <= SHARE


@measured
@pytest.mark.parametrize("windows", [1, 10])
def test_what_is_held_beside_blocks_is_missing(windows: int, request: pytest.FixtureRequest) -> None:
    """What the process gets beside blocks is taken off, and stays so, as the same is needed in the next window."""
    memory_budget = _begun(windows)
    memory_budget.for_blocks(0)
    pages = request.getfixturevalue("held")
    assert abs(memory_budget.for_blocks(0) - (SHARE - HELD)) < SLACK
    pages.close()
    assert abs(memory_budget.for_blocks(0) - (SHARE - HELD)) < SLACK


@measured
def test_blocks_themselves_are_not_beside_them(request: pytest.FixtureRequest) -> None:
    """What blocks fill is not taken off what they may fill."""
    memory_budget = _begun(10)
    request.getfixturevalue("held")
    assert memory_budget.for_blocks(HELD) > SHARE - SLACK


@measured
def test_there_is_always_some_room(request: pytest.FixtureRequest) -> None:
    """A share that is spent already leaves a quarter of itself."""
    memory_budget = MemoryBudget(HELD // 2, 0)
    request.getfixturevalue("held")
    assert memory_budget.for_blocks(0) == HELD // 8


@measured
def test_unused_memory_is_returned() -> None:
    """What small arrays leave on the heap is not held any longer."""
    before = own_bytes()
    assert before is not None
    small = [bytes(50_000) for _ in range(2000)]
    last = bytes(50_000)
    full = own_bytes()
    assert full is not None
    assert full - before > 80_000_000
    small.clear()
    return_unused_memory()
    after = own_bytes()
    assert after is not None
    assert after - before < 20_000_000
    assert len(last) == 50_000


USES_IT_TWICE = """
import resource
import numpy as np
from fedora_qa.engine.memory_budget import keep_unused_memory
keep_unused_memory()
for _ in range(2):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    held = [np.ones(1 << 20) for _ in range(12)]
    del held
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@measured
def test_unused_memory_is_kept_for_what_comes_next() -> None:
    """A hundred megabytes that were given up are there again without the system: it would clear 24,576 pages."""
    said = subprocess.run([sys.executable, "-c", USES_IT_TWICE], capture_output=True, text=True, check=True)
    assert int(said.stdout) < 1000
