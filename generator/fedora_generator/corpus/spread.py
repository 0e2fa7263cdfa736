"""Trials for a study of detection: many magnitudes of a fault, in many different sequences.

Magnitudes and starts follow the golden ratio's multiples modulo 1, the sequence that is most evenly spread for every
number of terms: with more trials or sequences, a corpus keeps those that it has.
"""

import math
from typing import Final

import numpy as np

from fedora_generator.corpus.ladders import Ladder
from fedora_generator.scene import Scene

SPAN: Final = 9.0
"""Magnitudes are drawn from a ninth of the nominal one to nine times it: two rungs of a ladder either way."""

SINGLE_SIZE_DIVISOR: Final = 4
"""A fault of a single size gets a fourth of the trials, as they differ by sequence alone."""

START_SPAN_S: Final = 40.0
"""Seconds of a flight over which starts are spread; some flights hit a solid after three quarters of a minute."""

_GOLDEN: Final = (math.sqrt(5) - 1) / 2


def trials_of(ladder: Ladder, most: int) -> int:
    """Return the number of trials of a fault; ``most`` is that of a fault with a range of sizes."""
    return most if ladder.has_range else -(-most // SINGLE_SIZE_DIVISOR)


def magnitude_of(ladder: Ladder, trial: int, beginning: float) -> float | None:
    """Return the magnitude of a trial, uniform in its logarithm.

    Parameters
    ----------
    ladder
        Magnitudes of the fault.
    trial
        Number of the trial.
    beginning
        0 to 1, different between faults.
    """
    return ladder.at(SPAN ** (2 * _golden_fraction(trial, beginning) - 1))


def random_magnitude_of(ladder: Ladder, random: np.random.Generator) -> float | None:
    """Return a magnitude drawn uniformly in its logarithm from the same range, to six digits where it is no number."""
    return ladder.at(SPAN ** random.uniform(-1.0, 1.0), digits=6)


def random_interval_s(random: np.random.Generator, duration_s: float) -> tuple[float, float]:
    """Return start and stop of an interval of a fifth to four fifths of a sequence, anywhere in it, to the us."""
    length_s = random.uniform(0.2, 0.8) * duration_s
    start_s = random.uniform(0.0, duration_s - length_s)
    return round(start_s, 6), round(start_s + length_s, 6)


def random_region(random: np.random.Generator, width: int, height: int) -> tuple[int, int, int, int]:
    """Return a rectangle whose sides are a quarter to three quarters of those of the image, anywhere in it."""
    across, down = (round(random.uniform(0.25, 0.75) * side) for side in (width, height))
    left, top = int(random.integers(width - across, endpoint=True)), int(random.integers(height - down, endpoint=True))
    return left, top, left + across, top + down


def start_of(scene: Scene, seed: int, duration_s: float) -> float:
    """Return where in its flight a sequence begins, in seconds and to the millisecond; it follows from the seed."""
    return round(scene.start_s + start_span_s(scene, duration_s) * _golden_fraction(seed, 0.0), 3)


def start_span_s(scene: Scene, duration_s: float) -> float:
    """Return the seconds over which starts are spread: fewer than usual where the flight ends earlier."""
    if scene.remaining_s is None:
        return START_SPAN_S
    return max(0.0, min(START_SPAN_S, scene.remaining_s - duration_s))


def _golden_fraction(number: int, beginning: float) -> float:
    return (beginning + number * _GOLDEN) % 1.0
