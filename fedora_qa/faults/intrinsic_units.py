"""Intrinsics of cameras that are declared in other units than pixels."""

from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.camera_changes import declared_each
from fedora_qa.faults.fault import Fault
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

NormalisedUnit = Literal["sides", "halves", "longer_side"]


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

        return declared_each(facts, description, self.names, changed)


@dataclass(frozen=True, slots=True)
class NormalisedIntrinsics:
    """K is in units of the image, not in pixels.

    Attributes
    ----------
    unit
        ``sides``: focal lengths and principal point in widths and heights, from the corner of the image, as datasets of
        views store them; ``halves``: in halves of them from the middle, as in a matrix of projection, whose other
        entries are those of the depth; ``longer_side``: all in longer sides from the middle, as structure from motion
        stores them.
    names
        Of the declared cameras.
    percent
        Excess of the focal length; of several cameras the largest.
    """

    unit: NormalisedUnit
    names: tuple[str, ...]
    percent: float
    cause: ClassVar[str] = "intrinsics_focal"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float:
        """Excess of the focal length, percent."""
        return self.percent

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare K in units of the image."""
        description = f"K of {', '.join(self.names)} is in {self._words} of the image"
        return declared_each(facts, description, self.names, self._normalised)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare pixels."""
        description = f"K of {', '.join(self.names)} from {self._words} of the image to px"
        return declared_each(facts, description, self.names, self._in_pixels)

    @property
    def _words(self) -> str:
        return {"sides": "sides", "halves": "halves of the sides", "longer_side": "longer sides"}[self.unit]

    def _normalised(self, _: str, camera: Camera) -> Camera:
        K = np.linalg.inv(self._pixels_per_unit(camera)) @ camera.K
        return replace(camera, K=K)

    def _in_pixels(self, _: str, camera: Camera) -> Camera:
        # [fx 0 cx; 0 fy cy; 0 0 1]: the last row of a matrix of projection is that of the depth.
        K = np.vstack([camera.K[:2], [0.0, 0.0, 1.0]])
        return replace(camera, K=self._pixels_per_unit(camera) @ K)

    def _pixels_per_unit(self, camera: Camera) -> NDArray[np.float64]:
        """Return the matrix from coordinates in units of the image to pixels, whose first has its centre at 0, 0."""
        width, height = camera.width, camera.height
        along_x, along_y, origin = {
            "sides": (width, height, 0.0),
            "halves": (width / 2, height / 2, 0.5),
            "longer_side": (max(width, height), max(width, height), 0.5),
        }[self.unit]
        # The corner of the image lies half a pixel before the centre of the first one.
        x_px, y_px = origin * width - 0.5, origin * height - 0.5
        return np.array([[along_x, 0.0, x_px], [0.0, along_y, y_px], [0.0, 0.0, 1.0]])
