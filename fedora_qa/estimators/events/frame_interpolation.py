"""Frames interpolated at the times of events: the delay of events where a pixel fires seldom.

Where light changes slowly from frame to frame, the frames determine a pixel's level at any time between them, and each
event determines exactly how far that pixel has moved since its others:

    L(t) = a + C+ P - C- M + delta L'(t) + kappa |L'(t)|

with L and its slope L' interpolated from the frames at the timestamp t of each event, P and M the brighter and darker
events of the pixel so far, a its own constant (one event of a pixel determines no more), and delta the delay of the
timestamps: a level reached at t - delta has moved on by delta L' at t. The last term is none of the events: the error
of frames where an edge begins or ends (the logarithm is curved, and polynomials cut corners) has one sign, and grows
with the slope, whichever way the light goes. Without it the events of falling light would come out late and those of
rising light early; with it a delay is determined by both, and hardly by edges of one kind alone. Bracketed level
samples (``levels.py``) interpolate events at the times of frames and need many events a frame; these samples need
several frames an event.

A sensor of the linear model compares whole grey values once a rendered step. The step of an event from the last whole
value is C + 1/2 at the crossing, plus half of the signal's motion in a rendered step until the comparison, plus
rounding. Motion and rounding follow from the slope (closed form in ``_rounded_up``) and are subtracted from the level.

Light that turns between two frames goes beyond the values of both. The steps of the linear model are large: many events
occur at such crests alone, always in the direction of the crest, so that thresholds come out too small and events too
early. The last event of a pixel before its light turns is counted, but gives no sample; the others lie on slopes, where
frames err upwards as often as downwards.

Each sample weighs 1 / (1 + (e / s)^2), e being how far four frames in place of six move it, how far the parabolas
through the first and the last three of those four lie apart, and how far off the edge-aware reconstruction of its
footprint may be, and s a small share of the threshold: the weight of white noise and an error of size e, independent of
the counts of events. Where an edge has passed, light stops to change between two frames: polynomials of any order cut
that corner, and may agree by chance on a level that is wrong. Parabolas measure the corner itself.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from fedora_qa.estimators.events.footprint import LEFT_BY_SHARP
from fedora_qa.estimators.events.pixels import PixelEvents
from fedora_qa.estimators.events.threshold_fit import NormalBlocks, normal_blocks
from fedora_qa.estimators.fitting.huber_regression import huber_regression_weights

Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]
Int64 = NDArray[np.int64]
Bool = NDArray[np.bool_]

FINE, COARSE = 6, 4
"""Frames through which a polynomial is laid to interpolate a level, and to estimate its error."""

SECONDS, ON, OFF, LEVEL, SLOPE, COARSER, SIGN, UNIFORM, CORNER = range(9)
"""Columns of samples: seconds since the first frame, brighter and darker events of the pixel so far (darker ones
negative), the level, its slope (1/s), what four frames in place of six would add to it, the sign of the event, the
level of the uniform reconstruction, and how far two parabolas lie apart."""

COLUMNS = 9
"""Number of columns of a sample."""

MOST_INTERPOLATED = 60_000
"""Beyond so many events, every second, third, ... pixel is sampled: the rest would add little precision."""

ERROR_SHARE = 0.01
"""Error of interpolation, as a fraction of the threshold, from which on a sample weighs less.

Rounding alone scatters a sample by some 3% of a threshold (8 bits, a threshold of 0.2, middle grey). It averages out
over the ten samples or more that share an edge, while the error of interpolation at an edge is the same in all of them:
in the mean over an edge, the white noise of each counts a tenth of its variance."""

InterpolationMethod = Literal["fine", "coarse", "uniform"]
"""Interpolation of levels at events: through six frames, through four, or through six of the uniform footprints."""


@dataclass(frozen=True, slots=True)
class InterpolatedLevels:
    """Levels interpolated at events, less the mean of their pixel.

    Attributes
    ----------
    pixels
        (m,) row * width + column.
    times_s
        (m,) of the events.
    regressors
        (m, 4): P, -M, the slope L' (1/s), and |L'|.
    levels
        (m,) through six frames each.
    coarse_levels
        (m,) through four.
    uniform_levels
        (m,) through six frames whose footprints are reconstructed as uniform pixels.
    weights
        (m,) by errors of interpolation.
    """

    pixels: NDArray[np.int64]
    times_s: Float64
    regressors: Float64
    levels: Float64
    coarse_levels: Float64
    uniform_levels: Float64
    weights: Float64

    def __len__(self) -> int:
        return len(self.pixels)


class FrameStack(NamedTuple):
    """Frames and their polynomials' denominators, for compiled loops.

    Attributes
    ----------
    times_ns, seconds
        (n,); seconds since the first.
    inverses
        (n - 5, 6, 6) of ``inverse_distances``.
    images, uniform_images
        (n, h, w) by the two reconstructions, in DN.
    usable
        (n, h, w) where both are known.
    log_eps
        Levels are the logarithms of images and this; the images themselves where it is NaN.
    """

    times_ns: Int64
    seconds: Float64
    inverses: Float64
    images: NDArray[np.floating]
    uniform_images: NDArray[np.floating]
    usable: Bool
    log_eps: float


def interpolate_frames(
    events: PixelEvents,
    frame_times_ns: NDArray[np.int64],
    images: NDArray[np.floating],
    uniform_images: NDArray[np.floating] | None = None,
    usable: NDArray[np.bool_] | None = None,
    *,
    threshold: float,
    log_eps_dn: float | None = None,
    tick_s: float = 0.0,
    leak_rate_hz: float = 0.0,
) -> InterpolatedLevels | None:
    """Interpolate frames at each event between the first and the last of them.

    Parameters
    ----------
    events
        By pixel of the event camera.
    frame_times_ns
        (n,) advancing.
    images
        (n, h, w) frames at the event camera's pixels, by the edge-aware reconstruction, in DN.
    uniform_images
        (n, h, w) by the uniform reconstruction; ``images`` if not given.
    usable
        (n, h, w) where both are known; where ``images`` are finite if not given.
    threshold
        The smaller declared one, in the unit of the levels.
    log_eps_dn
        Levels are the logarithms of images and this, in DN; the images themselves if not given.
    tick_s
        The rendered step of a sensor of the linear model, 0 for one of log intensity.
    leak_rate_hz
        As declared: so many brighter events a second are not due to the light.

    Returns
    -------
    InterpolatedLevels | None
        None with fewer than six frames.
    """
    if len(frame_times_ns) < FINE:
        return None
    usable = np.isfinite(images) if usable is None else usable
    inside = events.later_than(int(frame_times_ns[0]), int(frame_times_ns[-1]))
    # Pixels are left out whole: the constant a of a pixel is determined by all of its events together.
    every = max(1, -(-inside // MOST_INTERPOLATED))
    pixels, columns = np.empty(inside, np.int64), np.empty((inside, COLUMNS))
    seconds = (frame_times_ns - frame_times_ns[0]) * 1e-9
    frames = FrameStack(
        frame_times_ns,
        seconds,
        inverse_distances(seconds),
        images,
        images if uniform_images is None else uniform_images,
        usable,
        np.nan if log_eps_dn is None else log_eps_dn,
    )
    count = interpolate_at_events(events.starts, events.timestamped, frames, every, tick_s, pixels, columns)
    pixels, columns, kept = pixels[:count], columns[:count], np.ones(count, np.bool_)
    if tick_s > 0:
        # Events after which their pixel has none, or one of the other sign, precede a turn of the light.
        signs = columns[:, SIGN]
        kept[:] = False
        kept[:-1] = (pixels[1:] == pixels[:-1]) & (signs[1:] == signs[:-1])
    centred = np.empty((count, 8))
    error = ERROR_SHARE * threshold
    count = centre_levels(pixels, columns, kept, leak_rate_hz, LEFT_BY_SHARP, error, centred)
    regressors, centred = centred[:count, :4].copy(), centred[:count].T.copy()
    times_s = frame_times_ns[0] * 1e-9 + columns[:count, SECONDS]
    return InterpolatedLevels(pixels[:count].copy(), times_s, regressors, *centred[4:])


def inverse_distances(seconds: Float64) -> Float64:
    """Return the inverse distances of each six successive times, the denominators of divided differences.

    Parameters
    ----------
    seconds
        (n,) times, advancing, s.

    Returns
    -------
    Float64
        (n - 5, 6, 6) in 1/s: [first, order, j] is 1 / (t_{j + order} - t_j), j counted from ``first``.
    """
    inverses = np.zeros((len(seconds) - FINE + 1, FINE, FINE))
    for order in range(1, FINE):
        difference = 1 / (seconds[order:] - seconds[:-order])
        for j in range(FINE - order):
            inverses[:, order, j] = difference[j : j + len(inverses)]
    return inverses


def interpolation_weights(samples: InterpolatedLevels) -> Float64:
    """Return the weights of samples by errors of interpolation, those of outliers reduced (Huber).

    Parameters
    ----------
    samples
        (m,) levels at events.

    Returns
    -------
    Float64
        (m,), 0 to 1.
    """
    # Rows times the root of their weight have one variance, as Huber's estimate assumes.
    root = np.sqrt(samples.weights)
    robust = huber_regression_weights(samples.regressors * root[:, np.newaxis], samples.levels * root)
    return samples.weights * robust


def interpolation_blocks(
    samples: InterpolatedLevels,
    weights: Float64,
    block_of_sample: NDArray[np.intp],
    blocks: int,
    *,
    method: InterpolationMethod = "fine",
) -> NormalBlocks:
    """Return the normal equations of C+, C-, delay and kappa, summed by block.

    Parameters
    ----------
    samples
        (m,) levels at events.
    weights, block_of_sample
        (m,) of the samples.
    blocks
        Number of blocks, b.
    method
        Interpolation whose levels are regressed.

    Returns
    -------
    NormalBlocks
        (b, 4, 4) and (b, 4): of C+, C- (unit of the levels), delay and kappa (s).
    """
    levels = {
        "fine": samples.levels,
        "coarse": samples.coarse_levels,
        "uniform": samples.uniform_levels,
    }[method]
    return normal_blocks(samples.regressors, levels, weights, block_of_sample, blocks, samples.times_s)


@njit(cache=True)
def interpolate_at_events(
    starts: Int32,
    timestamped: Int64,
    frames: FrameStack,
    every: int,
    tick_s: float,
    pixels: Int64,
    samples: Float64,
) -> int:
    """Interpolate levels at each event between the first and the last frame; return how many were.

    A level is that of the polynomial through the six frames around the event, which must all be usable. Of the pixels,
    one in ``every`` is sampled, where it fires twice or more: a single sample is its own mean. ``pixels`` (m,) receives
    row * width + column, ``samples`` (m, 9) the columns that are named above.

    With ``tick_s`` > 0 events are those of a sensor that compares whole values once a tick. The part of their steps
    beyond C + 1/2 is subtracted from the level.

    The corner is what lies between the parabolas through the first and the last three of the four frames around. They
    share the frames t1 and t2, so that with the divided difference of third order they differ by
    L[t0, t1, t2, t3] (t3 - t0) (t - t1) (t - t2). Where light stops to change between two frames that is of the size of
    what any polynomial cuts off the corner.
    """
    frame_times, seconds, log_eps = frames.times_ns, frames.seconds, frames.log_eps
    n, height, width = frames.images.shape
    # Levels of the sampled pixels of a row at all frames, and the divided differences of six of them.
    levels, uniform_levels, usable_of = np.empty((width, n)), np.empty((width, n)), np.empty((width, n), np.bool_)
    divided, uniform, chosen = np.empty((FINE, FINE)), np.empty((FINE, FINE)), np.empty(width, np.int64)
    rows = 0
    for row in range(height):
        count = 0
        for column in range((-3 * row) % every, width, every):
            if starts[row * width + column + 1] - starts[row * width + column] > 1:
                chosen[count] = column
                count += 1
        for frame in range(n):
            _gather(frames.images[frame, row], chosen, count, log_eps, levels[:, frame])
            _gather(frames.uniform_images[frame, row], chosen, count, log_eps, uniform_levels[:, frame])
            for k in range(count):
                usable_of[k, frame] = frames.usable[frame, row, chosen[k]]
        for k in range(count):
            pixel = row * width + chosen[k]
            # Events in (first frame, last frame].
            begin, stop = starts[pixel], starts[pixel + 1]
            while begin < stop and timestamped[begin] >> 1 <= frame_times[0]:
                begin += 1
            while begin < stop and timestamped[stop - 1] >> 1 > frame_times[n - 1]:
                stop -= 1
            if stop - begin < 2:
                continue
            frame, divided_from, all_usable = 0, -1, False
            on, off, excess, uniform_excess = 0.0, 0.0, 0.0, 0.0
            for i in range(begin, stop):
                t, sign = timestamped[i] >> 1, 1.0 if timestamped[i] & 1 else -1.0
                while frame_times[frame + 1] < t:
                    frame += 1
                on, off = on + max(sign, 0.0), off + min(sign, 0.0)
                # The event lies in the middle interval of six frames, except near the first and the last frame.
                first = min(max(frame + 1 - FINE // 2, 0), n - FINE)
                if first != divided_from:
                    # Divided differences serve all events of a pixel between two frames.
                    divided_from, all_usable = first, True
                    for j in range(first, first + FINE):
                        all_usable &= usable_of[k, j]
                    if all_usable:
                        divide(levels[k], first, frames.inverses[first], divided)
                        divide(uniform_levels[k], first, frames.inverses[first], uniform)
                if not all_usable:
                    continue
                inner = min(max(frame + 1 - COARSE // 2, 0), n - COARSE)
                time_s = (t - frame_times[0]) * 1e-9
                level, slope = polynomial(divided, 0, seconds, first, FINE, time_s)
                coarse, _ = polynomial(divided, inner - first, seconds, inner, COARSE, time_s)
                uniform_level, uniform_slope = polynomial(uniform, 0, seconds, first, FINE, time_s)
                rounding, uniform_rounding = 0.0, 0.0
                if tick_s > 0.0:
                    # A step exceeds C + 1/2 by half of what the signal moves in a tick, and by rounding. What all steps
                    # of the pixel so far exceed it by is taken from the level; its own rounding comes after it.
                    step, uniform_step = max(0.0, sign * slope) * tick_s, max(0.0, sign * uniform_slope) * tick_s
                    rounding, uniform_rounding = _rounded_up(step), _rounded_up(uniform_step)
                    excess += sign * (0.5 * step + rounding)
                    uniform_excess += sign * (0.5 * uniform_step + uniform_rounding)
                pixels[rows] = pixel
                samples[rows, SECONDS], samples[rows, ON], samples[rows, OFF] = time_s, on, off
                samples[rows, LEVEL], samples[rows, SLOPE] = level - excess + sign * rounding, slope
                samples[rows, COARSER], samples[rows, SIGN] = coarse - level, sign
                samples[rows, UNIFORM] = uniform_level - uniform_excess + sign * uniform_rounding
                # The distance of the two parabolas: the last formula above.
                ends = seconds[inner + 3] - seconds[inner]
                inside = (time_s - seconds[inner + 1]) * (time_s - seconds[inner + 2])
                samples[rows, CORNER] = divided[3, inner - first] * ends * inside
                rows += 1
    return rows


@njit(cache=True)
def _gather(image: NDArray[np.floating], chosen: Int64, count: int, log_eps: float, levels: Float64) -> None:
    """Write the levels of an image's row at the chosen pixels."""
    # Loads by themselves, since logarithms between them would wait for each.
    for k in range(count):
        levels[k] = image[chosen[k]]
    if not np.isnan(log_eps):
        # The floor keeps the logarithm of a black pixel finite.
        for k in range(count):
            levels[k] = np.log(max(levels[k] + log_eps, 1e-3))


@njit(cache=True)
def centre_levels(
    pixels: Int64,
    samples: Float64,
    kept: Bool,
    leak_rate_hz: float,
    by_place: float,
    error: float,
    centred: Float64,
) -> int:
    """Subtract from each sample the mean of its pixel, and weigh it; return how many samples are kept.

    Only ``kept`` rows of ``samples`` (m, 9) count, at pixels with two of them or more. Each weighs
    1 / (1 + (e / error)^2), e being what four frames would add, the corner, and ``by_place`` times what the uniform
    reconstruction does, all less the pixel's mean. ``pixels`` and the first column of ``samples`` are moved to the
    front; ``centred`` (m, 8) receives P, -M, L', |L'|, the level, that of four frames, the uniform one, each less its
    weighted mean, and the weight.
    """
    rows, begin, values = 0, 0, np.empty(7)
    sums = np.empty(7)
    while begin < len(pixels):
        stop, count, difference = begin, 0, 0.0
        while stop < len(pixels) and pixels[stop] == pixels[begin]:
            if kept[stop]:
                count += 1
                difference += samples[stop, UNIFORM] - samples[stop, LEVEL]
            stop += 1
        if count > 1:
            total, first = 0.0, rows
            sums[:] = 0.0
            for i in range(begin, stop):
                if not kept[i]:
                    continue
                place = by_place * (samples[i, UNIFORM] - samples[i, LEVEL] - difference / count)
                errors = samples[i, COARSER] ** 2 + samples[i, CORNER] ** 2 + place**2
                # The inverse variance of white noise of size ``error`` and these errors, over that of the noise alone.
                weight = 1.0 / (1.0 + errors / error**2)
                # Leak makes brighter events without a change of light: P less the rate times the time.
                values[0] = samples[i, ON] - leak_rate_hz * samples[i, SECONDS]
                values[1], values[2], values[3] = samples[i, OFF], samples[i, SLOPE], abs(samples[i, SLOPE])
                values[4], values[5] = samples[i, LEVEL], samples[i, LEVEL] + samples[i, COARSER]
                values[6] = samples[i, UNIFORM]
                for j in range(7):
                    sums[j] += weight * values[j]
                    centred[rows, j] = values[j]
                centred[rows, 7] = weight
                total += weight
                pixels[rows], samples[rows, SECONDS] = pixels[i], samples[i, SECONDS]
                rows += 1
            # Subtracting the pixel's weighted mean eliminates its constant a (Frisch and Waugh, Econometrica 1, 1933).
            sums /= max(total, 1e-300)
            for i in range(first, rows):
                for j in range(7):
                    centred[i, j] -= sums[j]
        begin = stop
    return rows


@njit(cache=True)
def divide(levels: Float64, first: int, inverses: Float64, divided: Float64) -> None:
    """Write Newton's divided differences of six levels: ``divided[order, j]`` is that of points j to j + order."""
    for j in range(FINE):
        divided[0, j] = levels[first + j]
    for order in range(1, FINE):
        for j in range(FINE - order):
            # L[j..j+k] = (L[j+1..j+k] - L[j..j+k-1]) / (t_{j+k} - t_j) (Newton).
            divided[order, j] = (divided[order - 1, j + 1] - divided[order - 1, j]) * inverses[order, j]


@njit(cache=True)
def polynomial(
    divided: Float64, column: int, seconds: Float64, first: int, points: int, time_s: float
) -> tuple[float, float]:
    """Return value and slope at ``time_s`` of the polynomial through so many points from the ``first`` on.

    ``divided[:, column]`` are the divided differences of these points, whose times are ``seconds``.
    """
    # Horner's rule on Newton's form, with the derivative carried along.
    value, slope = divided[points - 1, column], 0.0
    for order in range(points - 2, -1, -1):
        since = time_s - seconds[first + order]
        slope = slope * since + value
        value = value * since + divided[order, column]
    return value, slope


@njit(cache=True)
def _rounded_up(step: float) -> float:
    """Return by how much rounding to whole values exceeds a value, on average, that has passed a half by U step.

    U is uniform over 0..1: the mean of 1/2 - frac(U step).
    """
    if step < 1e-9:
        return 0.5
    # Integral of frac over (0, step): 1/2 for each whole, and the square of the rest over 2.
    whole = float(np.floor(step))
    return 0.5 - (whole + (step - whole) ** 2) / (2.0 * step)
