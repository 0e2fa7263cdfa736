"""Frusta of a camera along a path, at a size that suits a drawing: where the camera was, and what it saw."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.record.evidence import FRUSTA, FRUSTUM_CAMERAS, named
from fedora_reports.evidence import Evidence
from fedora_reports.trajectory_path import Box

Float64 = NDArray[np.float64]

OUTLINE: Final = (0, 1, 5, 2, 1, 4, 0, 3, 4, 3, 2, 0)
"""Corners of a frustum in the order in which one line draws all of its edges."""

_REACH: Final = 0.1
"""Length of the rays to the corners as a share of the longest side of the box."""
_PEAK: Final = 0.3
"""Height of the peak above the upper edge as a share of the image's height."""


@dataclass(frozen=True, slots=True)
class Frusta:
    """Views of one camera.

    Attributes
    ----------
    camera
        Its stream.
    centres_world_m
        (f, 3) centres of projection.
    rays_world
        (f, 4, 3), to the top left, top right, bottom right and bottom left corner of the image.
    """

    camera: str
    centres_world_m: Float64
    rays_world: Float64

    @property
    def sentence(self) -> str:
        """What a drawing of them shows, for its caption."""
        return f"Frusta show the view of the camera of {self.camera}; a peak marks the upper edge of its image."

    def places(self, box: Box) -> Float64:
        """Return the corners of frusta that do not overlap, about the middle of a box, in units of its longest side.

        One whose centre lies outside of the box is left out, and one of which no corner is as far from that of another
        as the rays are long: neighbours touch at most.

        Returns
        -------
        ndarray
            (g, 6, 3): the centre of projection, the four corners of the image, and a peak above its upper edge.
        """
        with np.errstate(all="ignore"):
            lengths = np.linalg.norm(self.rays_world, axis=-1).max(axis=-1)
            within = ((self.centres_world_m >= box.low_m) & (self.centres_world_m <= box.high_m)).all(axis=-1)
        usable = within & np.isfinite(lengths) & (lengths > 0)
        centres = (self.centres_world_m[usable] - box.centre_m) / box.span_m
        image = self.rays_world[usable] * (_REACH / lengths[usable, None, None])
        top, bottom = image[:, :2].mean(axis=1), image[:, 2:].mean(axis=1)
        peak = top + _PEAK * (top - bottom)
        offsets = np.concatenate([np.zeros_like(peak)[:, None], image, peak[:, None]], axis=1)
        places: Float64 = centres[:, None] + offsets
        apart: list[int] = []
        for row, corners in enumerate(places):
            if all(np.linalg.norm(corners - places[other], axis=-1).max() >= _REACH for other in apart):
                apart.append(row)
        return places[apart]


def frusta_of(evidence: Evidence) -> Frusta | None:
    """Return the frusta of the file; None where none were kept, or their arrays do not fit."""
    for camera in FRUSTUM_CAMERAS:
        centres_m = evidence.numbers(named(FRUSTA, camera, "centres_world_m"), None, 3)
        rays = (
            None if centres_m is None else evidence.numbers(named(FRUSTA, camera, "rays_world"), len(centres_m), 4, 3)
        )
        if centres_m is not None and rays is not None:
            return Frusta(camera, centres_m.astype(np.float64), rays.astype(np.float64))
    return None
