"""Errors of flow: closed forms, and sums that depend on no order."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.scoring.metrics import ErrorSums, Partition, flow_accuracy, flow_errors, whole_image
from fedora_qa.scoring.types import FlowAccuracy

Array = np.ndarray[Any, Any]

TRUE_PX = np.random.default_rng(0).integers(-80, 81, (8, 10, 2)).astype(np.float32) / 8
"""Multiples of 1/8 px, so that sums and differences are exact."""


def accuracy(truth_px: Array, predicted_px: Array) -> FlowAccuracy:
    """The accuracy over all pixels of one field."""
    sums = ErrorSums()
    sums.add(*flow_errors(truth_px, predicted_px), [whole_image(*truth_px.shape[:2])])
    ((key, totals),) = sums.totals().items()
    return flow_accuracy(key, totals)


def test_a_constant_error_is_the_average() -> None:
    """Truth and (3/8, 1/2) px more has AEE 5/8 px exactly, in every pixel below 1 px."""
    scored = accuracy(TRUE_PX, TRUE_PX + np.float32([0.375, 0.5]))
    assert scored.aee_px == 0.625
    assert (scored.above_1px, scored.outliers) == (0.0, 0.0)


def test_a_gain_is_the_normalised_error() -> None:
    """Truth times 1.1 has NAEE 0.1, whatever the flow."""
    assert accuracy(TRUE_PX, 1.1 * TRUE_PX.astype(np.float64)).naee == pytest.approx(0.1, rel=1e-12)


def test_zero_flow_has_a_normalised_error_of_one() -> None:
    """Exactly: its error is the flow itself."""
    assert accuracy(TRUE_PX, np.zeros_like(TRUE_PX)).naee == 1.0
    assert accuracy(np.zeros_like(TRUE_PX), TRUE_PX).naee is None


@pytest.mark.parametrize(("error_px", "flow_px", "shares"), [
    (1.0, 10.0, (0, 0, 0, 0)),
    (1.5, 10.0, (1, 0, 0, 0)),
    (2.5, 10.0, (1, 1, 0, 0)),
    (3.5, 10.0, (1, 1, 1, 1)),
    (3.5, 80.0, (1, 1, 1, 0)),
    (4.5, 80.0, (1, 1, 1, 1)),
])  # fmt: skip
def test_shares_above(error_px: float, flow_px: float, shares: tuple[float, ...]) -> None:
    """A limit itself is not exceeded; KITTI's outlier exceeds 3 px and 5% of the flow."""
    scored = accuracy(np.full((2, 2, 2), [flow_px, 0.0]), np.full((2, 2, 2), [flow_px, error_px]))
    assert (scored.above_1px, scored.above_2px, scored.above_3px, scored.outliers) == shares


def test_angle() -> None:
    """Between (0, 0, 1) and (1, 0, 1) lie 45 degrees; tiny angles keep their digits."""
    still = np.zeros((2, 2, 2))
    assert accuracy(still, np.full((2, 2, 2), [1.0, 0.0])).angular_error_deg == pytest.approx(45.0, rel=1e-12)
    tiny = accuracy(still, np.full((2, 2, 2), [1e-9, 0.0])).angular_error_deg
    assert tiny == pytest.approx(np.degrees(1e-9), rel=1e-9)


def test_only_what_is_valid_and_predicted_counts() -> None:
    """Truth that is NaN is left out; a prediction that is NaN or infinite lowers the coverage, and is no error."""
    truth_px, predicted_px = TRUE_PX.copy(), TRUE_PX + np.float32([0.375, 0.5])
    truth_px[0] = np.nan
    predicted_px[1, :, 0], predicted_px[2] = np.nan, np.inf
    scored = accuracy(truth_px, predicted_px)
    assert (scored.valid_pixels, scored.scored_pixels, scored.aee_px) == (70, 50, 0.625)
    assert scored.coverage == 50 / 70
    assert scored.mean_flow_px == np.linalg.norm(TRUE_PX[3:].astype(float), axis=-1).mean()
    nothing = accuracy(TRUE_PX, np.full_like(TRUE_PX, np.nan))
    assert (nothing.coverage, nothing.aee_px, nothing.naee) == (0.0, None, None)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1 << 20), count=st.integers(1, 6))
def test_order_changes_nothing(seed: int, count: int) -> None:
    """The totals of fields in any order are the same to the last bit."""
    random = np.random.default_rng(seed)
    fields = [
        (random.normal(size=(5, 6, 2)), random.normal(size=(5, 6, 2)), random.integers(-1, 2, (5, 6)).astype(np.int8))
        for _ in range(count)
    ]
    for _, predicted_px, _ in fields:
        predicted_px[random.random((5, 6)) < 0.2] = np.nan

    def summed(part: list[Any]) -> ErrorSums:
        sums = ErrorSums()
        for truth_px, predicted_px, labels in part:
            parts = [whole_image(5, 6), Partition("depth", ("near", "far"), labels)]
            sums.add(*flow_errors(truth_px, predicted_px), parts)
        return sums

    whole = summed(fields).totals()
    assert summed([fields[i] for i in random.permutation(count)]).totals() == whole
    parts = [totals["valid"] for key, totals in whole.items() if key[0] == "depth"]
    assert sum(parts) == sum((labels >= 0).sum() for _, _, labels in fields)
