"""Shifts of image edges against steps of depth over all windows, in colour frames and in images of events."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.checks.protocol import Observation, Statistic
from fedora_qa.estimators.depth.edge_profiles import FARTHEST_PX, EdgeShift, edge_shift, peak_fraction_gain
from fedora_qa.estimators.events.tracked_level import fit_delay
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.views.depth_edges import DepthEdges
from fedora_qa.views.event_depth_edges import CORNER_PX, EventDepthEdges

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
class OtherLens(Feature):
    """The distortion with which events lie best at the steps of depth.

    Attributes
    ----------
    corner_px
        Displacement of the corners of the image beyond the declared lens, px, outwards positive.
    """

    corner_px: float


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


def events_at_depth_steps(windows: Sequence[EventDepthEdges], depth_frames: int) -> Observation:
    """State where the edges of events lie against the steps of depth, and whether they lie as through another lens.

    Parameters
    ----------
    windows
        Sums of each window.
    depth_frames
        Number of depth frames of the file.
    """
    coverage = Coverage(sum(window.frames for window in windows), depth_frames, "depth frames")
    if not windows:
        return Observation(coverage, unobservable="no depth frame lies within the events")
    sums = np.array([window.profiles for window in windows])
    as_declared, *displaced = (
        EdgeShifts(*(edge_shift(sums[:, distortion, axis]) for axis in (0, 1))) for distortion in range(sums.shape[1])
    )
    delays = _delays(windows)
    best = max(range(len(displaced)), key=lambda i: displaced[i].peak_fraction)
    other = displaced[best]
    if not as_declared.significant and not other.significant:
        why = (
            f"edges of events are not concentrated at steps of depth within {FARTHEST_PX} px: "
            f"a share of {as_declared.peak_fraction:.2g} +/- {as_declared.peak_fraction_error:.1g}"
        )
        return Observation(coverage, delays, unobservable="" if delays else why)
    # Profiles along rows and along columns cross different edges, so that their variances add.
    gains = [peak_fraction_gain(sums[:, 0, axis], sums[:, best + 1, axis]) for axis in (0, 1)]
    where, corner_px = Where(stream="events"), CORNER_PX[best + 1]
    advantage = Statistic(
        name="advantage_of_another_lens",
        value=sum(gain for gain, _ in gains),
        unit="1",
        standard_error=float(np.linalg.norm([error for _, error in gains])),
        side="upper",
        blind_from=max(as_declared.peak_fraction, other.peak_fraction),
        # The best of all distortions was chosen.
        tests=len(displaced),
        statement=f"At steps of depth lie {other.peak_fraction:.2g} of the edges around them in images of events if a "
        f"lens displaces the corners by {corner_px:+.2g} px more than is declared (outwards positive), and "
        f"{as_declared.peak_fraction:.2g} as declared.",
        code="alignment.events.lens",
        where=where,
        features=(OtherLens(corner_px),),
    )
    if not as_declared.significant:
        return Observation(coverage, (advantage, *delays))
    pair = as_declared.against_depth("events")
    lags = np.sum([window.lags for window in windows], axis=0)
    # Lags along both directions, and of all steps together, px.
    lags_px = [*(lags[:, 0] / np.maximum(lags[:, 1], 1.0)), lags[:, 0].sum() / max(lags[:, 1].sum(), 1.0)]
    measured = (
        ("shift_right", "right positive", as_declared.right),
        ("shift_down", "down positive", as_declared.down),
        (
            "shift_outwards",
            "away from the principal point positive",
            edge_shift(np.array([w.outward for w in windows])),
        ),
    )
    shifts = [
        Statistic(
            name=name,
            value=shift.shift_px,
            unit="px",
            standard_error=shift.standard_error_px,
            model_error_bound=shift.model_error_bound_px + float(lag_px),
            statement=f"Events lie {shift.shift_px:+.3g} +/- {shift.standard_error_px:.2g} px ({text}) from the steps "
            "of depth.",
            code="alignment.events.outward" if name == "shift_outwards" else "alignment.events.shift",
            where=where,
            features=() if pair is None or name == "shift_outwards" else (pair,),
        )
        for (name, text, shift), lag_px in zip(measured, lags_px, strict=True)
        if shift is not None
    ]
    return Observation(coverage, (*shifts, advantage, *delays))


def _delays(windows: Sequence[EventDepthEdges]) -> tuple[Statistic, ...]:
    """State the delay of the events against colour frames; nothing where they have nothing to do with each other."""
    fit = fit_delay([sums for window in windows for sums in window.delays])
    if fit is None or abs(fit.gain) <= SIGNIFICANT * fit.gain_error:
        return ()
    return (
        Statistic(
            name="time_offset",
            value=fit.delay_ms,
            unit="ms",
            standard_error=fit.standard_error_ms,
            model_error_bound=fit.lag_bound_ms,
            statement=f"Events are {fit.delay_ms:+.3g} +/- {fit.standard_error_ms:.2g} ms late against colour frames, "
            "which depth carries into their view and flow moves.",
            code="alignment.events.time_offset",
            where=Where(stream="events"),
        ),
    )
