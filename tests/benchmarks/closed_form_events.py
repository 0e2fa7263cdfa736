"""True events of a pixel from its closed form: turning points refined, crossings between them by Brent's method."""

from collections.abc import Callable
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

Floats = NDArray[np.float64]
Signal = Callable[[float], float]

TIE: Final = 1e-9
"""A turning point this near to a threshold decides nothing: rounding could turn it either way."""

FLAT: Final = 1e-12
"""Change of L between two samples that is rounding."""

ROOT_S: Final = 1e-14


def true_events(signal: Signal, times_s: Floats, samples: Floats, threshold: float) -> list[tuple[float, int]] | None:
    """Times (s) and polarities of the log model, first reference L(t_0); None where a turning point ties.

    ``samples`` are ``signal(times_s)``, dense enough that between two of them it turns at most once.
    """
    reference, events = samples[0], []
    for (start_s, start), (stop_s, stop) in pairwise(_monotone_pieces(signal, times_s, samples)):
        direction = 1 if stop > start else -1
        while (distance := direction * (stop - reference) - threshold) >= -TIE:
            if abs(distance) <= TIE:
                return None
            reference += direction * threshold
            found_s = brentq(lambda t, level=reference: signal(t) - level, start_s, stop_s, xtol=ROOT_S, rtol=1e-15)
            events.append((found_s, (direction + 1) // 2))
    return events


def _monotone_pieces(signal: Signal, times_s: Floats, samples: Floats) -> list[tuple[float, float]]:
    """Times and values of the ends and of all turning points."""
    changes = np.diff(samples)
    moving = np.flatnonzero(np.abs(changes) > FLAT)
    turns = [(int(a), int(b)) for a, b in pairwise(moving) if changes[a] * changes[b] < 0]
    points = [(float(times_s[0]), float(samples[0]))]
    for before, after in turns:
        sign = np.sign(changes[before])
        bounds = (times_s[before], times_s[after + 1])
        found = minimize_scalar(lambda t, sign=sign: -sign * signal(t), bounds=bounds, options={"xatol": 1e-12})
        at_sample = (float(times_s[before + 1]), float(samples[before + 1]))
        refined = (float(found.x), float(-sign * found.fun))
        points.append(max(at_sample, refined, key=lambda point, sign=sign: sign * point[1]))
    return [*points, (float(times_s[-1]), float(samples[-1]))]
