"""Shifts of image edges against steps of depth over all windows, in colour frames and in images of events."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.estimators.depth.edge_profiles import EdgeShift, edge_shift
from fedora_qa.features import Feature
from fedora_qa.views.depth_edges import DepthEdges

SIGNIFICANT: Final = 4.0
"""Standard errors by which a peak must exceed the rest: noise gives such a peak at one of 17 positions in 5 of 10,000
images."""

_UNMEASURED_PX: Final = 1e6
"""Standard error of the shift along an axis without edges."""


@dataclass(frozen=True, slots=True)
class CameraPairShift(Feature):
    """Shift of the second camera's image against the first one's.

    Attributes
    ----------
    first, second
        Names of the cameras.
    shift_px, error_px
        Right and down, in pixels of the second camera; the error includes the bound of the model's error.
    """

    first: str
    second: str
    shift_px: tuple[float, float]
    error_px: tuple[float, float]


@dataclass(frozen=True, slots=True)
class EventEdges(Feature):
    """Result of the search for edges of event counts at the steps of depth.

    Attributes
    ----------
    significant
        Whether such edges exceed their standard error by ``SIGNIFICANT``.
    """

    significant: bool


@dataclass(frozen=True, slots=True)
class EdgeShifts:
    """Shifts of image edges against steps of depth, in px of the image.

    Attributes
    ----------
    right, down
        Shift along the columns and along the rows; None where there are too few steps of depth.
    """

    right: EdgeShift | None
    down: EdgeShift | None

    @property
    def peak_fraction(self) -> float:
        """Fraction of the edge strength that lies at the steps of depth, summed over both axes."""
        return sum(shift.peak_fraction for shift in (self.right, self.down) if shift is not None)

    @property
    def peak_fraction_error(self) -> float:
        """Standard error of ``peak_fraction``."""
        errors = (shift.peak_fraction_error for shift in (self.right, self.down) if shift is not None)
        # Profiles along rows and along columns cross different edges, so that their variances add.
        return float(np.sqrt(sum(error**2 for error in errors)))

    @property
    def significant(self) -> bool:
        """Whether the edges at the steps of depth exceed their standard error by ``SIGNIFICANT``."""
        return self.peak_fraction > SIGNIFICANT * self.peak_fraction_error

    def against_depth(self, camera: str) -> CameraPairShift | None:
        """Return the shift of a camera against the depth camera; None without significant edges."""
        if not self.significant:
            return None
        # Right, then down: px and its error.
        shifts = [
            (0.0, _UNMEASURED_PX)
            if shift is None
            # Diagnosis weights each pair of cameras by one error, so this error includes the bound.
            else (shift.shift_px, float(np.hypot(shift.standard_error_px, shift.model_error_bound_px)))
            for shift in (self.right, self.down)
        ]
        return CameraPairShift("depth", camera, (shifts[0][0], shifts[1][0]), (shifts[0][1], shifts[1][1]))


def colour_edges(windows: Sequence[DepthEdges]) -> tuple[EdgeShifts, ...]:
    """Return the edges of colour frames as stored, and of mirrored ones, in the order of ``VARIANTS``."""
    sums = np.array([edges.colour for edges in windows])
    return tuple(
        EdgeShifts(*(edge_shift(sums[:, variant, axis]) for axis in (0, 1))) for variant in range(sums.shape[1])
    )


def event_edges(windows: Sequence[DepthEdges]) -> EdgeShifts:
    """Return the edges of images of events, in pixels of the event camera."""
    sums = np.array([edges.events for edges in windows])
    return EdgeShifts(*(edge_shift(sums[:, axis]) for axis in (0, 1)))
