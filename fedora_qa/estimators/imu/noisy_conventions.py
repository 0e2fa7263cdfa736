"""The convention of the IMU or of the poses in noise, of a sequence or of a part, by the full covariance of residuals.

Mean accelerations over a few long spans state no convention where noise of the poses exceeds what they measure. The
residuals of the fit weigh all samples: under the right convention their whitened squares are those of noise. Of
conventions that leave as much as the best one, within chance, the simplest is returned. Conventions have no fitted
numbers, so that few fit by chance.
"""

from collections.abc import Iterator
from dataclasses import replace
from math import log, sqrt
from typing import Final

import numpy as np

from fedora_qa.conventions import FRD_FROM_FLU
from fedora_qa.estimators.imu.conventions import (
    QUATERNION_CONVENTIONS,
    RATE_UNITS,
    GravityConvention,
    InertialConvention,
    signed_permutations,
)
from fedora_qa.estimators.imu.noisy_part import squares_of
from fedora_qa.estimators.imu.samples import InertialNoise, InertialSamples
from fedora_qa.estimators.imu.sequence_fit import ROTATION, InertialComparison
from fedora_qa.geometry import so3

_SIGMAS: Final = 3.0
"""Standard deviations of the squares of noise by which what a convention leaves may exceed their mean."""

_LONGEST_S: Final = 20.0
"""Length of the part that is compared; a hundred conventions are compared in it."""

_GRAVITIES: Final[dict[GravityConvention, float]] = {"missing": 0.0, "reversed": -1.0}


def explain_in_noise(
    samples: InertialSamples, noise: InertialNoise, comparison: InertialComparison
) -> InertialConvention | None:
    """Return the convention under which IMU and poses agree within noise.

    Parameters
    ----------
    samples
        Of the sequence or of a part, as declared.
    noise
        As declared; gravity is that of the declaration.
    comparison
        ``ROTATION``: the axes and the unit of the gyro; ``TRANSLATION``: the axes of the accelerometer or of positions,
        or gravity; either: the order and the direction of quaternions.

    Returns
    -------
    InertialConvention or None
        The simplest one that leaves noise alone; None where none does.
    """
    # Conventions of the poses' orientations alone change what is prepared.
    samples = comparison.prepared(samples.between(-np.inf, samples.pose_times_s[0] + _LONGEST_S))
    compared = [
        (_squares(altered, noise_of, comparison), convention)
        for convention, altered, noise_of in _conventions(samples, noise, is_rotation=comparison is ROTATION)
    ]
    (declared, rows), _ = compared[0]
    least = min(squares for (squares, _), _ in compared)
    # Squares of noise have the mean 1 and the variance 2. The best of n conventions leaves 2 ln n less by chance.
    residuals = 3.0 * rows
    if not rows or least > residuals + _SIGMAS * sqrt(2.0 * residuals):
        return None
    fitting = [
        replace(convention, residual=squares / residuals, declared_residual=declared / residuals, count=rows)
        for (squares, _), convention in compared
        if squares <= least + 2.0 * log(len(compared))
    ]
    return min(fitting, key=lambda convention: (convention.complexity, convention.residual))


def _conventions(
    samples: InertialSamples, noise: InertialNoise, *, is_rotation: bool
) -> Iterator[tuple[InertialConvention, InertialSamples, InertialNoise]]:
    """Yield conventions, the declared one first, with the samples and the noise as they are under it."""
    rates, forces = samples.angular_velocities_body_rad_s, samples.specific_forces_body_m_s2
    yield InertialConvention(), samples, noise
    for quaternions in QUATERNION_CONVENTIONS:
        convention = InertialConvention(quaternions)
        if convention.complexity > 0:
            order, q = convention.component_order, samples.orientations_xyzw
            q = q if order is None else q[:, np.argsort(order)]
            q = so3.inverse(q) if quaternions.endswith("inverse") else q
            yield convention, replace(samples, orientations_xyzw=q, R_world_imu=None), noise
    for axes in signed_permutations():
        convention = InertialConvention(sensor_axes=axes)
        if convention.complexity > 0:
            # Stored is P v: v = P^T (P v), of rows v^T = (P v)^T P.
            if is_rotation:
                altered = replace(samples, angular_velocities_body_rad_s=rates @ np.array(axes))
            else:
                altered = replace(samples, specific_forces_body_m_s2=forces @ np.array(axes))
            yield convention, altered, noise
    if is_rotation:
        for unit in RATE_UNITS:
            if unit != 1.0:
                altered = replace(samples, angular_velocities_body_rad_s=rates / unit)
                yield InertialConvention(rate_unit=unit), altered, noise
        return
    for axes in signed_permutations():
        convention = InertialConvention(world_axes=axes)
        if convention.complexity > 0:
            yield convention, replace(samples, positions_world_m=samples.positions_world_m @ np.array(axes)), noise
    # A sensor and a world with Z down: poses of a body with Z down in such a world.
    upside_down = replace(noise, gravity_m_s2=-noise.gravity_m_s2)
    altered = replace(samples, specific_forces_body_m_s2=forces @ np.array(FRD_FROM_FLU))
    yield InertialConvention(sensor_axes=FRD_FROM_FLU, up=(0, 0, -1)), altered, upside_down
    for gravity, factor in _GRAVITIES.items():
        yield InertialConvention(gravity=gravity), samples, replace(noise, gravity_m_s2=factor * noise.gravity_m_s2)


def _squares(samples: InertialSamples, noise: InertialNoise, comparison: InertialComparison) -> tuple[float, int]:
    """Return the whitened squares of the residuals of samples, and the number of rows."""
    residuals, covariance_bands = comparison.residuals_of(comparison.prepared(samples), noise)
    return squares_of(residuals, covariance_bands), len(residuals)
