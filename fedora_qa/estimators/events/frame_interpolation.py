"""Frames read at the times of events: what events are late by where a pixel fires seldom.

Where light changes slowly from frame to frame, the frames themselves tell a pixel's level at any time between them, and
each event tells exactly how far that pixel has moved since its others:

    L(t) = a + C+ P - C- M + delta L'(t) + kappa |L'(t)|

with L and its slope L' read from the frames at the stamp t of each event, P and M the brighter and darker events of the
pixel so far, a its own constant (one reading of a pixel tells no more), and delta the time by which events are stamped
late: a level reached at t - delta has moved on by delta L' when the stamp comes. The last term is none of the events:
what frames tell wrongly where an edge begins or ends (the logarithm is curved, and polynomials cut corners) has one
sign, and grows with the slope, whichever way the light goes. Without it falling light would look late and rising light
early; with it a delay is told by both, and hardly by edges of one kind alone. Bracketed level samples
(``event_levels``) read events at the times of frames and need many events a frame; these readings need several frames
an event.

A sensor of the linear model compares whole grey values once a rendered step. Its event steps from the last whole value
by C + 1/2 at the crossing, by half of what the signal moves in a step more until it is looked at, and by what rounding
adds; both follow from the slope (closed form in ``event_reading_kernels``) and are taken from the level.

Light that turns between two frames goes farther than they tell. The steps of the linear model are large: many are made
at such crests alone, always in the direction of the event, so that they look too small and too early. The last event of
a pixel before its light turns is counted, but not read; the others come on the way, where frames tell too much as
often as too little.

Each reading weighs 1 / (1 + (e / s)^2), e being how far four frames in place of six move it, how far the parabolas
through the first and the last three of those four lie apart, and how far off the sharp reconstruction of its footprint
may be, and s a small share of the threshold: the weight of white noise and an error of size e, with no regard to what
the events say. Where an edge has passed, light stops to change between two frames: polynomials of any order cut that
corner, and may agree by chance on a level that is wrong. Parabolas see the corner itself.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.footprint import LEFT_BY_SHARP
from fedora_qa.estimators.events.frame_interpolation_kernels import (
    FINE,
    READ,
    SECONDS,
    SIGN,
    centre_readings,
    read_at_events,
)
from fedora_qa.estimators.events.levels import NormalBlocks, huber_weights, normal_blocks
from fedora_qa.estimators.events.pixels import PixelEvents

Float64 = NDArray[np.float64]

MOST_READINGS = 60_000
"""Beyond so many events, every second, third, ... pixel is read: the rest would tell little more."""

ERROR_SHARE = 0.01
"""Of the threshold: the size of an error of reading from which on a reading counts less.

Rounding alone scatters a reading by some 3% of a threshold (8 bits, a threshold of 0.2, middle grey). It averages out
over the ten readings or more that share an edge, while what is read wrongly at an edge is wrong in all of them alike:
in the mean over an edge, the white noise of each counts a tenth of its variance."""

Way = Literal["fine", "coarse", "even"]
"""How levels are read at events."""


@dataclass(frozen=True, slots=True)
class Readings:
    """Levels read at events, less the mean of their pixel.

    Attributes
    ----------
    pixels
        (m,) row * width + column.
    times_s
        (m,) of the events.
    regressors
        (m, 4): P, -M, the slope L' (1/s), and |L'|.
    levels
        (m,) read from six frames each.
    coarse_levels
        (m,) read from four.
    even_levels
        (m,) read from six frames whose footprints are reconstructed as even.
    weights
        (m,) by errors of reading.
    """

    pixels: NDArray[np.int64]
    times_s: Float64
    regressors: Float64
    levels: Float64
    coarse_levels: Float64
    even_levels: Float64
    weights: Float64

    def __len__(self) -> int:
        return len(self.pixels)


def read_frames(
    events: PixelEvents,
    frame_times_ns: NDArray[np.int64],
    images: NDArray[np.floating],
    even_images: NDArray[np.floating] | None = None,
    usable: NDArray[np.bool_] | None = None,
    *,
    threshold: float,
    log_eps_dn: float | None = None,
    tick_s: float = 0.0,
    leak_rate_hz: float = 0.0,
) -> Readings | None:
    """Read the levels of ``images`` (n, h, w) at each event; None with fewer than six frames.

    Levels are those of the images, or with ``log_eps_dn`` the logarithms of images and this, in DN. ``even_images`` are
    those of the even reconstruction; the same images where there is none. ``usable`` (n, h, w) says where both are
    known; where they are finite if not given. ``tick_s`` is the rendered step of a sensor of the linear model, 0 for
    one of log intensity. ``leak_rate_hz`` is declared: so many brighter events a second are not due to the light.
    """
    if len(frame_times_ns) < FINE:
        return None
    usable = np.isfinite(images) if usable is None else usable
    inside = events.later_than(int(frame_times_ns[0]), int(frame_times_ns[-1]))
    every = max(1, -(-inside // MOST_READINGS))
    pixels, columns = np.empty(inside, np.int64), np.empty((inside, READ))
    seconds = (frame_times_ns - frame_times_ns[0]) * 1e-9
    count = read_at_events(
        events.starts,
        events.timestamped,
        frame_times_ns,
        seconds,
        inverse_distances(seconds),
        images,
        images if even_images is None else even_images,
        usable,
        np.nan if log_eps_dn is None else log_eps_dn,
        every,
        tick_s,
        pixels,
        columns,
    )
    pixels, columns, kept = pixels[:count], columns[:count], np.ones(count, np.bool_)
    if tick_s > 0:
        kept = ~_before_turns(pixels, columns[:, SIGN])
    centred = np.empty((count, 8))
    error = ERROR_SHARE * threshold
    count = centre_readings(pixels, columns, kept, leak_rate_hz, LEFT_BY_SHARP, error, centred)
    regressors, centred = centred[:count, :4].copy(), centred[:count].T.copy()
    times_s = frame_times_ns[0] * 1e-9 + columns[:count, SECONDS]
    return Readings(pixels[:count].copy(), times_s, regressors, *centred[4:])


def inverse_distances(seconds: Float64) -> Float64:
    """Return one over the distances (1/s) of each six times: (n - 5, 6, 6), [first, order, j] of j and j + order."""
    inverses = np.zeros((len(seconds) - FINE + 1, FINE, FINE))
    for order in range(1, FINE):
        apart = 1 / (seconds[order:] - seconds[:-order])
        for j in range(FINE - order):
            inverses[:, order, j] = apart[j : j + len(inverses)]
    return inverses


def reading_weights(readings: Readings) -> Float64:
    """Return the weights (m,) of the readings, those of outliers reduced (Huber)."""
    root = np.sqrt(readings.weights)
    robust = huber_weights(readings.regressors * root[:, np.newaxis], readings.levels * root)
    return readings.weights * robust


def reading_blocks(
    readings: Readings,
    weights: Float64,
    block_of_reading: NDArray[np.intp],
    blocks: int,
    *,
    read: Way = "fine",
) -> NormalBlocks:
    """Return the normal equations of C+, C-, delay and kappa, summed by block.

    Levels are read from six frames (``fine``) or four (``coarse``), or from six that are reconstructed as even
    (``even``).
    """
    levels = {
        "fine": readings.levels,
        "coarse": readings.coarse_levels,
        "even": readings.even_levels,
    }[read]
    return normal_blocks(readings.regressors, levels, weights, block_of_reading, blocks, readings.times_s)


def _before_turns(pixels: NDArray[np.int64], signs: Float64) -> NDArray[np.bool_]:
    """Return the events (m,), by pixel, after which their pixel has none, or one of the other sign."""
    before = np.ones(len(pixels), np.bool_)
    before[:-1] = (pixels[1:] != pixels[:-1]) | (signs[1:] != signs[:-1])
    return before
