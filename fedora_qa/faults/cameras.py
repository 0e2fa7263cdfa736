"""Faults of cameras: they are declared wrongly, or flow was made with a wrong one.

Flow of a wrong camera is undone by the difference of two flows made from the depth and the poses of the file, with the
wrong and the declared camera, so that noise of the poses cancels to first order.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.faults.fault import Fault, InapplicableError, Read, Vector3, signed_length, streams_in
from fedora_qa.geometry import so3
from fedora_qa.geometry.camera import camera_motion
from fedora_qa.geometry.motion import STENCIL, interpolate_poses
from fedora_qa.geometry.rigid_flow import rigid_flow
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Clock, Facts
from fedora_qa.sequence.sequence import SequenceRows

Float64 = NDArray[np.float64]
Change = Callable[[Camera], Camera]

_ROUNDING: Final = 1e-6
"""Rounding of a K that was stored in float32, as in ``metadata.cameras``."""


@dataclass(frozen=True, slots=True)
class FocalLength:
    """Focal lengths are too large by a factor.

    Attributes
    ----------
    stream
        ``metadata``: of the declared cameras; flow, or a rate: of the camera that the flow was made with.
    percent
        Excess of the factor over 1.
    camera
        The declared camera; None: all of them. Without meaning for flow.
    rows_percent
        That of the focal length along rows of pixels, fy; None: the same as along columns.
    """

    stream: str
    percent: float
    camera: str | None = None
    rows_percent: float | None = None
    cause: ClassVar[str] = "intrinsics_focal"

    @property
    def magnitude(self) -> float:
        """Excess of the factor, percent; the larger one of both axes."""
        return max(self.percent, self.percent if self.rows_percent is None else self.rows_percent, key=abs)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Multiply the focal lengths."""
        description = f"the focal length of {self.camera or self.stream} is {self.magnitude:.3g}% too large"
        change = self._by(*self._gains)
        return _planted(facts, sequence, self.stream, description, change, self.camera)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide the focal lengths."""
        along_columns, along_rows = self._gains
        by = f"{along_columns:.6g}" + ("" if along_rows == along_columns else f" and {along_rows:.6g}")
        description = f"the focal length of {self.camera or self.stream} divided by {by}"
        wrong, correct = self._by(along_columns, along_rows), self._by(1 / along_columns, 1 / along_rows)
        return _removed(facts, sequence, self.stream, description, wrong, correct, self.camera)

    @property
    def _gains(self) -> tuple[float, float]:
        rows_percent = self.percent if self.rows_percent is None else self.rows_percent
        return 1 + self.percent / 100, 1 + rows_percent / 100

    def _by(self, along_columns: float, along_rows: float) -> Change:
        # fx, fy and the skew between them.
        gains = np.array([[along_columns, along_columns, 1.0], [1.0, along_rows, 1.0], [1.0, 1.0, 1.0]])
        return lambda camera: replace(camera, K=camera.K * gains)


@dataclass(frozen=True, slots=True)
class PrincipalPointShift:
    """Principal points are too far to the right and down.

    Attributes
    ----------
    stream
        ``metadata``: of the declared cameras; flow, or a rate: of the camera that the flow was made with.
    columns_px, rows_px
        In the pixels of each camera.
    camera
        The declared camera; None: all of them. Without meaning for flow.
    """

    stream: str
    columns_px: float
    rows_px: float = 0.0
    camera: str | None = None
    cause: ClassVar[str] = "intrinsics_centre"

    @property
    def magnitude(self) -> float:
        """Length of the displacement, px; negative if its larger part is to the left or up."""
        return signed_length((self.columns_px, self.rows_px))

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Displace the principal points."""
        description = f"the principal point of {self.camera or self.stream} is displaced by {self.magnitude:.3g} px"
        return _planted(facts, sequence, self.stream, description, self._by(1), self.camera)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Displace them back."""
        description = f"the principal point of {self.camera or self.stream} back by {self.magnitude:.3g} px"
        return _removed(facts, sequence, self.stream, description, self._by(1), self._by(-1), self.camera)

    def _by(self, sign: int) -> Change:
        shift = np.zeros((3, 3))
        shift[:2, 2] = sign * self.columns_px, sign * self.rows_px
        return lambda camera: replace(camera, K=camera.K + shift)


@dataclass(frozen=True, slots=True)
class TransposedIntrinsics:
    """Cameras are declared with the transposed K, as libraries that multiply rows by matrices store it.

    Attributes
    ----------
    from_centre_px
        By how much principal points at 0, 0 are too far right and down: negative.
    """

    from_centre_px: float = 0.0
    cause: ClassVar[str] = "intrinsics_centre"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float | None:
        """Displacement of the principal point, px."""
        return self.from_centre_px or None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Transpose K of all cameras."""
        return _declared(facts, "K is transposed", lambda camera: replace(camera, K=camera.K.T), None)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Transpose the K that has the form of a K only once it is transposed."""
        return _declared(
            facts,
            "K transposed back",
            lambda camera: replace(camera, K=camera.K.T) if is_transposed(camera.K) else camera,
            None,
        )


def is_transposed(K: Float64) -> bool:
    """Whether K is not [fx 0 cx; 0 fy cy; 0 0 1], and its transpose is."""
    return not _has_form(K) and _has_form(K.T)


def _has_form(K: Float64) -> bool:
    # Without skew: the entries below the diagonal, and the one beside it, are 0.
    zeros = K[1, 0], K[2, 0], K[2, 1], K[0, 1]
    return bool(np.allclose(zeros, 0.0, rtol=0.0, atol=_ROUNDING) and abs(K[2, 2] - 1.0) <= _ROUNDING)


@dataclass(frozen=True, slots=True)
class IntrinsicsOfSize:
    """K of a camera is that of an image of another size with the same view.

    Attributes
    ----------
    camera
        The declared camera.
    width, height
        Of the other image, px. Pixels are square, so that the ratio of the widths is that of the focal lengths, and the
        middles of both images coincide.
    percent
        Excess of the focal length.
    about_corner
        Whether K was scaled about the corner of the image. If not, its rows were multiplied, which scales it about the
        middle of the first pixel, by the ratio that ``percent`` states.
    """

    camera: str
    width: int
    height: int
    percent: float
    about_corner: bool = True
    cause: ClassVar[str] = "intrinsics_focal"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float:
        """Excess of the focal length, percent."""
        return self.percent

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare K of the other size."""
        return self._scaled(facts, f"K of {self.camera} is that of {self.width} x {self.height} px", forward=True)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare K of the size of the camera."""
        return self._scaled(
            facts, f"K of {self.camera} from {self.width} x {self.height} px to its size", forward=False
        )

    def _scaled(self, facts: Facts, description: str, *, forward: bool) -> Fault:
        return _declared(facts, description, lambda camera: self.changed(camera, forward=forward), self.camera)

    def changed(self, camera: Camera, *, forward: bool) -> Camera:
        """Return the camera with K of the other size, or with K of its own size in place of that."""
        if not self.about_corner:
            ratio = (1 + self.percent / 100) ** (1 if forward else -1)
            return replace(camera, K=np.diag([ratio, ratio, 1.0]) @ camera.K)
        own, other = _of_size(camera.width, camera.height), _of_size(self.width, self.height)
        # K of an image = (pixels of the image from its middle, in widths) x (a K that no size enters).
        to, of = (other, own) if forward else (own, other)
        return replace(camera, K=to @ np.linalg.solve(of, camera.K))


@dataclass(frozen=True, slots=True)
class IntrinsicsOfSizes:
    """K of several cameras are those of images of other sizes, as where all images were resized and no K was.

    Attributes
    ----------
    parts
        One for each camera.
    """

    parts: tuple[IntrinsicsOfSize, ...]
    cause: ClassVar[str] = "intrinsics_focal"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float:
        """Excess of the focal length, percent; the largest of all cameras."""
        return max((part.percent for part in self.parts), key=abs)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare K of the other sizes."""
        return self._scaled(facts, f"K of {self._names} are those of images of other sizes", forward=True)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare K of the sizes of the cameras."""
        return self._scaled(facts, f"K of {self._names} from images of other sizes to theirs", forward=False)

    @property
    def _names(self) -> str:
        return ", ".join(part.camera for part in self.parts)

    def _scaled(self, facts: Facts, description: str, *, forward: bool) -> Fault:
        changes = {part.camera: part for part in self.parts}
        return _declared_each(
            facts, description, changes, lambda name, camera: changes[name].changed(camera, forward=forward)
        )


@dataclass(frozen=True, slots=True)
class PrincipalPointFromMiddle:
    """Principal points are counted from the middle of the image, not from its first pixel: about 0, 0.

    Attributes
    ----------
    names
        Of the declared cameras.
    from_centre_px
        By how much they are too far right and down: negative; of several cameras the largest.
    """

    names: tuple[str, ...]
    from_centre_px: float = 0.0
    cause: ClassVar[str] = "intrinsics_centre"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float | None:
        """Displacement of the principal point, px."""
        return self.from_centre_px or None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Count from the middle."""
        return self._moved(facts, f"the principal point of {', '.join(self.names)} is counted from the middle", -1)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Count from the first pixel."""
        return self._moved(facts, f"the principal point of {', '.join(self.names)} counted from the first pixel", 1)

    def _moved(self, facts: Facts, description: str, sign: Literal[1, -1]) -> Fault:
        def moved(_: str, camera: Camera) -> Camera:
            shift = np.zeros((3, 3))
            shift[:2, 2] = sign * (camera.width - 1) / 2, sign * (camera.height - 1) / 2
            return replace(camera, K=camera.K + shift)

        return _declared_each(facts, description, self.names, moved)


@dataclass(frozen=True, slots=True)
class FilmFocalLength:
    """Focal lengths are in millimetres of a film, or of a sensor, whose longer side is that of the image.

    Attributes
    ----------
    film_mm
        Length of that side.
    names
        Of the declared cameras.
    percent
        Excess of the focal length; of several cameras the largest.
    """

    film_mm: float
    names: tuple[str, ...]
    percent: float
    cause: ClassVar[str] = "intrinsics_focal"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float:
        """Excess of the focal length, percent."""
        return self.percent

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare millimetres."""
        of = ", ".join(self.names)
        return self._scaled(facts, f"the focal length of {of} is in mm of a {self.film_mm:g} mm film", 1)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare pixels."""
        of = ", ".join(self.names)
        return self._scaled(facts, f"the focal length of {of} from mm of a {self.film_mm:g} mm film to px", -1)

    def _scaled(self, facts: Facts, description: str, power: Literal[1, -1]) -> Fault:
        def changed(_: str, camera: Camera) -> Camera:
            gain = (self.film_mm / max(camera.width, camera.height)) ** power
            return replace(camera, K=camera.K * np.array([[gain, gain, 1.0], [gain, gain, 1.0], [1.0, 1.0, 1.0]]))

        return _declared_each(facts, description, self.names, changed)


def _of_size(width: int, height: int) -> Float64:
    """Return the matrix from coordinates about the middle of an image, in widths of it, to its pixels."""
    return np.array([[width, 0.0, (width - 1) / 2], [0.0, width, (height - 1) / 2], [0.0, 0.0, 1.0]])


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
        return _planted(facts, sequence, self.stream, description, self._by(1), self.camera)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Rotate them back."""
        description = f"the camera of {self.camera or self.stream} back by {self.magnitude:.3g} deg"
        return _removed(facts, sequence, self.stream, description, self._by(1), self._by(-1), self.camera)

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
    """

    arm_body_m: Vector3
    cause: ClassVar[str] = "lever_arm"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float:
        """Length of the displacement, m, with the sign of its largest component."""
        return signed_length(self.arm_body_m)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Add the displacement."""
        description = f"cameras are declared {abs(self.magnitude):.3g} m from their place"
        return _planted(facts, sequence, self.stream, description, self._by(1))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Subtract the displacement."""
        description = f"cameras back by {abs(self.magnitude):.3g} m"
        return _removed(facts, sequence, self.stream, description, self._by(1), self._by(-1))

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
        return _declared(facts, description, self._by(self.factor), None)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide the positions."""
        description = f"positions of the cameras on the body divided by {self.factor:.6g}"
        return _declared(facts, description, self._by(1 / self.factor), None)

    def _by(self, gain: float) -> Change:
        gains = np.ones((4, 4))
        gains[:3, 3] = gain
        return lambda camera: replace(camera, T_body_camera=camera.T_body_camera * gains)


def _planted(
    facts: Facts, sequence: SequenceRows, stream: str, description: str, wrong: Change, camera: str | None = None
) -> Fault:
    if stream == "metadata":
        return _declared(facts, description, wrong, camera)
    return _remade(facts, sequence, stream, description, wrong, sign=1)


def _removed(
    facts: Facts,
    sequence: SequenceRows,
    stream: str,
    description: str,
    wrong: Change,
    correct: Change,
    camera: str | None = None,
) -> Fault:
    """Return what undoes a fault: declared cameras are corrected, and flow loses the share of the wrong camera."""
    if stream == "metadata":
        return _declared(facts, description, correct, camera)
    return _remade(facts, sequence, stream, description, wrong, sign=-1)


def _declared(facts: Facts, description: str, change: Change, only: str | None) -> Fault:
    """Return the fault that changes a declared camera, or all of them."""
    declared = facts.declared.cameras
    if not declared or (only is not None and only not in declared):
        raise InapplicableError(f"Expected a declared camera{f' {only}' if only else ''}, got none")
    cameras = {name: change(camera) if only in (None, name) else camera for name, camera in declared.items()}
    return Fault(description, declared=replace(facts.declared, cameras=cameras))


def _declared_each(
    facts: Facts, description: str, names: Collection[str], change: Callable[[str, Camera], Camera]
) -> Fault:
    """Return the fault that changes some declared cameras, each by its name."""
    declared = facts.declared.cameras
    if not names or not declared.keys() >= set(names):
        raise InapplicableError(f"Expected declared cameras {', '.join(names)}, got fewer")
    cameras = {name: change(name, camera) if name in names else camera for name, camera in declared.items()}
    return Fault(description, declared=replace(facts.declared, cameras=cameras))


def _remade(facts: Facts, sequence: SequenceRows, stream: str, description: str, wrong: Change, *, sign: int) -> Fault:
    """Return the fault that adds to flow the difference between the flow of the wrong camera and of the declared one.

    Fields whose interval does not begin with a depth frame, or is not covered by poses, stay.
    """
    for needed in ("depth", "pose"):
        streams_in(facts, needed)
    camera = facts.declared.cameras.get("depth")
    if camera is None:
        raise InapplicableError("Expected a declared depth camera, got none: its intrinsics are needed")
    rows = {}
    for name in streams_in(facts, stream):

        def alter(read: Read, start: int, stop: int, clock: Clock = facts.clocks[name]) -> NDArray[Any]:
            fields = read(start, stop)
            # Other readers may share the fields that were read.
            altered = fields.copy()
            for place, row in enumerate(range(start, stop)):
                error_px = _camera_error_px(facts, sequence, clock, row, camera, wrong(camera))
                if error_px is not None:
                    altered[place] = fields[place] + sign * error_px
            return altered

        rows[f"path/{name}"] = alter
    return Fault(description, rows)


def _camera_error_px(
    facts: Facts, sequence: SequenceRows, clock: Clock, row: int, camera: Camera, wrong: Camera
) -> Float64 | None:
    """Return flow (H, W, 2) of the wrong camera less that of the declared one, px; None where it cannot be made."""
    assert clock.ends_ns is not None  # flow has intervals
    interval_ns = np.array([clock.times_ns[row], clock.ends_ns[row]])
    frame = int(np.argmax(facts.clocks["depth"].times_ns == interval_ns[0]))
    poses = facts.clocks["pose"]
    if facts.clocks["depth"].times_ns[frame] != interval_ns[0]:
        return None
    pose_rows = np.flatnonzero(poses.advancing)
    places = np.searchsorted(poses.times_ns[pose_rows], interval_ns)
    chosen = pose_rows[max(int(places[0]) - STENCIL, 0) : int(places[1]) + STENCIL + 1]
    if not len(chosen):
        return None
    first, stop = int(chosen[0]), int(chosen[-1]) + 1
    positions_m, q = (sequence.rows(f"path/pose/{name}", first, stop)[chosen - first]
                      for name in ("position", "orientation"))  # fmt: skip
    R, position_m = interpolate_poses(poses.times_ns[chosen], positions_m, q, at_ns=interval_ns)
    if not (np.all(np.isfinite(R)) and np.all(np.isfinite(position_m))):
        return None
    depth_m = sequence.rows("path/depth", frame, frame + 1)[0].astype(np.float64) / MM_PER_M
    height, width = depth_m.shape
    columns, lines = np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)[:, np.newaxis]
    wrong_px, declared_px = (
        rigid_flow(
            each.K,
            camera_motion(R[0], position_m[0], R[1], position_m[1], each.T_body_camera),
            columns,
            lines,
            depth_m,
            each.lens,
        )
        for each in (wrong, camera)
    )
    # A point that lies behind the wrong camera only has no flow there: its value in the file stays.
    error_px: Float64 = np.nan_to_num(wrong_px - declared_px, nan=0.0, posinf=0.0, neginf=0.0)
    return error_px
