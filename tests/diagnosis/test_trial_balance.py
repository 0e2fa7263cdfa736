"""Which of several mechanisms of a cause is kept: what a trial has revealed does not count against it."""

from dataclasses import replace

from fedora_qa.diagnosis.conclusion import UndoTrial
from fedora_qa.faults.gravity import GravityError


def test_what_the_plain_run_could_not_have_shown_does_not_count_against_a_trial() -> None:
    """Two findings that a trial causes outweigh the one that it clears, unless they were hidden before."""
    codes = ("imu.timing.clock_rate", "imu.timing.time_offset")
    clearing = UndoTrial(GravityError("gravity_missing"), "", frozenset({"F1"}), {}, codes, 4)
    deciding_nothing = UndoTrial(GravityError("gravity_sign"), "", frozenset(), {}, codes[:1], 4)
    assert clearing.balance < deciding_nothing.balance
    assert replace(clearing, revealed=frozenset(codes)).balance > deciding_nothing.balance
