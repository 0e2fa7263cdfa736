"""A parameter of two depth frames is found exactly, with an error that follows from the motion's noise."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.depth import pair_fit
from fedora_qa.estimators.depth.inverse_depth import DepthImage, depth_image
from fedora_qa.estimators.depth.pair_fit import FEWEST_PIXELS, fit_depth, inverted, noise_directions
from fedora_qa.estimators.depth.warp import DepthLattice, DepthModel, ModelNumber, lattice_of, residuals_after, warp
from fedora_qa.geometry.camera import RigidMotion

Float64 = NDArray[np.float64]

WIDTH, HEIGHT = 160, 120
K = np.array([[140.0, 0.0, 79.5], [0.0, 140.0, 59.5], [0.0, 0.0, 1.0]])
COLUMNS, ROWS = np.meshgrid(np.arange(float(WIDTH)), np.arange(float(HEIGHT)))
RAYS = np.stack([(COLUMNS - 79.5) / 140, (ROWS - 59.5) / 140, np.ones_like(COLUMNS)], axis=-1)
MOTION = RigidMotion(Rotation.from_rotvec([0.01, -0.02, 0.01]).as_matrix(), np.array([0.03, 0.01, -0.05]))
EXACT = np.zeros((6, 0))
FACES = ((np.array([0.9, 0.0, 0.6]), 3.0), (np.array([-0.8, 0.1, 0.7]), 3.5), (np.array([0.0, 1.0, 0.25]), 1.6))
"""Three walls that meet in a corner, as normal and distance: all six directions of a twist show."""


def corner(motion: RigidMotion | None) -> Float64:
    """z-depth of the corner seen before (None) or after a motion."""
    nearest = np.full(COLUMNS.shape, 1.0 / 50.0)
    for normal, distance_m in FACES:
        turned = normal if motion is None else motion.R @ normal
        away_m = distance_m if motion is None else distance_m + turned @ motion.t_m
        nearest = np.maximum(nearest, (RAYS @ turned) / away_m)
    return 1.0 / nearest


def frames(motion: RigidMotion = MOTION, factor: float = 1.0, ray: float = 0.0) -> tuple[DepthLattice, DepthImage]:
    lengths = np.linalg.norm(RAYS, axis=-1) ** ray
    before, after = (factor * corner(seen) * lengths for seen in (None, motion))
    return lattice_of(depth_image(before), 2), depth_image(after)


@pytest.mark.parametrize("step", [1e-3, "scale"])
@pytest.mark.parametrize("factor", [1e-3, 0.3048, 1.0, 1.02, 1000.0])
def test_scale_is_found_from_nothing(factor: float, step: float | ModelNumber) -> None:
    """From infinite depth on, the fit finds the factor of any unit."""
    fit = fit_depth(lambda k: DepthModel(K, MOTION, scale=k), *frames(factor=factor), EXACT, start=0.0, step=step)
    assert fit is not None
    assert fit.value == pytest.approx(factor, rel=1e-9)
    assert fit.typical < 1e-12


@pytest.mark.parametrize("step", [1e-3, "ray"])
@pytest.mark.parametrize("ray", [0.0, 0.5, 1.0])
def test_ray_exponent_is_found(ray: float, step: float | ModelNumber) -> None:
    """The exponent of |m| is found within the stated bound of the interpolation."""
    fit = fit_depth(lambda c: DepthModel(K, MOTION, ray=c), *frames(ray=ray), EXACT, start=0.0, step=step)
    assert fit is not None
    assert abs(fit.value - ray) <= fit.bound
    assert fit.bound < 0.05


@pytest.mark.parametrize("ray", [-20.0, 20.0, -5000.0, 5000.0, np.inf, np.nan])
def test_what_no_depth_can_be_is_no_fit(ray: float) -> None:
    """A fit that runs away to a power at which arithmetic overflows is none, and NumPy has nothing to warn of."""
    assert fit_depth(lambda c: DepthModel(K, MOTION, ray=c), *frames(), EXACT, start=ray, step=1e-3) is None


@pytest.mark.parametrize("scale", [np.inf, np.nan])
def test_boundless_scale_is_no_fit(scale: float) -> None:
    """Nor is one of a scale without bounds."""
    assert fit_depth(lambda k: DepthModel(K, MOTION, scale=k), *frames(), EXACT, start=scale, step=1e-3) is None


@pytest.mark.parametrize("number", ["scale", "ray"])
def test_known_effects_are_those_that_are_seen(number: ModelNumber) -> None:
    """Derivatives by a number of the model against differences of the residuals."""
    lattice, image1 = frames()
    model = DepthModel(K, MOTION)
    known = warp(model, lattice, image1, number)
    value, change = getattr(model, number), 1e-6
    ahead, behind = (
        residuals_after(replace(model, **{number: value + side}), lattice, image1) for side in (change, -change)
    )
    seen = (ahead - behind) / (2 * change)
    both = np.isfinite(seen) & np.isfinite(known.residuals)
    assert np.count_nonzero(both) > 1000
    np.testing.assert_allclose(known.number_derivatives[both], seen[both], atol=1e-6)
    assert not known.number_derivatives[~np.isfinite(known.residuals)].any()


def test_one_plane_leaves_no_more_than_rounding() -> None:
    """Half of the directions show nowhere on a plane, and nothing holds them: steps along them do not end."""
    normal, rng = np.array([0.3, 0.5, 1.0]), np.random.default_rng(0)
    turned = MOTION.R @ normal
    depths_m = 5.0 / (RAYS @ normal), (5.0 + turned @ MOTION.t_m) / (RAYS @ turned)
    before, after = (depth_image((1000 * one).astype(np.float32) / np.float32(1000)) for one in depths_m)
    lattice = lattice_of(before, 2)
    bounds = warp(DepthModel(K, MOTION), lattice, after).bounds
    for _ in range(40):
        off = 0.02 * rng.normal(size=6)
        fit = fit_depth(lambda _, off=off: DepthModel(K, MOTION.corrected(off)), lattice, after, np.eye(6),
                        start=0.0, step=None)  # fmt: skip
        assert fit is not None
        assert fit.typical < np.nanmedian(bounds)


@pytest.mark.parametrize("start", [0.7, 0.9])
def test_steps_that_do_not_end_give_the_best_value_of_all(start: float) -> None:
    """Where the derivative vanishes at the solution, each step halves the distance from it: the last one is best."""
    tried: list[float] = []

    def family(value: float) -> DepthModel:
        tried.append(value)
        return DepthModel(K, MOTION, scale=1.0 + value**2)

    lattice, image1 = frames()
    fit = fit_depth(family, lattice, image1, EXACT, start=start, step=1e-7)
    assert fit is not None
    typical = [np.nanmedian(np.abs(residuals_after(family(value), lattice, image1))) for value in list(tried)]
    assert fit.typical == pytest.approx(min(typical), rel=0.1)


@pytest.mark.parametrize("start", [1.5, -1.5, 2.0])
def test_steps_back_and_forth_across_the_solution_are_relaxed(start: float) -> None:
    """Newton's steps for arctan(x) = 0 lead ever farther to both sides from |x| = 1.39 on."""

    def family(value: float) -> DepthModel:
        return DepthModel(K, MOTION, scale=1.0 + 0.1 * np.arctan(value))

    fit = fit_depth(family, *frames(), EXACT, start=start, step=1e-4)
    assert fit is not None
    assert fit.value == pytest.approx(0.0, abs=1e-6)


def test_a_fit_that_is_stopped_states_its_last_step(monkeypatch: pytest.MonkeyPatch) -> None:
    """A fit whose steps have not ended has not converged, and is about its last step from the solution."""
    sigmas = np.repeat([0.01, 0.02], 3)
    planted = np.array([1.0, -0.5, 1.0, 0.5, 1.0, -1.0]) * sigmas
    model, noise = DepthModel(K, MOTION.corrected(planted)), noise_directions(np.diag(sigmas**2))
    whole = fit_depth(lambda _: model, *frames(), noise, start=0.0, step=None)
    monkeypatch.setattr(pair_fit, "_ITERATIONS", 1)
    stopped = fit_depth(lambda _: model, *frames(), noise, start=0.0, step=None)
    assert whole is not None
    assert stopped is not None
    assert whole.converged
    assert np.linalg.norm(whole.twist_step) < 1e-4 * np.linalg.norm(planted)
    assert not stopped.converged
    np.testing.assert_allclose(
        stopped.twist + stopped.twist_step, whole.twist, atol=0.2 * np.linalg.norm(stopped.twist_step)
    )


def test_wrong_motion_is_corrected_within_its_noise() -> None:
    """The twist by which the motion was spoilt is found, and is as many sigmas long as it was planted."""
    sigmas = np.array([1e-3, 1e-3, 1e-3, 5e-3, 5e-3, 5e-3])
    planted = np.array([1.0, -0.5, 2.0, 0.5, 1.5, -1.0]) * sigmas
    spoilt = MOTION.corrected(planted)
    noise = noise_directions(np.diag(sigmas**2))
    fit = fit_depth(lambda _: DepthModel(K, spoilt), *frames(), noise, start=0.0, step=None)
    assert fit is not None
    assert fit.typical < 1e-9
    assert fit.noise_square == pytest.approx(np.sum((planted / sigmas) ** 2), rel=0.02)
    assert fit.noise_dof == pytest.approx(6.0, abs=1e-3)
    assert np.isinf(fit.standard_error)


def test_what_a_fit_of_the_motion_leaves_of_its_error() -> None:
    """With a noise that hardly allows an error, a part of it is left, as stated; with an exact motion all of it."""
    noise, error = 1e-7 * np.eye(6), np.array([2.0, -1.0, 1.0, 3.0, 2.0, -2.0]) * 1e-7
    wrong = DepthModel(K, MOTION.corrected(error))
    fit = fit_depth(lambda _: wrong, *frames(), noise, start=0.0, step=None)
    assert fit is not None
    left = fit.motion_left @ error
    np.testing.assert_allclose(error + fit.twist, left, atol=0.02 * np.linalg.norm(left))
    assert 0.01 < np.linalg.norm(left) / np.linalg.norm(error) < 0.9
    exact = fit_depth(lambda _: wrong, *frames(), EXACT, start=0.0, step=None)
    assert exact is not None
    np.testing.assert_array_equal(exact.motion_left, np.eye(6))


@pytest.mark.parametrize("number", ["scale", "ray"])
def test_an_unknown_error_of_the_motion_moves_the_number_as_stated(number: ModelNumber) -> None:
    """The derivative by the twist, against fits with a motion that errs in each direction."""
    fits = []
    for error in np.concatenate((np.zeros((1, 6)), 1e-8 * np.eye(6))):
        wrong = DepthModel(K, MOTION.corrected(error))
        start = getattr(wrong, number)
        fit = fit_depth(
            lambda value, wrong=wrong: replace(wrong, **{number: value}), *frames(), EXACT, start=start, step=number
        )
        assert fit is not None
        fits.append(fit)
    moved = np.array([fit.value - fits[0].value for fit in fits[1:]]) / 1e-8
    np.testing.assert_allclose(fits[0].value_by_twist, moved, rtol=0.02, atol=0.02 * np.abs(moved).max())


def test_scale_error_follows_from_the_noise_of_the_path() -> None:
    """Over many noisy paths, the reciprocal of the scale is normal about the truth with the stated error."""
    rng, sigma_m = np.random.default_rng(3), 5e-3
    noise = noise_directions(np.diag([1e-12, 1e-12, 1e-12, sigma_m**2, sigma_m**2, sigma_m**2]))
    lattice, image1 = frames()
    scores = []
    for _ in range(60):
        noisy = replace(MOTION, t_m=MOTION.t_m + sigma_m * rng.standard_normal(3))
        fit = fit_depth(lambda k, noisy=noisy: DepthModel(K, noisy, scale=k), lattice, image1, noise,
                        start=0.0, step=1e-3)  # fmt: skip
        assert fit is not None
        scores.append((1 / fit.value - 1.0) / (fit.standard_error / fit.value**2))
    assert stats.kstest(scores, "norm").pvalue > 1e-3


def test_directions_of_noise() -> None:
    """Directions make the covariance again, and what has no noise has no direction."""
    half = np.random.default_rng(0).standard_normal((6, 3))
    directions = noise_directions(half @ half.T)
    assert directions.shape == (6, 3)
    np.testing.assert_allclose(directions @ directions.T, half @ half.T, atol=1e-12)
    assert noise_directions(np.zeros((6, 6))).shape == (6, 0)


def test_too_few_pixels_are_no_fit() -> None:
    """Frames that hardly overlap, models that do not exist and empty lattices give no number."""
    lattice, image1 = frames()
    few = DepthLattice(*(values[: FEWEST_PIXELS - 1] for values in (
        lattice.columns, lattice.rows, lattice.depths_m, lattice.relative_errors)))  # fmt: skip
    away = RigidMotion(Rotation.from_rotvec([0.0, 2.0, 0.0]).as_matrix(), MOTION.t_m)
    assert fit_depth(lambda _: DepthModel(K, MOTION), few, image1, EXACT, start=0.0, step=None) is None
    assert fit_depth(lambda _: DepthModel(K, away), lattice, image1, EXACT, start=0.0, step=None) is None
    assert fit_depth(lambda _: None, lattice, image1, EXACT, start=0.0, step=None) is None


@pytest.mark.parametrize("size", [1, 3, 7])
def test_inverse_of_equations_of_any_scale(size: int) -> None:
    """Against LAPACK, of numbers whose units differ by many powers of ten."""
    rng = np.random.default_rng(size)
    columns = rng.normal(size=(50, size)) * 10.0 ** rng.integers(-6, 6, size)
    matrix = columns.T @ columns
    scale = np.sqrt(np.diag(matrix))
    expected = np.linalg.inv(matrix / np.outer(scale, scale)) / np.outer(scale, scale)
    assert inverted(matrix)
    np.testing.assert_allclose(matrix * np.outer(scale, scale), expected * np.outer(scale, scale), atol=1e-12)


@pytest.mark.parametrize("matrix", [np.zeros((2, 2)), np.diag([1.0, np.nan]), np.array([[1.0, 2.0], [2.0, 1.0]])])
def test_what_has_no_inverse_is_refused(matrix: Float64) -> None:
    """Nothing seen, no numbers, and no minimum."""
    assert not inverted(matrix)
