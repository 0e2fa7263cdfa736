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

from fedora_qa.estimators.event_footprint import LEFT_BY_SHARP
from fedora_qa.estimators.event_levels import NormalBlocks, huber_weights, normal_blocks
from fedora_qa.estimators.event_reading_kernels import FINE, number_pixels, read_at_events

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
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    times_ns: NDArray[np.int64],
    p: NDArray[np.uint8],
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
    inside = int(np.diff(np.searchsorted(times_ns, frame_times_ns[[0, -1]], side="right"))[0])
    every = max(1, -(-inside // MOST_READINGS))
    pixels, columns = np.empty(inside, np.int64), np.empty((inside, 8))
    count = read_at_events(
        x,
        y,
        times_ns,
        p,
        frame_times_ns,
        images,
        images if even_images is None else even_images,
        usable,
        np.nan if log_eps_dn is None else log_eps_dn,
        every,
        tick_s,
        pixels,
        columns,
    )
    kept = np.arange(count)
    if tick_s > 0:
        kept = kept[~_before_turns(pixels[:count], columns[:count, 6])]
    numbers = _numbered(pixels[kept], usable[0].size)
    often = np.bincount(numbers)[numbers] > 1
    kept, numbers = kept[often], numbers[often]
    pixels, columns = pixels[kept], columns[kept]
    columns[:, 1] -= leak_rate_hz * columns[:, 0]
    level, coarse, even = columns[:, 3], columns[:, 3] + columns[:, 5], columns[:, 7]
    by_place = LEFT_BY_SHARP * _less_mean(even - level, numbers, np.ones(len(kept)))
    frame_times_s = (frame_times_ns - frame_times_ns[0]) * 1e-9
    corners = _corners(pixels, columns[:, 0], frame_times_s, images, log_eps_dn)
    weights = 1 / (1 + (columns[:, 5] ** 2 + corners**2 + by_place**2) / (ERROR_SHARE * threshold) ** 2)
    regressors = [_less_mean(each, numbers, weights) for each in (*columns[:, [1, 2, 4]].T, np.abs(columns[:, 4]))]
    return Readings(
        pixels,
        frame_times_ns[0] * 1e-9 + columns[:, 0],
        np.column_stack(regressors),
        _less_mean(level, numbers, weights),
        _less_mean(coarse, numbers, weights),
        _less_mean(even, numbers, weights),
        weights,
    )


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


def _corners(
    pixels: NDArray[np.int64],
    times_s: Float64,
    frame_times_s: Float64,
    images: NDArray[np.floating],
    log_eps_dn: float | None = None,
) -> Float64:
    """Return how far two parabolas lie apart (m,): those through the first and the last three of four frames around.

    They share the frames t1 and t2, so that with the divided difference of third order they differ by
    L[t0, t1, t2, t3] (t3 - t0) (t - t1) (t - t2). Where light stops to change between two frames that is of the size of
    what any polynomial cuts off the corner.
    """
    before = np.searchsorted(frame_times_s, times_s) - 1
    first = np.clip(before - 1, 0, len(frame_times_s) - 4)
    frames = first[:, np.newaxis] + np.arange(4)
    rows, columns = np.divmod(pixels, images.shape[2])
    t, divided = frame_times_s[frames], images[frames, rows[:, np.newaxis], columns[:, np.newaxis]].astype(np.float64)
    if log_eps_dn is not None:
        divided = np.log(divided + log_eps_dn)
    for order in (1, 2, 3):
        divided = np.diff(divided, axis=1) / (t[:, order:] - t[:, :-order])
    apart: Float64 = divided[:, 0] * (t[:, 3] - t[:, 0]) * (times_s - t[:, 1]) * (times_s - t[:, 2])
    return apart


def _before_turns(pixels: NDArray[np.int64], signs: Float64) -> NDArray[np.bool_]:
    """Return the events (m,) after which their pixel has none, or one of the other sign."""
    order = np.argsort(pixels, kind="stable")
    goes_on = (pixels[order][1:] == pixels[order][:-1]) & (signs[order][1:] == signs[order][:-1])
    before = np.ones(len(pixels), np.bool_)
    before[order[:-1]] = ~goes_on
    return before


def _numbered(pixels: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """Return the number (m,) of each event's pixel among those that occur."""
    numbers = np.empty(len(pixels), np.int64)
    number_pixels(pixels, most, numbers)
    return numbers


def _less_mean(values: Float64, numbers: NDArray[np.int64], weights: Float64) -> Float64:
    """Return values (m,) less the weighted mean of their pixel, which goes by its number."""
    total = np.bincount(numbers, weights)
    mean = np.bincount(numbers, weights * values) / np.maximum(total, 1e-300)
    centred: Float64 = values - mean[numbers]
    return centred
