"""Wind: the spectra of the specification, drawn from a seed, and a path that obeys its equation of motion."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from fedora_generator.flight import Flight
from fedora_generator.flights.gusts import (
    FOOT_M,
    Gusts,
    WindOptions,
    draw_gusts,
    low_altitude_turbulence,
    mean_wind_m_s,
    variance_share,
)
from fedora_generator.flights.kinds import HoverOptions, LoopOptions
from fedora_generator.flights.route import Waypoint
from fedora_generator.scene import load_scene
from fedora_qa.conventions import STANDARD_GRAVITY_M_S2

WIND = WindOptions(speed_m_s=6.0, towards_deg=30.0, altitude_m=12.0, airspeed_m_s=5.0)
DRAG_PER_S = 0.35
HOVER = HoverOptions(position_m=(1, 2, 12), yaw_deg=70, drag_per_s=DRAG_PER_S, wind=WIND)


def spectrum(omega_rad_s: float, sigma: float, scale_m: float, speed_m_s: float, axis: int) -> float:
    """One-sided power spectral density, as the specification prints it."""
    x = scale_m * omega_rad_s / speed_m_s
    if axis == 0:
        return sigma**2 * 2 * scale_m / (np.pi * speed_m_s) / (1 + x**2)
    return sigma**2 * scale_m / (np.pi * speed_m_s) * (1 + 3 * x**2) / (1 + x**2) ** 2


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_variance_of_a_band_is_the_integral_of_the_spectrum(axis: int) -> None:
    """The closed form of each axis, against quadrature of the printed density; over all frequencies it is sigma^2."""
    for low, high in ((0.0, 0.3), (0.3, 4.0), (4.0, 90.0)):
        integral, _ = quad(spectrum, low * 5 / 40, high * 5 / 40, args=(1.7, 40.0, 5.0, axis), epsabs=1e-12, limit=200)
        share = variance_share(np.array([low, high]), axis)
        assert 1.7**2 * (share[1] - share[0]) == pytest.approx(integral, rel=1e-9)
    assert variance_share(np.array([1e12]), axis)[0] == pytest.approx(1.0, abs=1e-11)


def test_intensities_and_scales_meet_the_medium_altitudes() -> None:
    """At 1000 ft the ratio is one: sigmas are 0.1 of the wind at 20 ft, scales 1000 ft, as the specification says."""
    turbulence = low_altitude_turbulence(10.0, 1000 * FOOT_M)
    np.testing.assert_allclose(turbulence.sigmas_m_s, 1.0, rtol=1e-12)
    np.testing.assert_allclose(turbulence.scales_m, 304.8, rtol=1e-12)
    level, _, up = low_altitude_turbulence(10.0, 100 * FOOT_M).scales_m
    assert level == pytest.approx(100 * FOOT_M / (0.177 + 0.0823) ** 1.2)
    assert up == pytest.approx(100 * FOOT_M)


def test_the_mean_wind_is_that_of_twenty_feet_there() -> None:
    """Logarithmic shear: the speed is given at 20 ft, 0 at the roughness height."""
    assert mean_wind_m_s(7.0, 20 * FOOT_M) == pytest.approx(7.0)
    assert mean_wind_m_s(7.0, 0.15 * FOOT_M) == pytest.approx(0.0, abs=1e-12)


def test_the_sinusoids_carry_the_variance() -> None:
    """Half the squared amplitudes add up to sigma^2 up to the shortest gust, whatever the seed."""
    gusts = draw_gusts(WIND, DRAG_PER_S, seed=4)
    sigmas_m_s, scales_m = low_altitude_turbulence(6.0, 12.0)
    for axis in range(3):
        share = variance_share(np.array([2 * np.pi * scales_m[axis]]), axis)[0]
        assert share > 0.95
        variance = 0.5 * np.sum(np.abs(gusts.amplitudes_m_s[axis]) ** 2)
        assert variance == pytest.approx(share * sigmas_m_s[axis] ** 2, rel=1e-12)


def test_the_gusts_of_a_long_flight_have_these_variances() -> None:
    """Sampled over ten hours the wind's covariance along its own axes is diagonal, to what so few long gusts allow."""
    gusts = draw_gusts(WIND, DRAG_PER_S, seed=4)
    times_s = np.random.default_rng(1).uniform(0, 36_000, 20_000)
    along_wind = (gusts.at(times_s).wind_m_s - gusts.mean_m_s) @ gusts.R_world_wind
    expected = 0.5 * np.sum(np.abs(gusts.amplitudes_m_s) ** 2, axis=1)
    np.testing.assert_allclose(np.cov(along_wind.T), np.diag(expected), atol=0.06 * expected.max())


def test_the_displacement_obeys_the_equation_of_motion() -> None:
    """x'' = drag (w - x') - 2 zeta omega_n x' - omega_n^2 x at every instant, and derivatives are derivatives."""
    gusts = draw_gusts(WIND, DRAG_PER_S, seed=9)
    times_s, h = np.linspace(0, 60, 500), 1e-4
    (position, velocity, acceleration, jerk), wind_m_s, wind_rate = gusts.at(times_s)
    omega_n = 2 * np.pi * WIND.response_hz
    gust_m_s = wind_m_s - gusts.mean_m_s
    force = DRAG_PER_S * (gust_m_s - velocity) - 2 * WIND.damping_ratio * omega_n * velocity - omega_n**2 * position
    np.testing.assert_allclose(acceleration, force, atol=1e-12)
    before, after = gusts.at(times_s - h), gusts.at(times_s + h)
    for order, found in enumerate((velocity, acceleration, jerk)):
        numeric = (after.displacement[order] - before.displacement[order]) / (2 * h)
        np.testing.assert_allclose(found, numeric, atol=1e-5)
    np.testing.assert_allclose(wind_rate, (after.wind_m_s - before.wind_m_s) / (2 * h), atol=1e-4)
    assert 0.05 < np.abs(position).max() < 3.0


def test_body_rates_in_gusts_are_the_derivative_of_the_attitude() -> None:
    """The angular velocity is that of scipy's rotations, wind and drag included."""
    flight, times_s, h = Flight(HOVER, seed=3), np.linspace(0, 20, 400), 1e-5
    before, after = (Rotation.from_matrix(flight.states_at(times_s + shift).R_world_body) for shift in (-h, h))
    numeric = (before.inv() * after).as_rotvec() / (2 * h)
    found = flight.states_at(times_s).angular_velocities_body_rad_s
    assert np.abs(found).max() > 0.05
    np.testing.assert_allclose(found, numeric, atol=2e-7)


def test_thrust_is_what_drag_and_gravity_leave() -> None:
    """Newton: acceleration + g - drag (wind - velocity) lies along body Z, with the wind as it was drawn."""
    states, times_s = Flight(HOVER, seed=3).states_at(np.linspace(0, 20, 50)), np.linspace(0, 20, 50)
    wind_m_s = draw_gusts(WIND, DRAG_PER_S, seed=3).at(times_s).wind_m_s
    thrust = states.accelerations_world_m_s2 + np.array([0, 0, STANDARD_GRAVITY_M_S2])
    thrust = thrust - DRAG_PER_S * (wind_m_s - states.velocities_world_m_s)
    in_body = np.einsum("nji,nj->ni", states.R_world_body, thrust)
    np.testing.assert_allclose(in_body[:, :2], 0.0, atol=1e-12)


def test_the_seed_draws_the_wind() -> None:
    """The same seed is the same flight bit for bit, another seed another; the path is moved, not replaced."""
    loop = LoopOptions(
        waypoints=(Waypoint(position_m=(0, 0, 9)), Waypoint(position_m=(9, 0, 9))), drag_per_s=DRAG_PER_S, wind=WIND
    )
    times_s = np.linspace(0, 8, 30)
    one, same, other = (Flight(loop, seed=seed).states_at(times_s).positions_world_m for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert np.abs(one - other).max() > 0.05
    calm = Flight(replace(loop, wind=None)).states_at(times_s).positions_world_m
    pushed = draw_gusts(WIND, DRAG_PER_S, seed=1).at(times_s).displacement[0]
    np.testing.assert_allclose(one - calm, pushed, atol=1e-12)


def test_without_wind_no_gust_is_evaluated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Off, it costs nothing: not one sinusoid."""

    def forbidden(self: Gusts, times_s: np.ndarray) -> None:
        raise AssertionError("a gust was evaluated")

    monkeypatch.setattr(Gusts, "at", forbidden)
    Flight(replace(HOVER, wind=None), seed=1).states_at(np.zeros(3))
    with pytest.raises(AssertionError, match="evaluated"):
        Flight(HOVER, seed=1).states_at(np.zeros(3))


def test_a_scene_flies_in_the_wind_of_its_seed(tmp_path: Path) -> None:
    """Another seed of the scene is another wind; without any seed a wind is refused."""
    path = tmp_path / "scene.toml"
    path.write_text(
        'base = "park-day"\nseed = 5\n[flight]\nkind = "hover"\nposition_m = [0, 0, 4]\ndrag_per_s = 0.3\n'
        "[flight.wind]\nspeed_m_s = 3\n"
    )
    scene, at = load_scene(path), np.linspace(0, 5, 9)
    found = scene.fly().states_at(at).positions_world_m
    np.testing.assert_array_equal(found, Flight(scene.flight, seed=5).states_at(at).positions_world_m)
    assert np.abs(replace(scene, seed=6).fly().states_at(at).positions_world_m - found).max() > 1e-3
    with pytest.raises(ValueError, match=r"Expected a seed with a wind, got none; use Scene.fly\(\)"):
        Flight(scene.flight)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        ({"speed_m_s": 0.0}, "speed_m_s > 0, got 0.0; leave the wind out"),
        ({"airspeed_m_s": 0.0}, "airspeed_m_s > 0"),
        ({"altitude_m": 1.0}, "altitude_m from 3.048 to 304.8"),
        ({"towards_deg": float("nan")}, "towards_deg to be finite"),
        ({"response_hz": -1.0}, "response_hz > 0"),
    ],
)
def test_an_impossible_wind_is_refused(bad: dict[str, float], message: str) -> None:
    """A calm that should be left out, an altitude without a model, numbers that are none."""
    with pytest.raises(ValueError, match=message):
        replace(WIND, **bad)


def test_a_wind_needs_drag() -> None:
    """Without drag the air cannot push: said, rather than silently ignored."""
    with pytest.raises(ValueError, match="drag_per_s > 0 with a wind"):
        replace(HOVER, drag_per_s=0.0)
