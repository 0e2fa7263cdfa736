"""Passes over tiles of a flow: what they gather is what plain arrays give, and derivatives are those of the flow."""

import numpy as np
import pytest

from fedora_qa.estimators.flow.residual import (
    known_patches,
    mean_derivatives,
    means_slopes_sines,
    patches_of,
    pixels_of,
    places_of,
)
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.rigid_flow import rigid_flow
from fedora_qa.geometry.so3 import exp

HEIGHT, WIDTH = 90, 120
ORIGINS = np.array([[4, 5], [60, 40], [80, 50]])
RNG = np.random.default_rng(4)
K = np.array([[90.0, 0.7, 58.0], [0.0, 85.0, 46.0], [0.0, 0.0, 1.0]])
MOTION = RigidMotion(exp(np.array([0.02, -0.05, 0.03])), np.array([0.3, -0.1, 0.4]))


def test_unknown_flow_is_taken_out() -> None:
    """Values that are none, infinite or too large are 0 and not known; all others are those of the field."""
    flow_px = RNG.normal(0, 5, (HEIGHT, WIDTH, 2)).astype(np.float32)
    flow_px[7, 9, 0], flow_px[50, 70, 1], flow_px[60, 90] = np.nan, -np.inf, 2e4
    patches, known = known_patches(flow_px, ORIGINS, 32, 2, 1e4)
    with np.errstate(invalid="ignore"):
        right = np.all(np.abs(flow_px) < 1e4, axis=-1)
    np.testing.assert_array_equal(patches, patches_of(np.where(right[..., None], flow_px, 0), ORIGINS))
    np.testing.assert_array_equal(known, patches_of(right, ORIGINS, halo_px=0))


def test_places_are_where_the_flow_leads() -> None:
    """Pixels plus the flow, less what each tile's flow is corrected by."""
    patches = RNG.normal(0, 5, (3, 36, 36, 2)).astype(np.float32)
    less_px = np.array([[0.0, 0.0], [1.5, -2.0], [0.0, 3.0]], np.float32)
    found = places_of(patches, ORIGINS, 2, less_px)
    for axis, pixels in enumerate(pixels_of(ORIGINS)):
        expected = pixels + patches[..., axis] - less_px[:, None, None, axis]
        np.testing.assert_allclose(found[axis], expected, atol=1e-4)


def test_means_and_slopes_of_a_flow() -> None:
    """Slopes of an affine flow are exact where all pixels count; means and sines are those of the pixels that do."""
    usable = RNG.uniform(size=(3, 32, 32)) < 0.6
    usable[0], usable[2] = True, False
    columns, rows = pixels_of(np.zeros((3, 2), np.int64))
    flow_px = np.stack((0.5 + 0.02 * columns - 0.03 * rows, 1.0 + 0.01 * rows), axis=-1).astype(np.float32)
    means, slopes, sines = means_slopes_sines(flow_px, usable, 2, 2)
    np.testing.assert_allclose(slopes[0], [[0.02, -0.03], [0.0, 0.01]], atol=1e-6)
    for tile in range(2):
        counted = flow_px[tile, 2:-2:2, 2:-2:2][usable[tile, ::2, ::2]].astype(np.float64)
        np.testing.assert_allclose(means[tile], counted.mean(axis=0), atol=1e-6)
        np.testing.assert_allclose(sines[tile], np.sin(2 * np.pi * counted).mean(axis=0), atol=1e-6)
    assert not np.concatenate((means[2], slopes[2].ravel(), sines[2])).any()


def flow_of(changed_K: np.ndarray, motion: RigidMotion, inverse_per_m: np.ndarray) -> np.ndarray:
    columns, rows = np.arange(WIDTH, dtype=float), np.arange(HEIGHT, dtype=float)[:, None]
    depths_m = 1.0 / np.where(inverse_per_m > 0, inverse_per_m.astype(np.float64), np.nan)
    return rigid_flow(changed_K, motion, columns, rows, depths_m)


def changed(of: int, by: float) -> tuple[np.ndarray, RigidMotion]:
    """K and motion, of which one is changed: a part of the twist, the logarithm of the focal length, the centre."""
    if of < 6:
        return K, MOTION.corrected(by * np.eye(6)[of])
    scale = np.exp(by) if of == 6 else 1.0
    moved = K * np.array([[scale, scale, 1], [1, scale, 1], [1, 1, 1]])
    if of > 6:
        moved[of - 7, 2] += by
    return moved, MOTION


@pytest.mark.parametrize("of", range(9))
def test_derivatives_are_those_of_the_rigid_flow(of: int) -> None:
    """Central differences of the flow, on the average over the pixels of a tile that count and have a depth."""
    inverse_per_m = RNG.uniform(0.1, 0.6, (HEIGHT, WIDTH)).astype(np.float32)
    inverse_per_m[50:60, 70:80] = 0.0
    usable = RNG.uniform(size=(3, 32, 32)) < 0.8
    depth_m = np.divide(1, inverse_per_m, out=np.full_like(inverse_per_m, np.nan), where=inverse_per_m > 0)
    found = mean_derivatives(depth_m, ORIGINS, usable, 1, 3, K, MOTION.R, MOTION.t_m)[..., of]
    step = 1e-6
    ahead, behind = (flow_of(*changed(of, by), inverse_per_m) for by in (step, -step))
    slopes = patches_of((ahead - behind) / (2 * step), ORIGINS, halo_px=0)[:, 1::3, 1::3]
    counts = (usable & (patches_of(inverse_per_m, ORIGINS, halo_px=0) > 0))[:, 1::3, 1::3]
    expected = [slopes[tile][counts[tile]].mean(axis=0) for tile in range(3)]
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-5)


def test_nothing_is_told_of_points_behind_the_camera() -> None:
    """Nor of tiles without a pixel that counts."""
    depth_m, usable = np.ones((HEIGHT, WIDTH), np.float32), np.ones((3, 32, 32), np.bool_)
    backward = np.array([0.0, 0.0, -2.0])
    assert not mean_derivatives(depth_m, ORIGINS, usable, 0, 8, K, np.eye(3), backward).any()
    assert not mean_derivatives(depth_m, ORIGINS, ~usable, 0, 8, K, np.eye(3), -backward).any()
