"""Changes of light before a low-pass, against sinusoids, whose response is known in closed form."""

import numpy as np
import pytest

from fedora_qa.estimators.events.levels import level_changes
from fedora_qa.estimators.events.low_pass import STEPS, changes_of_light, level_error_gain, time_constant_ns
from fedora_qa.estimators.events.pixels import PixelEvents, by_pixel

CONSTANT_NS = 5_000_000
STEP_OF_LEVEL = 0.002
THRESHOLDS = STEP_OF_LEVEL, STEP_OF_LEVEL
PIXELS = 24
FRAMES_NS = 60_000_000, 80_000_000


def events_behind_low_pass(angular_constants: float) -> tuple[PixelEvents, np.ndarray]:
    """Events of sin(w t + phase) behind the low-pass, w tau as given, and the true changes of that light.

    The steady response is sin(w t + phase - atan(w tau)) / sqrt(1 + (w tau)^2).
    """
    w = angular_constants / CONSTANT_NS
    phases = np.arange(PIXELS) * 2 * np.pi / PIXELS
    times_ns = np.arange(0, 140_000_000, 2000)
    pixels, stamps, polarities = [], [], []
    for pixel, phase in enumerate(phases):
        level = np.sin(w * times_ns + phase - np.arctan(angular_constants)) / np.hypot(1, angular_constants)
        # The reference is the last multiple of the step that the level has passed, whose hysteresis is one step.
        steps = np.floor(level / STEP_OF_LEVEL)
        at = np.flatnonzero(np.diff(steps)) + 1
        pixels.append(np.full(len(at), pixel))
        stamps.append(times_ns[at])
        polarities.append(steps[at] > steps[at - 1])
    order = np.argsort(np.concatenate(stamps), kind="stable")
    columns, stamps_ns, brighter = (np.concatenate(each)[order] for each in (pixels, stamps, polarities))
    events = by_pixel(
        columns.astype(np.uint16), np.zeros(len(order), np.uint16), stamps_ns, brighter.astype(np.uint8), (1, PIXELS)
    )
    start, stop = (np.sin(w * time + phases) for time in FRAMES_NS)
    return events, stop - start


@pytest.mark.parametrize("angular_constants", [0.3, 1.0, 2.0])
def test_changes_are_in_phase_with_the_light(angular_constants: float) -> None:
    """The regression on the light a quarter of a period later gives tan of the phase: within 0.05 tau w."""
    events, expected = events_behind_low_pass(angular_constants)
    quarter = np.roll(expected, -PIXELS // 4)

    def phase(changes: np.ndarray) -> float:
        return float(np.arctan2(changes.ravel() @ quarter, changes.ravel() @ expected))

    behind = level_changes(events, (1, PIXELS), FRAMES_NS, THRESHOLDS)
    light = changes_of_light(events, (1, PIXELS), FRAMES_NS, THRESHOLDS, CONSTANT_NS)
    assert light.is_known.all()
    assert phase(behind.mean) == pytest.approx(-np.arctan(angular_constants), abs=0.02)
    assert phase(light.mean) == pytest.approx(0, abs=0.05 * angular_constants + 0.01)


def test_the_distance_to_twice_the_step_exceeds_the_error() -> None:
    """The error of a central difference grows with the square of its step."""
    events, expected = events_behind_low_pass(1.5)
    once, twice = (
        changes_of_light(events, (1, PIXELS), FRAMES_NS, THRESHOLDS, CONSTANT_NS, step).mean.ravel() for step in STEPS
    )
    assert np.linalg.norm(twice - once) > 1.5 * np.linalg.norm(once - expected)


def test_without_a_low_pass_the_level_is_the_light() -> None:
    """A time constant of 0 changes nothing."""
    events, _ = events_behind_low_pass(1.0)
    light = changes_of_light(events, (1, PIXELS), FRAMES_NS, THRESHOLDS, 0)
    level = level_changes(events, (1, PIXELS), FRAMES_NS, THRESHOLDS)
    for name in ("mean", "line", "is_known"):
        np.testing.assert_array_equal(getattr(light, name), getattr(level, name))
    assert time_constant_ns(0.0) == 0
    assert time_constant_ns(1000 / (2 * np.pi)) == 1_000_000


def test_error_gain_is_1_without_an_event_between_and_3_with_one_at_each_pixel() -> None:
    """Errors of two levels are independent only with an event between them."""
    times_ns = np.array([850, 1050, 1950, 2500])
    assert level_error_gain(times_ns, (1000, 2000), 40, 4) == 1.0
    assert level_error_gain(times_ns, (1000, 2000), 200, 4) == pytest.approx(1.5)
    assert level_error_gain(times_ns, (1000, 2000), 200, 1) == 3.0
