"""The delay of events against a level that is known around one instant, without thresholds and for any contrast.

The reference of a pixel follows its level L like a mechanical play. A pixel fires where L leaves the reference by a
threshold C, and the reference then moves by C. If the phase of the reference is uniform over C, the distance of the
level is uniform over an interval of length C as well, and its mean d moves with the level between -C/2 and C/2: a level
that rises by x changes d to min(d + x, C/2). The events of a pixel between two instants are then, on average, the
change of P = L - d over C. A rising level is C/2 ahead of P: that is the lag of events behind an edge.

Sums of events y (positive less negative) of all pixels over an interval are fitted by::

    y = a (M + tau T + s H + p X + q Y)

M is the change of P over the interval, T its derivative by a delay of the events, H that by the width of the play
(relative to C/2), X and Y those by a shift of the events to the right and down. A delay moves events by tau v, with the
image velocity v of each pixel; a shift moves all events alike; and the lag is a part of C whatever the velocity. They
differ where velocities and contrasts vary over image and time. 1/a is the threshold in the unit of the level.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.robust import jackknife_errors

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

THRESHOLDS: Final = tuple(0.06 * 1.6**i for i in range(8))
"""Thresholds that are tried, in the unit of the level (of the logarithm, or of its mean): 0.06 to 1.6. The column H
interpolates between two of them."""

DELAYS_MS: Final = tuple(range(-30, 31, 3))
"""Delays of the events by which their interval is moved before the fit, ms. The fit is linear in what is left: at 3 ms
an edge at 300 px/s moves by 0.9 px, about its width."""

COLUMNS: Final = 5
"""M, T, H, X and Y."""

_DELAY, _LAG = 1, 2
"""Columns T and H."""

_PLAY_STEP: Final = 0.2
"""Relative step of the central difference by the width of the play."""

_NEIGHBOURS: Final = 1
"""Intervals on each side of the best one, through all of which the line of the remaining delay is drawn."""

_LEAST_FALL: Final = 0.25
"""Least change of the remaining delay with the interval, ms per ms: 1 without noise and for slow edges. The value is
not derived."""

_MOST_GROUPS: Final = 12
"""Groups of successive frames that are left out in turn."""

FEWEST_GROUPS: Final = 4
"""Least number of frames, and of parts of the image: the scatter of fewer is too uncertain."""


@dataclass(frozen=True, slots=True)
class DelayFit:
    """The delay of events, ms, positive where they are late.

    Attributes
    ----------
    delay_ms, standard_error_ms
        The delay, and its standard error by leaving out parts of the image and groups of frames in turn.
    lag_bound_ms
        Change of the delay if the lag of events is exactly that of the fitted threshold.
    gain, gain_error
        a of the fit, and its standard error: 0 where events have nothing to do with the level.
    explained
        Share of the sum of squares of y that the fit explains.
    threshold
        C in the unit of the level, as the fit has it.
    """

    delay_ms: float
    standard_error_ms: float
    lag_bound_ms: float
    gain: float
    gain_error: float
    explained: float
    threshold: float


def columns_of_levels(
    levels: Float32, shifts: Float32, threshold: float, step_ms: float, ends: tuple[int, int]
) -> Float64:
    """Return the columns M, T, H, X and Y of the fit for n pixels.

    Parameters
    ----------
    levels
        (m, n) level at m instants, evenly spread in time. The play forgets where it began after a change of C.
    shifts
        (2, n) derivatives of the change of the level by a shift of the events to the right and down.
    threshold
        C in the unit of the level.
    step_ms
        Time between two instants, ms.
    ends
        Instants, by number, at which the interval begins and ends; one more instant follows, and one precedes.
    """
    begin, end = ends
    play, wider, narrower = (
        _followed(levels, 0.5 * threshold * width, (begin - 1, begin, begin + 1, end - 1, end, end + 1))
        for width in (1.0, 1.0 + _PLAY_STEP, 1.0 - _PLAY_STEP)
    )
    # Late events are those of an earlier interval: dM/dtau = -(P'(end) - P'(begin)).
    by_delay = -((play[5] - play[3]) - (play[2] - play[0])) / (2 * step_ms)
    by_play = ((wider[4] - wider[1]) - (narrower[4] - narrower[1])) / (2 * _PLAY_STEP)
    return np.stack([play[4] - play[1], by_delay, by_play, shifts[0], shifts[1]]).astype(np.float64)


def _followed(levels: Float32, half_width: float, instants: Sequence[int]) -> Float32:
    """Return P = L - d (k, n) at some instants, with d within ``half_width`` of 0."""
    distance, followed = np.zeros_like(levels[0]), {}
    for i in range(1, max(instants) + 1):
        distance = np.clip(distance + levels[i] - levels[i - 1], -half_width, half_width)
        followed[i] = levels[i] - distance
    return np.stack([followed[i] for i in instants])


@dataclass(frozen=True, slots=True)
class DelaySums:
    """Normal equations of a frame by response (of the logarithm, of the level itself), threshold and part of the image.

    Attributes
    ----------
    products
        (2, thresholds, parts, 5, 5) of the columns.
    projections
        (2, thresholds, parts, delays, 5) of the columns and the sums of events.
    squares
        (parts, delays) of the sums of events.
    """

    products: Float32
    projections: Float32
    squares: Float32


def fit_delay(frames: Sequence[DelaySums]) -> DelayFit | None:
    """Fit the delay with the response, the threshold and the interval that explain most.

    Returns
    -------
    DelayFit | None
        None where fewer than ``FEWEST_GROUPS`` frames or parts have events, where the columns depend on each other, or
        where the delay is longer than those that are tried.
    """
    if len(frames) < FEWEST_GROUPS:
        return None
    products, projections, squares = (
        np.array([getattr(frame, name) for frame in frames], np.float64) for name in DelaySums.__slots__
    )
    total = products.sum(axis=(0, 3)), projections.sum(axis=(0, 3)), squares.sum(axis=(0, 1))
    if np.count_nonzero(squares.sum(axis=(0, 2))) < FEWEST_GROUPS or not np.all(total[2] > 0):
        return None
    # (2, thresholds, delays) share of the squares that the columns explain, b^T N^-1 b / y^T y: at the delay that needs
    # no correction. The column of the correction would explain other delays as well.
    uncorrected = [i for i in range(COLUMNS) if i != _DELAY]
    projected = total[1][..., uncorrected]
    try:
        solved = np.linalg.solve(
            total[0][:, :, np.newaxis][..., uncorrected, :][..., uncorrected], projected[..., np.newaxis]
        )
    except np.linalg.LinAlgError:
        return None
    explained = np.sum(solved[..., 0] * projected, axis=-1) / total[2]
    response, threshold, delay = (int(i) for i in np.unravel_index(int(np.argmax(explained)), explained.shape))
    chosen = products[:, response, threshold], projections[:, response, threshold]
    normal, projected = (each.sum(axis=(0, 1)) for each in chosen)
    # What is left is nothing at the delay: twice, as the fit is linear nearby only.
    for _ in range(2):
        delay = min(max(delay, _NEIGHBOURS), len(DELAYS_MS) - 1 - _NEIGHBOURS)
        near = range(delay - _NEIGHBOURS, delay + _NEIGHBOURS + 1)
        value_ms, gain = _delay_and_gain(normal, projected, near)
        if not DELAYS_MS[0] < value_ms < DELAYS_MS[-1]:
            return None
        delay = int(np.argmin(np.abs(np.array(DELAYS_MS) - value_ms)))
    fixed_ms, _ = _delay_and_gain(normal, projected, near, [i for i in range(COLUMNS) if i != _LAG])
    by_part = [each.sum(axis=0) for each in chosen]
    occupied = np.flatnonzero(squares.sum(axis=(0, 2)))
    groups = np.array_split(np.arange(len(frames)), min(len(frames), _MOST_GROUPS))
    left_out = (
        [_delay_and_gain(normal - by_part[0][part], projected - by_part[1][part], near) for part in occupied],
        [
            _delay_and_gain(normal - chosen[0][g].sum((0, 1)), projected - chosen[1][g].sum((0, 1)), near)
            for g in groups
        ],
    )
    errors = np.linalg.norm([jackknife_errors(np.array(each)) for each in left_out], axis=0)
    return DelayFit(
        float(value_ms), float(errors[0]), float(abs(value_ms - fixed_ms)), float(gain), float(errors[1]),
        float(explained[response, threshold, delay]), float(1.0 / gain) if gain else 0.0,
    )  # fmt: skip


def _delay_and_gain(
    normal: Float64, projected: Float64, near: range, columns: Sequence[int] = range(COLUMNS)
) -> Float64:
    """Return the delay, ms, at which nothing is left, on a line through neighbouring intervals, and the gain a."""
    moved_ms = np.array([DELAYS_MS[i] for i in near], np.float64)
    fits = np.array([_left_and_gain(normal, projected[i], columns) for i in near])
    fall = max(-float(np.polyfit(moved_ms, fits[:, 0], 1)[0]), _LEAST_FALL)
    return np.array([moved_ms.mean() + fits[:, 0].mean() / fall, fits[:, 1].mean()])


def _left_and_gain(normal: Float64, projected: Float64, columns: Sequence[int]) -> tuple[float, float]:
    """Return the delay that is left after the interval was moved, ms, and the gain a."""
    chosen = list(columns)
    fit = np.linalg.solve(normal[np.ix_(chosen, chosen)], projected[chosen])
    return (float(fit[1] / fit[0]) if fit[0] else 0.0), float(fit[0])
