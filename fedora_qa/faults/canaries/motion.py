"""Faults of IMU and pose values.

Faults of their timestamps are in ``timestamps.py``, those of the declared noise in ``declarations.py``.
"""

from typing import Final

from fedora_qa.faults.canary_conditions import CanaryConditions
from fedora_qa.faults.fault import Fault
from fedora_qa.faults.motion import AccelBias, GyroBias, QuaternionLength, Teleport

_LEAST_STRETCH: Final = 1e-3


def long_quaternions(conditions: CanaryConditions) -> Fault:
    """Quaternions are longer than 1."""
    return conditions.planted(QuaternionLength(conditions.size("length_error", at_least=_LEAST_STRETCH)))


def teleport(conditions: CanaryConditions) -> Fault:
    """Positions are displaced to the east from the place on."""
    # World frame (ENU): X points east.
    displacement_m = conditions.size("position_jump"), 0.0, 0.0
    return conditions.planted(Teleport(displacement_m, rows=(conditions.row_at_place("pose"), None)))


def gyro_bias(conditions: CanaryConditions) -> Fault:
    """Angular velocities about X are too large by a constant."""
    # Body frame: X points forward, so that the bias is one of the roll rate.
    return conditions.planted(GyroBias((conditions.size("bias_x"), 0.0, 0.0)))


def accel_bias(conditions: CanaryConditions) -> Fault:
    """Specific forces along X are too large by a constant."""
    return conditions.planted(AccelBias((conditions.size("bias_x"), 0.0, 0.0)))
