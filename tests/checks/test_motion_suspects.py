"""Rivals of a cause count by what they leave of the motion, against what the cause itself leaves."""

import pytest

from fedora_qa.checks.imu.imu_suspects import suspects_for
from fedora_qa.estimators.fitting.grouped_fit import Fitted
from fedora_qa.views.timing_cues import TimingCues


def weight_of_bias(delay_explains: float, bias_explains: float) -> float:
    """Weight of a gyro's bias behind a delay of 8 ms, by how much either explains."""
    explained = {"time_offset": delay_explains, "bias": bias_explains}
    found = Fitted(0.008, 1e-6, 0.0, free=True, explained=explained)
    suspects = suspects_for("rotation", "time_offset", found, 1.0, TimingCues())
    return next(suspect.weight for suspect in suspects if suspect.cause == "gyro_bias")


def test_a_rival_that_leaves_what_the_cause_explains_is_contradicted() -> None:
    """Of 90% that a bias explains nothing counts where a delay explains everything to a millionth."""
    assert weight_of_bias(1.0 - 1e-6, 0.9) < 0.01
    assert weight_of_bias(1.0, 0.9) == 0.0


@pytest.mark.parametrize("rival", [0.9, 0.95, 1.0])
def test_a_rival_that_leaves_no_more_counts_in_full(rival: float) -> None:
    assert weight_of_bias(0.9, rival) == pytest.approx(0.9 * rival)


def test_a_rival_that_leaves_little_more_stays_likely() -> None:
    """Twice as much is left: by one sample's likelihood, a factor of the square root of two."""
    assert weight_of_bias(0.9, 0.8) == pytest.approx(0.9 * 0.8 / 2**0.5)
