"""Each check that can fail has its hypotheses."""

from fedora_qa.checks import CHECKS
from fedora_qa.diagnosis.hypotheses import PROPOSALS


def test_proposals_are_of_checks_and_in_their_order() -> None:
    names = [check.name for check in CHECKS]
    assert list(PROPOSALS) == [name for name in names if name in PROPOSALS]
    assert set(PROPOSALS) <= set(names)
