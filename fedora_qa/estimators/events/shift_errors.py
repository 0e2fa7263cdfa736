"""Errors and lag of a shift of events against frames, by the levels that events leave undetermined.

The events of a pixel determine its level only to within a threshold C on each side, and the level lags behind the light
until the next event. The sums of slopes are those of ``shift``.
"""

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]


def open_level_errors(sums: Float64, threshold: float) -> tuple[Float64, Float64]:
    """Return the standard error and the lag of a shift, from the levels that events leave undetermined.

    The standard error is C sqrt(2/3 / sum h^2), with h the slope of the change. Where little moves, e is almost equal
    in successive intervals, so that the error is not divided by their number. The lag is due to the thresholds: a level
    that has risen lies above its reference by C/2 on average. Events therefore follow the motion by at most
    C/2 sum |g| / sum g^2, with g the slope of the level.

    Parameters
    ----------
    sums
        (3, 2) ``slope_sums`` of an interval.
    threshold
        C, in the unit of the level.

    Returns
    -------
    tuple[Float64, Float64]
        (2,) standard errors and (2,) bounds of the lag, to the right and down, px.
    """
    level, level_squares, change_squares = sums
    # At each of two frames the level is uniform over 2 C, of variance (2 C)^2 / 12; hence Var(e) = 2/3 C^2.
    # Regression of e on h has the standard error C sqrt(2/3 / sum h^2).
    errors = threshold * np.sqrt(2 / 3 / np.maximum(change_squares, 1e-300))
    # lag = C/2 sum |g| / sum g^2: half a threshold over the slope.
    lags = threshold / 2 * level / np.maximum(level_squares, 1e-300)
    return errors, lags


def reference_lags(sums: Float64, threshold: float) -> Float64:
    """Return the lag of a shift by pixels without an event before or after a frame, where it can exceed the texture.

    The reference stands for their level, and lags behind it by up to a threshold C. (Half of it is the mean over all
    times, but the level of a pixel that fires is almost C from its reference.) At a slope g the level changes by C over
    C / |g| px of motion. As long as that is less than half a period of the texture, the peak belongs to the edge that
    causes the events, and the same peak without such pixels bounds the error. Beyond it, events belong to an edge that
    has passed, and any peak within the lag may be the largest.

    Parameters
    ----------
    sums
        (4, 2) ``shift.IntervalChanges.lag_sums``.
    threshold
        C, in the unit of the level.

    Returns
    -------
    Float64
        (2,) bounds to the right and down, px; 0 where half a period exceeds the lag along both axes.
    """
    open_slopes, slope_squares, steeper_squares, change_squares = sums
    # Errors e of the level move the peak by sum e g / sum g^2 (regression), with |e| <= C at open pixels, 0 at others.
    lags: Float64 = threshold * open_slopes / np.maximum(slope_squares, 1e-300)
    # Of a change c = sin(x / w) with the slope h, sum c^2 / sum h^2 = w^2. Half a period is pi w.
    half_periods = np.pi * np.sqrt(change_squares / np.maximum(steeper_squares, 1e-300))
    return lags if np.any(lags > half_periods) else np.zeros(2)


def step_of_level(strength: float, change_squares: float, event_squares: float) -> float:
    """Return the size C of the step of the level by which a pixel fires, from events and frames.

    A pixel whose level changes by d fires d / C times on average over its references. C is therefore the reciprocal of
    the slope of the regression of the number n of events on d, ``r sigma_n / sigma_d``. The mean change of the pixels
    that fire over their events is too small: in a short interval those fire that were near the next step before, and
    their change is less than C.

    Parameters
    ----------
    strength
        Correlation coefficient r of events and change, at the shift of the events.
    change_squares, event_squares
        Sums of squares of the change and of the number of events about their means.

    Returns
    -------
    float
        In the unit of the change.
    """
    return float(np.sqrt(change_squares / max(event_squares, 1e-300)) / max(strength, 1e-300))


def bracketed_level_errors(sums: Float64, threshold: float) -> Float64:
    """Return the standard errors of a shift, from the levels that events on both sides leave undetermined.

    Between two events of one polarity the level lies between 0 and C, with the mean f C. Its variance is then at most
    f (1 - f) C^2 (Bhatia and Davis 2000), 1/6 C^2 on average over the time. Where the polarity differs, the uniform
    excursion leaves less: (1 - f)^2 / 3 C^2 on the way back. A change has twice the variance, hence Var(e) <= 1/3 C^2.

    Parameters
    ----------
    sums
        (3, 2) ``slope_sums`` of an interval.
    threshold
        C, in the unit of the level.

    Returns
    -------
    Float64
        (2,) to the right and down, px.
    """
    # Regression of e on h has the standard error C sqrt(1/3 / sum h^2).
    errors: Float64 = threshold * np.sqrt(1 / 3 / np.maximum(sums[2], 1e-300))
    return errors
