"""Which trial counts more: of mechanisms of a cause, and of rivals whose faults were undone alone or with others."""

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


def test_what_clears_because_of_another_fault_is_no_advantage_over_a_rival() -> None:
    """A rival is tried alone: late events and early frames clear the same timing, whatever else was undone with one."""
    rival = UndoTrial(GravityError("gravity_sign"), "", frozenset({"F3"}), {"F1": 0.99}, (), 4)
    alone = UndoTrial(GravityError("gravity_missing"), "", frozenset({"F3"}), {"F1": 0.99}, (), 4)
    with_another = replace(alone, cleared=frozenset({"F1", "F3"}), cleared_alone=alone.cleared, left={})
    assert rival.clears_as_much_as(alone)
    assert rival.clears_as_much_as(with_another)
    assert not rival.clears_as_much_as(replace(alone, cleared=frozenset({"F1", "F3"}), left={}))
