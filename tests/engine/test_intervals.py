"""Stretches mean what a set of numbers would."""

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.engine.intervals import Intervals

stretch = st.tuples(st.integers(0, 20), st.integers(1, 10)).map(lambda one: (one[0], one[0] + one[1]))


@given(st.lists(st.tuples(st.booleans(), stretch)), stretch)
def test_stretches_are_a_set(steps: list[tuple[bool, tuple[int, int]]], asked: tuple[int, int]) -> None:
    """Whatever is added and removed, the numbers are those of a set, in order and in as few stretches as can be."""
    intervals, numbers = Intervals(), set[int]()
    for add, (start, stop) in steps:
        if add:
            intervals.add(start, stop)
            numbers |= set(range(start, stop))
        else:
            intervals.remove(start, stop)
            numbers -= set(range(start, stop))
    stretches = list(intervals)
    assert [number for start, stop in stretches for number in range(start, stop)] == sorted(numbers)
    assert all(stop < start for (_, stop), (start, _) in pairwise(stretches))
    assert intervals.overlap(*asked) == len(numbers & set(range(*asked)))
