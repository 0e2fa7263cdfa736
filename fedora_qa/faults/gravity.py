"""Faults of the IMU that refer to the attitude: gravity in specific forces, and vectors in the axes of the world."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.fault import (
    KEYS_OF_SENSORS,
    Fault,
    InapplicableError,
    Read,
    RowRange,
    Sensor,
    Vector3,
    streams_in,
    values,
)
from fedora_qa.geometry import so3
from fedora_qa.geometry.motion import STENCIL, interpolate_poses
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

Float64 = NDArray[np.float64]

_ACCEL, _ORIENTATION = "path/imu/linear_acceleration", "path/pose/orientation"
_UP: Final = np.array([0.0, 0.0, 1.0])

Attitudes = Callable[[int, int], Float64]
"""From rows of the IMU, first and behind the last, to ``R_world_body`` (n, 3, 3) at their times."""


@dataclass(frozen=True, slots=True)
class GravityError:
    """Specific force contains gravity with a wrong factor: ``f + e g R_body_world (0, 0, 1)``, g the declared gravity.

    Attitudes are those of the pose, interpolated at IMU times; beyond the poses the nearest.

    Attributes
    ----------
    cause
        ``gravity_missing``, ``gravity_sign`` or ``gravity_magnitude``.
    excess_m_s2
        e g, of ``gravity_magnitude``: positive if the gravity of the samples exceeds the declared one. The other
        causes have e = -1 and e = -2.
    rows
        The samples; None: all.
    """

    cause: Literal["gravity_missing", "gravity_sign", "gravity_magnitude"]
    excess_m_s2: float = 0.0
    rows: RowRange | None = None
    stream: ClassVar[str] = "imu"

    @property
    def magnitude(self) -> float | None:
        """Excess of gravity, m/s^2; None for causes without a size."""
        return self.excess_m_s2 if self.cause == "gravity_magnitude" else None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Add the wrong part."""
        upward_m_s2 = self._upward_m_s2(facts)
        description = f"specific force has {upward_m_s2:+.4g} m/s^2 along the vertical"
        return _lifted(facts, sequence, description, upward_m_s2, self.rows)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Subtract the wrong part."""
        upward_m_s2 = -self._upward_m_s2(facts)
        description = f"{upward_m_s2:+.4g} m/s^2 added along the vertical"
        return _lifted(facts, sequence, description, upward_m_s2, self.rows)

    def _upward_m_s2(self, facts: Facts) -> float:
        if self.cause == "gravity_magnitude":
            return self.excess_m_s2
        if facts.declared.imu is None:
            raise InapplicableError("Expected a declared gravity, got none")
        return (-1 if self.cause == "gravity_missing" else -2) * facts.declared.imu.gravity


@dataclass(frozen=True, slots=True)
class GravityAlongBody:
    """Gravity was subtracted as a constant of the body, whatever the attitude is.

    Attributes
    ----------
    removed_body_m_s2
        What was subtracted, such as the mean or the first specific force; None: the declared gravity along Z.
    """

    removed_body_m_s2: Vector3 | None = None
    cause: ClassVar[str] = "gravity_missing"
    stream: ClassVar[str] = "imu"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Subtract gravity."""
        return self._changed(facts, f"gravity is subtracted along {self._axis}", -1.0)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Add gravity."""
        return self._changed(facts, f"gravity added along {self._axis}", 1.0)

    @property
    def _axis(self) -> str:
        if self.removed_body_m_s2 is None:
            return "the body's Z axis"
        x, y, z = self.removed_body_m_s2
        return f"({x:.4g}, {y:.4g}, {z:.4g}) m/s^2 of the body"

    def _changed(self, facts: Facts, description: str, sign: float) -> Fault:
        streams_in(facts, self.stream)
        if self.removed_body_m_s2 is not None:
            along_body_m_s2 = sign * np.array(self.removed_body_m_s2)
        elif facts.declared.imu is not None:
            along_body_m_s2 = sign * facts.declared.imu.gravity * _UP
        else:
            raise InapplicableError("Expected a declared gravity, got none")
        return Fault(description, {_ACCEL: values(lambda forces: forces + along_body_m_s2)})


@dataclass(frozen=True, slots=True)
class ForceSign:
    """Specific forces have the opposite sign: at rest the accelerometer measures gravity and not what opposes it."""

    cause: ClassVar[str] = "gravity_sign"
    stream: ClassVar[str] = "imu"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Reverse the sign."""
        return self._reversed(facts)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Reverse it again."""
        return self._reversed(facts)

    def _reversed(self, facts: Facts) -> Fault:
        streams_in(facts, self.stream)
        return Fault("the sign of specific forces is reversed", {_ACCEL: values(np.negative)})


@dataclass(frozen=True, slots=True)
class SensorsInWorld:
    """Vectors of the IMU are written in the axes of the world: ``v' = R_world_body v``.

    Attitudes are those of the pose, as of ``GravityError``.

    Attributes
    ----------
    sensors
        Whose vectors.
    """

    sensors: tuple[Sensor, ...]
    cause: ClassVar[str] = "frame_convention"
    stream: ClassVar[str] = "imu"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Write the vectors in the axes of the world."""
        return self._turned(facts, sequence, f"{self._names} in the axes of the world", "nij,nj->ni")

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Write the vectors in the axes of the body."""
        return self._turned(facts, sequence, f"{self._names} back to the axes of the body", "nji,nj->ni")

    @property
    def _names(self) -> str:
        return f"vectors of {' and '.join(self.sensors)}"

    def _turned(self, facts: Facts, sequence: SequenceRows, description: str, product: str) -> Fault:
        attitudes = _attitudes_at(facts, sequence)

        def alter(read: Read, start: int, stop: int) -> NDArray[Any]:
            return np.asarray(np.einsum(product, attitudes(start, stop), read(start, stop)))

        return Fault(description, {KEYS_OF_SENSORS[sensor]: alter for sensor in self.sensors})


def _lifted(facts: Facts, sequence: SequenceRows, description: str, upward_m_s2: float, rows: RowRange | None) -> Fault:
    """Return the fault that adds an acceleration along the vertical of the world to specific forces."""
    attitudes = _attitudes_at(facts, sequence)

    def alter(read: Read, start: int, stop: int) -> NDArray[Any]:
        first, last = (start, stop) if rows is None else (max(rows[0], start), min(rows[1] or stop, stop))
        forces = np.array(read(start, stop))
        if first < last:
            # R_body_world up = R_world_body^T up.
            up_body = np.einsum("nji,j->ni", attitudes(first, last), _UP)
            forces[first - start : last - start] += upward_m_s2 * up_body
        return forces

    return Fault(description, {_ACCEL: alter})


def _attitudes_at(facts: Facts, sequence: SequenceRows) -> Attitudes:
    """Return what gives attitudes at times of the IMU."""
    for stream in ("imu", "pose"):
        streams_in(facts, stream)
    clock, times_ns = facts.clocks["pose"], facts.clocks["imu"].times_ns
    pose_rows = np.flatnonzero(clock.advancing)
    pose_ns = clock.times_ns[pose_rows]
    if not len(pose_ns):
        raise InapplicableError("Expected poses with timestamps that advance, got none")

    def attitudes(start: int, stop: int) -> Float64:
        if start >= stop:
            return np.empty((0, 3, 3))
        at_ns = np.clip(times_ns[start:stop], pose_ns[0], pose_ns[-1])
        # The poses around these times, with all that the interpolation uses.
        first = max(int(np.searchsorted(pose_ns, at_ns.min())) - STENCIL, 0)
        last = min(int(np.searchsorted(pose_ns, at_ns.max())) + STENCIL, len(pose_ns) - 1)
        chosen = pose_rows[first : last + 1]
        q = sequence.rows(_ORIENTATION, int(chosen[0]), int(chosen[-1]) + 1)[chosen - chosen[0]]
        near_ns = pose_ns[first : last + 1]
        R_world_body, _ = interpolate_poses(near_ns, np.zeros((len(q), 3)), q, at_ns=at_ns)
        # Within a gap of the poses the attitude is the one of the pose before it.
        held = np.flatnonzero(np.isnan(R_world_body).any(axis=(1, 2)))
        R_world_body[held] = so3.matrices_from_quaternions(q[np.searchsorted(near_ns, at_ns[held], "right") - 1])
        return R_world_body

    return attitudes
