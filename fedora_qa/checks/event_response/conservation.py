"""Events against log intensity: what must be conserved."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import ceil, expm1, pi, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_response.conservation_suspects import FEW, why_broken
from fedora_qa.checks.event_response.inverse_trials import Trial, trials
from fedora_qa.checks.protocol import Check, Observation, Statistic, Suspect
from fedora_qa.conventions import NS_PER_S
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import sensor_shape, why_frames_and_events_do_not_meet
from fedora_qa.views.frame_runs import Closed, Ledger

Bool = NDArray[np.bool_]

TILE_PX: Final = 8


@dataclass(slots=True)
class Followed:
    """Stretches of frames, and what undoing faults did to windows that break the law."""

    ledger: Ledger
    trials: list[Trial] = field(default_factory=list)


class EventResponseConservation(Check[Followed]):
    """Do events add up to what the frames show, in every pixel?

    The share of pixels whose events contradict the frames, in the worst two seconds, and the same in the worst tile of
    8 x 8 pixels (tiles overlap by half). A contradiction is certain: no signal agrees with both, frames and events.

    Why it matters
    --------------
    Lost packets, packets written twice and dead regions leave every other statistic of a stream as it was, and spoil
    whatever integrates events: reconstruction, tracking, learned representations.

    How
    ---
    Log model: E = L - C+ P + C- M varies by less than C+ + C-, however long (``event_excursions``). Where the first
    reference is declared to be the signal at the first frame, and nine tenths of the pixels that could contradict that
    do not, E also stays within C+ and C- of its start: in the first two seconds that sees a single event in most
    pixels. Linear model: a silent pixel varies by at most C+ + C-, and P brighter events alone mean a rise of at least
    P (C+ + 1) - C+ - C- (``event_runs``); from a declared start its first run keeps to C+ and C-. Frames bound L at
    their times; two seconds are followed at a time. The first windows that break the law, and some later ones, are
    tried with faults undone: polarity, mirrored or exchanged axes, shifts, delays. What mends most pixels, less those
    that it breaks, names the cause.

    Noise model
    -----------
    Each frame bounds the value with certainty: half a step of the 8-bit code, which in L grows with 1/I, and what the
    pixels that a footprint cuts may hold; dark and curved regions need no mask, they only show less. Declared spread of
    thresholds widens the law by five sigma an event, leak moves it, spurious events excuse as many pixels as they may
    have hit, a low-pass those that fire around frame times.

    What no bound covers is a renderer that samples its pixels too coarsely. Frames whose cut pixels alone leave the
    signal open by C+ + C- or more are not believed: there the bound would have to hold to the last, and events tell as
    much (``stretch``). How often antialiasing fails is measured on the file: pixels that break the law only if those
    frames are believed. As many are allowed among the others, which are more even, with the Poisson error of so many
    and one. A structure one pixel wide runs through an eighth of a tile.

    Cannot see
    ----------
    Events lost in pairs of opposite polarity; whatever keeps within the thresholds, a dead region without contrast
    say; after two seconds or from an unknown start, a single event of a pixel that does not use its whole range.

    Sources
    -------
    First principles: the sensor's definition (P. Lichtsteiner, C. Posch, T. Delbruck, IEEE J. Solid-State Circuits 43
    (2008), section II) as inequalities; derivations in ``event_excursions``, ``event_runs`` and ``event_footprint``.
    """

    name = "event_response.conservation"
    needs = ("events", "rgb")
    _MATTERS: Final = 0.05
    _MOST: Final = 0.5
    """Share of the pixels in which events are lost, or of those that could show it where these are fewer."""
    _TILE_MODEL_ERROR_BOUND: Final = 1 / TILE_PX
    """A structure one pixel wide runs through as many pixels of a tile as its side has."""
    _ONE_REGION: Final = 0.6
    """Share of the violating pixels that lie together, and share of them that give no event, where a region is dead
    (in the diagnosis, after an alarm)."""

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def start(self, facts: Facts) -> Followed:
        """Return no stretch."""
        if facts.declared.events is None:
            raise ValueError("Expected a declared event sensor, got none; the check is not applicable")
        return Followed(Ledger(facts.declared.events, _phase_known(facts, facts.declared.events)))

    def update(self, state: Followed, window: Window) -> None:
        """Join the window's frames to the last stretch, or begin another, and try to undo faults where it is broken."""
        state.ledger.follow(window)
        state.trials.extend(trials(window))

    def merge(self, state: Followed, later: Followed) -> Followed:
        """Join the stretches that meet."""
        return Followed(state.ledger.then(later.ledger), state.trials + later.trials)

    def conclude(self, state: Followed, facts: Facts) -> Observation:
        """Count the pixels that broke the law, in the worst two seconds and by tile."""
        closed, rgb_count = state.ledger.closed(), len(facts.clocks["rgb"].times_ns)
        coverage = Coverage(min(sum(one.frames for one in closed), rgb_count), rgb_count, "frames")
        if not closed:
            return Observation(coverage, unobservable="no two frames with events around them")
        shape = sensor_shape(facts.declared)
        pixels = np.any([one.unpacked(shape) for one in closed], axis=0)
        if not pixels.any() and not any(one.telling for one in closed):
            return Observation(
                coverage, unobservable="nowhere do frames show so much change that an event could be missed"
            )
        tile, dead = self._tile(pixels, closed, facts, state.trials)
        return Observation(
            coverage,
            (self._share(closed, state.ledger.model, facts, dead, state.trials), tile),
            evidence={"conservation_violations": pixels.astype(np.uint8)},
            titles={
                "conservation_violations": "Pixels whose events do not add up to what the frames show [1: some do not]"
            },
        )

    def _share(
        self, closed: list[Closed], declared: EventModel, facts: Facts, dead: float, tried: Sequence[Trial]
    ) -> Statistic:
        shape = sensor_shape(facts.declared)
        size = shape[0] * shape[1]
        times_ns = facts.clocks["rgb"].times_ns
        counts = [int(np.bitwise_count(one.pixels).sum()) for one in closed]
        excused = [_excused_share(one, declared, times_ns) for one in closed]
        model_error_bounds = [one.flawed / size + share for one, share in zip(closed, excused, strict=True)]
        errors = [sqrt((one.flawed + 1) / size**2 + share / size) for one, share in zip(closed, excused, strict=True)]
        deviations = [
            (count / size - model_error_bound) / error
            for count, model_error_bound, error in zip(counts, model_error_bounds, errors, strict=True)
        ]
        worst = int(np.argmax(deviations))
        first = closed[worst].suspected
        last = min(first + 1, len(times_ns) - 1)
        return Statistic(
            name="violating_pixels",
            value=counts[worst] / size,
            unit="1",
            standard_error=errors[worst],
            model_error_bound=model_error_bounds[worst],
            side="upper",
            resolution=1 / size,
            material=min(self._MATTERS, self._MOST * closed[worst].telling / size),
            tests=len(closed),
            statement=f"In {counts[worst]} of {size} pixels events do not add up to what the frames "
            f"{closed[worst].first_frame} to {closed[worst].last_frame} show, most of them across frame {first}.",
            code="event_response.conservation.pixels",
            where=Where(
                stream="events",
                start_us=facts.to_file_us(int(times_ns[first])),
                stop_us=facts.to_file_us(int(times_ns[last])),
                frame=first,
            ),
            suspects=why_broken(
                closed[worst].unpacked(shape),
                float(counts[worst]),
                Suspect("dead_region", "events", 0.9 * dead),
                tried,
                facts,
            ),
        )

    def _tile(
        self, pixels: Bool, closed: list[Closed], facts: Facts, tried: Sequence[Trial]
    ) -> tuple[Statistic, float]:
        """Return the worst tile, and how well a dead region around it explains the violations.

        They lie together, and without events; or, of a region that is dead for some time, so close together that no
        loss of single events could be: a lost packet spoils few pixels of any place.
        """
        silent = facts.events is None or not facts.events.count
        share, row, column, tiles = _worst_tile(pixels)
        everywhere = float(pixels.mean())
        side = min(TILE_PX, *pixels.shape)
        region = sqrt(float(np.count_nonzero(pixels)))
        mute = sum(one.mute for one in closed) / max(sum(int(np.bitwise_count(one.pixels).sum()) for one in closed), 1)
        mute_together = min(_gathered(pixels, row, column, region), mute) > self._ONE_REGION
        dense = float(pixels.mean()) < FEW and _densest(pixels) > self._ONE_REGION
        dead = 0.1 if silent else 0.8 if mute_together else 0.6 if dense else 0.1
        measured = Statistic(
            name="worst_tile",
            value=share,
            unit="1",
            standard_error=sqrt(max(everywhere * (1 - everywhere), 1 / side**2) / side**2),
            expected=everywhere,
            model_error_bound=self._TILE_MODEL_ERROR_BOUND,
            side="upper",
            material=min(1.0, max(one.telling for one in closed) / side**2),
            tests=tiles,
            statement=f"In {share:.0%} of the pixels of the tile at ({column}, {row}) events do not add up; "
            f"{everywhere:.2%} of all.",
            code="event_response.conservation.region",
            where=Where(stream="events", tile=(column, row, column + side, row + side)),
            suspects=why_broken(pixels, None, Suspect("dead_region", "events", dead, region, "px"), tried, facts),
        )
        return measured, dead


def _phase_known(facts: Facts, declared: EventModel) -> bool:
    """Whether the signal at the first frame is declared to be the first reference, and no event comes before it."""
    times_ns = facts.clocks["rgb"].times_ns
    after = len(times_ns) > 0 and facts.events is not None and facts.events.first_ns > int(times_ns[0])
    return declared.initial_phase == "zero" and after


def _excused_share(closed: Closed, declared: EventModel, times_ns: NDArray[np.int64]) -> float:
    """Return the share of pixels that declared effects may drive beyond the law.

    A spurious event moves a pixel by a threshold. A low-pass holds back the events of the last five time constants
    before a frame: pixels that fire that close to a frame time may lag by more than their bound.
    """
    seconds = float(times_ns[closed.last_frame] - times_ns[closed.first_frame]) / NS_PER_S
    spurious = -expm1(-declared.shot_rate_hz * seconds)
    lagging = 0.0
    if declared.bandwidth_hz > 0:
        around_s = 10 / (2 * pi * declared.bandwidth_hz)
        lagging = closed.events_per_pixel / max(seconds, 1e-9) * around_s * closed.frames
    return min(spurious + lagging, 1.0)


def _worst_tile(pixels: Bool) -> tuple[float, int, int, int]:
    """Return the largest share in a tile, its first row and column, and the number of tiles; they overlap by half.

    So a region of five pixels a side lies wholly in one of them, wherever it is.
    """
    side = min(TILE_PX, *pixels.shape)
    step = max(side // 2, 1)
    sums = np.pad(pixels.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    counts = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    shares = counts[::step, ::step] / side**2
    row, column = (int(i) for i in np.unravel_index(int(np.argmax(shares)), shares.shape))
    return float(shares[row, column]), row * step, column * step, shares.size


def _densest(pixels: Bool) -> float:
    """Return the largest share of the marked pixels in one square of twice their number; 0 for less than a few."""
    count = int(np.count_nonzero(pixels))
    side = min(ceil(sqrt(2 * count)), *pixels.shape)
    if count < TILE_PX:
        return 0.0
    sums = np.pad(pixels.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    counts = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    return float(counts.max()) / count


def _gathered(pixels: Bool, row: int, column: int, region: float) -> float:
    """Return the share of the marked pixels around a tile, as near to it as a square of their number reaches."""
    reach = int(region) + TILE_PX
    near = pixels[max(row - reach, 0) : row + TILE_PX + reach, max(column - reach, 0) : column + TILE_PX + reach]
    return float(np.count_nonzero(near)) / max(int(np.count_nonzero(pixels)), 1)
