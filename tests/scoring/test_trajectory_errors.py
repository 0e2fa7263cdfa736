"""Errors of trajectories beside those of evo, and in closed form."""

from dataclasses import asdict

import numpy as np
import pytest
from evo.core import metrics, trajectory
from evo.core.geometry import umeyama_alignment
from scipy.spatial.transform import Rotation

from fedora_qa.scoring.metrics import Poses, absolute_errors, aligned, normalised_errors, relative_errors
from fedora_qa.scoring.types import Alignment
from tests.support.motion_world import RESTLESS

TIMES_S = np.arange(120) / 50
TRUE: Poses = (RESTLESS.positions_m(TIMES_S), RESTLESS.orientations(TIMES_S).as_quat())
STATISTICS = ("rmse", "mean", "median", "std", "min", "max")


def drifting() -> Poses:
    """The truth scaled, turned, moved and disturbed, so that every alignment gives another error."""
    random = np.random.default_rng(2)
    turn = Rotation.from_euler("ZYX", [0.5, -0.2, 0.1])
    positions = 1.3 * turn.apply(TRUE[0]) + [3.0, -1.0, 0.5] + random.normal(0, 0.02, TRUE[0].shape)
    orientations = turn * Rotation.from_quat(TRUE[1]) * Rotation.from_rotvec(random.normal(0, 0.03, TRUE[0].shape))
    return positions, orientations.as_quat()


def path_of(poses: Poses) -> trajectory.PoseTrajectory3D:
    """The poses as evo has them."""
    return trajectory.PoseTrajectory3D(poses[0], poses[1][:, [3, 0, 1, 2]], TIMES_S)


@pytest.mark.parametrize("alignment", ["none", "rigid", "similarity"])
def test_absolute_errors_are_those_of_evo(alignment: Alignment) -> None:
    """All statistics of translation and rotation, as predicted, aligned, and aligned with scale."""
    estimate = path_of(drifting())
    if alignment != "none":
        estimate.align(path_of(TRUE), correct_scale=alignment == "similarity")
    ours = list(absolute_errors(TRUE, drifting(), alignment))
    relations = (metrics.PoseRelation.translation_part, metrics.PoseRelation.rotation_angle_deg)
    for error, relation in zip(ours, relations, strict=True):
        theirs = metrics.APE(relation)
        theirs.process_data((path_of(TRUE), estimate))
        expected = theirs.get_all_statistics()
        assert {name: asdict(error)[name] for name in STATISTICS} == pytest.approx(
            {name: expected[name] for name in STATISTICS}, rel=1e-9
        )


@pytest.mark.parametrize("delta", [1, 50])
def test_relative_errors_are_those_of_evo(delta: int) -> None:
    """All pairs so many poses apart; of one pose that is evo's default."""
    ours = list(relative_errors(TRUE, drifting(), delta))
    relations = (metrics.PoseRelation.translation_part, metrics.PoseRelation.rotation_angle_deg)
    for error, relation in zip(ours, relations, strict=True):
        theirs = metrics.RPE(relation, delta=delta, delta_unit=metrics.Unit.frames, all_pairs=delta > 1)
        theirs.process_data((path_of(TRUE), path_of(drifting())))
        assert error.count == len(theirs.error) == len(TIMES_S) - delta
        expected = theirs.get_all_statistics()
        assert {name: asdict(error)[name] for name in STATISTICS} == pytest.approx(
            {name: expected[name] for name in STATISTICS}, rel=1e-7
        )


def test_relative_errors_do_not_see_a_motion_of_the_whole() -> None:
    """A path that is turned and moved as a whole has no relative error; too few poses have none."""
    turn = Rotation.from_euler("ZYX", [0.5, -0.2, 0.1])
    moved = turn.apply(TRUE[0]) + np.array([3.0, -1.0, 0.5]), (turn * Rotation.from_quat(TRUE[1])).as_quat()
    assert [error.max for error in relative_errors(TRUE, moved, 1)] == pytest.approx([0, 0], abs=1e-6)
    assert [error.max for error in absolute_errors(TRUE, moved, "rigid")] == pytest.approx([0, 0], abs=1e-6)
    assert list(relative_errors(TRUE, moved, len(TIMES_S))) == []


def test_positions_on_a_line_determine_no_alignment() -> None:
    """As a rotation about the line changes no distance; evo raises there. A mirrored path is not mirrored back."""
    line = np.outer(np.arange(5.0), [1.0, 2.0, 3.0]), np.tile([0.0, 0.0, 0.0, 1.0], (5, 1))
    assert aligned(line, line, with_scale=False) is None
    mirrored = TRUE[0] * [1, 1, -1], TRUE[1]
    placed = aligned(TRUE, mirrored, with_scale=False)
    assert placed is not None
    R, centre, _ = umeyama_alignment(mirrored[0].T, TRUE[0].T)
    np.testing.assert_allclose(placed[0], mirrored[0] @ R.T + centre, atol=1e-12)


def test_normalised_errors_by_hand() -> None:
    """Truth times 1.1 errs by 0.1 of its mean, of poses and of motions."""
    angles = np.linspace(0.1, 1.0, 10)
    truth = np.outer(angles, [3.0, 0.0, 4.0]), Rotation.from_rotvec(np.outer(angles, [0, 0, 1.0])).as_quat()
    predicted = 1.1 * truth[0], Rotation.from_rotvec(np.outer(1.1 * angles, [0, 0, 1.0])).as_quat()
    errors = {error.quantity: error for error in normalised_errors(truth, predicted)}
    for quantity in ("pose position", "pose orientation", "motion orientation"):
        assert errors[quantity].nae == pytest.approx(0.1, rel=1e-9)
    assert errors["pose position"].mean_truth == pytest.approx(5 * angles.mean())
    assert errors["pose orientation"].mean_truth == pytest.approx(angles.mean())
    assert errors["motion orientation"].mean_error == pytest.approx(0.01)


def test_a_still_path_has_no_normalised_motion() -> None:
    """Nothing is divided by a mean truth of 0; a single pose has no motion."""
    still = np.tile([1.0, 2.0, 2.0], (4, 1)), np.tile([0.0, 0.0, 0.0, 1.0], (4, 1))
    assert [error.nae for error in normalised_errors(still, still)] == [0.0, None, None, None]
    assert len(list(normalised_errors((still[0][:1], still[1][:1]), (still[0][:1], still[1][:1])))) == 2
