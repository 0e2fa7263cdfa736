"""Frames interpolated at the times of events: the delay of events where pixels fire seldom.

Where light changes slowly from frame to frame, the frames determine the level of a pixel at any time between them. Each
event determines exactly how far the level has changed since the other events of the pixel:

    L(t) = a + C+ P - C- M + delta L'(t) + kappa |L'(t)|

- L and its slope L' are interpolated from the frames at the timestamp t of each event.
- P and M are the numbers of brighter and darker events of the pixel so far.
- a is a constant of the pixel; a single event of a pixel determines only a.
- delta is the delay of the timestamps: the level was reached at t - delta and has changed by delta L' until t.
- kappa describes an error of the frames where an edge begins or ends, because the logarithm is curved and polynomials
  cut corners. This error has one sign and grows with the slope of the light in both directions. Without the term,
  events of falling light would appear late and events of rising light early. With it, edges of both directions
  determine the delay.

Bracketed level samples (``levels.py``) interpolate events at the times of frames and need many events between two
frames. The samples of this module need several frames between two events.

A sensor of the linear model compares whole grey values once in each rendered step. The step of an event from the last
whole value is C + 1/2 at the crossing, plus half of the change of the signal in a rendered step until the comparison,
plus rounding. Change and rounding follow from the slope (closed form in ``_rounded_up``) and are subtracted from the
level.

Light that turns between two frames exceeds the values of both frames. The steps of the linear model are large: many
events occur only at such crests, always in the direction of the crest, so that thresholds would be too small and events
too early. The last event of a pixel before its light turns is therefore counted but gives no sample. The other events
lie on slopes, where the errors of frames have both signs equally often.

Each sample has the weight 1 / (1 + (e / s)^2), with s a small share of the threshold. This is the weight of white noise
of size s with a further error of size e, and does not depend on the counts of events. The square of e is the sum of
three squares:

- the change of the level when four frames replace six,
- the distance between the parabolas through the first three and the last three of these four frames,
- the bound on the error of the edge-aware reconstruction of the footprint.

After an edge has passed, the light stops to change between two frames. Polynomials of any order cut this corner, and
can agree by chance on a wrong level. The parabolas measure the corner itself.
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
"""Number of frames of the polynomial that interpolates a level, and of the one that estimates its error."""

SECONDS, ON, OFF, LEVEL, SLOPE, COARSER, SIGN, UNIFORM, CORNER = range(9)
"""Columns of samples.

SECONDS: time since the first frame, s. ON, OFF: brighter events, and minus the darker events, of the pixel so far.
LEVEL, SLOPE: the level, and its slope (unit of the level / s). COARSER: the level through four frames less that through
six. SIGN: 1 or -1 of the event. UNIFORM: the level of the uniform reconstruction. CORNER: the distance between the two
parabolas."""

COLUMNS = 9
"""Number of columns of a sample."""

MOST_INTERPOLATED = 60_000
"""Number of events beyond which only every second, third, ... pixel is sampled. The others would add little
precision."""

ERROR_SHARE = 0.01
"""Error of interpolation, as a share of the threshold, at which a sample has half the weight.

Rounding alone scatters a sample by about 3% of a threshold (8 bits, a threshold of 0.2 nat, middle grey). Over the ten
or more samples of an edge this noise averages out to a tenth of its variance, while the error of interpolation is the
same in all samples of the edge. The noise counts therefore as 1% of a threshold."""

InterpolationMethod = Literal["fine", "coarse", "uniform"]
"""Interpolation of levels at events: through six frames, through four frames, or through six frames of the uniform
reconstruction."""


@dataclass(frozen=True, slots=True)
class InterpolatedLevels:
    """Levels interpolated at m events; regressors and levels are less the weighted mean of their pixel.

    Attributes
    ----------
    pixels
        (m,) row * width + column.
    times_s
        (m,) timestamps of the events, s from the origin of the file.
    regressors
        (m, 4): P, -M (counts), the slope L' and |L'| (unit of the levels / s).
    levels
        (m,) levels through six frames: nat for the log model, DN for the linear model.
    coarse_levels
        (m,) levels through four frames.
    uniform_levels
        (m,) levels through six frames of the uniform reconstruction.
    weights
        (m,) weights by the errors of interpolation, 0 to 1.
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
    """n frames, and the denominators of their polynomials, for compiled loops.

    Attributes
    ----------
    times_ns, seconds
        (n,) timestamps, ns, and seconds since the first frame.
    inverses
        (n - 5, 6, 6) inverse distances of times, 1/s, from ``inverse_distances``.
    images, uniform_images
        (n, h, w) frames by the edge-aware and by the uniform reconstruction, DN.
    usable
        (n, h, w) True where both are known.
    log_eps
        Levels are ln(image + log_eps), with log_eps in DN; where it is NaN, levels are the images.
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
    """Interpolate frames at each event between the first and the last frame.

    Parameters
    ----------
    events
        Events by pixel of the event camera.
    frame_times_ns
        (n,) strictly increasing timestamps of the frames, ns.
    images
        (n, h, w) frames at the pixels of the event camera, by the edge-aware reconstruction, DN.
    uniform_images
        (n, h, w) frames by the uniform reconstruction, DN; ``images`` where None.
    usable
        (n, h, w) True where both are known; where None, where ``images`` are finite.
    threshold
        The smaller declared threshold, in the unit of the levels.
    log_eps_dn
        Levels are ln(image + log_eps_dn), DN; where None, levels are the images (linear model).
    tick_s
        Rendered step of a sensor of the linear model, s; 0 for the log model.
    leak_rate_hz
        Declared rate of brighter events of a pixel that are not due to light, 1/s.

    Returns
    -------
    InterpolatedLevels | None
        None with fewer than six frames.
    """
    if len(frame_times_ns) < FINE:
        return None
    usable = np.isfinite(images) if usable is None else usable
    inside = events.later_than(int(frame_times_ns[0]), int(frame_times_ns[-1]))
    # Whole pixels are left out: all events of a pixel determine its constant a together.
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
        # Light turns after an event if the next event of the pixel has the other sign, or if there is none.
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
        (n,) strictly increasing times, s.

    Returns
    -------
    Float64
        (n - 5, 6, 6) in 1/s: [first, order, j] is 1 / (t_{j + order} - t_j), with j counted from ``first``; 0
        elsewhere.
    """
    inverses = np.zeros((len(seconds) - FINE + 1, FINE, FINE))
    for order in range(1, FINE):
        difference = 1 / (seconds[order:] - seconds[:-order])
        for j in range(FINE - order):
            inverses[:, order, j] = difference[j : j + len(inverses)]
    return inverses


def interpolation_weights(samples: InterpolatedLevels) -> Float64:
    """Return the weights of samples by their errors of interpolation, times Huber's weights.

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
        (m,) weights of the samples, and numbers of their blocks, 0 to b - 1.
    blocks
        Number b of blocks.
    method
        Interpolation whose levels are regressed.

    Returns
    -------
    NormalBlocks
        b blocks of four parameters: C+ and C- (unit of the levels), delay and kappa (s).
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
    """Interpolate levels at each event between the first and the last frame.

    A level is that of the polynomial through the six frames around the event; all of them must be usable. Only pixels
    with two or more events are sampled: a single sample equals the mean of its pixel.

    The corner is the distance between the parabolas through the first three and the last three of the four frames
    around the event. Both parabolas contain the frames t1 and t2. Their difference is therefore
    L[t0, t1, t2, t3] (t3 - t0) (t - t1) (t - t2), with the divided difference of third order. Where light stops to
    change between two frames, it is about as large as the error of any polynomial at this corner.

    Parameters
    ----------
    starts, timestamped
        (h * w + 1,) and (e,) events by pixel, as in ``PixelEvents``.
    frames
        The n frames.
    every
        One pixel in ``every`` is sampled.
    tick_s
        Where above 0, events are those of a sensor that compares whole values once in each tick of ``tick_s`` s. The
        part of their steps beyond C + 1/2 is subtracted from the level.
    pixels
        (m,) receives row * width + column of each sample.
    samples
        (m, 9) receives the columns ``SECONDS`` to ``CORNER``.

    Returns
    -------
    int
        Number of samples that were written.
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
                # The event lies in the middle interval of six frames, except near the first or the last frame.
                first = min(max(frame + 1 - FINE // 2, 0), n - FINE)
                if first != divided_from:
                    # All events of a pixel between two frames have the same divided differences.
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
                    # A step exceeds C + 1/2 by half of the change of the signal in a tick, and by rounding. The excess
                    # of all steps of the pixel so far is subtracted from the level. The rounding of this event itself
                    # follows its level, and is added back.
                    step, uniform_step = max(0.0, sign * slope) * tick_s, max(0.0, sign * uniform_slope) * tick_s
                    rounding, uniform_rounding = _rounded_up(step), _rounded_up(uniform_step)
                    excess += sign * (0.5 * step + rounding)
                    uniform_excess += sign * (0.5 * uniform_step + uniform_rounding)
                pixels[rows] = pixel
                samples[rows, SECONDS], samples[rows, ON], samples[rows, OFF] = time_s, on, off
                samples[rows, LEVEL], samples[rows, SLOPE] = level - excess + sign * rounding, slope
                samples[rows, COARSER], samples[rows, SIGN] = coarse - level, sign
                samples[rows, UNIFORM] = uniform_level - uniform_excess + sign * uniform_rounding
                # Distance of the parabolas: L[t0, t1, t2, t3] (t3 - t0) (t - t1) (t - t2).
                ends = seconds[inner + 3] - seconds[inner]
                inside = (time_s - seconds[inner + 1]) * (time_s - seconds[inner + 2])
                samples[rows, CORNER] = divided[3, inner - first] * ends * inside
                rows += 1
    return rows


@njit(cache=True)
def _gather(image: NDArray[np.floating], chosen: Int64, count: int, log_eps: float, levels: Float64) -> None:
    """Write the levels of a row of an image at the first ``count`` chosen pixels."""
    # Loads and logarithms in separate loops: otherwise each logarithm waits for its load.
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
    """Compute the weights of samples, and subtract from each sample the weighted mean of its pixel.

    The weight is 1 / (1 + (e / error)^2). The square of e is the sum of three squares: the level through four frames
    less that through six, the corner, and ``by_place`` times the difference of the two reconstructions less the mean of
    this difference over the pixel.

    Parameters
    ----------
    pixels
        (m,) pixels of the samples, equal ones in succession. Those of the samples that are kept are moved to the front.
    samples
        (m, 9) columns ``SECONDS`` to ``CORNER``. The column ``SECONDS`` is moved as ``pixels``.
    kept
        (m,) samples that count; pixels with fewer than two of them are left out.
    leak_rate_hz
        Rate of brighter events of a pixel that are not due to light, 1/s.
    by_place
        Bound on the error of the edge-aware reconstruction, as a share of its difference from the uniform one.
    error
        Error at which a sample has half the weight, in the unit of the levels.
    centred
        (m, 8) receives P, -M, L', |L'|, the level, the level through four frames and that of the uniform
        reconstruction, each less its weighted mean, and the weight.

    Returns
    -------
    int
        Number of samples that are kept.
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
                # weight = error^2 / (error^2 + e^2): inverse variance with and without e.
                weight = 1.0 / (1.0 + errors / error**2)
                # Leak causes brighter events without a change of light: P - rate * time.
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
    """Write Newton's divided differences of six successive levels.

    Parameters
    ----------
    levels
        (n,) levels of a pixel at all frames.
    first
        The first of the six frames.
    inverses
        (6, 6) inverse distances of their times, 1/s, from ``inverse_distances``.
    divided
        (6, 6) receives the differences: [order, j] is that of the frames j to j + order, counted from ``first``, in
        units of the level / s^order.
    """
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
    """Return value and slope of the polynomial through successive frames.

    Parameters
    ----------
    divided
        (6, 6) divided differences, from ``divide``.
    column
        Column of the first frame of the polynomial in ``divided``.
    seconds
        (n,) times of all frames, s.
    first
        The first frame of the polynomial.
    points
        Number of frames of the polynomial, at most 6 - ``column``.
    time_s
        Time at which it is evaluated, s.

    Returns
    -------
    tuple[float, float]
        Value, in the unit of the levels, and slope, in this unit / s.
    """
    # Horner's rule for Newton's form and its derivative: v = v (t - t_k) + d_k, v' = v' (t - t_k) + v.
    value, slope = divided[points - 1, column], 0.0
    for order in range(points - 2, -1, -1):
        since = time_s - seconds[first + order]
        slope = slope * since + value
        value = value * since + divided[order, column]
    return value, slope


@njit(cache=True)
def _rounded_up(step: float) -> float:
    """Return the mean amount by which rounding to whole values raises a value that has passed a half by U step.

    With U uniform from 0 to 1 this is the mean of 1/2 - frac(U step).
    """
    if step < 1e-9:
        return 0.5
    # Integral of frac(x) from 0 to step: (whole + rest^2) / 2; the mean is this over the step.
    whole = float(np.floor(step))
    return 0.5 - (whole + (step - whole) ** 2) / (2.0 * step)
