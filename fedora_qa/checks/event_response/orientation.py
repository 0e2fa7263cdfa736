"""Events against log intensity: axes, directions and sign."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.events.block_means import BLOCK_PX
from fedora_qa.estimators.events.orientation import (
    LEAST_PREDICTED,
    SYMMETRIES,
    ChangeMoments,
    PartOrientation,
    most_reoriented,
    other_correlations,
    responding_shares,
    transformation,
)
from fedora_qa.estimators.fitting.robust import jackknife_errors
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_axes import look_apart
from fedora_qa.views.event_blocks import NOMINAL_RESPONSE, block_moments
from fedora_qa.views.event_camera import starts_at_first_frame, why_frames_and_events_do_not_meet
from fedora_qa.views.sensor_events import place_of_segment, place_of_tiles

Float64 = NDArray[np.float64]

# Eight symmetries of the square with both signs, less the declared orientation.
_OTHERS: Final = 2 * len(SYMMETRIES) - 1

FEWEST_WINDOWS: Final = 4


@dataclass(frozen=True, slots=True)
class EventSymmetry(Feature):
    """Transform of the events under which they correlate significantly better with the frames than as declared.

    Attributes
    ----------
    inverted
        Polarity is inverted.
    swapped_axes, mirrored_columns, mirrored_rows
        Axes are exchanged, then columns mirrored left to right, then rows top to bottom.
    """

    inverted: bool
    swapped_axes: bool
    mirrored_columns: bool
    mirrored_rows: bool

    @staticmethod
    def numbered(orientation: int) -> "EventSymmetry":
        """Return the symmetry of an orientation, numbered as by ``other_correlations``."""
        inverted, symmetry = transformation(orientation)
        return EventSymmetry(inverted, *symmetry)

    @property
    def text(self) -> str:
        """The transform in words."""
        words = (
            (self.inverted, "with inverted polarity"),
            (self.swapped_axes, "with exchanged axes"),
            (self.mirrored_columns, "mirrored left to right"),
            (self.mirrored_rows, "mirrored top to bottom"),
        )
        return " and ".join(word for applies, word in words if applies)


@dataclass(frozen=True, slots=True)
class OrientationMoments:
    """Moments of one window under the eight symmetries: between successive frames, and over the whole window.

    Attributes
    ----------
    steps, span
        (8, 6) moments between successive frames, and between the first and the last frame.
    tiles
        (t, 8, 6) moments between successive frames, of each tile of the image.
    implied
        Moments over the window with the events that the frames imply.
    levels
        (3, k) signal of some pixels in the first frame, and its least and greatest value, as of ``BlockMoments``.
    start_ns, stop_ns
        Ends of the window, ns from the file's origin.
    """

    steps: ChangeMoments
    span: ChangeMoments
    tiles: Float64
    implied: ChangeMoments
    levels: Float64
    start_ns: int
    stop_ns: int


class EventResponseOrientation(WindowCheck[OrientationMoments]):
    """Do events and frames agree in axes, direction and sign?

    The correlation of the changes by frames and by events, as declared and under the eight symmetries of the square
    with both signs: over the file, in each window of 0.2 s, and in each of 4 x 4 tiles of the image.

    Why it matters
    --------------
    Plugins and loaders differ in polarity codes, in the order of x and y, and in the direction of rows. No other stream
    of a file shows such a difference, and a network that is trained on such events learns motion in a wrong direction.

    How
    ---
    The change of the signal between successive frames is correlated with the signed events in between. Both are
    averaged over 4 x 4 px blocks, so that small shifts hardly change the correlation. Where successive frames change
    too little, the change over a window is used. The declared orientation must have at least half of the expected
    correlation, and a higher one than all fifteen others. The orientation with the highest correlation names the cause.
    The same comparison is made for each window, and for each tile over all windows, so that a segment or a region with
    another convention is detected and located, where at least a quarter agrees.

    Without a declared response only the orientations are compared, over the file: the correlation to expect is unknown.

    Cameras whose declared axes differ by more than 10 deg, beside quarter turns about the optical axis, show different
    things. Their events and frames are compared as if they looked one way, and must not reach half of the expected
    correlation under any orientation: else the mounting of one camera is declared wrongly.

    Noise model
    -----------
    Between events, the level of a pixel is uncertain within C+ and C-, which gives a change a variance of 2/3 C+ C-,
    averaged over a block (noise). With s the variance of the change by frames, the expected correlation is sqrt(s / (s
    + noise)). With the declared initial phase ``zero`` a pixel has no event until its level differs from that in the
    first frame by a threshold. Where the frames let but a share f of the pixels respond, the expected correlation is at
    most that of the events which the frames imply, or less by sqrt(f) if this is more. The standard error over the file
    is the delete-one jackknife over windows. For parts it is three times the error of independent blocks, because
    blocks of one moving texture are not independent.

    Cannot detect
    -------------
    Parts in which the expected correlation is below 0.3 (hovering, no texture, night): not_observable where this is the
    whole file. Shifts (``event_response.alignment``), small delays (``event_response.timing``), and symmetries of the
    scene itself.

    Sources
    -------
    First principles (``fedora_qa/estimators/events/orientation.py``); delete-one jackknife: Efron and Stein 1981.
    """

    name = "event_response.orientation"
    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras at one place, or cameras that are declared to look apart and declared thresholds."""
        reason = why_frames_and_events_do_not_meet(facts, needs_response=False)
        if reason and not why_frames_and_events_do_not_meet(facts, axes="any") and look_apart(facts.declared):
            return ""
        return reason

    def measure(self, window: Window) -> OrientationMoments | None:
        """Correlate frames and events of one window under the eight symmetries."""
        blocks = block_moments(window)
        if blocks is None:
            return None
        tiles = blocks.steps.sum(axis=0)
        start_ns, stop_ns = window.span.start_ns, window.span.stop_ns
        return OrientationMoments(
            ChangeMoments(tiles.sum(axis=0)), blocks.span, tiles, blocks.implied, blocks.levels, start_ns, stop_ns
        )

    def conclude(self, state: Sequence[OrientationMoments], facts: Facts) -> Observation:
        """Compare the orientations over all windows."""
        coverage = Coverage(len(state), len(state), "windows")
        if not state:
            return Observation(coverage, unobservable="no two frames with events around them")
        response = facts.declared.events or NOMINAL_RESPONSE
        # Between events, the change of a pixel has a variance of 2/3 C+ C-. The mean over a block has this variance
        # divided by the number of its pixels.
        noise = 2 / 3 * response.threshold_on * response.threshold_off / BLOCK_PX**2
        by_change = [np.array([getattr(window, name).sums for window in state]) for name in ("steps", "span")]
        signals = [ChangeMoments(sums.sum(axis=0)).frame_variance() for sums in by_change]
        # Correlation of a signal with itself and independent noise.
        predicted = [float(np.sqrt(signal / (signal + noise))) for signal in signals]
        if starts_at_first_frame(facts) and state[0].start_ns <= int(facts.clocks["rgb"].times_ns[0]):
            # Pixels of a share f have had events, so that the uncertainty of their levels is as above. The others are
            # still at their first reference: var e = f (s + noise), cov(d, e) = f s of both, or what frames imply.
            levels = np.stack([window.levels for window in state])
            shares = responding_shares(levels, response.threshold_on, response.threshold_off)
            squares = np.array([window.span.sums[0, 3] for window in state])
            share = float(shares @ squares) / max(float(squares.sum()), np.finfo(np.float64).tiny)
            implied = ChangeMoments(np.sum([window.implied.sums for window in state], axis=0)).correlations()[0]
            predicted = [min(value, max(float(implied), value * share**0.5)) for value in predicted]
        # The change from frame to frame, or over the whole window where motion is too slow between frames.
        best = int(np.argmax(predicted))
        # Element 4 holds the sum of squares of the events' change.
        if not np.any(by_change[best][..., 4]):
            return Observation(coverage, unobservable="no events between the frames (see event_response.conservation)")
        if predicted[best] < LEAST_PREDICTED:
            return Observation(
                coverage,
                unobservable=f"frames change too little: the expected correlation is only {predicted[best]:.2g}",
            )
        if look_apart(facts.declared):
            return Observation(coverage, (_as_if_parallel(by_change[best], predicted[best], facts.declared),))
        correlation, advantage = _whole(by_change[best], predicted[best])
        if facts.declared.events is None:
            # Without thresholds it is not known which correlation to expect.
            return Observation(coverage, (advantage,))
        statistics = [correlation, advantage]
        # The segment of time and the region whose correlation increases most by another orientation.
        segment = most_reoriented([window.steps for window in state], noise)
        if segment is not None:
            chosen = [window for window, inside in zip(state, segment.parts, strict=True) if inside]
            where, place = place_of_segment(facts, chosen[0].start_ns, chosen[-1].stop_ns)
            statistics.append(_part("advantage_in_a_stretch", "stretch", segment, where, place))
        tiles = np.sum([window.tiles for window in state], axis=0)
        region = most_reoriented([ChangeMoments(sums) for sums in tiles], noise)
        if region is not None:
            where, place = place_of_tiles(facts, region.parts)
            statistics.append(_part("advantage_in_a_region", "region", region, where, place))
        return Observation(coverage, tuple(statistics))


def _whole(sums: Float64, predicted: float) -> tuple[Statistic, Statistic]:
    """Return the correlation of all windows, and the excess of that of another orientation.

    ``sums`` (w, 8, 6) are the moments of the windows.
    """
    correlations = ChangeMoments(sums.sum(axis=0)).correlations()
    alternatives = other_correlations(correlations)
    orientation = int(np.argmax(alternatives))
    symmetry = EventSymmetry.numbered(orientation)
    # Another orientation counts only if it reaches half of the predicted correlation, and more than the declared one.
    is_clear = alternatives[orientation] > max(predicted / 2, correlations[0])
    features = (symmetry,) if is_clear else ()
    error, error_of_advantage = _errors(
        sums, lambda moments: _agreement_and_advantage(moments.correlations(), orientation)
    )
    agreement = Statistic(
        name="correlation",
        value=float(correlations[0]),
        unit="1",
        standard_error=error,
        expected=predicted,
        model_error_bound=predicted / 2,
        side="lower",
        # With unrelated events the correlation falls from the predicted one, with an error of up to the bound, to 0.
        blind_from=1.5 * predicted,
        statement=f"Events and frames have a correlation of {correlations[0]:.2g}; about {predicted:.2g} is expected.",
        code="event_response.orientation.unrelated",
        where=Where(stream="events"),
        features=features,
    )
    alternative = Statistic(
        name="advantage_of_another_orientation",
        value=float(alternatives[orientation] - correlations[0]),
        unit="1",
        standard_error=error_of_advantage,
        side="upper",
        # Excess of the correct orientation over an unrelated one, if another orientation is correct.
        blind_from=float(np.max(np.abs(correlations))),
        tests=len(alternatives),
        statement=f"Events agree better with the frames {symmetry.text}: correlation {alternatives[orientation]:.2g}, "
        f"as stored {correlations[0]:.2g}.",
        code="event_response.orientation.other",
        where=Where(stream="events"),
        features=features,
    )
    return agreement, alternative


def _as_if_parallel(sums: Float64, predicted: float, declared: Declared) -> Statistic:
    """Return the best correlation under all orientations of cameras that are declared to look apart.

    Their images show different things, so that none must reach half of the predicted correlation. ``sums`` (w, 8, 6)
    are the moments of the windows.
    """
    correlations = ChangeMoments(sums.sum(axis=0)).correlations()
    best = int(np.argmax(np.abs(correlations)))
    rgb, events = (declared.cameras[name].T_body_camera[:3, :3] for name in ("rgb", "events"))
    # The trace of a rotation is 1 + 2 cos(angle).
    angle_deg = float(np.rad2deg(np.arccos(np.clip((np.trace(rgb.T @ events) - 1) / 2, -1.0, 1.0))))
    return Statistic(
        name="advantage_of_another_orientation",
        value=float(abs(correlations[best])),
        unit="1",
        standard_error=_errors(sums, lambda moments: (float(moments.correlations()[best]),))[0],
        model_error_bound=predicted / 2,
        side="upper",
        # The correlation if the cameras look one way.
        blind_from=predicted,
        tests=2 * len(SYMMETRIES),
        statement=f"Events agree with the frames as if both cameras looked one way: correlation "
        f"{abs(correlations[best]):.2g}; their declared axes differ by {angle_deg:.3g} deg.",
        code="event_response.orientation.other",
        where=Where(stream="events"),
    )


def _agreement_and_advantage(correlations: Float64, orientation: int) -> tuple[float, float]:
    """Return the declared correlation (of 8), and the excess of that of another orientation."""
    return float(correlations[0]), float(other_correlations(correlations)[orientation] - correlations[0])


def _errors(sums: Float64, values_of: Callable[[ChangeMoments], tuple[float, ...]]) -> list[float]:
    """Return the standard errors of values of the moments of all windows.

    Blocks of one moving texture are not independent: three times the error of independent blocks, 1 / sqrt(n). With
    enough windows the jackknife counts, but never less than the error of independent blocks.
    """
    floor = 3 / float(np.sqrt(max(sums[:, 0, 0].sum(), 1.0)))
    total = sums.sum(axis=0)
    if len(sums) < FEWEST_WINDOWS:
        return [floor for _ in values_of(ChangeMoments(total))]
    left_out = np.array([values_of(ChangeMoments(total - window)) for window in sums])
    return [max(float(error), floor / 3) for error in jackknife_errors(left_out)]


def _part(name: str, rule: str, part: PartOrientation, where: Where, place: str) -> Statistic:
    symmetry = EventSymmetry.numbered(part.orientation)
    return Statistic(
        name=name,
        value=part.other - part.declared,
        unit="1",
        standard_error=part.standard_error,
        side="upper",
        tests=part.compared * _OTHERS,
        statement=f"{place} events agree better with the frames {symmetry.text}: correlation {part.other:.2g}, "
        f"as stored {part.declared:.2g}.",
        code=f"event_response.orientation.{rule}",
        where=where,
        features=(symmetry,),
    )
