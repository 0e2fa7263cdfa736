"""Laws of conservation: never broken by an ideal sensor, broken by lost and superfluous events, exact to join."""

from functools import reduce
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.events.conservation import (
    EVERY_FRAME,
    ConservationLaw,
    EventFreeRuns,
    Excursions,
    bound,
    follow_runs,
)

ON, OFF = 0.2, 0.3
STEP_ON, STEP_OFF = 6.0, 8.0
LAW = ConservationLaw(ON, OFF)
seeds = st.integers(0, 2**32 - 1)


def ideal_log(
    rng: np.random.Generator, frames: int = 30, pixels: int = 6, phase: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """A random level (n, 1, pixels) and the events (n - 1, 2, 1, pixels) of an ideal sensor between the frames."""
    level = np.cumsum(rng.normal(0, 0.3, (frames, pixels)), axis=0)
    reference = level[0] - phase * rng.uniform(-OFF, ON, pixels)
    counts = np.zeros((frames - 1, 2, 1, pixels), np.int32)
    for i, target in enumerate(level[1:]):
        for pixel in range(pixels):
            while target[pixel] >= reference[pixel] + ON:
                reference[pixel] += ON
                counts[i, 1, 0, pixel] += 1
            while target[pixel] <= reference[pixel] - OFF:
                reference[pixel] -= OFF
                counts[i, 0, 0, pixel] += 1
    return level[:, np.newaxis], counts


def ideal_linear(rng: np.random.Generator, frames: int = 30, pixels: int = 6) -> tuple[np.ndarray, np.ndarray]:
    """Whole values seen every fourth step, and events of a sensor that takes its reference from the value."""
    values = 100 + np.rint(np.cumsum(rng.normal(0, 4, (4 * frames, pixels)), axis=0))
    reference, counts = values[0].copy(), np.zeros((frames - 1, 2, 1, pixels), np.int32)
    for step in range(1, 4 * (frames - 1) + 1):
        up, down = values[step] - reference > STEP_ON, reference - values[step] > STEP_OFF
        counts[(step - 1) // 4, 1, 0] += up
        counts[(step - 1) // 4, 0, 0] += down
        reference = np.where(up | down, values[step], reference)
    return values[::4, np.newaxis], counts


def excursions(level: np.ndarray, counts: np.ndarray, error: float = 0.0, first: int = 0) -> Excursions:
    drift, frames = np.zeros(len(counts)), np.arange(first, first + len(level))
    light, off = np.exp(level) * np.cosh(error), np.exp(level) * np.sinh(error)  # logarithms of level -+ error
    return bound(light, off, counts, drift, LAW, frames)


def runs(values: np.ndarray, counts: np.ndarray, error: float = 0.0, first: int = 0) -> EventFreeRuns:
    frames = np.arange(first, first + len(values))
    return follow_runs(
        values - error, values + error, counts, threshold_on=STEP_ON, threshold_off=STEP_OFF, frames=frames
    )


@given(seeds)
@settings(max_examples=50, deadline=None)
def test_ideal_log_events_keep_the_law(seed: int) -> None:
    """Whatever the level does, it never strays from its events by the sum of the thresholds."""
    assert np.all(excursions(*ideal_log(np.random.default_rng(seed))).excess() < ON + OFF)


@given(seeds)
@settings(max_examples=50, deadline=None)
def test_references_that_begin_at_the_signal_keep_the_law_of_the_start(seed: int) -> None:
    """From a first reference at the signal no level strays from its events by a threshold; from others some do."""
    signal, counts = ideal_log(np.random.default_rng(seed), phase=0.0)
    assert np.all(excursions(signal, counts).departure() < 0)
    signal, counts = ideal_log(np.random.default_rng(seed), pixels=60)
    assert np.any(excursions(signal, counts).departure() > 0)


@given(seeds)
@settings(max_examples=50, deadline=None)
def test_ideal_linear_events_keep_the_law(seed: int) -> None:
    """Whatever the values do, no run is too wide and no rise too small."""
    assert not runs(*ideal_linear(np.random.default_rng(seed))).broken.any()


@given(seeds)
@settings(max_examples=50, deadline=None)
def test_runs_that_begin_at_the_reference_keep_the_law_of_the_start(seed: int) -> None:
    """Before its first event no value strays from the first one by a threshold, whatever the error of a value."""
    values, counts = ideal_linear(np.random.default_rng(seed))
    assert np.all(runs(values, counts).departure(STEP_ON, STEP_OFF) <= 0)
    assert np.all(runs(values, counts, 0.5).departure(STEP_ON, STEP_OFF) <= 0)


@pytest.mark.parametrize(("change", "departure"), [(9.0, 3.0), (4.0, -2.0), (-9.0, 1.0), (-4.0, -4.0)])
def test_a_run_departs_by_what_lies_beyond_a_threshold(change: float, departure: float) -> None:
    """The value of a pixel without events changes; errors of 0.25 of its first and its last value may explain 0.5."""
    values, counts = np.array([50.0, 50.0, 50.0 + change])[:, np.newaxis, np.newaxis], np.zeros((2, 2, 1, 1), np.int32)
    assert runs(values, counts).departure(STEP_ON, STEP_OFF).item() == pytest.approx(departure)
    assert runs(values, counts, 0.25).departure(STEP_ON, STEP_OFF).item() == pytest.approx(departure - 0.5)


@given(seeds, st.lists(st.integers(1, 28), max_size=5, unique=True), st.booleans())
@settings(max_examples=50, deadline=None)
def test_stretches_join_exactly(seed: int, cuts: list[int], from_the_right: bool) -> None:
    """Cut at any frames and joined in any order, the bounds are those of the whole, bit for bit."""
    rng = np.random.default_rng(seed)
    edges = [0, *sorted(cuts), 29]
    for made, ideal in ((excursions, ideal_log), (runs, ideal_linear)):
        signal, counts = ideal(rng)
        parts = [made(signal[a : b + 1], counts[a:b], 0.01, a) for a, b in pairwise(edges)]
        if from_the_right:
            joined = reduce(lambda later, earlier: earlier.then(later), reversed(parts))
        else:
            joined = reduce(lambda earlier, later: earlier.then(later), parts)
        whole = made(signal, counts, 0.01)
        for name in type(whole).__slots__:
            assert np.array_equal(getattr(joined, name), getattr(whole, name)), name


@given(seeds, st.lists(st.integers(1, 28), max_size=5, unique=True))
@settings(max_examples=50, deadline=None)
def test_what_is_followed_in_place_is_the_whole(seed: int, cuts: list[int]) -> None:
    """Gone on with from any frames, bit for bit, some of which tell nothing of some pixels."""
    rng = np.random.default_rng(seed)
    level, counts = ideal_log(rng)
    light, drift, frames = np.exp(level), rng.normal(0, 0.01, 29), np.arange(30)
    error = np.where(rng.uniform(size=light.shape) < 0.7, np.inf, 0.01)
    edges = [0, *sorted(cuts), 29]
    parts = [
        (light[a : b + 1], error[a : b + 1], counts[a:b], drift[a:b], frames[a : b + 1]) for a, b in pairwise(edges)
    ]
    followed = bound(*parts[0][:4], LAW, parts[0][4])
    for part in parts[1:]:
        followed.follow(*part)
    joined = reduce(lambda earlier, later: earlier.then(later), [bound(*part[:4], LAW, part[4]) for part in parts])
    whole = bound(light, error, counts, drift, LAW, frames)
    for name in Excursions.__slots__:
        assert np.array_equal(getattr(followed, name), getattr(whole, name)), name
        assert np.array_equal(getattr(joined, name), getattr(whole, name)), name


def zigzag(lost: int, superfluous: int) -> tuple[np.ndarray, np.ndarray]:
    """A level that falls, rises and falls by five thresholds; brighter events lost or superfluous at the top."""
    sweep = np.linspace(0, 1.0, 21)
    level = np.concatenate([sweep[::-1], sweep[1:], sweep[-2::-1]])[:, np.newaxis, np.newaxis] + 1e-6
    counts = np.zeros((len(level) - 1, 2, 1, 1), np.int32)
    reference = 1.0
    for i, target in enumerate(level[1:, 0, 0]):
        while target >= reference + ON:
            reference, counts[i, 1] = reference + ON, counts[i, 1] + 1
        while target <= reference - OFF:
            reference, counts[i, 0] = reference - OFF, counts[i, 0] + 1
    counts[counts[:, 1].nonzero()[0][-1], 1] += superfluous - lost
    return level, counts


@pytest.mark.parametrize(("lost", "superfluous", "broken"), [(0, 0, False), (1, 0, True), (0, 1, True)])
def test_lost_and_superfluous_events_break_the_law(lost: int, superfluous: int, broken: bool) -> None:
    """Between two falls, one event lost or superfluous on a rise cannot be explained by any level."""
    assert bool(excursions(*zigzag(lost, superfluous)).excess() > ON + OFF) == broken


def test_wide_bounds_excuse_everything() -> None:
    """Where frames tell nothing of the level, no loss is sure."""
    level, counts = zigzag(3, 0)
    unknown = np.full(level.shape, np.inf)
    drift, frames = np.zeros(len(counts)), np.arange(len(level))
    free = bound(np.exp(level), unknown, counts, drift, LAW, frames)
    assert np.all(free.excess() < 0)


def test_uneven_light_tells_nothing() -> None:
    """Errors that reach the first limit and the second times the light are as good as infinite ones."""
    level, counts = zigzag(1, 0)
    light, drift, frames = np.exp(level), np.zeros(len(counts)), np.arange(len(level))
    error = np.full(level.shape, 0.01)
    for uneven, broken in (((0.011, 0.0), True), ((0.0, 0.011), True), ((0.01, 0.0), False), ((0.0, 0.001), False)):
        found = bound(light, error, counts, drift, ConservationLaw(ON, OFF, uneven=(EVERY_FRAME, uneven)), frames)
        assert bool(found.excess(1) > ON + OFF) == broken
        assert bool(found.excess(0) > ON + OFF)


def test_bounds_are_those_of_a_plain_loop() -> None:
    """What is followed a row at a time, by logarithms of its own, is the definition, frame by frame."""
    rng = np.random.default_rng(8)
    light, error = rng.uniform(1, 9, (12, 3, 4)), rng.uniform(0, 3, (12, 3, 4))
    error[rng.uniform(size=error.shape) < 0.2] = np.inf
    counts = rng.poisson(0.2, (11, 2, 3, 4)).astype(np.int32)
    found = bound(light, error, counts, np.zeros(11), ConservationLaw(ON, OFF, dark=0.5), np.arange(12))
    known = error < light + 0.5
    with np.errstate(invalid="ignore", divide="ignore"):
        lower, upper = np.log(light + 0.5 - error), np.log(light + 0.5 + error)
    moved = np.concatenate([np.zeros((1, 3, 4)), np.cumsum(ON * counts[:, 1] - OFF * counts[:, 0], axis=0)])
    highest, lowest = np.where(known, lower - moved, -np.inf), np.where(known, upper - moved, np.inf)
    assert np.allclose(found.excess(), highest.max(axis=0) - lowest.min(axis=0), atol=1e-9)
    assert np.array_equal(found.highest_at, highest.argmax(axis=0))
    assert np.array_equal(found.lowest_at, lowest.argmin(axis=0))


def test_leak_is_taken_off() -> None:
    """A pixel at rest that leaks one brighter event an interval keeps the law only with its drift declared."""
    level, counts = np.zeros((21, 1, 1)), np.zeros((20, 2, 1, 1), np.int32)
    counts[:, 1] = 1
    frames = np.arange(21)
    for drift, broken in ((np.full(20, ON), False), (np.zeros(20), True)):
        found = bound(np.exp(level), 0 * level, counts, drift, LAW, frames)
        assert bool(found.excess() > ON + OFF) == broken


@pytest.mark.parametrize(
    ("values", "on", "broken"),
    [
        ([100, 105, 110], [0, 0], False),
        ([100, 108, 116], [0, 0], True),
        ([100, 108, 116], [0, 1], False),
        ([100, 114, 116], [2, 0], False),
        ([100, 105, 106], [3, 0], True),
    ],
    ids=["still", "dead", "fired", "twice", "too-often"],
)
def test_linear_law_cases(values: list[int], on: list[int], broken: bool) -> None:
    """With thresholds 6 and 8 a silent run spans at most 14; three brighter events mean a rise of 7 at least."""
    counts = np.zeros((2, 2, 1, 1), np.int32)
    counts[:, 1, 0, 0] = on
    assert runs(np.array(values, float).reshape(3, 1, 1), counts).broken.item() == broken
