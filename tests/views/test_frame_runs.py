"""Stretches of frames: which frames are believed, and what the others measure."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.events.conservation import EVERY_FRAME, ConservationLaw, Excursions, bound, follow_runs
from fedora_qa.sequence.declared import EventModel
from fedora_qa.views.frame_runs import EVEN, FrameRun, FrameRuns, violations

LEVELS = np.log(np.array([100.0, 100.0, 180.0, 100.0]))


def excursions(believed: tuple[float, float]) -> Excursions:
    """Bounds of one silent pixel whose third frame alone shows 180 DN instead of 100, and is the least even one."""
    light = np.exp(LEVELS)[:, np.newaxis, np.newaxis]
    error = light * np.expm1(np.array([0.05, 0.05, 0.06, 0.05]))[:, np.newaxis, np.newaxis]
    silent = np.zeros((3, 2, 1, 1), np.int32)
    law = ConservationLaw(0.2, 0.2, uneven=(believed, EVERY_FRAME))
    return bound(light, error, silent, np.zeros(3), law, np.arange(4))


def test_what_only_uneven_frames_contradict_is_their_flaw() -> None:
    """A frame that is not believed makes no violation; it counts how often antialiasing fails. A believed one does."""
    model = EventModel(model="log", threshold_on=0.2, threshold_off=0.2)
    none, no_events = np.zeros((1, 1), np.bool_), np.zeros((1, 1), np.int32)
    for believed, flawed in (((0.0, 0.055), 1), (EVERY_FRAME, 0)):
        runs = FrameRuns(model)
        runs.add(0, [FrameRun(excursions(believed), no_events, none)])
        (summary,) = runs.summaries()
        assert summary.flawed == flawed
        assert summary.unpacked((1, 1)).sum() == 1 - flawed


ON, OFF, SIGMA = 0.2, 0.25, 0.03
STEP_ON, STEP_OFF, STEP_SIGMA = 30.0, 25.0, 2.0


def climbing_log_pixels(rng: np.random.Generator, frames: int = 20, pixels: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Levels (n, 1, pixels) that mostly rise, and the events (n - 1, 2, 1, pixels) of pixels with own thresholds.

    One polarity prevails, so that the difference of thresholds adds up.
    """
    level = np.cumsum(rng.normal(0.3, 0.3, (frames, pixels)), axis=0)
    on, off = (np.maximum(rng.normal(size, SIGMA, pixels), 0.02) for size in (ON, OFF))
    reference, counts = level[0].copy(), np.zeros((frames - 1, 2, 1, pixels), np.int32)
    for i, target in enumerate(level[1:]):
        rises = np.maximum(np.floor((target - reference) / on), 0).astype(np.int32)
        falls = np.maximum(np.floor((reference - target) / off), 0).astype(np.int32)
        counts[i, 1, 0], counts[i, 0, 0] = rises, falls
        reference += rises * on - falls * off
    return level[:, np.newaxis], counts


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_pixels_with_thresholds_of_their_own_keep_the_law(seed: int) -> None:
    """The declared spread excuses what grows with the number of events of one polarity, from a known start as well."""
    level, counts = climbing_log_pixels(np.random.default_rng(seed))
    law = ConservationLaw(ON, OFF, uneven=(EVERY_FRAME, EVERY_FRAME))
    bounds = bound(np.exp(level), np.zeros(level.shape), counts, np.zeros(len(counts)), law, np.arange(len(level)))
    events = counts.sum(axis=(0, 1)).astype(np.int32)
    run = FrameRun(bounds, events, np.zeros(events.shape, np.bool_))
    spread = EventModel(model="log", threshold_on=ON, threshold_off=OFF, threshold_sigma=SIGMA)
    assert not violations(run, EVEN, spread, phase_declared=True)[0].any()
    # The same pixels break the law of a sensor that declares no spread.
    assert violations(run, EVEN, replace(spread, threshold_sigma=0.0), phase_declared=False)[0].any()


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=25)
def test_linear_pixels_with_thresholds_of_their_own_keep_the_law(seed: int) -> None:
    """A lower threshold lets more events stand for the same rise, and a higher one a silent pixel vary by more."""
    rng, frames, pixels = np.random.default_rng(seed), 12, 200
    values = 100 + np.rint(np.cumsum(rng.normal(8, 8, (4 * frames, pixels)), axis=0))
    on, off = (rng.normal(size, STEP_SIGMA, pixels) for size in (STEP_ON, STEP_OFF))
    reference, counts = values[0].copy(), np.zeros((frames - 1, 2, 1, pixels), np.int32)
    for step in range(1, 4 * (frames - 1) + 1):
        up, down = values[step] - reference > on, reference - values[step] > off
        counts[(step - 1) // 4, 1, 0] += up
        counts[(step - 1) // 4, 0, 0] += down
        reference = np.where(up | down, values[step], reference)
    shown = values[::4, np.newaxis]
    runs = follow_runs(
        shown, shown, counts, threshold_on=STEP_ON, threshold_off=STEP_OFF, spread=5 * STEP_SIGMA,
        frames=np.arange(frames),
    )  # fmt: skip
    assert not runs.broken.any()
