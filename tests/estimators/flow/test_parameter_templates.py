"""Small faults of parameters are told from the motion and from each other, and sized."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.flow.motion_fit import FlowSample, fit_motion, twist_statistic
from fedora_qa.estimators.flow.parameter_templates import (
    PARAMETER_TEMPLATES,
    Evidence,
    parameter_templates,
    sum_of,
    weigh_templates,
)
from fedora_qa.geometry.camera import RigidMotion
from tests.estimators.flow.test_motion_fit import MOTION, SIGMA_PX, SPREAD, K, sample


def mounted(rotation_rad: np.ndarray, shift_m: np.ndarray) -> RigidMotion:
    """The motion of points if the true camera is turned and moved back, along the axes of the body."""
    turned = Rotation.from_rotvec(-rotation_rad).as_matrix()
    return RigidMotion(turned.T @ MOTION.R @ turned, turned.T @ (MOTION.R @ -shift_m + MOTION.t_m + shift_m))


def templates_for(fields: FlowSample, motion: RigidMotion) -> np.ndarray:
    """Templates of a camera at the body's origin, with the body's axes, while the body moves steadily."""

    def remounted(rotation_rad: np.ndarray, shift_m: np.ndarray) -> RigidMotion:
        return mounted(rotation_rad, shift_m).corrected(motion.twist_from(MOTION))

    def delayed(seconds: float) -> RigidMotion:
        return motion.corrected(seconds * np.array([0.1, 0.3, -0.2, 0.5, 0.4, -0.3]))

    return parameter_templates(K, motion, fields, remounted, delayed)


def test_a_longer_focal_length_magnifies_about_the_centre() -> None:
    """Of pixels that are askew, too: the image is as of a camera with the right focal length, enlarged."""
    skewed = K + np.array([[0.0, 90.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    true = skewed.copy()
    true[:2, :2] /= 1.002
    fields = sample(K_made=true)
    templates = parameter_templates(skewed, MOTION, fields, lambda *_: MOTION, lambda _: None)
    own = next(fault for fault in PARAMETER_TEMPLATES if fault.parameter == "intrinsics_focal")
    sizes, share = weigh_templates(skewed, MOTION, fields, templates, None, None).explained_by(own.columns)
    assert own.size(sizes) == pytest.approx(0.2, rel=0.01)
    assert share > 0.9999


K_LONG, K_RIGHT = K.copy(), K.copy()
K_LONG[[0, 1], [0, 1]] *= 1 / 1.002
K_RIGHT[0, 2] -= 0.3
FAULTS = {
    "gain": (sample(gain=1.002), "flow_gain", 0.2),
    "focal": (sample(K_made=K_LONG), "intrinsics_focal", 0.2),
    "centre": (sample(K_made=K_RIGHT), "intrinsics_centre", 0.3),
    **{
        f"turned about {axis}": (sample(mounted(np.radians(0.1) * turn, np.zeros(3))), "extrinsic_rotation", 0.1)
        for axis, turn in zip("xyz", np.eye(3), strict=True)
    },
    # Across the axis of the rotation: a shift along it shows nowhere.
    "moved": (sample(mounted(np.zeros(3), 0.02 * np.array([3.0, 2.0, 0.0]) / np.sqrt(13))), "lever_arm", 0.02),
    "late": (sample(MOTION.corrected(0.001 * np.array([0.1, 0.3, -0.2, 0.5, 0.4, -0.3]))), "time_offset", 1.0),
}


@pytest.mark.parametrize(("fields", "cause", "size"), FAULTS.values(), ids=FAULTS)
def test_small_fault_is_explained_by_its_own_template(fields: FlowSample, cause: str, size: float) -> None:
    """Its template explains all but 0.01% of the squares and gives the size; no other explains as much."""
    evidence = weigh_templates(K, MOTION, fields, templates_for(fields, MOTION), None, None)
    explained = {fault.parameter: evidence.explained_by(fault.columns) for fault in PARAMETER_TEMPLATES}
    own = next(fault for fault in PARAMETER_TEMPLATES if fault.parameter == cause)
    assert explained[cause][1] > 0.9999
    assert own.size(explained[cause][0]) == pytest.approx(size, rel=0.01)
    assert max(share for other, (_, share) in explained.items() if other != cause) < explained[cause][1]


def test_each_template_belongs_to_one_parameter() -> None:
    """Their columns follow each other without a gap, and there are no others."""
    count = templates_for(sample(), MOTION).shape[-1]
    columns = [column for fault in PARAMETER_TEMPLATES for column in range(*fault.columns.indices(count))]
    assert columns == list(range(count))


@pytest.mark.parametrize("cause", ["gain", "focal", "centre"])
def test_small_fault_is_found_under_pose_noise(cause: str) -> None:
    """With the correction of the pose eliminated, ten noisy fields still give the size to 2%."""
    _, name, size = FAULTS[cause]
    gain, K_made = (1.002 if cause == "gain" else 1.0), {"focal": K_LONG, "centre": K_RIGHT}.get(cause, K)
    rng = np.random.default_rng(4)
    evidences = []
    for seed in range(10):
        true = MOTION.corrected(np.sqrt(np.diag(SPREAD)) * rng.standard_normal(6))
        fields = sample(true, K_made, gain, seed)
        fit = fit_motion(K, MOTION, fields)
        assert fit is not None
        templates = templates_for(fields, fit.motion)
        evidences.append(weigh_templates(K, MOTION, fields, templates, fit, SPREAD))
    own = next(fault for fault in PARAMETER_TEMPLATES if fault.parameter == name)
    sizes, share = sum_of(evidences).explained_by(own.columns)
    assert own.size(sizes) == pytest.approx(size, rel=0.02)
    assert share > 0.99


def test_what_pose_noise_leaves_is_the_statistic_of_its_twist() -> None:
    """A field that a noisy pose explains keeps as its squares those of the twist in units of the noise."""
    twist = np.sqrt(np.diag(SPREAD)) * np.array([1.0, -0.5, 2.0, 0.5, 1.5, -1.0])
    fields = sample(MOTION.corrected(twist))
    fit = fit_motion(K, MOTION, fields)
    assert fit is not None
    evidence = weigh_templates(K, MOTION, fields, templates_for(fields, fit.motion), fit, SPREAD)
    assert evidence.total == pytest.approx(twist_statistic(fit, SPREAD)[0], rel=0.01)
    assert evidence.total == pytest.approx(np.sum(twist**2 / np.diag(SPREAD)), rel=0.01)


def test_evidence_states_sizes_and_what_they_leave() -> None:
    """Orthogonal templates of information 4 and 25 with the sizes 3 and 2 explain 136 squares of 181, or of 544."""
    matrix, sizes = np.diag([4.0, 25.0]), np.array([3.0, 2.0])
    for total, count, error in ((181.0, 10**4, 0.5), (544.0, 100, 0.5 * np.sqrt(4.08))):
        evidence = Evidence(matrix, matrix @ sizes, total, count)
        fit = evidence.fit(slice(0, 2))
        assert fit.sizes == pytest.approx(sizes)
        assert fit.removed_share == pytest.approx(1 - np.sqrt(1 - 136 / total))
        assert fit.standard_error == pytest.approx(error)
        alone = evidence.along(np.array([1.0, 0.0])).fit(slice(0, 1))
        assert (*alone.sizes, alone.removed_share) == pytest.approx((3.0, 1 - np.sqrt(1 - 36 / total)))
    assert Evidence(matrix, np.zeros(2), 0.0, 10).explained_by(slice(0, 2))[1] == 0.0


def test_points_that_the_camera_passes_tell_nothing() -> None:
    """Pixels whose points lie behind the camera afterwards, whatever flow they have, alter neither fit nor evidence."""
    twist = np.array([0.01, -0.015, 0.02, 0.05, -0.02, 0.03])
    ahead = sample(MOTION.corrected(twist))
    passed = FlowSample(
        np.concatenate((ahead.columns, ahead.columns[:50])),
        np.concatenate((ahead.rows, ahead.rows[:50])),
        np.concatenate((ahead.depths_m, np.full(50, 0.1))),
        np.concatenate((ahead.flow_px, np.full((50, 2), 3.0))),
        SIGMA_PX,
    )
    fits = [fit_motion(K, MOTION, one) for one in (ahead, passed)]
    evidences = []
    for fields, fit in zip((ahead, passed), fits, strict=True):
        assert fit is not None
        np.testing.assert_allclose(fit.twist, twist, atol=1e-9)
        templates = templates_for(fields, fit.motion)
        evidences += [weigh_templates(K, MOTION, fields, templates, fit, SPREAD),
                      weigh_templates(K, MOTION, fields, templates, None, None)]  # fmt: skip
    for one, other in (evidences[::2], evidences[1::2]):
        np.testing.assert_allclose(other.matrix, one.matrix, atol=1e-9 * np.abs(one.matrix).max())
        assert other.total == pytest.approx(one.total, rel=1e-6)
