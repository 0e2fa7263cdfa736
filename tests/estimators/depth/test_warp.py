"""Depth carried to another frame agrees there to rounding, but where something else is seen."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.depth.inverse_depth import depth_image
from fedora_qa.estimators.depth.warp import (
    DepthLattice,
    DepthModel,
    lattice_of,
    lattice_stride,
    ray_lengths,
    residuals_after,
    warp,
)
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.lens import rays_of_pixels
from fedora_qa.sequence.declared import Lens

Float64 = NDArray[np.float64]

WIDTH, HEIGHT = 200, 150
K = np.array([[180.0, 0.0, 99.5], [0.0, 175.0, 70.2], [0.0, 0.0, 1.0]])
COLUMNS, ROWS = np.meshgrid(np.arange(float(WIDTH)), np.arange(float(HEIGHT)))
RAYS = np.stack([(COLUMNS - K[0, 2]) / K[0, 0], (ROWS - K[1, 2]) / K[1, 1], np.ones_like(COLUMNS)], axis=-1)
MOTION = RigidMotion(Rotation.from_rotvec([0.02, -0.03, 0.01]).as_matrix(), np.array([0.05, 0.02, -0.12]))
NORMAL, DISTANCE_M = np.array([0.3, 0.5, 1.0]), 5.0


def plane_before(rays: Float64 = RAYS) -> Float64:
    """z-depth of the plane ``NORMAL . X = DISTANCE_M`` in the first frame."""
    return np.asarray(DISTANCE_M / (rays @ NORMAL))


def plane_after(rays: Float64 = RAYS) -> Float64:
    """The same plane in the second frame: X0 = R^T (X1 - t)."""
    normal = MOTION.R @ NORMAL
    return np.asarray((DISTANCE_M + normal @ MOTION.t_m) / (rays @ normal))


def test_a_plane_agrees_to_rounding() -> None:
    """Inverse depth is affine on a plane, so that reading between pixels adds nothing."""
    lattice = lattice_of(depth_image(plane_before()), 2)
    warped = warp(DepthModel(K, MOTION), lattice, depth_image(plane_after()))
    known = np.isfinite(warped.residuals)
    assert np.count_nonzero(known) > 0.6 * len(known)
    assert np.max(np.abs(warped.residuals[known])) < 1e-12


def test_stored_millimetres_stay_within_the_bound() -> None:
    """What float32 does to both frames lies within the bound of each pixel, which is at most some millionths."""
    before, after = (
        (1000 * depths).astype(np.float32) / np.float32(1000) for depths in (plane_before(), plane_after())
    )
    warped = warp(DepthModel(K, MOTION), lattice_of(depth_image(before), 1), depth_image(after))
    known = np.isfinite(warped.residuals)
    assert np.all(np.abs(warped.residuals[known]) <= warped.bounds[known])
    assert np.median(warped.bounds[known]) < 5e-6


@pytest.mark.parametrize("curvature_per_m", [0.02, 0.1])
def test_curved_surfaces_stay_within_the_bound(curvature_per_m: float) -> None:
    """Bilinear reading errs on a curved surface, by less than the second differences say."""

    def bowl(rays: Float64) -> Float64:
        """z with z = 5 + c (x^2 + y^2) / 2, the near root; a bowl around the optical axis."""
        square = (rays[..., 0] ** 2 + rays[..., 1] ** 2) * curvature_per_m
        return np.asarray(10.0 / (1.0 + np.sqrt(1.0 - 10.0 * square)))

    still = RigidMotion(Rotation.from_rotvec([0.0, 0.0, 0.3]).as_matrix(), np.zeros(3))
    image = depth_image(bowl(RAYS))
    square_K = np.diag([180.0, 175.0, 1.0]) + np.array([[0, 0, 99.5], [0, 0, 70.2], [0, 0, 0]])
    warped = warp(DepthModel(square_K, still), lattice_of(image, 1), image)
    known = np.isfinite(warped.residuals)
    assert np.count_nonzero(known) > 10_000
    assert np.all(np.abs(warped.residuals[known]) <= warped.bounds[known])


def test_steps_stay_within_the_bound() -> None:
    """Depths rounded to 2 mm stay within the bound that knows the step."""
    before, after = (np.rint(depths / 2e-3) * 2e-3 for depths in (plane_before(), plane_after()))
    share = 2e-3 / before.min()
    warped = warp(DepthModel(K, MOTION), lattice_of(depth_image(before, share), 1), depth_image(after, share))
    known = np.isfinite(warped.residuals)
    assert np.all(np.abs(warped.residuals[known]) <= warped.bounds[known])


def test_what_is_hidden_is_not_compared() -> None:
    """Behind a board that moves before a wall, no pixel of the wall is compared with the board."""
    side = RigidMotion(np.eye(3), np.array([-0.4, 0.0, 0.0]))

    def board(centre_m: float) -> Float64:
        """A wall at 6 m, and before it a board of 1 m at 2 m, seen where it stands to the right by so much."""
        points = 2.0 * RAYS
        on_board = (np.abs(points[..., 0] - centre_m) < 0.5) & (np.abs(points[..., 1]) < 0.4)
        return np.where(on_board, 2.0, 6.0)

    lattice = lattice_of(depth_image(board(0.2)), 1)
    warped = warp(DepthModel(K, side), lattice, depth_image(board(-0.2)))
    known = np.isfinite(warped.residuals)
    assert np.count_nonzero(known) > 2000
    assert np.max(np.abs(warped.residuals[known])) < 1e-12


def test_derivative_by_the_twist() -> None:
    """The derivative is that of the residual when the motion is corrected, by central differences."""
    lattice, image1 = lattice_of(depth_image(plane_before()), 5), depth_image(plane_after())
    analytic = warp(DepthModel(K, MOTION), lattice, image1).twist_derivatives
    for axis, step in enumerate(np.eye(6) * 1e-5):
        ahead, behind = (
            warp(DepthModel(K, MOTION.corrected(sign * step)), lattice, image1).residuals for sign in (1, -1)
        )
        numeric = (ahead - behind) / 2e-5
        known = np.isfinite(numeric)
        np.testing.assert_allclose(analytic[known, axis], numeric[known], rtol=1e-3, atol=2e-4)


@pytest.mark.parametrize(
    "lens", [Lens("radtan", (-0.37, 0.16, 4e-4, -3e-4)), Lens("equidistant", (0.19, 0.004, 0.0007, -0.0004))]
)
def test_a_plane_through_a_distorted_lens(lens: Lens) -> None:
    """Inverse depth bends between pixels: within the bound; derivatives are those of differences. A pinhole fails."""
    rays = np.stack([*rays_of_pixels(K, lens, COLUMNS, ROWS), np.ones_like(COLUMNS)], axis=-1)
    image0, image1 = depth_image(plane_before(rays)), depth_image(plane_after(rays))
    model, lattice = DepthModel(K, MOTION, lens=lens), lattice_of(image0, 5)
    warped = warp(model, lattice, image1)
    known = np.isfinite(warped.residuals)
    assert np.count_nonzero(known) > 0.6 * len(known)
    assert np.all(np.abs(warped.residuals[known]) <= warped.bounds[known])
    assert np.max(np.abs(warped.residuals[known])) < 1e-5
    pinhole = warp(replace(model, lens=None), lattice, image1).residuals
    assert np.nanmax(np.abs(pinhole)) > 1e-3
    np.testing.assert_array_equal(residuals_after(model, lattice, image1), warped.residuals)
    for axis, step in enumerate(np.eye(6) * 1e-7):
        ahead, behind = (
            warp(replace(model, motion=MOTION.corrected(sign * step)), lattice, image1).residuals for sign in (1, -1)
        )
        numeric = (ahead - behind) / 2e-7
        both = known & np.isfinite(numeric)
        np.testing.assert_allclose(warped.twist_derivatives[both, axis], numeric[both], rtol=1e-3, atol=2e-4)
    with_ray, plus, minus = (warp(replace(model, ray=ray), lattice, image1, "ray") for ray in (0.0, 1e-5, -1e-5))
    numeric = (plus.residuals - minus.residuals) / 2e-5
    both = np.isfinite(numeric) & known
    np.testing.assert_allclose(with_ray.number_derivatives[both], numeric[both], rtol=1e-3, atol=2e-4)


@pytest.mark.parametrize("factor", [1e-3, 0.5, 1000.0])
def test_scaled_depths_agree_with_the_scaled_path(factor: float) -> None:
    """Depths too large by a factor agree with a path that is as much longer in their unit."""
    lattice, image1 = lattice_of(depth_image(factor * plane_before()), 3), depth_image(factor * plane_after())
    warped = warp(DepthModel(K, MOTION, scale=factor), lattice, image1)
    assert np.nanmax(np.abs(warped.residuals)) < 1e-12


def test_rays_agree_as_rays() -> None:
    """Lengths of rays, which are no plane's inverse depth, agree to the interpolation's error once taken as such."""
    lengths = np.linalg.norm(RAYS, axis=-1)
    lattice, image1 = lattice_of(depth_image(plane_before() * lengths), 3), depth_image(plane_after() * lengths)
    as_rays = warp(DepthModel(K, MOTION, ray=1.0), lattice, image1)
    as_z = warp(DepthModel(K, MOTION), lattice, image1)
    known = np.isfinite(as_rays.residuals)
    assert np.all(np.abs(as_rays.residuals[known]) <= as_rays.bounds[known])
    assert np.nanmedian(np.abs(as_z.residuals)) > 100 * np.nanmedian(np.abs(as_rays.residuals))


def test_lengths_of_rays() -> None:
    """The lengths of the rays of a pinhole are those of the vectors (x/z, y/z, 1)."""
    np.testing.assert_allclose(ray_lengths(K, None, (HEIGHT, WIDTH)), np.linalg.norm(RAYS, axis=-1), rtol=1e-7)


def test_lattice_keeps_enough_of_small_images() -> None:
    """The step is what the effort asks for, unless the image is too small for it."""
    assert lattice_stride(1080, 1440, 0.25) == 4
    assert lattice_stride(1080, 1440, 1.0) == 1
    assert lattice_stride(200, 270, 0.05) == 3
    assert lattice_stride(20, 30, 0.25) == 1


def test_lattice_thins_evenly() -> None:
    """At most so many pixels are kept, all of them clear of the border."""
    lattice = lattice_of(depth_image(plane_before()), 1, most=500)
    assert isinstance(lattice, DepthLattice)
    assert len(lattice.columns) == 500
    assert lattice.columns.min() >= 5
    assert lattice.columns.max() <= WIDTH - 6
