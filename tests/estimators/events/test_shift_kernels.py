"""Change of frames and events of an interval, against NumPy."""

import numpy as np
import pytest

from fedora_qa.estimators.events.shift_kernels import change_and_events

SHAPE = (12, 17)


def compared(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    before, after = rng.normal(size=(2, *SHAPE)).astype(np.float32)
    errors = rng.uniform(0.01, 0.1, (2, *SHAPE))
    errors[0, :2], errors[1, :, 3] = np.inf, np.nan
    return before, after, errors[0], errors[1], rng.poisson(0.4, (2, *SHAPE)).astype(np.int32)


@pytest.mark.parametrize("seed", range(4))
def test_pixels_that_are_known_and_fired_one_way_count(seed: int) -> None:
    before, after, error_before, error_after, counts = compared(seed)
    change, events, usable, sums = change_and_events(before, after, error_before, error_after, counts)

    expected = np.isfinite(error_before) & np.isfinite(error_after) & ~((counts > 0).all(axis=0))
    step = np.abs(after.astype(np.float64) - before)
    fired = counts.sum(axis=0)
    assert 0 < np.count_nonzero(expected) < expected.size
    np.testing.assert_array_equal(usable, expected)
    np.testing.assert_array_equal(change, np.where(expected, step, 0.0))
    np.testing.assert_array_equal(events, np.where(expected, fired, 0))
    assert sums == pytest.approx(
        [
            expected.sum(),
            fired[expected].sum(),
            expected.sum() * step[expected].var(),
            expected.sum() * fired[expected].var(),
        ]
    )


def test_nothing_known_tells_nothing() -> None:
    before, after, error, _, counts = compared(0)
    change, events, usable, sums = change_and_events(before, after, np.full_like(error, np.inf), error, counts)
    assert not usable.any()
    assert not change.any()
    assert not events.any()
    assert sums.tolist() == [0.0] * 4
