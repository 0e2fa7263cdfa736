"""The comparator against exact loops: what is taken for quiet without an exact comparison is quiet, whatever it is."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fedora_generator.events.comparator import (
    COLUMN_MASK,
    Comparator,
    SignalNotFiniteError,
    list_active,
    mark_quiet,
    pixel_buffer,
    row_buffers,
)
from fedora_generator.events.keys import KeyLayout
from tests.generator.event_sensor_cases import Floats

EXTREMES = [0.0, -0.0, 5e-324, -2.2e-308, 1e-45, 1.2e-38, 1.0, 819.2, -4096.0, 3.4e38, -3.5e38, 1e300, -1.7e308]
references = st.one_of(st.sampled_from(EXTREMES), st.floats(-20, 20), st.floats(allow_nan=False, allow_infinity=False))
thresholds = st.one_of(st.sampled_from([1e-6, 0.2, 15.0, 1e300]), st.floats(1e-6, 100))


@given(references, thresholds, thresholds, thresholds, st.integers(-4, 4), st.booleans())
@settings(max_examples=400, deadline=None)
def test_surely_quiet_is_quiet(reference: float, on: float, off: float, other: float, ulps: int, up: bool) -> None:
    """A pixel marked quiet is strictly between its thresholds in float64; signals lie within 4 ulps of one of them.

    A second pixel, on the same comparator, has thresholds of its own.
    """
    bound = reference + on if up else reference - off
    assume(abs(bound) < 1e308)
    at = bound
    for _ in range(abs(ulps)):
        at = np.nextafter(at, np.copysign(np.inf, ulps))
    signal = np.array([[at, reference]])
    levels = np.full((1, 2), reference)
    comparator = Comparator(KeyLayout(1, 2), np.array([[on, other]]), np.array([[off, other]]), levels)
    quiet = np.zeros(2, np.uint8)
    mark_quiet(signal, comparator._middle, comparator._near, 0, quiet)
    if quiet[0]:
        assert reference - off < signal[0, 0] < reference + on


@given(st.floats(-800, 800), st.floats(-0.998, 0.998))
def test_most_of_the_quiet_are_surely_so(reference: float, share: float) -> None:
    """With thresholds of 0.2 nat a signal within 99.8% of them is seen to be quiet: little is left to look into."""
    threshold, quiet = np.full((1, 1), 0.2), np.zeros(1, np.uint8)
    comparator = Comparator(KeyLayout(1, 1), threshold, threshold, np.full((1, 1), reference))
    mark_quiet(np.full((1, 1), reference + 0.2 * share), comparator._middle, comparator._near, 0, quiet)
    assert quiet[0] == 1


@given(st.integers(1, 300), st.floats(0, 1), st.integers(0, 2**32 - 1))
@settings(max_examples=60, deadline=None)
def test_every_pixel_that_is_not_quiet_is_listed(width: int, share: float, seed: int) -> None:
    """From none to all of a row of any width, in order, after those that were listed before."""
    quiet, words, candidates = row_buffers(width)
    quiet[:width] = np.random.default_rng(seed).random(width) >= share
    pixels = pixel_buffer(width, 2)
    count = list_active(words, 700, candidates, pixels, 0)
    count = list_active(words, 701, candidates, pixels, count)
    expected = np.flatnonzero(quiet == 0)
    assert (pixels[:count] & COLUMN_MASK).tolist() == [*expected, *expected]
    assert (pixels[:count] >> 16).tolist() == [700] * len(expected) + [701] * len(expected)


def movie(seed: int, height: int, width: int) -> list[Floats]:
    """Random walks, some pixels at rest, some that jump to where float32 is too coarse and back, some by nothing."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(0, 0.25, (8, height, width)) * (rng.random((8, height, width)) < 0.5)
    walks = np.cumsum(steps, axis=0)
    walks[rng.integers(8, size=3), rng.integers(height, size=3), rng.integers(width, size=3)] = [-0.0, 1e-310, 830.0]
    return list(walks)


def spread(seed: int, height: int, width: int, shared: bool) -> tuple[Floats, Floats]:
    """Thresholds, on and off, of one row or of every pixel, from the floor up."""
    rng = np.random.default_rng(seed)
    shape = (1 if shared else height, width)
    return rng.uniform(0.02, 0.4, shape), rng.uniform(0.02, 0.4, shape)


seeds_and_sizes = (st.integers(0, 2**32 - 1), st.integers(1, 20), st.integers(1, 70), st.booleans())


@given(*seeds_and_sizes)
@settings(max_examples=30, deadline=None)
def test_references_and_crossings_are_those_of_a_plain_loop(seed: int, height: int, width: int, shared: bool) -> None:
    """Pixel by pixel in Python: the same levels crossed in the same order, and the same references, to the last bit."""
    frames, (on, off) = movie(seed, height, width), spread(seed, height, width, shared)
    layout = KeyLayout(height, width)
    comparator = Comparator(layout, on, off, frames[0].copy())
    levels = frames[0].copy()
    for step, (previous, signal) in enumerate(pairwise(frames)):
        keys = comparator.crossings(previous, signal, step * 10**6, (step + 1) * 10**6)
        expected = []
        for row, column in np.ndindex(height, width):
            line, value = 0 if shared else row, signal[row, column]
            while value >= levels[row, column] + on[line, column] or value <= levels[row, column] - off[line, column]:
                brighter = value > levels[row, column]
                levels[row, column] += on[line, column] if brighter else -off[line, column]
                expected.append((row << layout.column_bits | column) << 1 | int(brighter))
        assert (keys & ((1 << layout.timestamp_shift) - 1)).tolist() == expected
        assert comparator.reference.tobytes() == levels.tobytes()


@given(*seeds_and_sizes)
@settings(max_examples=30, deadline=None)
def test_references_and_steps_are_those_of_a_plain_comparison(seed: int, height: int, width: int, shared: bool) -> None:
    """Strictly beyond a threshold fires once and moves the reference to the value, as NumPy compares all at once."""
    frames, (on, off) = movie(seed, height, width), spread(seed, height, width, shared)
    layout = KeyLayout(height, width)
    comparator = Comparator(layout, on, off, frames[0].copy())
    levels = frames[0].copy()
    for step, signal in enumerate(frames[1:], start=1):
        keys = comparator.steps(signal, step * 10**6)
        brighter, darker = signal > levels + on, signal < levels - off
        rows, columns = np.nonzero(brighter | darker)
        places = (rows << layout.column_bits | columns) << 1 | brighter[rows, columns]
        assert keys.tolist() == ((step * 1_000 << layout.timestamp_shift) | places).tolist()
        levels[rows, columns] = signal[rows, columns]
        assert comparator.reference.tobytes() == levels.tobytes()


@given(st.integers(0, 19), st.integers(0, 129), st.sampled_from([np.nan, np.inf, -np.inf]), st.booleans())
@settings(max_examples=40, deadline=None)
def test_one_broken_pixel_is_found_anywhere(row: int, column: int, broken: float, shared: bool) -> None:
    """In any row of any band and any column, at the edges of words and blocks too, among pixels that are quiet."""
    signal, (on, off) = np.zeros((20, 130)), spread(1, 20, 130, shared)
    signal[row, column] = broken
    comparator = Comparator(KeyLayout(20, 130), on, off, np.zeros((20, 130)))
    with pytest.raises(SignalNotFiniteError):
        comparator.crossings(np.zeros((20, 130)), signal, 0, 1_000)
    with pytest.raises(SignalNotFiniteError):
        comparator.steps(signal, 1_000)
