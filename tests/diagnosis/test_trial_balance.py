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


def test_a_fault_that_leaves_less_surpasses_its_approximation() -> None:
    """Both clear one finding; of another one the error of a size leaves 3%, and the approximation 24%."""
    approximation = UndoTrial(GravityError("gravity_sign"), "", frozenset({"F1"}), {"F2": -0.24, "F3": 0.4}, ("a",), 4)
    nearer = UndoTrial(GravityError("gravity_missing"), "", frozenset({"F1", "F3"}), {"F2": 0.03}, ("a",), 4)
    assert nearer.surpasses(approximation)
    assert not approximation.surpasses(nearer)
    assert nearer.removed == {"F1", "F2", "F3"}
    for no_better in (
        replace(nearer, left={"F2": 0.15}),  # more than a tenth of a deviation is left
        replace(approximation, left={"F2": 0.09}, cleared=frozenset({"F3"})),  # what the other clears is not decided
        replace(nearer, caused=("a", "b")),
        replace(nearer, crashed=("flow_geometry.endpoint",)),
        replace(nearer, left={"F2": 0.03, "F4": 0.5}),
    ):
        assert not no_better.surpasses(approximation)
    # The error of a size is no difference.
    assert not nearer.surpasses(replace(approximation, left={"F2": 0.08}))
    exact = replace(nearer, cleared=frozenset({"F1", "F2"}), left={}, caused=())
    assert exact.surpasses(replace(approximation, left={"F2": 0.08}))
    assert not exact.surpasses(approximation), "F3 is not decided"
    with_another = replace(nearer, cleared_alone=frozenset({"F1"}))
    assert not with_another.surpasses(approximation)
