"""The event stream by itself: pixels that fire without cause."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.event_stream.event_rows import event_coverage, why_no_sensor
from fedora_qa.checks.event_stream.moved_hot_pixels import suspects_of_moved
from fedora_qa.checks.protocol import Check, Observation, Statistic, Suspect
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.events.rates import Loudness, Tally, loudness
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import own, sensor_events, sensor_shape


class EventStreamRates(Check[Tally]):
    """Does any pixel fire without cause?

    The excess of the loudest pixel over its neighbourhood, in events a second, and the rate of declared hot pixels.

    Why it matters
    --------------
    One hot pixel of 200 Hz gives more events than hundreds of others; it draws optical flow and learned features to
    itself. If its polarity alternates, it breaks no law of brightness either.

    How
    ---
    Events of every pixel are counted over the whole file, whatever their polarity, and held against the 24 neighbours:
    what moves over a sensor moves over them as well. The excess is over the third largest neighbour, so that two hot
    pixels side by side do not hide each other. Declared hot pixels are excused, and held to their declared rate. Hot
    pixels that lie where mirroring, an exchange of axes or one shift would take the declared ones are no new ones:
    all events were moved.

    A scene that swings to and fro (hovering) makes neighbours differ alike in every swing: one just passes its
    threshold each time, the others never do. One event a swing is therefore allowed for. Swings are counted as runs of
    equal polarity that a pixel and three of its neighbours have all reached, wherever on the sensor that is most.

    Noise model
    -----------
    Standard error: Poisson's of the third largest neighbour and of the swings allowed for, with the distance of the
    former from the neighbours' median, which measures how much edges and textures make neighbours differ (1.1 standard
    deviations of a normal distribution), and of one event. A declared spread of thresholds allows the rate to be larger
    by five sigma of it. All pixels are tests. Declared hot pixels have the Poisson error of their sum, and lose what
    falls into refractory periods.

    Cannot see
    ----------
    Pixels that are hot for a short time only, or less than the scene itself is loud or swings; three and more hot
    pixels side by side. Dead pixels and regions: without frames they are scenes at rest
    (``event_response.conservation``).

    Sources
    -------
    First principles: order statistics of 24 neighbours, the sensor's hysteresis; derivation in ``event_rates``.
    """

    name = "event_stream.rates"
    needs = ("events",)
    _SURELY: Final = 7.0
    """Standard deviations above which a pixel is counted as hot in the diagnosis (after an alarm only)."""

    def not_applicable(self, facts: Facts) -> str:
        """Need the size of the sensor."""
        return why_no_sensor(facts)

    def start(self, facts: Facts) -> Tally:
        """Return the tally of nothing."""
        return Tally.of_nothing(sensor_shape(facts.declared))

    def update(self, state: Tally, window: Window) -> None:
        """Count the window's events."""
        events = own(window, sensor_events(window))
        state.add(events.x, events.y, events.p)

    def merge(self, state: Tally, later: Tally) -> Tally:
        """Join."""
        return state.then(later)

    def conclude(self, state: Tally, facts: Facts) -> Observation:
        """Compare pixels with their neighbours."""
        counts = state.events
        coverage = event_coverage(facts, int(counts.sum()))
        span_s = _span_s(facts)
        if not counts.any() or min(counts.shape) < 3 or span_s <= 0:
            return Observation(coverage, unobservable="too few events or pixels to compare neighbours")
        loud = loudness(state)
        hot = _declared_hot(facts.declared.events, counts.shape)
        seconds = span_s * coverage.share
        z = np.where(hot, -np.inf, loud.z)
        moved = self._moved(z, facts)
        measured = [self._loudest(counts, loud, z, seconds, facts, moved)]
        if hot.any() and facts.declared.events is not None and facts.declared.events.hot_pixel_rate_hz > 0:
            over = (counts - loud.median)[hot]
            measured.append(self._declared_rate(over, loud.error[hot], facts.declared.events, seconds, moved))
        return Observation(
            coverage,
            tuple(measured),
            evidence={"event_counts": np.minimum(counts, np.iinfo(np.uint16).max).astype(np.uint16)},
            titles={"event_counts": "Events of each pixel [events]"},
        )

    def _moved(self, z: NDArray[np.float64], facts: Facts) -> tuple[Suspect, ...]:
        """Return what would have moved declared hot pixels to where others are."""
        rows, columns = np.nonzero(z > self._SURELY)
        found = [(int(column), int(row)) for column, row in zip(columns, rows, strict=True)]
        declared = facts.declared.events.hot_pixels if facts.declared.events is not None else ()
        return suspects_of_moved(found, [(int(column), int(row)) for column, row in declared], z.shape[::-1])

    def _loudest(
        self,
        counts: NDArray[np.int64],
        loud: Loudness,
        z: NDArray[np.float64],
        seconds: float,
        facts: Facts,
        moved: tuple[Suspect, ...],
    ) -> Statistic:
        row, column = (int(i) for i in np.unravel_index(int(np.argmax(z)), z.shape))
        many = int(np.count_nonzero(z > self._SURELY))
        rate_hz, excess_hz = (float(of_all[row, column]) / seconds for of_all in (counts, loud.excess))
        return Statistic(
            name="loudest_pixel_excess",
            value=excess_hz,
            unit="Hz",
            standard_error=float(loud.error[row, column]) / seconds,
            # One event a swing; and a pixel whose threshold is low by five declared sigma fires so much more often.
            model_error_bound=float(loud.swings[row, column]) / seconds + rate_hz * _mismatch(facts.declared.events),
            side="upper",
            tests=counts.size,
            statement=f"{max(many, 1)} pixels fire without cause: ({column}, {row}) at {rate_hz:.4g} Hz, "
            f"{excess_hz:.4g} Hz more than its neighbours.",
            code="event_stream.rates.hot_pixel",
            where=Where(stream="events", pixel=(column, row)),
            suspects=(*moved, Suspect("hot_pixels", "events", 0.3 if moved else 0.95, float(max(many, 1)), "pixels")),
        )

    def _declared_rate(
        self,
        over: NDArray[np.float64],
        error: NDArray[np.float64],
        declared: EventModel,
        seconds: float,
        moved: tuple[Suspect, ...],
    ) -> Statistic:
        expected = declared.hot_pixel_rate_hz
        rate_hz = float(over.mean()) / seconds
        variance = expected * seconds / len(over) + float(np.sum(error**2)) / len(over) ** 2
        percent = 100 * (rate_hz / expected - 1)
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
            suspects=(*moved, Suspect("noise_misdeclared", "events", 0.3 if moved else 0.8, percent, "percent")),
        )


def _declared_hot(declared: EventModel | None, shape: tuple[int, ...]) -> NDArray[np.bool_]:
    hot = np.zeros(shape, np.bool_)
    for column, row in declared.hot_pixels if declared is not None else ():
        if 0 <= row < shape[0] and 0 <= column < shape[1]:
            hot[row, column] = True
    return hot


def _mismatch(declared: EventModel | None) -> float:
    if declared is None or declared.threshold_sigma <= 0:
        return 0.0
    spread = declared.threshold_sigma / max(min(declared.threshold_on, declared.threshold_off), 1e-12)
    return min(5 * spread, 1.0)


def _span_s(facts: Facts) -> float:
    return (facts.events.last_ns - facts.events.first_ns) / NS_PER_S if facts.events is not None else 0.0
