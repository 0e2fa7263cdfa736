"""A bias of a part under noise of the poses that hides it in every single row."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.estimators.imu.noisy_part import noisy_part
from fedora_qa.estimators.imu.samples import ComparisonRows

Float64 = NDArray[np.float64]

ROWS, STEP_S, SIGMA_M = 200, 0.005, 0.005
SEEDS = range(5)


def second_differences(bias: Float64, seed: int) -> ComparisonRows:
    """Rows of positions with noise against forces with a bias (n, 3), in m/s, with the covariance of that noise."""
    noise_m = SIGMA_M * np.random.default_rng(seed).standard_normal((ROWS + 2, 3))
    # (p - 2 p + p) / dt has the variance 6, and the covariances -4 and 1 with the next two rows.
    residuals = np.diff(noise_m, 2, axis=0) / STEP_S + STEP_S * bias
    bands = np.array([1.0, -4.0, 6.0])[:, None] * np.ones(ROWS) * (SIGMA_M / STEP_S) ** 2
    jacobians = STEP_S * np.broadcast_to(np.eye(3), (ROWS, 3, 3))
    times_s = STEP_S * np.arange(ROWS, dtype=np.float64)
    return ComparisonRows(
        np.arange(ROWS), times_s, np.full(ROWS, STEP_S), residuals, np.zeros((ROWS, 3)),
        jacobians, jacobians, np.stack([bands] * 3),
    )  # fmt: skip


def part_of(bias: Float64, seed: int) -> tuple[ComparisonRows, tuple[float, float] | None]:
    """Return the rows, and the ends of the part, where a bias of the whole is all that is fitted beside it."""
    rows = second_differences(bias, seed)
    part = noisy_part([rows], [rows.residuals], centre=0.0, parameters=3)
    return rows, None if part is None else (part.start_s, part.stop_s)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_bias_that_no_row_shows_is_placed(seed: int) -> None:
    """A row has a noise of 2.4 m/s; 3 m/s^2 are 0.015 m/s in each, and are placed to a twentieth of the sequence."""
    bias = np.zeros((ROWS, 3))
    bias[60:140] = [0.0, 3.0, 0.0]
    rows, part = part_of(bias, seed)
    assert np.abs(rows.residuals).max() < 5 * np.sqrt(6) * SIGMA_M / STEP_S
    assert part == pytest.approx((60 * STEP_S, 140 * STEP_S), abs=0.05 * ROWS * STEP_S)


@pytest.mark.parametrize("seed", SEEDS)
def test_noise_alone_has_no_part(seed: int) -> None:
    assert part_of(np.zeros((ROWS, 3)), seed)[1] is None


def test_what_the_whole_explains_is_no_part() -> None:
    """Where parameters of the whole leave noise alone, no part is asked for."""
    bias = np.zeros((ROWS, 3))
    bias[60:140] = [0.0, 3.0, 0.0]
    rows = second_differences(bias, 0)
    assert noisy_part([rows], [rows.residuals - STEP_S * bias], centre=0.0, parameters=3) is None
