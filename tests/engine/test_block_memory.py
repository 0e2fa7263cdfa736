"""Pages of a block are used again when nobody looks at it any more, and never before."""

import numpy as np

from fedora_qa.engine.block_memory import BlockMemory, is_looked_at, lies_in_pages

FLOAT32 = np.dtype(np.float32)
SHAPE = (2, 300, 500, 1)
SIZE = 4 * 2 * 300 * 500


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
    """A block that is gone leaves its pages to the next of its size, and to no other."""
    memory = BlockMemory()
    block = memory.array(SHAPE, FLOAT32)
    place = block.ctypes.data
    assert not memory.free(SIZE)
    del block
    assert memory.free(SIZE)
    assert memory.array((3,), FLOAT32).ctypes.data != place
    again = memory.array(SHAPE[::-1], FLOAT32)
    assert again.ctypes.data == place
    assert memory.held_bytes == SIZE + 12


def test_pages_are_not_used_again_while_a_view_is_left() -> None:
    """Who looks at a part of a block, by whatever steps, keeps all of it."""
    memory = BlockMemory()
    block = memory.array(SHAPE, FLOAT32)
    block[...] = 7.0
    assert not is_looked_at(block)
    view = block[1:].reshape(-1)[::3].view(np.int32)
    assert is_looked_at(block)
    del block
    assert not memory.free(SIZE)
    assert not memory.give_back()
    memory.array(SHAPE, FLOAT32)[...] = 8.0
    assert (view.view(np.float32) == 7.0).all()
    del view
    assert memory.free(SIZE)


def test_pages_that_nobody_uses_go_back() -> None:
    """Free pages are given back one block at a time, and those in use never."""
    memory = BlockMemory()
    kept = memory.array(SHAPE, FLOAT32)
    memory.array((5, 4096), FLOAT32)
    assert memory.held_bytes == SIZE + 5 * 4 * 4096
    assert memory.give_back()
    assert memory.held_bytes == SIZE
    assert not memory.give_back()
    kept[...] = 1.0


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
