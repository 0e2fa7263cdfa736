"""Distortion of lenses against OpenCV, its inverse and derivative, and its domain."""

import cv2
import numpy as np
import pytest

from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.lens import (
    compiled,
    distorted,
    distortion_slopes,
    imaged_at,
    largest_radius,
    pixels_of_rays,
    rays_of_pixels,
    undistorted,
)
from fedora_qa.geometry.rigid_flow import depths_by_flow, moved_points, rigid_flow, rounding_px, twist_jacobian
from fedora_qa.geometry.so3 import exp
from fedora_qa.sequence.declared import Lens

LENSES = {
    "of DSEC": Lens("radtan", (-0.37, 0.16, 4e-4, -3e-4)),
    "with k3": Lens("radtan", (-0.28, 0.07, 2e-4, 2e-5, -0.004)),
    "pincushion": Lens("radtan", (0.1, 0.02, 0.0, 0.0)),
    "of TUM-VIE": Lens("equidistant", (0.19, 0.004, 0.0007, -0.0004)),
    "ideal fisheye": Lens("equidistant", (0.0, 0.0, 0.0, 0.0)),
}
K = np.array([[300.0, 0.0, 134.5], [0.0, 310.0, 99.5], [0.0, 0.0, 1.0]])
MOTION = RigidMotion(exp(np.array([0.01, -0.02, 0.03])), np.array([0.05, -0.02, 0.08]))


def rays() -> tuple[np.ndarray, np.ndarray]:
    """Return slopes within 35 degrees of the optical axis, that itself among them."""
    x, y = np.meshgrid(np.linspace(-0.6, 0.6, 13), np.linspace(-0.4, 0.4, 9))
    return x.ravel(), y.ravel()


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_projection_is_that_of_opencv(lens: Lens) -> None:
    """To 1e-11 of the focal length, for both models."""
    x, y = rays()
    points = np.stack((x, y, np.ones_like(x)), axis=-1)[:, None]
    still, coefficients = np.zeros(3), np.array(lens.coefficients)
    project = cv2.projectPoints if lens.model == "radtan" else cv2.fisheye.projectPoints
    expected = project(points, still, still, np.eye(3), coefficients)[0].reshape(-1, 2)
    np.testing.assert_allclose(np.stack(distorted(lens, x, y), axis=-1), expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("lens", [None, *LENSES.values()], ids=["pinhole", *LENSES])
def test_a_point_is_imaged_as_its_ray(lens: Lens | None) -> None:
    """At every depth; a point behind the camera or beyond the domain of the lens is imaged nowhere."""
    x, y = rays()
    expected = np.stack(pixels_of_rays(K, lens, x, y), axis=-1)
    for Z in (0.2, 50.0):
        points = np.stack((x * Z, y * Z, np.full_like(x, Z)), axis=-1)
        np.testing.assert_allclose([imaged_at(K, compiled(lens), *point) for point in points], expected, rtol=1e-12)
    assert np.isnan(imaged_at(K, compiled(lens), 0.1, 0.1, -1.0)).all()
    assert np.isnan(imaged_at(K, compiled(lens), 0.1, 0.1, 0.0)).all()
    if lens is not None and np.isfinite(limit := largest_radius(lens)):
        assert np.isnan(imaged_at(K, compiled(lens), 1.01 * limit, 0.0, 1.0)).all()


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_inverse_is_exact(lens: Lens) -> None:
    """Rays come back to the stated tolerance, over the derivative of the lens."""
    x, y = rays()
    np.testing.assert_allclose(undistorted(lens, *distorted(lens, x, y)), (x, y), rtol=0, atol=1e-12)


def test_inverse_is_that_of_opencv() -> None:
    """OpenCV takes five steps of a fixed point for the radial-tangential model, ten of Newton for the other."""
    x, y = np.meshgrid(np.linspace(-0.2, 0.2, 5), np.linspace(-0.2, 0.2, 5))
    image = np.stack((x.ravel(), y.ravel()), axis=-1)[:, None]
    for name, undistort, tolerance in (
        ("of DSEC", cv2.undistortPoints, 1e-5),
        ("of TUM-VIE", cv2.fisheye.undistortPoints, 1e-8),
    ):
        expected = undistort(image, np.eye(3), np.array(LENSES[name].coefficients)).reshape(-1, 2)
        found = undistorted(LENSES[name], x.ravel(), y.ravel())
        np.testing.assert_allclose(np.stack(found, axis=-1), expected, rtol=0, atol=tolerance)


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_derivative_is_that_of_differences(lens: Lens) -> None:
    """Central differences of 1e-6 agree to 1e-9; on the axis as elsewhere."""
    x, y = rays()
    step = 1e-6
    by_x = (np.array(distorted(lens, x + step, y)) - distorted(lens, x - step, y)) / (2 * step)
    by_y = (np.array(distorted(lens, x, y + step)) - distorted(lens, x, y - step)) / (2 * step)
    expected = np.stack((by_x, by_y), axis=-1).transpose(1, 0, 2)
    np.testing.assert_allclose(distortion_slopes(lens, x, y), expected, rtol=0, atol=1e-9)


def test_nothing_is_imaged_beyond_the_fold() -> None:
    """A barrel of k1 alone folds at r = 1 / sqrt(-3 k1), where it images 2/3 of that radius; beyond there is no ray."""
    lens = Lens("radtan", (-0.3, 0.0, 0.0, 0.0))
    fold = 1 / np.sqrt(0.9)
    assert largest_radius(lens) == pytest.approx(fold)
    inside, outside = np.array([0.999 * fold]), np.array([1.001 * fold])
    zero = np.zeros(1)
    assert undistorted(lens, *distorted(lens, inside, zero))[0] == pytest.approx(inside, abs=1e-9)
    assert np.isnan(distorted(lens, outside, zero)[0]).all()
    assert np.isnan(undistorted(lens, np.array([0.68 * fold]), zero)[0]).all()
    assert largest_radius(LENSES["of DSEC"]) == np.inf == largest_radius(LENSES["ideal fisheye"])


def test_fisheye_sees_almost_to_the_side() -> None:
    """At 89 degrees from the axis an ideal fisheye images a ray at its angle, and gives it back."""
    lens, slope = LENSES["ideal fisheye"], np.array([np.tan(np.deg2rad(89.0))])
    x_d, _ = distorted(lens, slope, np.zeros(1))
    assert x_d == pytest.approx(np.deg2rad(89.0))
    assert undistorted(lens, x_d, np.zeros(1))[0] == pytest.approx(slope, rel=1e-9)
    assert np.isnan(undistorted(lens, np.array([1.6]), np.zeros(1))[0]).all()  # 92 degrees


@pytest.mark.parametrize("lens", [LENSES["of DSEC"], LENSES["of TUM-VIE"]], ids=["radtan", "equidistant"])
def test_flow_is_what_opencv_projects_before_and_after(lens: Lens) -> None:
    """Its derivative is that of differences, and its depths come back from it."""
    columns, rows = (places.ravel() for places in np.meshgrid(np.linspace(5, 260, 9), np.linspace(5, 190, 7)))
    depths_m = np.linspace(2.0, 9.0, columns.size)
    x, y = rays_of_pixels(K, lens, columns, rows)
    points0_m = np.stack((x, y, np.ones_like(x)), axis=-1) * depths_m[:, None]
    project = cv2.projectPoints if lens.model == "radtan" else cv2.fisheye.projectPoints
    R, _ = cv2.Rodrigues(MOTION.R)
    ends = project(points0_m[:, None], R, MOTION.t_m, K, np.array(lens.coefficients))[0].reshape(-1, 2)
    flow_px = rigid_flow(K, MOTION, columns, rows, depths_m, lens)
    np.testing.assert_allclose(flow_px, ends - np.stack((columns, rows), axis=-1), rtol=0, atol=1e-9)
    np.testing.assert_allclose(depths_by_flow(K, MOTION, columns, rows, flow_px, lens), depths_m, rtol=1e-8)
    points1_m = np.stack(moved_points(K, MOTION, columns, rows, depths_m, lens), axis=-1)
    for axis, jacobian in enumerate(np.moveaxis(twist_jacobian(K, points1_m, lens), -1, 0)):
        twist = 1e-6 * np.eye(6)[axis]
        after, before = (
            rigid_flow(K, MOTION.corrected(sign * twist), columns, rows, depths_m, lens) for sign in (1, -1)
        )
        np.testing.assert_allclose(jacobian, (after - before) / 2e-6, rtol=1e-6, atol=1e-4)


@pytest.mark.parametrize("lens", [LENSES["of DSEC"], LENSES["pincushion"], LENSES["of TUM-VIE"]])
def test_rounding_of_depth_and_flow_stays_within_its_bound(lens: Lens) -> None:
    """Millimetres and flow in float32, as files hold them: the bound holds everywhere and is not idle."""
    columns, rows = np.meshgrid(np.arange(270.0), np.arange(200.0))
    depths_m = 2.0 + 0.03 * columns
    flow_px = rigid_flow(K, MOTION, columns, rows, depths_m, lens)
    stored_m = (1000 * depths_m).astype(np.float32) / np.float32(1000)
    stored_px = flow_px.astype(np.float32).astype(np.float64)
    error = np.abs(stored_px - rigid_flow(K, MOTION, columns, rows, stored_m.astype(np.float64), lens))
    bound = rounding_px(K, MOTION, columns, rows, stored_m.astype(np.float64), stored_px, lens=lens)
    assert (error <= bound).all()
    assert bound.max() < 1e-3
