"""Faults of the intrinsics of cameras: they are declared wrongly, or flow was made with wrong ones."""

from dataclasses import dataclass, replace
from typing import ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.camera_changes import Change, declared, declared_each, planted, removed
from fedora_qa.faults.fault import Fault, signed_length
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

Float64 = NDArray[np.float64]

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
        return planted(facts, sequence, self.stream, description, change, self.camera)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide the focal lengths."""
        along_columns, along_rows = self._gains
        by = f"{along_columns:.6g}" + ("" if along_rows == along_columns else f" and {along_rows:.6g}")
        description = f"the focal length of {self.camera or self.stream} divided by {by}"
        wrong, correct = self._by(along_columns, along_rows), self._by(1 / along_columns, 1 / along_rows)
        return removed(facts, sequence, self.stream, description, wrong, correct, self.camera)

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
        return planted(facts, sequence, self.stream, description, self._by(1), self.camera)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Displace them back."""
        description = f"the principal point of {self.camera or self.stream} back by {self.magnitude:.3g} px"
        return removed(facts, sequence, self.stream, description, self._by(1), self._by(-1), self.camera)

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
        return declared(facts, "K is transposed", lambda camera: replace(camera, K=camera.K.T), None)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Transpose the K that has the form of a K only once it is transposed."""
        return declared(
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
        return declared(facts, description, lambda camera: self.changed(camera, forward=forward), self.camera)

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
        return declared_each(
            facts, description, changes, lambda name, camera: changes[name].changed(camera, forward=forward)
        )


@dataclass(frozen=True, slots=True)
class IntrinsicsOfAnotherImage:
    """K of a camera is that of other images of it, as of those before they were rectified.

    Attributes
    ----------
    camera
        The declared camera.
    percent
        Excess of the focal length.
    columns_px, rows_px
        By how much the principal point is too far to the right and down.
    """

    camera: str
    percent: float
    columns_px: float
    rows_px: float
    cause: ClassVar[str] = "intrinsics_centre"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float:
        """Displacement of the principal point, px."""
        return signed_length((self.columns_px, self.rows_px))

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare K of the other images."""
        shift, gains = self._parts
        return declared(facts, f"K of {self.camera} is that of other images",
                        lambda camera: replace(camera, K=camera.K * gains + shift), self.camera)  # fmt: skip

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare K of the images of the file."""
        shift, gains = self._parts
        by = f"focal length divided by {1 + self.percent / 100:.6g}, principal point back by {self.magnitude:.3g} px"
        return declared(facts, f"K of {self.camera}: {by}",
                        lambda camera: replace(camera, K=(camera.K - shift) / gains), self.camera)  # fmt: skip

    @property
    def _parts(self) -> tuple[Float64, Float64]:
        shift, gains = np.zeros((3, 3)), np.ones((3, 3))
        shift[:2, 2] = self.columns_px, self.rows_px
        gains[:2, :2] = 1 + self.percent / 100
        return shift, gains


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

        return declared_each(facts, description, self.names, moved)


def _of_size(width: int, height: int) -> Float64:
    """Return the matrix from coordinates about the middle of an image, in widths of it, to its pixels."""
    return np.array([[width, 0.0, (width - 1) / 2], [0.0, width, (height - 1) / 2], [0.0, 0.0, 1.0]])
