"""Events against log intensity: what must be conserved."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import expm1, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_view import (
    SeenFrames,
    seen_frames,
    sensor_events,
    sensor_shape,
    why_frames_and_events_do_not_meet,
)
from fedora_qa.checks.protocol import Check, Measured, Observation, Suspect
from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.estimators.event_excursions import Excursions, bound
from fedora_qa.estimators.event_kernels import mark_bursts
from fedora_qa.estimators.event_runs import Runs, follow_runs
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

Bool = NDArray[np.bool_]

TILE_PX: Final = 8
MISMATCH_SIGMAS: Final = 5.0
"""Of the declared spread of thresholds: beyond lies one pixel in two million."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """Consecutive frames whose bounds have been joined.

    Attributes
    ----------
    bounds
        By the law of the declared model.
    events
        (h, w) events in the stretch.
    excused
        (h, w): events may honestly be missing (bursts within a declared refractory period).
    """

    bounds: Excursions | Runs
    events: NDArray[np.int64]
    excused: Bool

    def then(self, later: "Stretch") -> "Stretch":
        """Join with the stretch that begins at this one's last frame. Exact."""
        one, other = self.bounds, later.bounds
        if isinstance(one, Excursions) and isinstance(other, Excursions):
            joined: Excursions | Runs = one.then(other)
        elif isinstance(one, Runs) and isinstance(other, Runs):
            joined = one.then(other)
        else:
            raise TypeError(f"Expected stretches of one model, got {type(one).__name__} and {type(other).__name__}")
        return Stretch(joined, self.events + later.events, self.excused | later.excused)


@dataclass(frozen=True, slots=True)
class Violations:
    """Pixels (h, w) that broke the law.

    ``through[i]`` counts the violations that frame interval i may hold.
    """

    pixels: Bool
    through: NDArray[np.int64]


class Conservation(Check[list[Stretch]]):
    """Do events add up to what the frames show, in every pixel, over any time?

    Log model: L less the sum of events varies by less than C+ + C- for ever (``event_excursions``). Linear model: the
    value varies by at most C+ + C- while a pixel is silent, and rises by at least P (C+ + 1) - C+ - C- over P brighter
    events (``event_runs``). Each frame bounds the value, certainly: rounding by half a step, and the pixels that a
    footprint cuts by the contrast they may hold; so no dark or curved region has to be left out, it only shows less.
    An ideal sensor breaks neither law anywhere; antialiasing of the frames themselves may do so in one pixel in ten
    thousand. Declared spurious events excuse as many pixels as they may have hit, a low-pass those that fire around
    frame times; spread of thresholds widens the law by five sigma on every event. Blind to events lost in pairs of
    opposite polarity, and to whatever keeps within the thresholds.
    """

    name = "event_response.conservation"
    needs = ("events", "rgb")
    _ANTIALIASING: Final = 1e-4
    _MATTERS: Final = 0.05
    _TILE_ALLOWANCE: Final = 0.25
    """One thin structure may run through a quarter of a tile."""
    _ONE_REGION: Final = 0.8
    """Share of the violating pixels that lie together where a region is dead (in the diagnosis, after an alarm)."""

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def start(self, facts: Facts) -> list[Stretch]:
        """Return no stretch."""
        return []

    def update(self, state: list[Stretch], window: Window) -> None:
        """Join the window's frames to the last stretch, or begin another."""
        seen, declared = seen_frames(window), window.facts.declared.events
        if declared is not None and len(seen) > 1:
            _join(state, _stretch(window, seen, declared))

    def merge(self, state: list[Stretch], later: list[Stretch]) -> list[Stretch]:
        """Join the stretches that meet."""
        merged = list(state)
        for stretch in later:
            _join(merged, stretch)
        return merged

    def conclude(self, state: list[Stretch], facts: Facts) -> Observation:
        """Count the pixels that broke the law, over all and by tile."""
        rgb_count = len(facts.clocks["rgb"].times_ns)
        frames = sum(stretch.bounds.last_frame - stretch.bounds.first_frame + 1 for stretch in state)
        coverage = Coverage(min(frames, rgb_count), rgb_count, "frames")
        declared = facts.declared.events
        if not state or declared is None:
            return Observation(coverage, unobservable="no two frames with events around them")
        violations = _violations(state, declared, rgb_count)
        allowance = self._ANTIALIASING + _excused_share(state, declared, facts)
        measured = (self._share(violations, allowance, facts), self._tile(violations))
        return Observation(
            coverage,
            measured,
            evidence={"conservation_violations": violations.pixels.astype(np.uint8)},
            titles={"conservation_violations": "Pixels whose events do not add up to what the frames show"},
        )

    def _share(self, violations: Violations, allowance: float, facts: Facts) -> Measured:
        count, pixels = int(np.count_nonzero(violations.pixels)), violations.pixels.size
        interval = int(np.argmax(violations.through))
        times_ns = facts.clocks["rgb"].times_ns
        return Measured(
            name="violating_pixels",
            value=count / pixels,
            unit="1",
            standard_error=sqrt(allowance / pixels),
            allowance=allowance,
            side="upper",
            resolution=1 / pixels,
            matters=self._MATTERS,
            statement=f"In {count} of {pixels} pixels events do not add up to what the frames show, most of them "
            f"across frame {interval}.",
            code="event_response.conservation.pixels",
            where=Where(
                stream="events",
                start_us=facts.to_file_us(int(times_ns[interval])),
                stop_us=facts.to_file_us(int(times_ns[min(interval + 1, len(times_ns) - 1)])),
                frame=interval,
            ),
            suspects=(
                Suspect("dropped_samples", "events", 0.5, float(count), "samples"),
                Suspect("duplicated_samples", "events", 0.4, float(count), "samples"),
                *_WHATEVER_BREAKS_THE_LAW,
            ),
        )

    def _tile(self, violations: Violations) -> Measured:
        share, row, column, tiles = _worst_tile(violations.pixels)
        everywhere = float(violations.pixels.mean())
        side = min(TILE_PX, *violations.pixels.shape)
        region = sqrt(float(np.count_nonzero(violations.pixels)))
        weight = 0.8 if _gathered(violations.pixels, row, column, region) > self._ONE_REGION else 0.1
        return Measured(
            name="worst_tile",
            value=share,
            unit="1",
            standard_error=sqrt(max(everywhere * (1 - everywhere), 1 / side**2) / side**2),
            expected=everywhere,
            allowance=self._TILE_ALLOWANCE,
            side="upper",
            matters=1.0,
            tests=tiles,
            statement=f"In {share:.0%} of the pixels of the tile at ({column}, {row}) events do not add up; "
            f"{everywhere:.2%} of all.",
            code="event_response.conservation.region",
            where=Where(stream="events", tile=(column, row, column + side, row + side)),
            suspects=(
                Suspect("dead_region", "events", weight, region, "px"),
                Suspect("dropped_samples", "events", 0.4),
                Suspect("duplicated_samples", "events", 0.35),
                *_WHATEVER_BREAKS_THE_LAW,
            ),
        )


_WHATEVER_BREAKS_THE_LAW: Final = (
    *(
        Suspect(cause, "events", 0.3)
        for cause in ("time_offset", "clock_rate", "polarity_inverted", "mirrored", "axes_swapped", "other_sequence",
                      "threshold_misdeclared", "event_model_misdeclared", "spatial_offset", "hot_pixels", "time_unit")
    ),
    *(
        Suspect(cause, "rgb", 0.3)
        for cause in ("swapped_frames", "frozen_frames", "exposure_or_gamma", "channel_order", "time_offset",
                      "mirrored", "other_sequence", "spatial_offset")
    ),
)  # fmt: skip
"""Every fault of events or frames breaks it; which one, other checks say better."""


def _stretch(window: Window, seen: SeenFrames, declared: EventModel) -> Stretch:
    excused = np.zeros(sensor_shape(window.facts.declared), np.bool_)
    if declared.refractory_us > 0:
        events = sensor_events(window)
        mark_bursts(events.x, events.y, events.times_ns, int(2 * declared.refractory_us * NS_PER_US), excused)
    for column, row in declared.hot_pixels:
        if 0 <= row < excused.shape[0] and 0 <= column < excused.shape[1]:
            excused[row, column] = True
    law = _log_law if declared.model == "log" else _linear_law
    return Stretch(law(seen, declared), seen.counts.sum(axis=(0, 1), dtype=np.int64), excused)


def _log_law(seen: SeenFrames, declared: EventModel) -> Excursions:
    low = np.maximum(seen.even_dn - seen.error_dn + declared.log_eps_dn, 0.0)
    high = seen.even_dn + seen.error_dn + declared.log_eps_dn
    with np.errstate(divide="ignore"):
        lower, upper = np.log(low), np.log(high)
    elapsed_s = np.diff(seen.times_ns) / NS_PER_S
    return bound(
        lower,
        upper,
        seen.counts,
        declared.leak_rate_hz * declared.threshold_on * elapsed_s,
        threshold_on=declared.threshold_on,
        threshold_off=declared.threshold_off,
        frames=seen.frames,
    )


def _linear_law(seen: SeenFrames, declared: EventModel) -> Runs:
    # The event camera rounds luma to whole values itself.
    error = seen.error_dn + 0.5
    return follow_runs(
        seen.even_dn - error,
        seen.even_dn + error,
        seen.counts,
        threshold_on=declared.threshold_on,
        threshold_off=declared.threshold_off,
        frames=seen.frames,
    )


def _join(stretches: list[Stretch], later: Stretch) -> None:
    if stretches and stretches[-1].bounds.last_frame == later.bounds.first_frame:
        stretches[-1] = stretches[-1].then(later)
    else:
        stretches.append(later)


def _violations(state: Sequence[Stretch], declared: EventModel, frames: int) -> Violations:
    pixels = np.zeros(state[0].excused.shape, np.bool_)
    changes = np.zeros(frames + 1, np.int64)
    for stretch in state:
        broken = _broken(stretch, declared) & ~stretch.excused
        pixels |= broken
        if isinstance(stretch.bounds, Excursions):
            highest, lowest = stretch.bounds.highest[1, broken], stretch.bounds.lowest[1, broken]
            np.add.at(changes, np.minimum(highest, lowest), 1)
            np.add.at(changes, np.maximum(highest, lowest), -1)
    return Violations(pixels, np.cumsum(changes)[:frames])


def _broken(stretch: Stretch, declared: EventModel) -> Bool:
    if isinstance(stretch.bounds, Runs):
        return stretch.bounds.broken
    limit = declared.threshold_on + declared.threshold_off
    # Each event steps by the pixel's own threshold, and the law's ends are its own as well.
    own = MISMATCH_SIGMAS * declared.threshold_sigma * (sqrt(2.0) + np.sqrt(stretch.events))
    broken: Bool = stretch.bounds.excess() > limit + own
    return broken


def _excused_share(state: Sequence[Stretch], declared: EventModel, facts: Facts) -> float:
    """Return the share of pixels that declared effects may drive beyond the law.

    A spurious event moves a pixel by a threshold. A low-pass holds back the events of the last five time constants
    before a frame: pixels that fire that close to a frame time may lag by more than their bound.
    """
    clock = facts.clocks["rgb"].times_ns
    seconds = sum(float(clock[s.bounds.last_frame] - clock[s.bounds.first_frame]) for s in state) / NS_PER_S
    spurious = -expm1(-declared.shot_rate_hz * seconds)
    lagging = 0.0
    if declared.bandwidth_hz > 0:
        events = sum(float(stretch.events.mean()) for stretch in state)
        frames = sum(s.bounds.last_frame - s.bounds.first_frame + 1 for s in state)
        around_s = 10 / (2 * np.pi * declared.bandwidth_hz)
        lagging = min(1.0, events / max(seconds, 1e-9) * around_s * frames)
    return min(spurious + lagging, 1.0)


def _worst_tile(pixels: Bool) -> tuple[float, int, int, int]:
    """Return the largest share in a tile, its first row and column, and the number of tiles."""
    side = min(TILE_PX, *pixels.shape)
    rows, columns = pixels.shape[0] // side, pixels.shape[1] // side
    shares = pixels[: rows * side, : columns * side].reshape(rows, side, columns, side).mean(axis=(1, 3))
    row, column = (int(i) for i in np.unravel_index(int(np.argmax(shares)), shares.shape))
    return float(shares[row, column]), row * side, column * side, shares.size


def _gathered(pixels: Bool, row: int, column: int, region: float) -> float:
    """Return the share of the marked pixels around a tile, as near to it as a square of their number reaches."""
    reach = int(region) + TILE_PX
    near = pixels[max(row - reach, 0) : row + TILE_PX + reach, max(column - reach, 0) : column + TILE_PX + reach]
    return float(np.count_nonzero(near)) / max(int(np.count_nonzero(pixels)), 1)
