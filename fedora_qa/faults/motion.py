"""Faults of IMU and pose values.

Faults of their timestamps are in ``timestamps.py``, those of the declared noise in ``declarations.py``.
"""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.canary_conditions import CanaryConditions
from fedora_qa.faults.fault import Fault, values, values_by_row

_LEAST_STRETCH: Final = 1e-3
_ALONG_X: Final = np.array([1.0, 0.0, 0.0])


def long_quaternions(conditions: CanaryConditions) -> Fault:
    """Quaternions are longer than 1."""
    factor = 1 + conditions.size("length_error", at_least=_LEAST_STRETCH)
    return Fault(f"quaternions have the length {factor:.6g}", {"path/pose/orientation": values(lambda q: q * factor)})


def teleport(conditions: CanaryConditions) -> Fault:
    """Positions are displaced to the east from the place on."""
    size_m, row = conditions.size("position_jump"), conditions.row_at_place("pose")

    def alter(positions: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
        # World frame (ENU): X points east.
        return np.asarray(positions + np.outer(rows >= row, _ALONG_X) * size_m)

    return Fault(f"positions jump by {size_m:.3g} m at row {row}", {"path/pose/position": values_by_row(alter)})


def gyro_bias(conditions: CanaryConditions) -> Fault:
    """Angular velocities about X are too large by a constant."""
    bias = conditions.size("bias_x")
    # Body frame: X points forward, so that the bias is one of the roll rate.
    description = f"the gyro is biased by {bias:.3g} rad/s"
    return Fault(description, {"path/imu/angular_velocity": values(lambda rates: rates + bias * _ALONG_X)})


def accel_bias(conditions: CanaryConditions) -> Fault:
    """Specific forces along X are too large by a constant."""
    bias = conditions.size("bias_x")
    description = f"the accelerometer is biased by {bias:.3g} m/s^2"
    return Fault(description, {"path/imu/linear_acceleration": values(lambda forces: forces + bias * _ALONG_X)})
