"""What the IMU's own noise does to a fit whose regressors are made of the IMU's samples.

The regressor of a gain is the motion itself, as the gyro tells it: its noise is also in the residual (errors in
variables). Where nothing moves the regressor is all noise, and the fit finds a gain of any size. With J = J0 + j of
noise j, and residuals r0 + n, the expected score ``J^T C^-1 r`` is off by ``E[j^T C^-1 n]``, and the information
``J^T C^-1 J`` is too large by ``E[j^T C^-1 j]``.

Both are measured. Two halves of the samples, every other one, show one motion with independent noise of twice the
variance. Half the difference of what they give holds no motion and has the noise of what all samples give:
``dJ = (J_even - J_odd)/2`` and ``dr = (r_even - r_odd)/2`` have the covariances of j and n, so ``dJ^T C^-1 dr`` and
``dJ^T C^-1 dJ`` estimate the two without bias, whatever the noise's size. To subtract the first is to hold the
regressors of either half against the residuals of the other: (J_even r_odd + J_odd r_even)/2. In exact samples the
differences are the integration's own error, of fourth order, and vanish in the product.

Source: first principles; for errors in variables W. Fuller, Measurement Error Models, Wiley 1987, sections 1.2, 2.2.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.imu.samples import Effects, InertialNoise, InertialSamples, Rows

EffectsOf = Callable[[InertialSamples, InertialNoise], Effects]


def with_scatter(rows: Rows, samples: InertialSamples, noise: InertialNoise, effects_of: EffectsOf) -> Rows:
    """Return the rows with what noise alone makes of them; as they are where no noise of the IMU is declared.

    So they stay too where the halves do not reach all rows, as at the ends of very few samples.
    """
    if noise.smoothing_s == 0:
        return rows
    even, odd = (effects_of(half, noise) for half in halves(samples))
    if not (np.isin(rows.poses, even.poses).all() and np.isin(rows.poses, odd.poses).all()):
        return rows
    in_even, in_odd = (np.isin(half.poses, rows.poses) for half in (even, odd))
    scatter = replace(
        rows,
        residuals=(even.residuals[in_even] - odd.residuals[in_odd]) / 2,
        jacobians=(even.jacobians[in_even] - odd.jacobians[in_odd]) / 2,
        model_errors=np.zeros_like(rows.model_errors),
    )
    return replace(rows, scatter=scatter)


def halves(samples: InertialSamples) -> tuple[InertialSamples, InertialSamples]:
    """Return the samples with the even and the odd ones of the IMU; both keep its first and last: the span stays."""
    last = len(samples.imu_times_s) - 1
    even, odd = (
        np.unique(np.concatenate(([0], np.arange(first, last, 2), [last])).astype(np.intp)) for first in (0, 1)
    )
    return _chosen(samples, even), _chosen(samples, odd)


def _chosen(samples: InertialSamples, imu: NDArray[np.intp]) -> InertialSamples:
    return replace(
        samples,
        imu_times_s=samples.imu_times_s[imu],
        angular_velocities_body_rad_s=samples.angular_velocities_body_rad_s[imu],
        specific_forces_body_m_s2=samples.specific_forces_body_m_s2[imu],
        R_world_imu=None if samples.R_world_imu is None else samples.R_world_imu[imu],
    )
