"""Pixels with events that no change of light causes, and columns or rows of a sensor that does not have them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_stream.event_rows import event_coverage, why_no_sensor
from fedora_qa.checks.protocol import Check, Observation, Statistic
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.events.rates import PixelCounts, neighbour_excess
from fedora_qa.estimators.events.silent_borders import silent_border
from fedora_qa.features import Feature
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.sensor_events import own, sensor_events, sensor_shape

Pixel = tuple[int, int]
"""Column and row."""

_SIGNIFICANT: Final = 7.0
"""Standard deviations above which a pixel is counted as hot in the diagnosis (after an alarm only)."""

_MOST: Final = 0.5
"""Least ratio of hot pixels that lie at the moved positions of declared ones; other pixels may be hot as well."""

_FEWEST_SHIFTED: Final = 2
"""Least number of pixels for a shift: one pixel always fits some shift. With f hot and d declared pixels of n, two
pixels fit one shift by chance with a probability of f^2 d^2 / 2n or less: 3% for five of five in the smallest
sensors."""


_CENTRES_PX: Final = (0.0, 1.0)
"""Principal points from (W - 1) / 2 to (W + 1) / 2, by their distance from the first, px."""

_NEAR_PX: Final = 0.25
"""Half of the least distance between the centres of two sizes, px."""


@dataclass(frozen=True, slots=True)
class MovedHotPixels(Feature):
    """Hot pixels lie where a move of the image takes the declared ones.

    Attributes
    ----------
    transform
        The move.
    right_px
        Shift to the right, px; None for other moves, and where the shift is also down.
    """

    transform: Literal["mirrored", "transposed", "shifted"]
    right_px: float | None = None


@dataclass(frozen=True, slots=True)
class HotPixelCount(Feature):
    """Pixels whose events exceed those of their neighbours significantly.

    Attributes
    ----------
    count
        Their number, 1 at least.
    """

    count: int


class EventStreamRates(Check[PixelCounts]):
    """Does any pixel fire without a change of light, and are the declared columns and rows there?

    The largest excess of a pixel's rate over its neighbourhood, in Hz, and the mean rate of declared hot pixels. The
    number of last columns, or rows, without any event, where the principal point is the centre of the others, in px.

    Why it matters
    --------------
    One hot pixel of 200 Hz gives more events than hundreds of other pixels, and biases optical flow and learned
    features. If its polarity alternates, its events agree with the brightness constraint, so that conservation cannot
    detect them.

    How
    ---
    Events of every pixel are counted over the whole file, regardless of polarity, and compared with the 24 neighbours:
    an edge that moves over a pixel moves over its neighbours as well. The excess is over the third largest neighbour,
    so that two adjacent hot pixels do not hide each other. Declared hot pixels are excluded, and their rate is compared
    with the declared one. Hot pixels at the positions of declared ones after mirroring, exchange of axes or one shift
    are not new: all events were moved. Where the sequence is declared as recorded, hot pixels are a property of its
    sensor: the record states them, and only declared ones are judged.

    In a scene that oscillates (hovering), neighbours differ in the same way in every swing: one pixel just reaches its
    threshold each time, and the others never do. One event a swing is therefore allowed. The number of swings is the
    largest number of runs of equal polarity that a pixel and three of its neighbours have all reached anywhere on the
    sensor. Of a pixel that reverses no more often, and whose successive runs of equal polarity are of equal length, or
    differ by one event in half of the cases at most, all events are allowed: an edge swings within a single pixel.

    A declared size that is too large adds columns on the right, or rows below, without events. A view without edges
    does so too. Only where the declared principal point is the centre of the columns (rows) with events, and not that
    of the declared size, are silent ones judged. Pixels with events are counted in strips as wide as the silent border,
    or a sixteenth of the rest, and the border is compared with all strips and with the nearest four.

    Noise model
    -----------
    The variance is the sum of the Poisson variances of the third largest neighbour and of the allowed swings, the
    square of the difference between the third largest neighbour and the neighbours' median, and that of one event. The
    difference measures how much edges and textures make neighbours differ (1.1 standard deviations of a normal
    distribution). A declared spread of thresholds allows the rate to be larger by five of its standard deviations. All
    pixels count as tests. Declared hot pixels have the Poisson error of their sum, and lose events in refractory
    periods. A strip without events has the probability (1 + m / r)^-r of a gamma-Poisson distribution, whose mean m and
    relative variance 1/r are measured from the strips; the standard error is the width at which this is the probability
    of one standard deviation.

    Cannot detect
    -------------
    A declared size that is too large by a few columns beside few events, or with a principal point that fits it.
    Pixels that are hot for a short time only, or whose excess is below the rate of the scene or its swings. Three or
    more adjacent hot pixels. Dead pixels and regions: without frames they cannot be distinguished from a scene at rest
    (``event_response.conservation``).

    Sources
    -------
    First principles: order statistics of 24 neighbours, the sensor's hysteresis; derivation in
    ``fedora_qa/estimators/events/rates.py``.
    """

    name = "event_stream.rates"
    needs = ("events",)

    def not_applicable(self, facts: Facts) -> str:
        """Require the size of the sensor."""
        return why_no_sensor(facts)

    def start(self, facts: Facts) -> PixelCounts:
        """Return the counts of no events."""
        return PixelCounts.of_nothing(sensor_shape(facts.declared))

    def update(self, state: PixelCounts, window: Window) -> None:
        """Count the window's events."""
        events = own(window, sensor_events(window))
        state.add(events.x, events.y, events.p)

    def merge(self, state: PixelCounts, later: PixelCounts) -> PixelCounts:
        """Add the counts of later windows."""
        return state.then(later)

    def conclude(self, state: PixelCounts, facts: Facts) -> Observation:
        """Compare pixels with their neighbours."""
        counts, declared = state.events, facts.declared.events
        coverage = event_coverage(facts, int(counts.sum()))
        span_s = (facts.events.last_ns - facts.events.first_ns) / NS_PER_S if facts.events is not None else 0.0
        if not counts.any() or min(counts.shape) < 3 or span_s <= 0:
            return Observation(coverage, unobservable="too few events or pixels to compare neighbours")
        excess = neighbour_excess(state)
        declared_pixels = [(int(x), int(y)) for x, y in declared.hot_pixels] if declared is not None else []
        declared_hot = np.zeros(counts.shape, np.bool_)
        for column, row in declared_pixels:
            if 0 <= row < counts.shape[0] and 0 <= column < counts.shape[1]:
                declared_hot[row, column] = True
        # Events were counted in the planned windows only: rates refer to the time that these cover.
        seconds = span_s * coverage.share
        # Declared hot pixels have a statistic of their own.
        z = np.where(declared_hot, -np.inf, excess.z)
        rows, columns = np.nonzero(z > _SIGNIFICANT)
        hot_pixels = [(int(column), int(row)) for column, row in zip(columns, rows, strict=True)]
        move = moved_hot_pixels(hot_pixels, declared_pixels, (z.shape[1], z.shape[0]))
        features = (move,) if move is not None else ()
        row, column = (int(i) for i in np.unravel_index(int(np.argmax(z)), z.shape))
        rate_hz, excess_hz = (float(of_all[row, column]) / seconds for of_all in (counts, excess.events))
        evidence = {"event_counts": np.minimum(counts, np.iinfo(np.uint16).max).astype(np.uint16)}
        titles = {"event_counts": "Events of each pixel [events]"}
        threshold_spread = 0.0
        if declared is not None and declared.threshold_sigma > 0:
            # Relative to the lower threshold, where a spread changes the number of events most.
            spread = declared.threshold_sigma / max(min(declared.threshold_on, declared.threshold_off), 1e-12)
            threshold_spread = min(5 * spread, 1.0)
        hot_count = max(len(hot_pixels), 1)
        statistics = [
            Statistic(
                name="loudest_pixel_excess",
                value=excess_hz,
                unit="Hz",
                standard_error=float(excess.error[row, column]) / seconds,
                # One event a swing, and the excess of a pixel whose threshold is low by five declared sigma.
                model_error_bound=float(excess.swings[row, column]) / seconds + rate_hz * threshold_spread,
                side="upper",
                tests=counts.size,
                statement=f"{hot_count} pixels fire without a change of light: ({column}, {row}) at {rate_hz:.4g} Hz, "
                f"{excess_hz:.4g} Hz more than its neighbours.",
                code="event_stream.rates.hot_pixel",
                where=Where(stream="events", pixel=(column, row)),
                features=(*features, HotPixelCount(hot_count)),
            )
        ]
        if declared_hot.any() and declared is not None and declared.hot_pixel_rate_hz > 0:
            # Less the neighbours' median: the scene adds events to a hot pixel as it does to them.
            over = (counts - excess.median)[declared_hot]
            statistics.append(self._declared_rate(over, excess.error[declared_hot], declared, seconds, features))
        statistics.extend(_silent_borders(counts > 0, facts))
        if facts.declared.kind == "recorded":
            loudest = (
                f"{len(hot_pixels)}, the loudest ({column}, {row}) with {excess_hz:.4g} Hz more than its neighbours"
            )
            return Observation(
                coverage,
                tuple(statistics[1:]),
                unobservable="" if statistics[1:] else "hot pixels are a property of the sensor, and none are declared",
                evidence=evidence,
                titles=titles,
                inferred={"events.hot_pixels": loudest} if hot_pixels else {},
            )
        return Observation(coverage, tuple(statistics), evidence=evidence, titles=titles)

    def _declared_rate(
        self,
        over: NDArray[np.float64],
        error: NDArray[np.float64],
        declared: EventModel,
        seconds: float,
        features: tuple[Feature, ...],
    ) -> Statistic:
        expected = declared.hot_pixel_rate_hz
        rate_hz = float(over.mean()) / seconds
        # Variance of a mean count over n pixels: r T / n (Poisson), and the errors of their neighbourhoods.
        variance = expected * seconds / len(over) + float(np.sum(error**2)) / len(over) ** 2
        return Statistic(
            name="declared_hot_pixel_rate",
            value=rate_hz,
            unit="Hz",
            expected=expected,
            standard_error=float(np.sqrt(variance)) / seconds,
            # Events within the refractory period of another are lost: of Poisson events at most this rate.
            model_error_bound=expected * declared.refractory_us * 1e-6 * (rate_hz + expected),
            statement=f"Declared hot pixels fire at {rate_hz:.4g} Hz; {expected:.4g} Hz is declared.",
            code="event_stream.rates.declared_hot_pixels",
            where=Where(stream="events"),
            features=features,
        )


def _silent_borders(active: NDArray[np.bool_], facts: Facts) -> Iterator[Statistic]:
    """Yield the last columns and rows without events where the principal point is the centre of the others."""
    principal_px = facts.declared.cameras["events"].K[:2, 2]
    for axis, name in enumerate(("columns", "rows")):
        border = silent_border(np.count_nonzero(active, axis=axis))
        if border is None:
            continue
        declared_px = active.shape[1 - axis]
        active_px = declared_px - border.width_px
        off_px = float(principal_px[axis]) - (active_px - 1) / 2
        # A correct K of the declared size lies at (W - 1) / 2 or above, by half of the silent width from this.
        if not (_CENTRES_PX[0] - _NEAR_PX < off_px < min(_CENTRES_PX[1] + _NEAR_PX, border.width_px / 2 - _NEAR_PX)):
            continue
        yield Statistic(
            name=f"silent_{name}",
            value=float(border.width_px),
            unit="px",
            # Judgement compares the width with 0: in this unit the border is z standard errors wide.
            standard_error=border.width_px / max(border.z, 0.5),
            side="upper",
            tests=active.shape[1 - axis],
            statement=f"No event in the last {border.width_px} of {declared_px} declared {name}, and the principal "
            f"point is the centre of the other {active_px}.",
            code="event_stream.rates.silent_border",
            where=Where(stream="events"),
        )


def moved_hot_pixels(
    hot_pixels: Sequence[Pixel], declared: Sequence[Pixel], size: tuple[int, int]
) -> MovedHotPixels | None:
    """Return the move that takes most declared hot pixels to other hot pixels; None where too few coincide.

    Parameters
    ----------
    hot_pixels
        Pixels with events without cause that are not declared hot.
    declared
        Declared hot pixels.
    size
        Width and height of the sensor, px.

    Returns
    -------
    MovedHotPixels or None
        With the size of a shift to the right in px.
    """
    if not hot_pixels or not declared:
        return None
    hot = set(hot_pixels)
    right, bottom = size[0] - 1, size[1] - 1
    mirrored, transposed = MovedHotPixels("mirrored"), MovedHotPixels("transposed")
    # Positions of the declared pixels after each move, the move, and the least number of pixels that determine it: one
    # for the four symmetries, two for a shift, since any single pair of pixels fits some shift.
    symmetries = (
        ({(right - column, row) for column, row in declared}, mirrored, 1),
        ({(column, bottom - row) for column, row in declared}, mirrored, 1),
        ({(right - column, bottom - row) for column, row in declared}, mirrored, 1),
        ({(row, column) for column, row in declared}, transposed, 1),
    )
    # Shifts are generated one at a time: there may be one for each pair of a hot and a declared pixel.
    shifts = (
        (
            {(column + right_px, row + down_px) for column, row in declared},
            MovedHotPixels("shifted", float(right_px) if down_px == 0 else None),
            _FEWEST_SHIFTED,
        )
        for right_px, down_px in sorted({(x - column, y - row) for x, y in hot_pixels for column, row in declared})
    )
    most, likeliest = 0, None
    for moved, move, fewest in chain(symmetries, shifts):
        common = len(hot & moved)
        if common > most and common >= max(fewest, _MOST * len(hot)):
            most, likeliest = common, move
    return likeliest
