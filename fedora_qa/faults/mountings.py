"""Faults of the mountings of cameras on the body: they are declared wrongly, or flow was made with wrong ones."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fedora_qa.conventions import R_BODY_OPTICAL, SAME_AXES
from fedora_qa.faults.camera_changes import Change, declared, planted, removed
from fedora_qa.faults.fault import Fault, Matrix3, Vector3, signed_length
from fedora_qa.geometry import so3
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows


@dataclass(frozen=True, slots=True)
class MountingRotation:
    """Cameras are rotated in their mounting: ``R_body_camera' = R_body_camera Exp(rotation)``.

    Attributes
    ----------
    stream
        ``metadata``: the declared cameras; flow, or a rate: the camera that the flow was made with.
    rotation_deg
        Rotation vector in optical axes: about Z, a roll clockwise as seen from behind the camera.
    camera
        The declared camera; None: all of them. Without meaning for flow.
    """

    stream: str
    rotation_deg: Vector3
    camera: str | None = None
    cause: ClassVar[str] = "extrinsic_rotation"

    @property
    def magnitude(self) -> float:
        """Angle, deg, with the sign of the largest component."""
        return signed_length(self.rotation_deg)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Rotate the cameras."""
        description = f"the camera of {self.camera or self.stream} is rotated by {self.magnitude:.3g} deg"
        return planted(facts, sequence, self.stream, description, self._by(1), self.camera)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Rotate them back."""
        description = f"the camera of {self.camera or self.stream} back by {self.magnitude:.3g} deg"
        return removed(facts, sequence, self.stream, description, self._by(1), self._by(-1), self.camera)

    def _by(self, sign: int) -> Change:
        T_camera_rotated = np.eye(4)
        T_camera_rotated[:3, :3] = so3.exp(sign * np.radians(self.rotation_deg))
        return lambda camera: replace(camera, T_body_camera=camera.T_body_camera @ T_camera_rotated)


@dataclass(frozen=True, slots=True)
class MountingLeverArm:
    """Cameras are declared too far along the axes of the body.

    Attributes
    ----------
    arm_body_m
        Declared less correct position.
    camera
        The declared camera; None: all of them.
    """

    arm_body_m: Vector3
    camera: str | None = None
    cause: ClassVar[str] = "lever_arm"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float:
        """Length of the displacement, m, with the sign of its largest component."""
        return signed_length(self.arm_body_m)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Add the displacement."""
        description = f"{self._cameras} declared {abs(self.magnitude):.3g} m from the place"
        return planted(facts, sequence, self.stream, description, self._by(1), self.camera)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Subtract the displacement."""
        description = f"{self._cameras} back by {abs(self.magnitude):.3g} m"
        return removed(facts, sequence, self.stream, description, self._by(1), self._by(-1), self.camera)

    @property
    def _cameras(self) -> str:
        return f"the camera of {self.camera}" if self.camera else "cameras"

    def _by(self, sign: int) -> Change:
        shift = np.zeros((4, 4))
        shift[:3, 3] = sign * np.array(self.arm_body_m)
        return lambda camera: replace(camera, T_body_camera=camera.T_body_camera + shift)


@dataclass(frozen=True, slots=True)
class MountingUnit:
    """Positions of the cameras on the body are declared in another unit than metres.

    Attributes
    ----------
    factor
        Declared over correct value: 1000 for millimetres.
    distance_m
        Declared less correct distance of the farthest camera from the origin of the body.
    """

    factor: float
    distance_m: float = 0.0
    cause: ClassVar[str] = "lever_arm"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float | None:
        """Displacement of the farthest camera, m."""
        return self.distance_m or None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Multiply the positions."""
        description = f"cameras are declared {self.factor:.6g} times too far from the body"
        return declared(facts, description, self._by(self.factor), None)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide the positions."""
        description = f"positions of the cameras on the body divided by {self.factor:.6g}"
        return declared(facts, description, self._by(1 / self.factor), None)

    def _by(self, gain: float) -> Change:
        gains = np.ones((4, 4))
        gains[:3, 3] = gain
        return lambda camera: replace(camera, T_body_camera=camera.T_body_camera * gains)


@dataclass(frozen=True, slots=True)
class CameraAxes:
    """Mountings of cameras are declared in other optical axes: ``R_body_camera' = R_body_camera axes``.

    Attributes
    ----------
    axes
        Rotation; by default that of body axes taken for optical ones, of a camera that looks straight ahead.
    body_axes
        Rotation to the axes of another body, in which positions are declared, too:
        ``T_body_camera' = body_axes T_body_camera``.
    """

    axes: Matrix3 = tuple(zip(*R_BODY_OPTICAL, strict=True))  # type: ignore[assignment]  # the transpose
    body_axes: Matrix3 = SAME_AXES
    cause: ClassVar[str] = "frame_convention"
    stream: ClassVar[str] = "metadata"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the other axes."""
        return self._declared(facts, "cameras are declared in other axes", self.body_axes, self.axes)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare optical axes, and those of the body."""
        to = "the axes of the body" if np.array_equal(self.axes, SAME_AXES) else "optical axes"
        transposed = (np.array(axes).T for axes in (self.body_axes, self.axes))
        return self._declared(facts, f"cameras back to {to}", *transposed)

    def _declared(self, facts: Facts, description: str, body_axes: ArrayLike, axes: ArrayLike) -> Fault:
        T_written_body, T_camera_written = np.eye(4), np.eye(4)
        T_written_body[:3, :3], T_camera_written[:3, :3] = body_axes, axes

        def changed(camera: Camera) -> Camera:
            return replace(camera, T_body_camera=T_written_body @ camera.T_body_camera @ T_camera_written)

        return declared(facts, description, changed, None)


@dataclass(frozen=True, slots=True)
class InvertedMounting:
    """Mountings are declared as ``T_camera_body``, from the body to the camera.

    Attributes
    ----------
    camera
        The declared camera; None: all of them.
    """

    camera: str | None = None
    cause: ClassVar[str] = "frame_convention"
    stream: ClassVar[str] = "metadata"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the inverse."""
        return self._inverted(facts, f"the mounting of {self.camera or 'all cameras'} is inverted")

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the inverse of the inverse."""
        return self._inverted(facts, f"the mounting of {self.camera or 'all cameras'} inverted back")

    def _inverted(self, facts: Facts, description: str) -> Fault:
        def inverted(camera: Camera) -> Camera:
            return replace(camera, T_body_camera=np.linalg.inv(camera.T_body_camera).astype(np.float64))

        return declared(facts, description, inverted, self.camera)
