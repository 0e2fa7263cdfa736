"""Changes of the level by the events on both sides of a frame, against integrals and against a slow form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from fedora_qa.estimators.events.levels import level_changes, mean_level
from fedora_qa.estimators.events.pixels import by_pixel

SHAPE = 3, 5
THRESHOLDS = 0.2, 0.3


@settings(max_examples=100, deadline=None)
@given(st.floats(0, 1), st.floats(0.05, 1), st.floats(0.05, 1))
def test_mean_level_is_the_mean_over_excursions(share: float, last: float, following: float) -> None:
    """The mean over o in [0, U) of a level that rises by o and falls by o + D at constant speed."""

    def level(excursion: float) -> float:
        path = share * (2 * excursion + following)
        return min(path, 2 * excursion - path)

    turn = share * following / (1 - 2 * share) if share < 0.5 else last
    mean = quad(level, 0, last, points=[min(turn, last)])[0] / last
    assert mean_level(share, True, last, following) == pytest.approx(mean, abs=1e-9)
    assert mean_level(share, False, last, following) == pytest.approx(share * following)


@pytest.mark.parametrize("turned", [True, False])
def test_levels_meet_the_references_at_events(turned: bool) -> None:
    """0 at the first event, and a threshold up or down at the second."""
    assert mean_level(0.0, turned, 0.2, 0.3) == pytest.approx(0)
    assert mean_level(1.0, turned, 0.2, 0.3) == pytest.approx(-0.3 if turned else 0.3)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_changes_are_those_of_a_slow_form(seed: int) -> None:
    """The level follows from the last event and the next one, or is the reference where one of them is missing."""
    rng = np.random.default_rng(seed)
    count = 60
    times_ns, pixels = np.sort(rng.choice(1000, count, replace=False)), rng.integers(0, 15, count)
    brighter = rng.integers(0, 2, count)
    frames_ns = tuple(sorted(rng.integers(200, 800, 2).tolist()))
    events = by_pixel(
        (pixels % 5).astype(np.uint16), (pixels // 5).astype(np.uint16), times_ns, brighter.astype(np.uint8), SHAPE
    )
    found = level_changes(events, SHAPE, frames_ns, THRESHOLDS)
    for pixel in range(15):
        own = np.flatnonzero(pixels == pixel)
        levels, known = [], 0
        for frame in frames_ns:
            before, after = own[times_ns[own] <= frame], own[times_ns[own] > frame]
            reference = np.sum(np.where(brighter[before] > 0, THRESHOLDS[1], -THRESHOLDS[0]))
            known += bool(len(before) and len(after))
            if not len(before) or not len(after):
                levels.append((reference, reference))
                continue
            (last, following), sign = (before[-1], after[0]), 2 * brighter[before[-1]] - 1
            share = (frame - times_ns[last]) / (times_ns[following] - times_ns[last])
            turned = bool(brighter[last] != brighter[following])
            size = THRESHOLDS[brighter[following]]
            levels.append((
                reference + sign * mean_level(share, turned, THRESHOLDS[brighter[last]], size),
                reference + sign * share * (-size if turned else size),
            ))  # fmt: skip
        row, column = divmod(pixel, 5)
        assert found.is_known[row, column] == (known == 2)
        assert (found.mean[row, column], found.line[row, column]) == pytest.approx(np.subtract(levels[1], levels[0]))
