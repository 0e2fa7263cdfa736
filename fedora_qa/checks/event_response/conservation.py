"""Events against log intensity: conservation of the signal less the sum of its events."""

from dataclasses import dataclass, field
from math import ceil, expm1, inf, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Check, Observation, Statistic
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.events.balance import BalanceSums
from fedora_qa.estimators.events.change_courses import (
    FEWEST_INTERVALS,
    common_change,
    longest_unrelated,
    silent_tiles,
)
from fedora_qa.estimators.events.rates import LoneEvents, count_lone_events
from fedora_qa.estimators.events.violation_box import share_in_box, with_neighbours
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.conservation_trials import InverseTrial, inverse_trials, is_tried
from fedora_qa.views.event_balance import balance_features, window_balance
from fedora_qa.views.event_blocks import block_moments
from fedora_qa.views.event_camera import resampled_frames, starts_at_first_frame, why_frames_and_events_do_not_meet
from fedora_qa.views.frame_runs import FrameRuns, FrameRunSummary
from fedora_qa.views.sensor_events import GRID, sensor_shape

Bool = NDArray[np.bool_]

TILE_PX: Final = 8


@dataclass(frozen=True, slots=True)
class Violations(Feature):
    """Pixels whose events contradict the frames.

    Attributes
    ----------
    pixels
        Their number.
    fraction
        Their fraction of the image.
    """

    pixels: int
    fraction: float


@dataclass(frozen=True, slots=True)
class ViolationCluster(Feature):
    """Concentration of the violating pixels of the whole file.

    Attributes
    ----------
    side_px
        Side of a square of as many pixels, px.
    fraction_of_image
        Fraction of the pixels of the image that violate the law.
    fraction_nearby
        Fraction of the violating pixels that lie around the worst tile, within the side of such a square.
    fraction_without_events
        Fraction of the violating pixels without any event, while others have as many as usual.
    fraction_in_densest_square
        Fraction of the violating pixels in one square of twice their number; 0 for fewer than 8 pixels.
    fraction_in_densest_band
        The same of one band of whole rows, or of whole columns.
    firing_of_disturbed
        Violating pixels that have events, relative to those that declared noise may disturb; infinite without such
        noise.
    fraction_of_worst_tile
        Fraction of the pixels of the worst tile that violate the law.
    changes_in_box
        Share of the changes by events in the rectangle in which nine tenths of the violating pixels lie by their
        columns, and by their rows. Beside declared noise, which disturbs single pixels, those that lie alone do not
        count.
    """

    side_px: float
    fraction_of_image: float
    fraction_nearby: float
    fraction_without_events: float
    fraction_in_densest_square: float
    fraction_in_densest_band: float = 0.0
    firing_of_disturbed: float = inf
    fraction_of_worst_tile: float = 0.0
    changes_in_box: float = 1.0


@dataclass(frozen=True, slots=True)
class LoneEventRate(Feature):
    """Events without other events near them in space and time; noise gives equally many everywhere.

    Attributes
    ----------
    quiet_hz
        Rate a pixel that three quarters of the image reach.
    mean_hz
        Rate a pixel of the whole image.
    seconds
        Length of a group of frames, at most 2 s.
    """

    quiet_hz: float
    mean_hz: float
    seconds: float


@dataclass(frozen=True, slots=True)
class ChangeCourses(Feature):
    """How frames and events change together over time.

    Attributes
    ----------
    unrelated_percent
        Longest part of the time in which both change without correlation, while they correlate otherwise; 0 for none.
    common_percent
        Largest gain of all tiles of the frames together that their events do not contain; 0 where there is none, and
        for the linear model.
    silent_share
        Share of the violating pixels in tiles without an event for a while in which they change as usual and others
        have events, 0 to 1.
    """

    unrelated_percent: float = 0.0
    common_percent: float = 0.0
    silent_share: float = 0.0


@dataclass(slots=True)
class ConservationState:
    """State of the check over some windows.

    Attributes
    ----------
    runs
        Frame runs.
    trials
        Inverse trials of windows that violate the law.
    lone
        Events without other events near them, between the frames; None where no frames were compared.
    moments
        (k, t, 6) moments of changes by interval and tile, of each window.
    balance
        Sums over the windows in which inverses are tried; None before the first.
    """

    runs: FrameRuns
    trials: list[InverseTrial] = field(default_factory=list)
    lone: LoneEvents | None = None
    moments: list[NDArray[np.float32]] = field(default_factory=list)
    balance: BalanceSums | None = None


class EventResponseConservation(Check[ConservationState]):
    """Does the sum of events agree with the frames in every pixel?

    The share of pixels whose events contradict the frames, in the two seconds with the largest deviation, and the same
    share in the worst tile of 8 x 8 pixels (tiles overlap by half). A contradiction is certain: no signal agrees with
    both frames and events.

    Why it matters
    --------------
    Lost packets, packets written twice and dead regions change no other statistic of a stream, and every method that
    integrates events has wrong results: reconstruction, tracking, learned representations.

    How
    ---
    Log model: E = L - C+ P + C- M varies by less than C+ + C-, over any time (``Excursions``). If the declared initial
    phase is zero (the first reference is the signal at the first frame), and at least nine tenths of the pixels that
    can contradict this agree with it, E also stays within C+ and C- of its start. In the first two seconds this detects
    a single lost event in most pixels. Linear model: the signal of a pixel without events varies by at most C+ + C-,
    and P brighter events alone imply a rise of at least P (C+ + 1) - C+ - C- (``EventFreeRuns``); with a declared start
    its first run stays within C+ and C-. Frames bound L at their times, and two seconds are compared at a time. In the
    first windows that violate the law, and in some later ones, the inverses of suspected faults are applied: polarity,
    mirrored or exchanged axes, shifts, delays. The inverse that resolves most pixels, less the pixels that it makes
    violate the law, names the cause. Where none does, the number of events for each change of the light does: its
    gain, its scatter, its course over time and across the image, and events against the change (``balance``).

    Noise model
    -----------
    The bounds of the signal by a frame hold with certainty: half a step of the 8-bit code, which in L is proportional
    to 1/I, plus the possible values of the pixels that a footprint cuts. Dark and curved regions need no mask: their
    bounds are only wider. The thresholds of a pixel are constant: their declared spread widens the law by five sigma an
    event. A declared leak moves the law. As many violations are allowed as declared spurious events may have caused.
    Behind a declared low-pass, a frame is used only at pixels without events within five of its time constants.

    No bound covers a renderer that samples its pixels too coarsely. Frames in which the cut pixels alone leave the
    signal uncertain by C+ + C- or more are therefore not used: their bound would have to be exact, and events determine
    the signal as well (``frame_runs``). The rate of antialiasing errors is measured on the file: it is the number of
    pixels that violate the law only if those frames are used. The same number is allowed among the other frames, which
    are more uniform, with the Poisson error of that number plus one. A structure one pixel wide covers an eighth of a
    tile, which is the bound of the worst tile.

    Cannot detect
    -------------
    Events lost in pairs of opposite polarity. Faults that keep the signal within the thresholds, such as a dead region
    without contrast. After two seconds, or from an unknown start: a single event of a pixel that does not use its whole
    range.

    Sources
    -------
    First principles: the sensor's definition (P. Lichtsteiner, C. Posch, T. Delbruck, IEEE J. Solid-State Circuits 43
    (2008), section II) as inequalities; derivations in
    ``fedora_qa/estimators/events/conservation.py`` and ``footprint.py``.
    """

    name = "event_response.conservation"
    needs = ("events", "rgb")
    _MOST_USEFUL: Final = 0.05
    _MOST: Final = 0.5
    """Material share of violating pixels, of the informative pixels."""
    _TILE_MODEL_ERROR_BOUND: Final = 1 / TILE_PX
    """A structure one pixel wide runs through as many pixels of a tile as its side has."""

    def not_applicable(self, facts: Facts) -> str:
        """Require both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def start(self, facts: Facts) -> ConservationState:
        """Return a state without frame runs."""
        declared = facts.declared.events
        if declared is None:
            raise ValueError("Expected a declared event sensor, got none; the check is not applicable")
        return ConservationState(FrameRuns(declared, starts_at_first_frame(facts)))

    def update(self, state: ConservationState, window: Window) -> None:
        """Join the window's frames to the last run, or begin another, and try inverse transforms on violations."""
        state.runs.follow(window)
        if window.sampling.features:
            state.trials.extend(inverse_trials(window))
        resampled = resampled_frames(window)
        if len(resampled) > 1:
            lone = count_lone_events(resampled.counts, np.diff(resampled.times_ns))
            state.lone = lone if state.lone is None else state.lone + lone
            if window.sampling.features and is_tried(window):
                balance = window_balance(window, state.runs.model)
                state.balance = balance if state.balance is None else state.balance.then(balance)
        blocks = block_moments(window)
        if blocks is not None:
            # Axis 2 holds the eight symmetries, the declared orientation first.
            state.moments.append(blocks.steps[:, :, 0].astype(np.float32))

    def merge(self, state: ConservationState, later: ConservationState) -> ConservationState:
        """Join adjacent frame runs."""
        lone = state.lone + later.lone if state.lone and later.lone else state.lone or later.lone
        balance = state.balance.then(later.balance) if state.balance and later.balance else None
        return ConservationState(
            state.runs.then(later.runs),
            state.trials + later.trials,
            lone,
            state.moments + later.moments,
            balance or state.balance or later.balance,
        )

    def conclude(self, state: ConservationState, facts: Facts) -> Observation:
        """Count the pixels that violate the law, in the worst two seconds and by tile."""
        groups, rgb_count = state.runs.summaries(), len(facts.clocks["rgb"].times_ns)
        coverage = Coverage(min(sum(group.frames for group in groups), rgb_count), rgb_count, "frames")
        if not groups:
            return Observation(coverage, unobservable="no two frames with events around them")
        shape = sensor_shape(facts.declared)
        pixels = np.any([group.unpacked(shape) for group in groups], axis=0)
        # No pixel violates the law, and none changes enough to be able to.
        if not pixels.any() and not any(group.informative for group in groups):
            return Observation(coverage, unobservable="in no pixel do frames change enough to detect a lost event")
        # Tiles overlap by half, so that any region of five pixels a side lies wholly in one of them.
        side = min(TILE_PX, *pixels.shape)
        step = max(side // 2, 1)
        fractions = _square_counts(pixels, side)[::step, ::step] / side**2
        tile_row, tile_column = (int(i) for i in np.unravel_index(int(np.argmax(fractions)), fractions.shape))
        tile_fraction = float(fractions[tile_row, tile_column])
        row, column = tile_row * step, tile_column * step

        # Concentration of the violating pixels: around the worst tile, and in one square of twice their number.
        count, everywhere = int(np.count_nonzero(pixels)), float(pixels.mean())
        side_px = sqrt(float(count))
        reach = int(side_px) + TILE_PX
        near = pixels[max(row - reach, 0) : row + TILE_PX + reach, max(column - reach, 0) : column + TILE_PX + reach]
        densest = densest_band = 0.0
        if count >= TILE_PX:
            densest = float(_square_counts(pixels, min(ceil(sqrt(2 * count)), *pixels.shape)).max()) / count
            of_rows, of_columns = (
                _most_in_a_band(pixels.sum(axis=1 - axis), ceil(2 * count / pixels.shape[1 - axis])) for axis in (0, 1)
            )
            densest_band = max(of_rows, of_columns) / count
        # Where a group has lost most of its events, or all lie at other times, pixels without any are not dead.
        usual = float(np.median([group.events_per_pixel for group in groups]))
        disturbed = pixels.size * sum(_excused_share(group, state.runs.model, facts) for group in groups)
        firing = sum(group.violations - group.without_events for group in groups)
        cluster = ViolationCluster(
            side_px,
            fraction_of_image=everywhere,
            fraction_nearby=float(np.count_nonzero(near)) / max(count, 1),
            fraction_of_worst_tile=tile_fraction,
            fraction_without_events=sum(
                group.without_events for group in groups if group.events_per_pixel >= max(usual / 2, 1 / pixels.size)
            )
            / max(sum(group.violations for group in groups), 1),
            fraction_in_densest_square=densest,
            fraction_in_densest_band=densest_band,
            firing_of_disturbed=firing / disturbed if disturbed else inf,
            changes_in_box=_changes_in_box(state.moments, with_neighbours(pixels) if disturbed else pixels),
        )
        courses = _courses(state.moments, state.runs.model, pixels)
        balance = balance_features(state.balance) if pixels.any() else ()
        tile = Statistic(
            name="worst_tile",
            value=tile_fraction,
            unit="1",
            # Binomial error over the pixels of a tile; the floor of one pixel keeps it above 0 where no pixel of the
            # image violates.
            standard_error=sqrt(max(everywhere * (1 - everywhere), 1 / side**2) / side**2),
            # The rest of the image is the reference: violations everywhere are stated by ``violating_pixels``.
            expected=everywhere,
            model_error_bound=self._TILE_MODEL_ERROR_BOUND,
            side="upper",
            # No more pixels of a tile can violate the law than are informative.
            blind_from=min(1.0, max(group.informative for group in groups) / side**2),
            tests=fractions.size,
            statement=f"In {tile_fraction:.0%} of the pixels of the tile at ({column}, {row}) the sum of events "
            f"contradicts the frames; in the whole image in {everywhere:.2%}.",
            code="event_response.conservation.region",
            where=Where(stream="events", tile=(column, row, column + side, row + side)),
            features=(Violations(count, everywhere), cluster, courses, *balance, *state.trials),
        )
        times_ns = facts.clocks["rgb"].times_ns
        seconds = max(float(times_ns[group.last_frame] - times_ns[group.first_frame]) / NS_PER_S for group in groups)
        noise = (LoneEventRate(state.lone.quiet_rate_hz, state.lone.mean_rate_hz, seconds),) if state.lone else ()
        shared = (cluster, courses, *noise, *balance, *state.trials)
        worst_group = self._worst_group(groups, state.runs.model, facts, shared)
        return Observation(
            coverage,
            (worst_group, tile),
            evidence={"conservation_violations": pixels.astype(np.uint8)},
            titles={"conservation_violations": "Pixels whose sum of events contradicts the frames [1: contradiction]"},
        )

    def _worst_group(
        self, groups: list[FrameRunSummary], declared: EventModel, facts: Facts, features: tuple[Feature, ...]
    ) -> Statistic:
        """Return the fraction of violating pixels, of the two seconds in which it exceeds its bound most."""
        height, width = sensor_shape(facts.declared)
        size = height * width
        times_ns = facts.clocks["rgb"].times_ns
        counts = [group.violations for group in groups]
        bounds, errors = [], []
        for group in groups:
            excused = _excused_share(group, declared, facts)
            # As many violations are allowed as uneven frames alone cause, with the Poisson error of that number + 1.
            bounds.append(group.flawed / size + excused)
            # Shares of the image: (k + 1) / size^2 of k flawed pixels (Poisson), p / size of an excused share p
            # (binomial).
            errors.append(sqrt((group.flawed + 1) / size**2 + excused / size))
        deviations = [
            (count / size - model_error_bound) / error
            for count, model_error_bound, error in zip(counts, bounds, errors, strict=True)
        ]
        worst = int(np.argmax(deviations))
        group, first = groups[worst], groups[worst].suspected
        last = min(first + 1, len(times_ns) - 1)
        return Statistic(
            name="violating_pixels",
            value=counts[worst] / size,
            unit="1",
            standard_error=errors[worst],
            model_error_bound=bounds[worst],
            side="upper",
            resolution=1 / size,
            blind_from=min(self._MOST_USEFUL, self._MOST * group.informative / size),
            tests=len(groups),
            statement=f"In {counts[worst]} of {size} pixels the sum of events contradicts the frames "
            f"{group.first_frame} to {group.last_frame}, in most of them across frame {first}.",
            code="event_response.conservation.pixels",
            where=Where(
                stream="events",
                start_us=facts.to_file_us(int(times_ns[first])),
                stop_us=facts.to_file_us(int(times_ns[last])),
                frame=first,
            ),
            features=(Violations(counts[worst], counts[worst] / size), *features),
        )


def _excused_share(group: FrameRunSummary, declared: EventModel, facts: Facts) -> float:
    """Return the share of the pixels that declared spurious events let violate the law."""
    # A spurious event changes a pixel by a threshold: a Poisson process of the declared rate gives at least one event
    # in this fraction of the pixels.
    times_ns = facts.clocks["rgb"].times_ns
    seconds = float(times_ns[group.last_frame] - times_ns[group.first_frame]) / NS_PER_S
    return -expm1(-declared.shot_rate_hz * seconds)


def _courses(moments: list[NDArray[np.float32]], model: EventModel, violating: Bool) -> ChangeCourses:
    """Return how frames and events change together over the windows, with the pixels (h, w) that violate the law."""
    if not moments:
        return ChangeCourses()
    by_tile = np.concatenate(moments).astype(np.float64)
    _, _, _, dd, ee, de = by_tile.sum(axis=1).T
    run = longest_unrelated(dd, ee, de)
    # A gain of the light is a constant of the signal in the log model alone.
    gain = expm1(common_change(by_tile)) if model.model == "log" else 0.0
    height, width = violating.shape
    in_silence = silent_tiles(by_tile).reshape(GRID, GRID)[
        np.ix_(GRID * np.arange(height) // height, GRID * np.arange(width) // width)
    ]
    return ChangeCourses(
        unrelated_percent=100 * run / len(dd) if run >= FEWEST_INTERVALS else 0.0,
        common_percent=100 * gain,
        silent_share=float(np.count_nonzero(violating & in_silence)) / max(int(np.count_nonzero(violating)), 1),
    )


def _changes_in_box(moments: list[NDArray[np.float32]], pixels: Bool) -> float:
    """Return the share of the changes by events in the box of violating pixels; 1 where nothing was compared."""
    if not moments:
        return 1.0
    changes = np.sum([of_window[..., 4].sum(axis=0, dtype=np.float64) for of_window in moments], axis=0)
    return share_in_box(changes.reshape(GRID, GRID), pixels)


def _square_counts(pixels: Bool, side: int) -> NDArray[np.int64]:
    """Return the number of marked pixels in each square of a side, by its first row and column."""
    # A summed-area table: the count in any square from its four corners.
    sums = np.pad(pixels.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    counts: NDArray[np.int64] = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    return counts


def _most_in_a_band(counts: NDArray[np.int64], width: int) -> int:
    """Return the largest sum of so many neighbouring counts."""
    sums = np.pad(counts.cumsum(), (1, 0))
    width = min(width, len(counts))
    return int((sums[width:] - sums[:-width]).max())
