"""Each check that can fail has its hypotheses."""

from fedora_qa.checks import CHECKS
from fedora_qa.diagnosis.hypotheses import PROPOSALS


def test_every_check_has_a_proposal_in_the_order_of_checks() -> None:
    """An alarm of any check gives rise to hypotheses; without a row it would be an error after the pass."""
    assert list(PROPOSALS) == [check.name for check in CHECKS]
