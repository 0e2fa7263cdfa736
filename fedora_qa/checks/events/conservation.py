"""Events against log intensity: what must be conserved."""

from math import expm1, pi, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.events.stretch import GROUP_NS, Closed, Ledger, stretch_of
from fedora_qa.checks.events.view import sensor_shape, why_frames_and_events_do_not_meet
from fedora_qa.checks.protocol import Check, Measured, Observation, Suspect
from fedora_qa.conventions import NS_PER_S
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

Bool = NDArray[np.bool_]

TILE_PX: Final = 8


class Conservation(Check[Ledger]):
    """Do events add up to what the frames show, in every pixel?

    Log model: L less the sum of events varies by less than C+ + C-, however long (``event_excursions``). Linear model:
    the value varies by at most C+ + C- while a pixel is silent, and rises by at least P (C+ + 1) - C+ - C- over P
    brighter events (``event_runs``). The laws are held to over two seconds at a time (``event_stretch``).

    Each frame bounds the value, certainly: rounding by half a step, and the pixels that a footprint cuts by the
    contrast they may hold; so no dark or curved region has to be left out, it only shows less. What remains is the
    antialiasing of the frames themselves. It is allowed 2 pixels in a million a frame, which is an estimate and no
    noise model: in one clean file 7.5 in 100 000 were found beyond their bound. Declared spurious events excuse as
    many pixels as they may have hit, a low-pass those that fire around frame times; spread of thresholds widens the
    law by five sigma on every event. Blind to events lost in pairs of opposite polarity, and to whatever keeps within
    the thresholds: a dead region without contrast, say.
    """

    name = "event_response.conservation"
    needs = ("events", "rgb")
    _ANTIALIASING_PER_FRAME: Final = 2e-6
    _MATTERS: Final = 0.05
    """Of the pixels, in which events are lost; it shows in those of them whose level moves by enough."""
    _TILE_ALLOWANCE: Final = 0.25
    """One thin structure may run through a quarter of a tile: a judgement, not derived."""
    _ONE_REGION: Final = 0.8
    """Share of the violating pixels that lie together where a region is dead (in the diagnosis, after an alarm)."""

    def not_applicable(self, facts: Facts) -> str:
        """Need both cameras at one place, and declared thresholds."""
        return why_frames_and_events_do_not_meet(facts)

    def start(self, facts: Facts) -> Ledger:
        """Return no stretch."""
        if facts.declared.events is None:
            raise ValueError("Expected a declared event sensor, got none; the check is not applicable")
        return Ledger(facts.declared.events)

    def update(self, state: Ledger, window: Window) -> None:
        """Join the window's frames to the last stretch, or begin another."""
        stretch = stretch_of(window)
        if stretch is not None:
            state.add(window.span.start_ns // GROUP_NS, [stretch])

    def merge(self, state: Ledger, later: Ledger) -> Ledger:
        """Join the stretches that meet."""
        return state.then(later)

    def conclude(self, state: Ledger, facts: Facts) -> Observation:
        """Count the pixels that broke the law, in the worst two seconds and by tile."""
        closed, rgb_count = state.closed(), len(facts.clocks["rgb"].times_ns)
        coverage = Coverage(min(sum(one.frames for one in closed), rgb_count), rgb_count, "frames")
        if not closed:
            return Observation(coverage, unobservable="no two frames with events around them")
        shape = sensor_shape(facts.declared)
        pixels = np.any([one.unpacked(shape) for one in closed], axis=0)
        tile, gathered = self._tile(pixels, max(one.telling for one in closed), facts)
        return Observation(
            coverage,
            (self._share(closed, state.model, facts, gathered), tile),
            evidence={"conservation_violations": pixels.astype(np.uint8)},
            titles={
                "conservation_violations": "Pixels whose events do not add up to what the frames show [1: some do not]"
            },
        )

    def _share(self, closed: list[Closed], declared: EventModel, facts: Facts, gathered: bool) -> Measured:
        size = int(np.prod(sensor_shape(facts.declared)))
        times_ns = facts.clocks["rgb"].times_ns
        counts = [int(np.bitwise_count(one.pixels).sum()) for one in closed]
        allowances = [
            self._ANTIALIASING_PER_FRAME * one.frames + _excused_share(one, declared, times_ns) for one in closed
        ]
        errors = [sqrt(allowance / size) for allowance in allowances]
        deviations = [
            (count / size - allowance) / error
            for count, allowance, error in zip(counts, allowances, errors, strict=True)
        ]
        worst = int(np.argmax(deviations))
        first = closed[worst].suspected
        last = min(first + 1, len(times_ns) - 1)
        return Measured(
            name="violating_pixels",
            value=counts[worst] / size,
            unit="1",
            standard_error=errors[worst],
            allowance=allowances[worst],
            side="upper",
            resolution=1 / size,
            matters=self._MATTERS * closed[worst].telling,
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
            suspects=(
                Suspect("dropped_samples", "events", 0.5, float(counts[worst]), "samples"),
                Suspect("duplicated_samples", "events", 0.4, float(counts[worst]), "samples"),
                Suspect("dead_region", "events", 0.6 if gathered else 0.1),
                *_cut_off(facts),
                *_WHATEVER_BREAKS_THE_LAW,
            ),
        )

    def _tile(self, pixels: Bool, telling: float, facts: Facts) -> tuple[Measured, bool]:
        """Return the worst tile, and whether the violations lie together around it while other regions give events."""
        silent = facts.events is None or not facts.events.count
        share, row, column, tiles = _worst_tile(pixels)
        everywhere = float(pixels.mean())
        side = min(TILE_PX, *pixels.shape)
        region = sqrt(float(np.count_nonzero(pixels)))
        gathered = _gathered(pixels, row, column, region) > self._ONE_REGION and not silent
        measured = Measured(
            name="worst_tile",
            value=share,
            unit="1",
            standard_error=sqrt(max(everywhere * (1 - everywhere), 1 / side**2) / side**2),
            expected=everywhere,
            allowance=self._TILE_ALLOWANCE,
            side="upper",
            matters=telling,  # a dead tile shows in the pixels that would have given events
            tests=tiles,
            statement=f"In {share:.0%} of the pixels of the tile at ({column}, {row}) events do not add up; "
            f"{everywhere:.2%} of all.",
            code="event_response.conservation.region",
            where=Where(stream="events", tile=(column, row, column + side, row + side)),
            suspects=(
                Suspect("dead_region", "events", 0.8 if gathered else 0.1, region, "px"),
                Suspect("dropped_samples", "events", 0.4),
                Suspect("duplicated_samples", "events", 0.35),
                *_cut_off(facts),
                *_WHATEVER_BREAKS_THE_LAW,
            ),
        )
        return measured, gathered


_WHATEVER_BREAKS_THE_LAW: Final = (
    *(
        Suspect(cause, "events", 0.3)
        for cause in ("time_offset", "clock_rate", "polarity_inverted", "mirrored", "axes_swapped", "other_sequence",
                      "threshold_misdeclared", "event_model_misdeclared", "spatial_offset", "hot_pixels", "time_unit")
    ),
    *(
        Suspect(cause, "rgb", 0.3)
        for cause in ("swapped_frames", "frozen_frames", "exposure_or_gamma", "channel_order", "time_offset",
                      "clock_rate", "mirrored", "other_sequence", "spatial_offset")
    ),
)  # fmt: skip
"""Every fault of events or frames breaks it; which one, other checks say better."""


def _cut_off(facts: Facts) -> tuple[Suspect, ...]:
    """Suspect that events were cut off, where they end more than two frames before the frames do."""
    times_ns = facts.clocks["rgb"].times_ns
    if facts.events is None or not facts.events.count or len(times_ns) < 2:
        return ()
    duration_ns, silent_ns = int(times_ns[-1] - times_ns[0]), int(times_ns[-1]) - facts.events.last_ns
    if silent_ns * (len(times_ns) - 1) <= 2 * duration_ns:
        return ()
    return (Suspect("truncated", "events", 0.8),)


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
