"""Noise is known by events without company, as many everywhere."""

import numpy as np
import pytest

from fedora_qa.estimators.events.rates import count_lone_events

SHAPE, INTERVALS, STEP_S = (80, 96), 50, 0.02
STEPS_NS = np.full(INTERVALS, 20_000_000)


def noise_events(rate_hz: float) -> np.ndarray[tuple[int, ...], np.dtype[np.int32]]:
    random = np.random.default_rng(5)
    return random.poisson(rate_hz * STEP_S / 2, (INTERVALS, 2, *SHAPE)).astype(np.int32)


@pytest.mark.parametrize("rate_hz", [1.0, 8.0])
def test_the_rate_of_noise_is_measured_beside_edges(rate_hz: float) -> None:
    """Thousands of events in a part of the image change the rate of the others by less than their Poisson error."""
    counts = noise_events(rate_hz)
    counts[:, 0, 40:, :20] += 3
    lone = count_lone_events(counts, STEPS_NS)
    tile_seconds = np.prod(SHAPE) * INTERVALS * STEP_S / 64
    assert lone.mean_rate_hz == pytest.approx(rate_hz, rel=0.05)
    # The lower quartile of 64 rates lies 0.67 of their standard deviations below the rate; silence takes its share.
    assert (
        1.0 - 3.0 / np.sqrt(rate_hz * tile_seconds * np.exp(-9 * rate_hz * STEP_S)) < lone.quiet_rate_hz / rate_hz < 1
    )


def test_what_edges_leave_alone_is_not_everywhere() -> None:
    """Lone events along one column fill no quiet tile."""
    counts = np.zeros((INTERVALS, 2, *SHAPE), np.int32)
    counts[:, 1, ::4, 50] = 1
    lone = count_lone_events(counts, STEPS_NS)
    assert lone.mean_rate_hz > 0
    assert lone.quiet_rate_hz == 0


def test_intervals_add_up() -> None:
    """Two halves are the whole, to the last bit."""
    counts, intervals_ns = noise_events(2.0), 20_000_000 + np.arange(INTERVALS)
    whole = count_lone_events(counts, intervals_ns)
    halves = count_lone_events(counts[:20], intervals_ns[:20]) + count_lone_events(counts[20:], intervals_ns[20:])
    assert np.array_equal(whole.lone, halves.lone)
    assert whole.quiet_rate_hz == halves.quiet_rate_hz


@pytest.mark.parametrize("shape", [(2, 9), (5, 11), (24, 37)])
def test_pixels_are_counted_by_tile(shape: tuple[int, int]) -> None:
    """A loop over pixels with nine pixels each counts the same, in images of fewer pixels than tiles as well."""
    counts = np.random.default_rng(7).poisson(0.05, (1, 2, *shape)).astype(np.int32)
    events, expected = counts[0].sum(axis=0), np.zeros((2, 8, 8), np.int64)
    for row in range(1, shape[0] - 1):
        for column in range(1, shape[1] - 1):
            own = events[row, column]
            if own <= 1 and events[row - 1 : row + 2, column - 1 : column + 2].sum() == own:
                expected[own, row * 8 // shape[0], column * 8 // shape[1]] += 1
    lone = count_lone_events(counts, np.array([1]))
    assert np.array_equal([lone.silent, lone.lone], expected)
    assert np.array_equal(lone.weighted_ns, lone.silent)
