"""Events against log intensity: position in the image."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.events.far_shift import FarSums, far_shift, far_sums, joined
from fedora_qa.estimators.events.low_pass import STEPS, changes_of_light, level_error_gain, time_constant_ns
from fedora_qa.estimators.events.shift import (
    CLEAR,
    RADIUS_PX,
    IntervalChanges,
    PartShift,
    PartShifts,
    ShiftSums,
    lattice_peak,
    lattice_spread,
    most_shifted,
    shifts_of_parts,
)
from fedora_qa.estimators.events.shift_errors import open_level_errors, reference_lags
from fedora_qa.estimators.events.shift_field import ShiftFieldFit, field_fits, scale_and_roll
from fedora_qa.estimators.events.shift_kernels import FIRED, KNOWN, OPEN, USABLE
from fedora_qa.estimators.fitting.robust import sensitivity_range
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import USUAL_PIXELS, Window
from fedora_qa.views.event_camera import (
    WINDOW_NS,
    intervals_due,
    lattice_signals,
    resampled_frames,
    why_frames_and_events_do_not_meet,
)
from fedora_qa.views.sensor_events import (
    GRID,
    is_large_sensor,
    pixel_events,
    place_of_segment,
    place_of_tiles,
    sensor_events,
    sensor_shape,
)

Float64 = NDArray[np.float64]

INTERVALS: Final = 3
INTERVALS_OF_LARGE: Final = (2, 1)
"""Frame intervals in 0.2 s that are correlated, evenly spread. Large sensors use fewer, as errors hardly depend on
their number: limits of 1 s of 640x480 grow by 2 to 5% with two intervals, by another 3 to 4% with one. One suffices in
files of 1.6 s or more whose images are read as densely as by ``full``, which leaves out no window."""

_DENSE_PX: Final = 0.2 * USUAL_PIXELS
"""Least number of pixels that are read of the largest image for dense reading: ``full`` reads a share of 0.25,
``standard`` 0.1."""

LEAST_CORRELATION: Final = 0.1
"""Least correlation coefficient of events and frames of one scene; unrelated ones reach 0.03."""

FEWEST_INTERVALS: Final = 4

_PROBABLE: Final = 0.3
"""Correlation above which the peak of a tile mostly comes from the scene of the tile: a fit that leaves out tiles at
wrong edges may use more tiles than those with ``CLEAR`` edges. A zoom blurs the correlation of a tile. The value is not
derived."""

REACH_PX: Final = RADIUS_PX - 1
"""Farthest shift whose peak has values on both sides; farther ones are estimated on blocks of pixels."""


_ERRORS_OF_A_LIMIT: Final = 5.0
"""Standard errors of the limit of a measurement, about: their number grows slowly with the comparisons of a file."""

_FARTHEST_OF_A_TILE_PX: Final = 1.0
"""Shift of the farthest tile by a scale or a roll up to which their limits are stated. In 16 files of 90x68 and 0.5 s,
all tiles kept clear edges up to twice as much, and lost them from three times on."""

_GROWTH: Final = 2.0
"""Largest ratio of the standard error with a fault of twice its limit to that without, in 15 of 16 such files: a fault
blurs the correlation of a tile. Of faults at the upper end of the stated range, 15 of 19 were detected."""


@dataclass(frozen=True, slots=True)
class EventShift(Feature):
    """Shift of events against the frames: of the whole image, or one component of that of a part.

    Attributes
    ----------
    right_px, down_px
        In pixels of the event camera; 0 for the other component of a part.
    errors_px
        Standard errors of both.
    """

    right_px: float
    down_px: float
    errors_px: tuple[float, float]


@dataclass(frozen=True, slots=True)
class CameraErrorFits(Feature):
    """Errors of the event camera, or the opposite ones of the colour camera, that the shifts of the tiles follow.

    Attributes
    ----------
    fits
        One for each model; none where too few tiles have a shift.
    """

    fits: tuple[ShiftFieldFit, ...]


@dataclass(frozen=True, slots=True)
class ShiftCorrelations:
    """Sums over the lit pixels of some frame intervals.

    Attributes
    ----------
    patches
        (k, 2, s, s) cross-correlations of frame changes with event changes, as ``lattice_peak`` takes them.
    lines, two_sided, coarse
        (2, s, s) sums of such correlations, of changes by events without excursions between events, without pixels that
        lack an event before or after a frame, and with twice the step of the difference that undoes a low-pass.
    squares
        (k, 2) sums of squares of both changes.
    slopes
        (k, 3, 2) to the right and down, as in ``slope_sums``, where the change by events is known.
    lag_sums
        (k, 4, 2) as in ``reference_lags``.
    error_gains
        (k,) as of ``level_error_gain``.
    far
        The patches at half the resolution, for shifts beyond the reach of these.
    tiles
        Sums of each tile of the image over the intervals.
    start_ns, stop_ns
        Ends of the window, ns from the file's origin.
    """

    patches: Float64
    lines: Float64
    two_sided: Float64
    coarse: Float64
    squares: Float64
    slopes: Float64
    lag_sums: Float64
    error_gains: Float64
    far: FarSums
    tiles: ShiftSums
    start_ns: int
    stop_ns: int


class EventResponseAlignment(WindowCheck[ShiftCorrelations]):
    """Do events lie at the pixels where the frames change?

    The shift of events against frames, to the right and down, in px of the event camera (positive: events lie too far
    right or down); the scale of the image of events against that of the frames, and its roll.

    Why it matters
    --------------
    A crop or a half-pixel convention that differs between both sensors displaces every label that is transferred from
    frames to events, above all flow and depth.

    How
    ---
    The change of the signal between two frames is cross-correlated with the change by events, over shifts of up to
    eight pixels, for three intervals in each 0.2 s (one or two for large sensors). Frames are resampled at the centres
    and at the corners of the event camera's pixels, which gives whole and half shifts, so that the peak of the smoothed
    sum is not biased towards whole pixels. Each product is divided by the root of both energies at its shift, and the
    events of a tile are paired with frames beyond the tile. Otherwise small tiles would peak at their borders, or at
    stronger edges. Larger shifts, up to fourteen pixels, are measured to half a pixel on blocks of 2 x 2.

    Scale and roll are fitted by least squares to the shifts of 4 x 4 tiles with a correlation of at least 0.5, together
    with a shift of all (``fedora_qa/estimators/events/shift_field.py``). A wrong focal length of either camera changes
    the scale, a camera that is rotated about its axis the roll.

    A sum of events lags behind the motion, most where brightness reverses: the signal must first return through both
    thresholds. The level at a frame is therefore estimated from the last event before it and the first event after it.
    A declared low-pass delays the events; the change of the light before it follows from the level and its derivative
    (``fedora_qa/estimators/events/low_pass.py``).

    Shift and delay are nearly degenerate along the mean motion. The shift is fitted alone, not together with the delay:
    a late stream appears shifted here, by its delay times that motion. ``event_response.timing`` separates the two.

    Noise model
    -----------
    The standard error is the spread of the peak when groups of intervals are left out in turn, or tiles of the image
    where that is larger. Two errors of the level are systematic. Each is bounded by the change of the peak under the
    opposite assumption. The first is the excursion of the level between two events before it reverses: none, against
    the mean of all possible ones. The second is due to pixels without an event before or after a frame: their reference
    is used as the level and lags; without these pixels the error of the shift has the other sign. Where slopes g of the
    level are small, the lag of up to a threshold C, C sum |g| over these pixels / sum g^2 over all that fire, exceeds
    half a period of the texture. Events then belong to edges that have passed, and the lag is the bound. Behind a
    declared low-pass, the change of the peak with twice the step of the derivative is a third bound. Each window
    and each of 4 x 4 tiles is also compared with the median of all (tiles where their correlation is at least 0.5). The
    error of a part is the larger of the spread over tiles or windows and the error by levels between two events, C
    sqrt(1/3 / sum h^2), with h the slope of the change. Where there are ten or more parts, their scatter is used if it
    exceeds these errors. The errors of scale and roll follow from those of the tiles, widened to their scatter, or from
    the jackknife over tiles where that is larger; their bound is the largest effect of a displacement of each tile by
    up to the bound of the shift.

    Cannot detect
    -------------
    Shifts beyond fourteen pixels. Unrelated scenes (correlation below 0.1). Shifts along edges that all have one
    direction. Scales and rotations with fewer than six tiles of clear edges, or that move tiles by more than eight
    pixels. Parts with few edges. Hovering makes the error too large: not_observable. So does texture so faint that a
    pixel needs several periods of it to fire.

    Sources
    -------
    First principles (``fedora_qa/estimators/events/shift.py``); delete-one jackknife: Efron and Stein 1981.
    """

    name = "event_response.alignment"
    needs = ("events", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras at one place, whose axes differ by 10 deg at most, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts, axes="near")

    def measure(self, window: Window) -> ShiftCorrelations | None:
        """Correlate some intervals of the window."""
        resampled, declared = resampled_frames(window), window.facts.declared.events
        if declared is None or len(resampled) < 2:
            return None
        # Fewer intervals of large sensors: see INTERVALS_OF_LARGE.
        per_window = INTERVALS
        if is_large_sensor(window):
            times_ns, cameras = window.facts.clocks["rgb"].times_ns, window.facts.declared.cameras.values()
            is_long = int(times_ns[-1] - times_ns[0]) >= 2 * FEWEST_INTERVALS * WINDOW_NS
            read_px = window.sampling.tile_share * max(camera.width * camera.height for camera in cameras)
            # One interval a window suffices only in long files whose images are read densely (INTERVALS_OF_LARGE).
            per_window = INTERVALS_OF_LARGE[is_long and read_px >= _DENSE_PX]
        due, last = intervals_due(window, resampled, per_window), len(resampled) - 2
        if due <= 0:
            return None
        # In the middle of equal parts of the window, far from its ends, where events before and after are read.
        chosen = np.unique((np.arange(due) + 0.5) * (last + 1) // due).astype(int).tolist()
        sensor = sensor_shape(window.facts.declared)
        thresholds, events = (declared.threshold_off, declared.threshold_on), pixel_events(window)
        all_times_ns = sensor_events(window).times_ns
        constant_ns = time_constant_ns(declared.bandwidth_hz)
        lines, two_sided, coarse = np.zeros((3, 2, 2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
        whole, lag_sums, error_gains, tiles, far = [], [], [], [], []
        for i in chosen:
            between_ns = int(resampled.times_ns[i]), int(resampled.times_ns[i + 1])
            by_events = changes_of_light(events, sensor, between_ns, thresholds, constant_ns)
            earlier, later = (lattice_signals(window, resampled, declared, frame) for frame in (i, i + 1))
            fired = by_events.mean != 0
            flag = USABLE + KNOWN * by_events.is_known + FIRED * fired + OPEN * (fired & ~by_events.is_known)
            flag = flag.astype(np.uint8)
            level = earlier[0][0]
            changes = IntervalChanges(
                level,
                (later[0][0] - np.float64(level), later[1][0] - np.float64(earlier[1][0])),
                (flag * (earlier[0][1] & later[0][1]), flag * (earlier[1][1] & later[1][1])),
                by_events.mean,
            )
            whole.append(changes.sums([(0, level.shape[0], 0, level.shape[1])]))
            lag_sums.append(changes.lag_sums())
            lines += changes.patches(by_events.line)
            two_sided += changes.patches(np.where(by_events.is_known, by_events.mean, 0.0))
            if constant_ns:
                twice = changes_of_light(events, sensor, between_ns, thresholds, constant_ns, STEPS[1])
                coarse += changes.patches(twice.mean)
            else:
                coarse += whole[-1].patches[0]
            fired_pixels = int(np.count_nonzero(fired))
            error_gains.append(level_error_gain(all_times_ns, between_ns, constant_ns, fired_pixels))
            far.append(far_sums(changes.changes[0], changes.events, changes.flags[0] > 0))
            tiles.append(changes.tile_sums(GRID))
        return ShiftCorrelations(
            np.concatenate([sums.patches for sums in whole]),
            lines,
            two_sided,
            coarse,
            np.concatenate([sums.squares for sums in whole]),
            np.concatenate([sums.slopes for sums in whole]),
            np.array(lag_sums),
            np.array(error_gains),
            joined(far),
            ShiftSums.added(tiles),
            window.span.start_ns,
            window.span.stop_ns,
        )

    def conclude(self, state: Sequence[ShiftCorrelations], facts: Facts) -> Observation:
        """Find the peak of the summed correlations, in px of the event camera."""
        of = max(len(facts.clocks["rgb"].times_ns) - 1, 0)
        coverage = Coverage(sum(len(window.patches) for window in state), of, "frame intervals")
        if coverage.seen < FEWEST_INTERVALS:
            return Observation(coverage, unobservable="fewer than four frame intervals with events")
        patches = np.concatenate([window.patches for window in state])
        squares = np.sum([window.squares.sum(axis=0) for window in state], axis=0)
        far = far_shift(joined([window.far for window in state]), REACH_PX, LEAST_CORRELATION)
        if facts.declared.events is None:
            return Observation(coverage, unobservable="the event sensor is not declared")
        # The larger threshold leaves the larger uncertainty of the level.
        threshold = max(facts.declared.events.threshold_on, facts.declared.events.threshold_off)
        # Undoing a low-pass adds the uncertainty of two more levels.
        threshold *= float(np.sqrt(np.mean(np.concatenate([window.error_gains for window in state]))))
        slopes = np.concatenate([window.slopes for window in state]).mean(axis=0)
        if far is None:
            total = patches.sum(axis=0)
            # Correlation coefficient of frames and events; 1e-300 keeps it finite where nothing changes.
            strength = float(total.max()) / max(float(np.sqrt(squares.prod())), 1e-300)
            near = lattice_peak(total)
            if near is None or strength < LEAST_CORRELATION:
                why = f"events and frames have a correlation of at most {strength:.2g} within {RADIUS_PX} px"
                return Observation(coverage, unobservable=why)
            # Spread over time, and over the image, where the errors of neighbouring pixels on one edge are alike.
            tiles = np.sum([window.tiles.patches for window in state], axis=0)
            over_time, over_image = lattice_spread(patches), lattice_spread(tiles[tiles.any(axis=(1, 2, 3))])
            variants = [
                lattice_peak(np.sum([getattr(window, name) for window in state], axis=0))
                for name in ("lines", "two_sided", "coarse")
            ]
            if over_time is None or over_image is None or None in variants:
                return Observation(coverage, unobservable="the peak depends on single frame intervals or tiles")
            shift, errors = near, np.maximum(over_time, over_image)
            # Excursions of the level between events, pixels without an event before or after a frame, and the step of
            # the difference that undoes a low-pass: errors of the level, each bounded by the distance of the peak
            # without them, or with twice the step; the second also by its lag, where that exceeds the texture.
            by_excursions, by_references, by_step = (
                np.abs([each.right_px - near.right_px, each.down_px - near.down_px]) for each in variants if each
            )
            lag_sums = np.concatenate([window.lag_sums for window in state]).sum(axis=0)
            bounds = by_excursions + np.maximum(by_references, reference_lags(lag_sums, threshold)) + by_step
        else:
            level_errors, bounds = open_level_errors(slopes, threshold)
            shift, errors = far.shift, np.maximum(far.errors_px, level_errors)
        both = EventShift(shift.right_px, shift.down_px, (float(errors[0]), float(errors[1])))
        whole = (
            self._whole("shift_right", shift.right_px, "right", float(errors[0]), float(bounds[0]), both),
            self._whole("shift_down", shift.down_px, "down", float(errors[1]), float(bounds[1]), both),
        )
        of_tiles = self._tiles(state, threshold)
        field = self._of_tiles(of_tiles, bounds, facts)
        fits = self._camera_errors(state, threshold, facts)
        statistics = (*whole, *self._parts(state, threshold, bounds, of_tiles, facts), *field)
        return Observation(
            coverage, tuple(replace(statistic, features=(*statistic.features, fits)) for statistic in statistics)
        )

    def _tiles(self, state: Sequence[ShiftCorrelations], threshold: float) -> PartShifts:
        """Return the shifts of the tiles of the image, whose correlations are spread over the windows."""
        tiles = np.array([window.tiles.patches for window in state])
        count = sum(len(window.patches) for window in state)
        spreads = [lattice_spread(of_tile) for of_tile in tiles.swapaxes(0, 1)]
        added = ShiftSums.added([window.tiles for window in state])
        return shifts_of_parts(added, count, threshold, CLEAR, spreads=spreads)

    def _camera_errors(self, state: Sequence[ShiftCorrelations], threshold: float, facts: Facts) -> CameraErrorFits:
        """Return the errors of a camera that the tiles follow, also tiles of which some peak at a wrong edge."""
        sums = ShiftSums.added([window.tiles for window in state])
        tiles = shifts_of_parts(sums, sum(len(window.patches) for window in state), threshold, _PROBABLE)
        centres_px, K = _tile_centres(facts)[tiles.is_finite], facts.declared.cameras["events"].K
        return CameraErrorFits(field_fits(centres_px, tiles.shifts_px[tiles.is_finite], K))

    def _of_tiles(self, tiles: PartShifts, bounds: Float64, facts: Facts) -> tuple[Statistic, ...]:
        """Return scale and roll of the events against the frames; none where too few tiles have clear edges."""
        centres_px = _tile_centres(facts)[tiles.is_finite]
        shifts_px, errors_px = tiles.shifts_px[tiles.is_finite], tiles.errors_px[tiles.is_finite]
        K = facts.declared.cameras["events"].K
        similarity = scale_and_roll(centres_px, shifts_px, errors_px, K)
        if similarity is None:
            return ()
        # An error of the level moves every tile by at most the bound of the whole.
        bound = similarity.per_px * float(bounds.max())
        # Tiles near the border that are shifted farther lose their clear edges, so that the measurement ends there: a
        # limit beyond it would not be true, and what deviates is stated all the same.
        farthest_px = float(np.linalg.norm(_tile_centres(facts) - K[:2, 2], axis=1).max())
        of_use = _FARTHEST_OF_A_TILE_PX / farthest_px

        def statistic(name: str, value: float, error: float, unit: str, per_unit: float, words: str) -> list[Statistic]:
            limit = bound + _ERRORS_OF_A_LIMIT * error
            if limit > of_use and abs(value) <= limit:
                return []
            return [
                Statistic(
                    name=name,
                    value=per_unit * value,
                    unit=unit,
                    standard_error=per_unit * error,
                    model_error_bound=per_unit * bound,
                    blind_from=per_unit * of_use,
                    sensitivity=sensitivity_range(
                        per_unit * error * np.array([1.0, _GROWTH]), per_unit * bound * np.array([1.0, _GROWTH])
                    ),
                    statement=f"The image of events is {words.format(per_unit * value, per_unit * error)} the changes "
                    "of the frames.",
                    code=f"event_response.alignment.{name}",
                    where=Where(stream="events"),
                )
            ]

        return (
            *statistic("scale", similarity.scale, similarity.scale_error, "percent", 100.0,
                       "{:+.3g} +/- {:.2g}% wider than"),
            *statistic("roll", similarity.roll_rad, similarity.roll_error_rad, "deg", 180 / np.pi,
                       "rotated by {:+.3g} +/- {:.2g} deg (clockwise positive) against"),
        )  # fmt: skip

    def _parts(
        self,
        state: Sequence[ShiftCorrelations],
        threshold: float,
        bounds: Float64,
        regions: PartShifts,
        facts: Facts,
    ) -> list[Statistic]:
        """Return the segment of time and the region with the largest shift against the rest."""
        statistics = []
        windows = [ShiftSums(*(getattr(each, name).sum(axis=0) for name in ShiftSums.__slots__)) for each in state]
        usual = max(len(window.patches) for window in state)
        tiles = np.array([window.tiles.patches for window in state])
        variants = [np.array([getattr(window, name) for window in state]) for name in ("lines", "two_sided")]
        # A segment of time is spread over the tiles, and a tile over the segments.
        spreads = [lattice_spread(of_window[of_window.any(axis=(1, 2, 3))]) for of_window in tiles]
        segment = most_shifted(
            shifts_of_parts(
                ShiftSums.stacked(windows), usual, threshold, LEAST_CORRELATION, spreads=spreads, variants=variants
            )
        )
        if segment is not None:
            chosen = [window for window, alike in zip(state, segment.alike, strict=True) if alike]
            where, place = place_of_segment(facts, chosen[0].start_ns, chosen[-1].stop_ns)
            statistics.append(self._part("stretch", segment, bounds, where, place))
        region = most_shifted(regions)
        if region is not None:
            where, place = place_of_tiles(facts, region.alike)
            statistics.append(self._part("region", region, bounds, where, place))
        return statistics

    def _part(self, rule: str, part: PartShift, bounds: Float64, where: Where, place: str) -> Statistic:
        word, error = _AXES[part.axis], part.standard_error_px
        right, down = (float(part.axis == axis) for axis in (0, 1))
        along = EventShift(right * part.shift_px, down * part.shift_px, (right * error, down * error))
        return Statistic(
            name=f"shift_in_a_{rule}",
            value=part.shift_px,
            unit="px",
            standard_error=error,
            model_error_bound=float(bounds[part.axis]),
            # Each part was compared along both axes.
            tests=2 * part.compared,
            sensitivity=sensitivity_range(part.errors_px, bounds),
            statement=f"{place} events lie {part.shift_px:+.3g} +/- {error:.2g} px ({word} positive) from their "
            "position in the rest.",
            code=f"event_response.alignment.{rule}",
            where=where,
            features=(along,),
        )

    def _whole(
        self, name: str, value: float, word: Literal["right", "down"], error: float, bound: float, both: EventShift
    ) -> Statistic:
        return Statistic(
            name=name,
            value=value,
            unit="px",
            standard_error=error,
            model_error_bound=bound,
            statement=f"Events lie {value:+.3g} +/- {error:.2g} px ({word} positive) from the changes of the frames.",
            code="event_response.alignment.shift",
            where=Where(stream="events"),
            features=(both,),
        )


_AXES: Final[tuple[Literal["right", "down"], ...]] = ("right", "down")


def _tile_centres(facts: Facts) -> Float64:
    """Return the centres (GRID^2, 2) of the tiles of the event camera, by rows, as columns and rows."""
    # The centre of the pixels from a to b - 1 is (a + b - 1) / 2.
    rows, columns = (
        (np.arange(GRID) + np.arange(1, GRID + 1)) * size / (2 * GRID) - 0.5 for size in sensor_shape(facts.declared)
    )
    return np.stack([np.tile(columns, GRID), np.repeat(rows, GRID)], axis=1)
