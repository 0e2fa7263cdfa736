"""The delay of events against a known level, from the sums of events over an interval."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.estimators.events.tracked_level import (
    COLUMNS,
    DELAYS_MS,
    THRESHOLDS,
    DelayFit,
    DelaySums,
    columns_of_levels,
    fit_delay,
)

Floats = NDArray[np.float64]
STEP_MS, STEPS, BEFORE = 2.5, 8, 3
HALF_MS = STEP_MS * STEPS
PIXELS, PARTS, FRAMES = 400, 9, 8
TIMES_MS = np.arange(-BEFORE * STEPS, STEPS + 2) * STEP_MS


def sums_of_frame(
    rng: np.random.Generator, delay_ms: float, shift_px: float = 0.0, threshold: float = 0.2, sign: float = 1.0
) -> DelaySums:
    """Waves of random lengths that pass pixels at random speeds; events of a sensor of random phases."""
    parts = rng.integers(0, PARTS, PIXELS)
    velocities, waves = rng.uniform(-0.15, 0.15, PIXELS), rng.uniform(0.6, 1.6, PIXELS)
    phases, contrasts = rng.uniform(0, 2 * np.pi, PIXELS), rng.uniform(0.3, 1.0, PIXELS)

    def level(time_ms: float, right_px: float = 0.0) -> NDArray[np.float32]:
        """Of pixels at an instant, px/ms times ms being px."""
        values = contrasts * np.sin(waves * (right_px - velocities * time_ms) + phases)
        return np.asarray(values.astype(np.float32))

    levels = np.stack([level(time_ms) for time_ms in TIMES_MS])
    change = level(HALF_MS, -0.5) - level(-HALF_MS, -0.5) - (level(HALF_MS, 0.5) - level(-HALF_MS, 0.5))
    shifts = np.stack([change, rng.normal(size=PIXELS).astype(np.float32)])
    # A sensor whose references follow exactly, long before the first delay and in small steps.
    fine_ms = np.arange(-200.0, HALF_MS + 60.0, 0.25)
    reference, counts = level(fine_ms[0]) + rng.uniform(-threshold, threshold, PIXELS), np.zeros(PIXELS)
    total = []
    for time_ms in fine_ms:
        crossed = np.trunc((level(time_ms, -shift_px) - reference) / threshold)
        reference, counts = reference + threshold * crossed, counts + sign * crossed
        total.append(counts)
    history = np.array(total)

    def sums_until(time_ms: float) -> Floats:
        return np.asarray(history[int(np.searchsorted(fine_ms, time_ms))])

    events = np.array(
        [sums_until(moved + HALF_MS - delay_ms) - sums_until(moved - HALF_MS - delay_ms) for moved in DELAYS_MS]
    )
    products = np.zeros((2, len(THRESHOLDS), PARTS, COLUMNS, COLUMNS))
    projections = np.zeros((2, len(THRESHOLDS), PARTS, len(DELAYS_MS), COLUMNS))
    for k, response in enumerate((levels, levels**3)):
        for j, tried in enumerate(THRESHOLDS):
            ends = (BEFORE - 1) * STEPS, (BEFORE + 1) * STEPS
            columns = columns_of_levels(response, shifts, tried, STEP_MS, ends)
            for part in range(PARTS):
                inside = columns[:, parts == part]
                products[k, j, part] = inside @ inside.T
                projections[k, j, part] = events[:, parts == part] @ inside.T
    squares = np.array([np.sum(events[:, parts == part] ** 2, axis=1) for part in range(PARTS)])
    return DelaySums(*(each.astype(np.float32) for each in (products, projections, squares)))


def fit(delay_ms: float, shift_px: float = 0.0, threshold: float = 0.2, sign: float = 1.0) -> DelayFit:
    rng = np.random.default_rng(1)
    fitted = fit_delay([sums_of_frame(rng, delay_ms, shift_px, threshold, sign) for _ in range(FRAMES)])
    assert fitted is not None
    return fitted


@pytest.mark.parametrize("delay_ms", [-20.0, -5.0, 0.0, 2.0, 5.0, 20.0])
def test_a_delay_is_recovered(delay_ms: float) -> None:
    """To a fraction of a millisecond, though the events of a pixel lag behind the level by several."""
    fitted = fit(delay_ms)
    assert fitted.delay_ms == pytest.approx(delay_ms, abs=0.4)
    assert fitted.standard_error_ms < 0.4


@pytest.mark.parametrize("threshold", [0.1, 0.3])
def test_the_threshold_is_estimated(threshold: float) -> None:
    """It need not be declared, and the lag that it gives is no delay."""
    fitted = fit(0.0, threshold=threshold)
    assert fitted.threshold == pytest.approx(threshold, rel=0.15)
    assert fitted.delay_ms == pytest.approx(0.0, abs=0.4)


def test_a_shift_is_no_delay() -> None:
    """Events that all lie 0.3 px to the right: velocities of both signs separate it from a delay."""
    assert fit(0.0, shift_px=0.3).delay_ms == pytest.approx(0.0, abs=0.5)


def test_polarity_has_no_effect() -> None:
    """Inverted events have a negative gain and the same delay."""
    fitted = fit(5.0, sign=-1.0)
    assert fitted.gain < 0
    assert fitted.delay_ms == pytest.approx(5.0, abs=0.4)


def test_few_frames_give_no_delay() -> None:
    """Their scatter states no error."""
    rng = np.random.default_rng(1)
    assert fit_delay([sums_of_frame(rng, 0.0) for _ in range(3)]) is None
    assert fit_delay([]) is None


def test_the_mean_reference_follows_like_a_play() -> None:
    """The columns have the mean of the events of many sensors of random phases, for a level that turns back."""
    threshold, ends = 0.2, ((BEFORE - 1) * STEPS, (BEFORE + 1) * STEPS)
    rng = np.random.default_rng(2)
    turning = np.concatenate([np.linspace(0, 1.0, 12), np.linspace(0.97, 0.5, len(TIMES_MS) - 12)]).astype(np.float32)
    levels = np.repeat(turning[:, np.newaxis], 20_000, axis=1)
    reference, counts = levels[0] + rng.uniform(-threshold, threshold, levels.shape[1]), []
    sums = np.zeros(levels.shape[1])
    for level in levels:
        crossed = np.trunc((level - reference) / threshold)
        reference, sums = reference + threshold * crossed, sums + crossed
        counts.append(sums.mean())
    columns = columns_of_levels(levels[:, :1], np.zeros((2, 1), np.float32), threshold, STEP_MS, ends)
    assert columns[0, 0] / threshold == pytest.approx(counts[ends[1]] - counts[ends[0]], abs=0.02)
