"""Pages of a block are used again when nobody looks at it any more, and never before."""

import mmap
from itertools import pairwise
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.engine.block_memory import BlockMemory, Intervals, is_looked_at, lies_in_pages

FLOAT32 = np.dtype(np.float32)
SHAPE = (2, 256, 512, 1)
SIZE = 4 * 2 * 256 * 512
PAGE = mmap.PAGESIZE

interval = st.tuples(st.integers(0, 20), st.integers(1, 10)).map(lambda at: (at[0], at[0] + at[1]))


def test_arrays_are_what_was_asked_for() -> None:
    """An array has the shape and type, can be written, and does not share memory with another."""
    memory = BlockMemory()
    one, other = (memory.array(SHAPE, FLOAT32) for _ in range(2))
    one[...], other[...] = 1.0, 2.0
    assert one.shape == SHAPE
    assert one.dtype == FLOAT32
    assert (one == 1.0).all()
    assert (other == 2.0).all()
    assert memory.held_bytes == 2 * SIZE


def test_pages_are_used_again() -> None:
    """A block that is gone leaves its pages to the next, be it of that size or less; a larger one needs more."""
    memory = BlockMemory()
    block = memory.array(SHAPE, FLOAT32)
    place = block.ctypes.data
    assert memory.missing(SIZE) == SIZE
    del block
    assert (memory.missing(SIZE), memory.missing(SIZE + 1)) == (0, PAGE)
    again = memory.array(SHAPE[::-1], FLOAT32)
    assert again.ctypes.data == place
    assert (memory.held_bytes, memory.used_bytes) == (SIZE, SIZE)
    del again
    halves = [memory.array((1, 256, 512), FLOAT32) for _ in range(2)]
    assert memory.held_bytes == SIZE
    assert {half.ctypes.data for half in halves} == {place, place + SIZE // 2}


def test_pages_are_not_used_again_while_a_view_is_left() -> None:
    """Who looks at a part of a block, by whatever steps, keeps all of it."""
    memory = BlockMemory()
    block = memory.array(SHAPE, FLOAT32)
    block[...] = 7.0
    assert not is_looked_at(block)
    view = block[1:].reshape(-1)[::3].view(np.int32)
    assert is_looked_at(block)
    del block
    assert memory.missing(SIZE) == SIZE
    assert not memory.give_back()
    memory.array(SHAPE, FLOAT32)[...] = 8.0
    assert (view.view(np.float32) == 7.0).all()
    del view
    assert memory.missing(2 * SIZE) == 0


def test_pages_that_nobody_uses_go_back() -> None:
    """Free pages are given back one gap at a time, the narrowest first, and those in use never."""
    memory = BlockMemory()
    first, kept, last = (memory.array((pages, PAGE // 4), FLOAT32) for pages in (7, 3, 5))
    kept[...] = 1.0
    del first, last
    for held in (10, 3):
        assert memory.give_back()
        assert memory.held_bytes == held * PAGE
    assert not memory.give_back()
    assert (kept == 1.0).all()
    del kept
    memory.give_back_all()
    assert (memory.held_bytes, memory.used_bytes) == (0, 0)


@given(st.lists(st.tuples(st.sampled_from(["take", "drop", "give back"]), st.integers(1, 40), st.integers(0, 9))))
def test_what_is_held_is_known_and_nobody_is_written_over(steps: list[tuple[str, int, int]]) -> None:
    """Whatever is taken and dropped: blocks keep what was written, all that is held is counted, and no more is asked
    of the system than ``missing`` said."""
    memory, blocks = BlockMemory(), list[tuple[int, NDArray[Any]]]()
    for number, (step, pages, which) in enumerate(steps):
        before = memory.held_bytes
        if step == "take":
            missing = memory.missing(pages * PAGE)
            block = memory.array((pages, PAGE // 4), FLOAT32)
            block[...] = number
            blocks.append((number, block))
            assert memory.held_bytes == before + missing
            del block
        elif step == "drop" and blocks:
            del blocks[which % len(blocks)]
            assert memory.held_bytes == before
        elif step == "give back":
            assert memory.give_back() == (before > memory.used_bytes)
        assert all((block == written).all() for written, block in blocks)
        assert memory.used_bytes == sum(block.nbytes for _, block in blocks) <= memory.held_bytes


def test_a_block_outlives_its_memory() -> None:
    """Blocks may be looked at after who decoded them is gone."""
    block = BlockMemory().array(SHAPE, FLOAT32)
    block[...] = 3.0
    assert (block == 3.0).all()


def test_pages_are_told_from_other_memory() -> None:
    """Blocks of these pages are, arrays of the heap and views of them are not."""
    block = BlockMemory().array(SHAPE, FLOAT32)
    assert lies_in_pages(block)
    heap = np.empty(SHAPE, FLOAT32)
    assert not any(lies_in_pages(other) for other in (heap, heap[1:], heap.view(np.uint8).reshape(-1), block.copy()))


@given(st.lists(st.tuples(st.booleans(), interval)), interval)
def test_intervals_are_a_set(steps: list[tuple[bool, tuple[int, int]]], asked: tuple[int, int]) -> None:
    """Whatever is added and removed, the numbers are those of a set, in order and in as few intervals as can be."""
    intervals, numbers = Intervals(), set[int]()
    for add, (start, stop) in steps:
        if add:
            intervals.add(start, stop)
            numbers |= set(range(start, stop))
        else:
            intervals.remove(start, stop)
            numbers -= set(range(start, stop))
    pieces = list(intervals)
    assert [number for start, stop in pieces for number in range(start, stop)] == sorted(numbers)
    assert all(stop < start for (_, stop), (start, _) in pairwise(pieces))
    assert intervals.overlap(*asked) == len(numbers & set(range(*asked)))
