"""Wind: a mean and Dryden gusts, as sums of sinusoids, and the displacement of a quadrotor from its path.

Source: MIL-F-8785C, Flying Qualities of Piloted Airplanes (1980), 3.7.2 (Dryden spectra) and 3.7.3 (low altitude).
Each axis has a sinusoid in each band of frequency. The variance of a band is the integral of the spectrum over it, in
closed form; its frequency and phase are random. So every derivative is a sum of sinusoids as well.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]

FOOT_M: Final = 0.3048
LOWEST_M, HIGHEST_M = 10 * FOOT_M, 1000 * FOOT_M

BANDS: Final = 48
LONGEST_SCALES: Final = 100.0
"""Gusts longer than this many scales count as one of that length."""
SHORTEST_GUST_M: Final = 1.0
"""The spectra end here: shorter gusts average out over the vehicle."""

ROUGHNESS_FT: Final = 0.15
"""Of the ground, for flight near the ground (category C)."""

_WIND_KEY: Final = 3
"""Key of the random stream, beside those of the sensors."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WindOptions:
    """A wind of ``speed_m_s`` at 20 ft, blowing ``towards_deg`` (counter-clockwise from east), and its gusts.

    The spectra are those of ``altitude_m``. ``airspeed_m_s`` is the speed at which the vehicle meets gusts (None: the
    mean wind). The pilot responds as a spring and damper of ``response_hz`` and ``damping_ratio``.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    speed_m_s: float
    towards_deg: float = 0.0
    altitude_m: float = LOWEST_M
    airspeed_m_s: float | None = None
    response_hz: float = 0.3
    damping_ratio: float = 0.8

    def __post_init__(self) -> None:
        airspeed_m_s = self.speed_m_s if self.airspeed_m_s is None else self.airspeed_m_s
        for name in ("speed_m_s", "response_hz", "damping_ratio"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"Expected {name} > 0, got {getattr(self, name)}; leave the wind out for a calm")
        if not (math.isfinite(airspeed_m_s) and airspeed_m_s > 0):
            raise ValueError(f"Expected airspeed_m_s > 0, got {airspeed_m_s}")
        if not LOWEST_M <= self.altitude_m <= HIGHEST_M:
            raise ValueError(
                f"Expected altitude_m from {LOWEST_M:g} to {HIGHEST_M:g}, where the low-altitude model holds, "
                f"got {self.altitude_m}; use the nearest"
            )
        if not math.isfinite(self.towards_deg):
            raise ValueError(f"Expected towards_deg to be finite, got {self.towards_deg}")


class Turbulence(NamedTuple):
    """Standard deviation and scale of length of the gusts along, across and up."""

    sigmas_m_s: Floats
    scales_m: Floats


class Disturbance(NamedTuple):
    """Effect of the wind at n instants, each (n, 3) in the world frame."""

    displacement: tuple[Floats, Floats, Floats, Floats]
    """From the path, metres, and its first three derivatives"""
    wind_m_s: Floats
    wind_rate_m_s2: Floats


def low_altitude_turbulence(speed_at_20_ft_m_s: float, altitude_m: float) -> Turbulence:
    """Intensities and scales below 1000 ft (MIL-F-8785C, 3.7.3.4, figures 10 and 11)."""
    altitude_ft = altitude_m / FOOT_M
    ratio = 0.177 + 0.000823 * altitude_ft
    sigma_up = 0.1 * speed_at_20_ft_m_s
    sigma_level = sigma_up / ratio**0.4
    scale_level_m = altitude_m / ratio**1.2
    return Turbulence(
        np.array([sigma_level, sigma_level, sigma_up]), np.array([scale_level_m, scale_level_m, altitude_m])
    )


def variance_share(x: Floats, axis: int) -> Floats:
    """Share of the variance of an axis at frequencies up to omega = x V / L: (n,) from 0 to 1.

    Along, the spectrum is proportional to 1 / (1 + x^2); across and up to (1 + 3 x^2) / (1 + x^2)^2.

    Parameters
    ----------
    x
        (n,) frequency in units of V / L, airspeed over scale of length.
    axis
        0 along the wind, 1 across, 2 up.
    """
    if axis == 0:
        return np.asarray(2 / np.pi * np.arctan(x))
    return np.asarray((2 * np.arctan(x) - x / (1 + x * x)) / np.pi)


@dataclass(frozen=True, slots=True)
class Gusts:
    """One draw of the wind: per axis (along, across, up) m sinusoids ``Re(amplitude exp(i omega t))``."""

    R_world_wind: Floats
    """(3, 3)"""
    mean_m_s: Floats
    """(3,) in the world"""
    omegas_rad_s: Floats
    """(3, m)"""
    amplitudes_m_s: Complex
    """(3, m)"""
    displacements_m: Complex
    """(3, m)"""

    def at(self, times_s: Floats) -> Disturbance:
        """Wind, m/s, and displacement, m, in the world frame at ``times_s`` (n,), seconds."""
        axes = []
        for axis in range(3):
            # A derivative multiplies an amplitude by i omega: rows (6, m) for displacement, velocity, acceleration and
            # jerk, then for the gust and its rate.
            rates = 1j * self.omegas_rad_s[axis]
            displacements = [self.displacements_m[axis] * rates**order for order in range(4)]
            gusts = [self.amplitudes_m_s[axis] * rates**order for order in range(2)]
            oscillations = np.exp(rates[:, None] * times_s)
            axes.append((np.stack(displacements + gusts) @ oscillations).real)
        *displacement, gust_m_s, gust_rate_m_s2 = np.stack(axes, axis=-1) @ self.R_world_wind.T
        position, velocity, acceleration, jerk = displacement
        return Disturbance((position, velocity, acceleration, jerk), gust_m_s + self.mean_m_s, gust_rate_m_s2)


def draw_gusts(options: WindOptions, drag_per_s: float, seed: int) -> Gusts:
    """Draw the wind of a seed: amplitudes of the wind, m/s, and of the displacement, m, along the axes of the wind.

    The displacement x of a vehicle in a gust w follows ``x'' = drag (w - x') - 2 zeta omega_n x' - omega_n^2 x``: air
    drags it along, a spring and a damper hold it to its path. The pilot trims the mean wind away.
    """
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_WIND_KEY,)))
    mean_m_s = mean_wind_m_s(options.speed_m_s, options.altitude_m)
    airspeed_m_s = mean_m_s if options.airspeed_m_s is None else options.airspeed_m_s
    turbulence = low_altitude_turbulence(options.speed_m_s, options.altitude_m)
    omegas, amplitudes = [], []
    for axis, (sigma_m_s, scale_m) in enumerate(zip(*turbulence, strict=True)):
        # Bands of equal ratio in units of V / L, each with a random frequency and phase.
        edges = np.geomspace(1 / LONGEST_SCALES, 2 * math.pi * scale_m / SHORTEST_GUST_M, BANDS + 1)
        frequencies = edges[:-1] * (edges[1:] / edges[:-1]) ** rng.uniform(size=BANDS)
        shares = np.diff(variance_share(edges, axis), prepend=0.0)
        shares = np.concatenate([[shares[0] + shares[1]], shares[2:]])  # what lies below the first band joins it
        phases_rad = rng.uniform(0, 2 * np.pi, BANDS)
        omegas.append(frequencies / (scale_m / airspeed_m_s))
        amplitudes.append(sigma_m_s * np.sqrt(2 * shares) * np.exp(1j * phases_rad))
    omegas_rad_s, amplitudes_m_s = np.stack(omegas), np.stack(amplitudes)

    # Frequency response of the displacement to the gust.
    omega_n = 2 * math.pi * options.response_hz
    damping = 2 * options.damping_ratio * omega_n + drag_per_s
    response_s = drag_per_s / (omega_n**2 - omegas_rad_s**2 + 1j * damping * omegas_rad_s)
    cos, sin = math.cos(math.radians(options.towards_deg)), math.sin(math.radians(options.towards_deg))
    R_world_wind = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return Gusts(R_world_wind, mean_m_s * R_world_wind[:, 0], omegas_rad_s, amplitudes_m_s, amplitudes_m_s * response_s)


def mean_wind_m_s(speed_at_20_ft_m_s: float, altitude_m: float) -> float:
    """Mean wind, m/s, by logarithmic shear (MIL-F-8785C, 3.7.3.2)."""
    return speed_at_20_ft_m_s * math.log(altitude_m / FOOT_M / ROUGHNESS_FT) / math.log(20 / ROUGHNESS_FT)
