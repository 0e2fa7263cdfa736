"""Faults of the inertial unit."""

from typing import Final

import h5py
import numpy as np
from scipy.signal import savgol_filter

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.metadata import declare_noise
from fedora_generator.faults.pose import attitudes_at
from fedora_generator.faults.rows import edit, edit_values, window_of
from fedora_qa.conventions import US_PER_S

GYRO, ACCEL, TIMESTAMPS = "path/imu/angular_velocity", "path/imu/linear_acceleration", "path/imu/ts"
METADATA: Final = "metadata/imu"

_SWAPPED: Final = [1, 0, 2]
_FORWARD_RIGHT_DOWN: Final = np.array([1.0, -1.0, -1.0])
_X: Final = np.array([1.0, 0.0, 0.0])
_NOISES: Final = ("gyro_noise_density", "accel_noise_density", "gyro_bias_walk", "accel_bias_walk")
_DERIVATIVE_SAMPLES: Final = 21
"""Samples of the cubic fitted for a derivative: differences of neighbours would multiply the noise by the rate."""


def axes_swapped(file: h5py.File, fault: Fault) -> None:
    """Exchange X and Y of both sensors."""
    edit_values(file, fault, lambda vectors: vectors[:, _SWAPPED])


def frame_convention(file: h5py.File, fault: Fault) -> None:
    """Write X forward, Y right, Z down."""
    edit_values(file, fault, lambda vectors: vectors * _FORWARD_RIGHT_DOWN)


def unit_deg_rad(file: h5py.File, fault: Fault) -> None:
    """Multiply angular velocity by the magnitude: 180 / pi writes degrees per second."""
    factor = fault.magnitude_in("1")
    edit(file[GYRO], window_of(file, "imu", fault), lambda rates: rates * factor)


def gyro_bias(file: h5py.File, fault: Fault) -> None:
    """Add the magnitude to the angular velocity about body X."""
    bias = fault.magnitude_in("rad/s") * _X
    edit(file[GYRO], window_of(file, "imu", fault), lambda vectors: vectors + bias)


def accel_bias(file: h5py.File, fault: Fault) -> None:
    """Add the magnitude to the specific force along body X."""
    bias = fault.magnitude_in("m/s^2") * _X
    edit(file[ACCEL], window_of(file, "imu", fault), lambda vectors: vectors + bias)


def gravity_missing(file: h5py.File, fault: Fault) -> None:
    """Remove the reaction to gravity: f = R^T a. The attitude is the file's own pose, with its noise."""
    _add_gravity(file, fault, -_declared_gravity(file))


def gravity_sign(file: h5py.File, fault: Fault) -> None:
    """Change the sign of gravity: f = R^T (a + g)."""
    _add_gravity(file, fault, -2 * _declared_gravity(file))


def gravity_magnitude(file: h5py.File, fault: Fault) -> None:
    """Make the gravity of the samples larger by the magnitude than the declared gravity."""
    _add_gravity(file, fault, fault.magnitude_in("m/s^2"))


def lever_arm(file: h5py.File, fault: Fault) -> None:
    """Mount the unit off the body's origin, forward by the magnitude: f + w' x r + w x (w x r)."""
    window = window_of(file, "imu", fault)
    timestamps_us, rates = file[TIMESTAMPS][window], file[GYRO][window]
    if len(rates) < _DERIVATIVE_SAMPLES:
        raise FaultError(f"Expected at least {_DERIVATIVE_SAMPLES} IMU samples, got {len(rates)}")
    arm_body_m = fault.magnitude_in("m") * _X
    step_s = (timestamps_us[-1] - timestamps_us[0]) / (len(timestamps_us) - 1) / US_PER_S
    rates_of_rates = savgol_filter(rates, _DERIVATIVE_SAMPLES, 3, deriv=1, delta=step_s, axis=0)
    # w' x r + w x (w x r)
    lever_arm_m_s2 = np.cross(rates_of_rates, arm_body_m) + np.cross(rates, np.cross(rates, arm_body_m))
    file[ACCEL][window] = file[ACCEL][window] + lever_arm_m_s2


def noise_misdeclared(file: h5py.File, fault: Fault) -> None:
    """Declare every noise of the unit too large by the magnitude."""
    declare_noise(file, METADATA, _NOISES, fault)


def _declared_gravity(file: h5py.File) -> float:
    if METADATA not in file or "gravity" not in file[METADATA].attrs:
        raise FaultError(f"Expected a declared gravity in {METADATA}, got none")
    return float(file[METADATA].attrs["gravity"])


def _add_gravity(file: h5py.File, fault: Fault, upward_m_s2: float) -> None:
    window = window_of(file, "imu", fault)
    up_body = attitudes_at(file, file[TIMESTAMPS][window]).inv().apply([0.0, 0.0, 1.0])
    file[ACCEL][window] = file[ACCEL][window] + upward_m_s2 * up_body
