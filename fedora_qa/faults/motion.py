"""Faults of IMU and pose values, and their canaries; those of axes are in ``axes.py``, of gravity in ``gravity.py``."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.canary_conditions import CanaryConditions
from fedora_qa.faults.fault import (
    Fault,
    Matrix3,
    Read,
    RowRange,
    Vector3,
    in_rows,
    signed_length,
    streams_in,
    values,
    within,
)
from fedora_qa.geometry import so3
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

Float64 = NDArray[np.float64]

_GYRO, _ACCEL = "path/imu/angular_velocity", "path/imu/linear_acceleration"
_POSITION, _ORIENTATION = "path/pose/position", "path/pose/orientation"

_LEAST_STRETCH: Final = 1e-3


@dataclass(frozen=True, slots=True)
class GyroBias:
    """Angular velocities are too large by a constant.

    Attributes
    ----------
    bias_rad_s
        About body X, Y and Z.
    rows
        The samples; None: all.
    """

    bias_rad_s: Vector3
    rows: RowRange | None = None
    cause: ClassVar[str] = "gyro_bias"
    stream: ClassVar[str] = "imu"

    @property
    def magnitude(self) -> float:
        """Length of the bias, rad/s, with the sign of its largest component."""
        return signed_length(self.bias_rad_s)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Add the bias."""
        return _displaced(facts, _GYRO, f"the gyro is biased by {self.magnitude:.3g} rad/s", self.bias_rad_s, self.rows)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Subtract the bias."""
        description = f"{self.magnitude:.3g} rad/s subtracted from the gyro"
        return _displaced(facts, _GYRO, description, _opposite(self.bias_rad_s), self.rows)


@dataclass(frozen=True, slots=True)
class AccelBias:
    """Specific forces are too large by a constant.

    Attributes
    ----------
    bias_m_s2
        Along body X, Y and Z.
    rows
        The samples; None: all.
    """

    bias_m_s2: Vector3
    rows: RowRange | None = None
    cause: ClassVar[str] = "accel_bias"
    stream: ClassVar[str] = "imu"

    @property
    def magnitude(self) -> float:
        """Length of the bias, m/s^2, with the sign of its largest component."""
        return signed_length(self.bias_m_s2)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Add the bias."""
        description = f"the accelerometer is biased by {self.magnitude:.3g} m/s^2"
        return _displaced(facts, _ACCEL, description, self.bias_m_s2, self.rows)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Subtract the bias."""
        description = f"{self.magnitude:.3g} m/s^2 subtracted from the accelerometer"
        return _displaced(facts, _ACCEL, description, _opposite(self.bias_m_s2), self.rows)


@dataclass(frozen=True, slots=True)
class Teleport:
    """Positions are displaced within a range of rows.

    Attributes
    ----------
    displacement_m
        In the world (east, north, up).
    rows
        The first displaced row, and the row where positions are correct again; None for the latter: none.
    """

    displacement_m: Vector3
    rows: RowRange
    cause: ClassVar[str] = "teleport"
    stream: ClassVar[str] = "pose"

    @property
    def magnitude(self) -> float:
        """Length of the displacement, m, with the sign of its largest component."""
        return signed_length(self.displacement_m)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Add the displacement."""
        description = f"positions jump by {abs(self.magnitude):.3g} m at row {self.rows[0]}"
        return _displaced(facts, _POSITION, description, self.displacement_m, self.rows)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Subtract the displacement."""
        description = f"positions back by {abs(self.magnitude):.3g} m from row {self.rows[0]}"
        return _displaced(facts, _POSITION, description, _opposite(self.displacement_m), self.rows)


@dataclass(frozen=True, slots=True)
class PoseLeverArm:
    """Positions are those of another point of the body: ``p + R_world_body arm``.

    Attributes
    ----------
    arm_body_m
        From the body's origin to that point.
    rows
        The poses; None: all.
    """

    arm_body_m: Vector3
    rows: RowRange | None = None
    cause: ClassVar[str] = "lever_arm"
    stream: ClassVar[str] = "pose"

    @property
    def magnitude(self) -> float:
        """Length of the arm, m, with the sign of its largest component."""
        return signed_length(self.arm_body_m)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Move positions to the other point."""
        description = f"positions of a point {self.magnitude:.3g} m from the origin"
        return self._moved(facts, sequence, description, self.arm_body_m)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Move positions to the body's origin."""
        description = f"positions back by {self.magnitude:.3g} m in the body"
        return self._moved(facts, sequence, description, _opposite(self.arm_body_m))

    def _moved(self, facts: Facts, sequence: SequenceRows, description: str, arm: Vector3) -> Fault:
        streams_in(facts, self.stream)

        def alter(read: Read, start: int, stop: int) -> NDArray[Any]:
            R_world_body = so3.matrices_from_quaternions(sequence.rows(_ORIENTATION, start, stop))
            displaced = within(np.arange(start, stop), self.rows)[:, None]
            return np.asarray(read(start, stop) + np.where(displaced, R_world_body @ np.array(arm), 0.0))

        return Fault(description, {_POSITION: alter})


@dataclass(frozen=True, slots=True)
class QuaternionOrder:
    """Components of quaternions are in another order.

    Attributes
    ----------
    order
        Which of x, y, z, w (0 to 3) is stored at each place: (3, 0, 1, 2) for w, x, y, z.
    inverted
        Whether they rotate from world to body, too.
    rows
        The poses; None: all.
    """

    order: tuple[int, int, int, int] = (3, 0, 1, 2)
    inverted: bool = False
    rows: RowRange | None = None
    cause: ClassVar[str] = "quaternion_order"
    stream: ClassVar[str] = "pose"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Store the components in this order."""
        order = list(self.order)
        description = f"quaternions are {', '.join('xyzw'[place] for place in order)}"
        if self.inverted:
            description += ", from world to body"
        return _of_orientations(
            facts, description, lambda q: (so3.inverse(q) if self.inverted else q)[:, order], self.rows
        )

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Return to x, y, z, w."""
        places = np.argsort(self.order)
        description = "quaternions back to x, y, z, w" + (", from body to world" if self.inverted else "")
        return _of_orientations(
            facts, description, lambda q: so3.inverse(q[:, places]) if self.inverted else q[:, places], self.rows
        )


@dataclass(frozen=True, slots=True)
class QuaternionInversion:
    """Quaternions rotate from world to body.

    Attributes
    ----------
    rows
        The poses; None: all.
    """

    rows: RowRange | None = None
    cause: ClassVar[str] = "quaternion_inverted"
    stream: ClassVar[str] = "pose"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Conjugate the quaternions."""
        return _of_orientations(facts, "quaternions take the world to the body", so3.inverse, self.rows)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Conjugate them again: conjugation is its own inverse."""
        return _of_orientations(facts, "quaternions are inverted", so3.inverse, self.rows)


@dataclass(frozen=True, slots=True)
class AngleOrder:
    """Yaw, pitch and roll were combined in reverse order: ``R' = R_x(roll) R_y(pitch) R_z(yaw)``.

    Written are the angles of ``R = R_z(yaw) R_y(pitch) R_x(roll)``, as of ``ZYX`` taken for ``XYZ``.

    Attributes
    ----------
    were_taken_so
        Whether angles were taken in the reverse order and combined in the right one instead: R' for R, and R for R'.
    """

    were_taken_so: bool = False
    cause: ClassVar[str] = "frame_convention"
    stream: ClassVar[str] = "pose"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Combine the angles in reverse order."""
        if self.were_taken_so:
            return _of_orientations(facts, "yaw, pitch and roll are taken in reverse order", _from_reverse_order)
        return _of_orientations(facts, "yaw, pitch and roll are combined in reverse order", _in_reverse_order)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Combine the angles in the order in which they were taken."""
        if self.were_taken_so:
            return _of_orientations(facts, "yaw, pitch and roll are taken in the other order", _in_reverse_order)
        return _of_orientations(facts, "yaw, pitch and roll are combined in the other order", _from_reverse_order)


def _in_reverse_order(orientations_xyzw: Float64) -> Float64:
    """Return ``R_x(roll) R_y(pitch) R_z(yaw)`` of ``R_z(yaw) R_y(pitch) R_x(roll)``, as quaternions (n, 4)."""
    # (R_x(roll) R_y(pitch) R_z(yaw))^-1 = R_z(-yaw) R_y(-pitch) R_x(-roll)
    return so3.inverse(_with_angles_negated(orientations_xyzw))


def _from_reverse_order(orientations_xyzw: Float64) -> Float64:
    """Return the inverse of ``_in_reverse_order``."""
    return _with_angles_negated(so3.inverse(orientations_xyzw))


def _with_angles_negated(orientations_xyzw: Float64) -> Float64:
    """Return quaternions (n, 4) of the negative yaw, pitch and roll, of the same lengths.

    Of the two quaternions of a rotation the one nearer to the inverse is returned, to which it is equal for a rotation
    about one axis.
    """
    negated = so3.quaternions_from_angles(-so3.angles_from_quaternions(orientations_xyzw))
    alike = np.einsum("ni,ni->n", negated, so3.inverse(orientations_xyzw)) >= 0
    signs = np.where(alike, 1.0, -1.0)
    return np.asarray(negated * (signs * np.linalg.norm(orientations_xyzw, axis=-1))[:, None])


@dataclass(frozen=True, slots=True)
class AngleSense:
    """Yaw, pitch or roll is counted the other way, and yaw from another direction.

    Attributes
    ----------
    signs
        Of yaw, pitch and roll, of ``R = R_z(yaw) R_y(pitch) R_x(roll)``: -1 for an angle that is counted the other way.
    world_turn
        Rotation of the world behind it: ``R = world_turn R'``, where R' has the angles with these signs.
    """

    signs: tuple[int, int, int]
    world_turn: Matrix3 = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    cause: ClassVar[str] = "frame_convention"
    stream: ClassVar[str] = "pose"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Count the angles the other way."""
        turn = so3.inverse(so3.quaternions_from_matrices(np.array(self.world_turn)))
        description = f"{self._angles} counted the other way"
        return _of_orientations(facts, description, lambda q: _with_signs(so3.compose(turn, q), self.signs))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Count the angles as the format does."""
        turn = so3.quaternions_from_matrices(np.array(self.world_turn))
        description = f"{self._angles} counted the other way again"
        return _of_orientations(facts, description, lambda q: so3.compose(turn, _with_signs(q, self.signs)))

    @property
    def _angles(self) -> str:
        names = [name for name, sign in zip(("yaw", "pitch", "roll"), self.signs, strict=True) if sign < 0]
        return f"{' and '.join(names)} {'is' if len(names) == 1 else 'are'}"


def _with_signs(orientations_xyzw: Float64, signs: tuple[int, int, int]) -> Float64:
    """Return quaternions (n, 4) of yaw, pitch and roll with these signs, of the same lengths.

    Of the two quaternions of a rotation that one is returned which turns into the given one by the same signs.
    """
    angles_rad = so3.angles_from_quaternions(orientations_xyzw)
    before, after = so3.quaternions_from_angles(angles_rad), so3.quaternions_from_angles(angles_rad * signs)
    lengths = np.linalg.norm(orientations_xyzw, axis=-1)
    is_same = np.einsum("ni,ni->n", before, orientations_xyzw) >= 0
    return np.asarray(after * np.where(is_same, lengths, -lengths)[:, None])


@dataclass(frozen=True, slots=True)
class PoseInversion:
    """Poses are ``T_body_world``: quaternions rotate from world to body, positions are of the world in the body."""

    cause: ClassVar[str] = "quaternion_inverted"
    stream: ClassVar[str] = "pose"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Invert the poses."""
        return self._inverted(facts, sequence, "poses take the world to the body")

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Invert them again: inversion is its own inverse."""
        return self._inverted(facts, sequence, "poses are inverted")

    def _inverted(self, facts: Facts, sequence: SequenceRows, description: str) -> Fault:
        streams_in(facts, self.stream)

        def alter(read: Read, start: int, stop: int) -> NDArray[Any]:
            # The inverse of (R, p) is (R^T, -R^T p).
            R_world_body = so3.matrices_from_quaternions(sequence.rows(_ORIENTATION, start, stop))
            return np.asarray(-np.einsum("nji,nj->ni", R_world_body, read(start, stop)))

        return Fault(description, {_POSITION: alter, _ORIENTATION: values(so3.inverse)})


@dataclass(frozen=True, slots=True)
class QuaternionLength:
    """Quaternions are not of unit length.

    Attributes
    ----------
    excess
        Length above 1; without influence on the undoing, which normalises each quaternion.
    """

    excess: float
    cause: ClassVar[str] = "quaternion_not_unit"
    stream: ClassVar[str] = "pose"

    @property
    def magnitude(self) -> float:
        """Length above 1."""
        return self.excess

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Multiply by the length."""
        length = 1 + self.excess
        return _of_orientations(facts, f"quaternions have the length {length:.6g}", lambda q: q * length)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Normalise; quaternions of length 0 have no direction, and stay."""

        def alter(q: NDArray[Any]) -> NDArray[Any]:
            unit = so3.normalise(q)
            return np.where(np.isfinite(unit), unit, q)

        return _of_orientations(facts, "quaternions are normalised", alter)


def _opposite(vector: Vector3) -> Vector3:
    return -vector[0], -vector[1], -vector[2]


def _displaced(facts: Facts, key: str, description: str, vector: Vector3, rows: RowRange | None) -> Fault:
    streams_in(facts, key.split("/")[1])
    return Fault(description, {key: in_rows(lambda vectors: vectors + np.array(vector), rows)})


def _of_orientations(
    facts: Facts, description: str, alter: Callable[[NDArray[Any]], NDArray[Any]], rows: RowRange | None = None
) -> Fault:
    streams_in(facts, "pose")
    return Fault(description, {_ORIENTATION: in_rows(alter, rows)})


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
