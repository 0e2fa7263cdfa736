"""The motion behind a flow field is recovered, and small faults are told from it and sized."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.flow.motion_fit import (
    PARAMETER_TEMPLATES,
    Evidence,
    FlowSample,
    fit_most,
    fit_motion,
    parallel_sum,
    parameter_templates,
    sum_of,
    twist_statistic,
    weigh_templates,
)
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.rigid_flow import rigid_flow

K = np.array([[600.0, 0.0, 320.0], [0.0, 600.0, 240.0], [0.0, 0.0, 1.0]])
MOTION = RigidMotion(Rotation.from_rotvec([0.02, -0.03, 0.01]).as_matrix(), np.array([0.1, -0.05, -0.4]))
SIGMA_PX = 1e-4
SPREAD = np.diag([0.003, 0.003, 0.003, 0.01, 0.01, 0.01]) ** 2


def sample(motion: RigidMotion = MOTION, K_made: np.ndarray = K, gain: float = 1.0, seed: int = 0) -> FlowSample:
    rng = np.random.default_rng(seed)
    columns, rows, depths_m = rng.uniform(0, 640, 300), rng.uniform(0, 480, 300), rng.uniform(1.0, 20.0, 300)
    flow_px = gain * rigid_flow(K_made, motion, columns, rows, depths_m)
    return FlowSample(columns, rows, depths_m, flow_px, SIGMA_PX)


def test_motion_is_recovered_exactly() -> None:
    """From a start that is off by a degree and 5 cm, to rounding: three-dimensional scenes leave nothing open."""
    twist = np.array([0.01, -0.015, 0.02, 0.05, -0.02, 0.03])
    fit = fit_motion(K, MOTION, sample(MOTION.corrected(twist)))
    assert fit is not None
    np.testing.assert_allclose(fit.twist, twist, atol=1e-9)
    assert np.abs(fit.residual_px).max() < 1e-8


def test_nonsense_is_refused() -> None:
    """A field that no motion explains, hundreds of pixels off, gives no fit rather than a wild one."""
    garbage = sample()
    rng = np.random.default_rng(1)
    wild = FlowSample(garbage.columns, garbage.rows, garbage.depths_m, 5000 * rng.standard_normal((300, 2)), SIGMA_PX)
    assert fit_motion(K, MOTION, wild) is None


@pytest.mark.parametrize("share", [0.25, 0.45])
def test_motion_of_most_pixels_is_recovered_exactly(share: float) -> None:
    """Pixels that move by themselves, anywhere in the image, have no effect as long as they are less than half."""
    twist = np.array([0.01, -0.015, 0.02, 0.05, -0.02, 0.03])
    whole = sample(MOTION.corrected(twist))
    moving = np.random.default_rng(3).random(300) < share
    whole.flow_px[moving] += [8.0, -5.0]
    fit = fit_motion(K, MOTION, whole)
    assert fit is not None
    assert np.abs(fit.twist - twist).max() > 1e-3
    most = fit_most(K, MOTION, whole, fit)
    np.testing.assert_allclose(most.twist, twist, atol=1e-9)
    np.testing.assert_allclose(most.residual_px[moving], np.tile([8.0, -5.0], (moving.sum(), 1)), atol=1e-6)
    np.testing.assert_allclose(most.residual_px[~moving], 0.0, atol=1e-6)


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


def test_correction_is_chi_square_under_its_noise() -> None:
    """Over 400 draws of the declared noise the statistic has mean 6 and variance 12, the moments of chi-square(6)."""
    rng = np.random.default_rng(2)
    statistics = []
    for _ in range(400):
        twist = np.sqrt(np.diag(SPREAD)) * rng.standard_normal(6)
        fit = fit_motion(K, MOTION, sample(MOTION.corrected(twist)))
        assert fit is not None
        statistic, expected = twist_statistic(fit, SPREAD)
        assert expected == pytest.approx(6.0, abs=1e-3)
        statistics.append(statistic)
    assert np.mean(statistics) == pytest.approx(6.0, abs=5 * np.sqrt(12 / 400))
    assert np.var(statistics) == pytest.approx(12.0, rel=0.4)


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


def test_parallel_sum_is_that_of_the_inverses() -> None:
    """Of regular matrices; of a singular one, where only its own directions count; of any size, where 1 is lost."""
    rng = np.random.default_rng(4)
    one, other = (root @ root.T for root in rng.normal(size=(2, 6, 6)))
    np.testing.assert_allclose(parallel_sum(one, other), np.linalg.inv(np.linalg.inv(one) + other), rtol=1e-8)
    flat = np.outer(one[0], one[0])
    limit = flat / (1.0 + one[0] @ other @ one[0])
    np.testing.assert_allclose(parallel_sum(flat, other), limit, atol=1e-9 * np.abs(limit).max())
    huge = 1e30 * np.outer(other[0], other[0])
    left = parallel_sum(one, huge)
    assert np.all(np.isfinite(left))
    assert abs(other[0] @ left @ other[0]) < 1e-12 * (other[0] @ one @ other[0])
