"""Errors of depth and disparity in closed form."""

import math
from typing import Any

import numpy as np
import pytest

from fedora_qa.scoring.metrics import ErrorSums, depth_accuracy, depth_errors, whole_image
from fedora_qa.scoring.types import DepthAccuracy

Array = np.ndarray[Any, Any]

TRUE_M = np.random.default_rng(0).integers(1, 64, (8, 10)).astype(np.float64) / 4


def accuracy(truth_m: Array, predicted_m: Array) -> DepthAccuracy:
    """The accuracy over all pixels of one frame."""
    sums = ErrorSums()
    sums.add(*depth_errors(truth_m, predicted_m), [whole_image(*truth_m.shape)])
    ((key, totals),) = sums.totals().items()
    return depth_accuracy(key, totals)


def test_a_gain() -> None:
    """Depth a quarter too large: disparity is a fifth too small, and every ratio lies at 1.25 or within."""
    scored = accuracy(TRUE_M, 1.25 * TRUE_M)
    assert scored.abs_rel == pytest.approx(0.25, rel=1e-12)
    assert scored.nade == pytest.approx(0.2, rel=1e-12)
    assert scored.log_rmse == pytest.approx(math.log(1.25), rel=1e-12)
    assert scored.mean_log_error == pytest.approx(math.log(1.25), rel=1e-12)
    assert scored.within_1_25 == 0.0
    assert accuracy(TRUE_M, TRUE_M / 1.2).within_1_25 == 1.0


def test_a_constant_error() -> None:
    """Depth half a metre too large has an RMSE of half a metre exactly."""
    scored = accuracy(TRUE_M, TRUE_M + 0.5)
    assert scored.rmse_m == 0.5
    assert scored.ade_per_m == pytest.approx(float(np.mean(1 / TRUE_M - 1 / (TRUE_M + 0.5))), rel=1e-12)
    assert scored.mean_disparity_per_m == pytest.approx(float(np.mean(1 / TRUE_M)), rel=1e-12)


def test_normalised_disparity_has_no_unit() -> None:
    """NADE of 1/Z is that of f B / Z in px: focal length and baseline cancel."""
    predicted_m = TRUE_M * np.random.default_rng(1).uniform(0.8, 1.2, TRUE_M.shape)
    disparity_px, predicted_px = 550 * 0.6 / TRUE_M, 550 * 0.6 / predicted_m
    assert accuracy(TRUE_M, predicted_m).nade == pytest.approx(
        np.abs(predicted_px - disparity_px).mean() / disparity_px.mean(), rel=1e-12
    )


def test_only_what_is_valid_and_predicted_counts() -> None:
    """Depths of 0, below 0, NaN and infinity are none, of the truth and of a prediction."""
    truth_m, predicted_m = TRUE_M.copy(), TRUE_M + 0.5
    truth_m[0] = [np.nan, np.inf, 0, -1, -np.inf] * 2
    predicted_m[1] = [np.nan, np.inf, 0, -1, -np.inf] * 2
    scored = accuracy(truth_m, predicted_m)
    assert (scored.valid_pixels, scored.scored_pixels, scored.rmse_m) == (70, 60, 0.5)
    assert scored.mean_disparity_per_m == pytest.approx(float(np.mean(1 / TRUE_M[2:])), rel=1e-12)
