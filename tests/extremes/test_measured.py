"""Every case of docs/extremes.md keeps within its bound."""

import pytest

from tests.extremes.measured import CASES, Case


@pytest.mark.parametrize("case", CASES, ids=[case.tried for case in CASES])
def test_the_error_is_within_its_bound(case: Case) -> None:
    """Right: no farther from the reference than the bound says."""
    assert case.error() <= case.bound
