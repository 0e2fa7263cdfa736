"""What the study of confidence says of diagnoses whose shares are known."""

from math import log

import pytest

from fedora_qa.diagnosis.diagnose import UNTHOUGHT
from tests.benchmarks.confidence import SHARPNESSES, Told, log_likelihood, page

SURE = Told("imu:time_offset", "imu:time_offset", (0.0,))
EQUALS = (log(0.5), log(0.5))
RIGHT, WRONG = Told("a", "a", EQUALS), Told("a", "b", EQUALS)


def test_likelihood_of_known_shares() -> None:
    """Of two equals each is right with half of what is left to them, whatever the sharpness."""
    half = (1 - UNTHOUGHT) / 2
    told = log(1 - UNTHOUGHT) + log(half) + log(1 - half)
    assert [log_likelihood([SURE, RIGHT, WRONG], one) for one in SHARPNESSES] == pytest.approx(
        [told] * len(SHARPNESSES)
    )


def test_sharpness_is_found_where_shares_are_true() -> None:
    """Weights 1 and 0.83, of which the first is right four times in five, are shared so by a power of 8."""
    weights = (0.0, log(0.83))
    told = [Told("a", "a", weights)] * 8 + [Told("a", "b", weights)] * 2
    assert max(SHARPNESSES, key=lambda one: log_likelihood(told, one)) == 8.0


def test_page_counts_each_diagnosis_once() -> None:
    """A diagnosis stands in the row of its confidence, with how many of the row are right."""
    lines = list(page([SURE, RIGHT, WRONG]))
    assert lines[0] == "3 diagnoses, 2 right."
    assert lines[2:4] == ["| 30% to 50% | 2 | 49% | 50% |", "| 90% to 100% | 1 | 98% | 100% |"]
