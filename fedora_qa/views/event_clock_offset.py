"""The clock offset of the events against the frames: over a file, over segments of time, over parts of the image.

There are two estimates: from frames interpolated at events (``frame_interpolation``), and from bracketed level samples
(``level_samples``). Beyond its capture range one fit underestimates an offset, since intensity is not linear in time
for long. Some windows are then fitted again after subtraction of the estimated offset, until the fit gives no further
offset (Gauss-Newton). This iteration starts at the fit of all windows, and at the best of a ladder of offsets by level
samples; where both converge to different offsets, the one with the smaller residual is taken. The same offset is
subtracted in further windows, and all are fitted together, so that the error includes their scatter.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, isfinite, pi
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US
from fedora_qa.estimators.events.delays import (
    CellSums,
    DelayStep,
    delays,
    delays_of_parts,
    largest_rectangle_step,
    largest_segment_step,
)
from fedora_qa.estimators.events.footprint import LEFT_BY_SHARP
from fedora_qa.estimators.events.frame_interpolation import (
    FINE,
    InterpolationMethod,
    interpolate_frames,
    interpolation_blocks,
    interpolation_weights,
)
from fedora_qa.estimators.events.pixels import PixelEvents
from fedora_qa.estimators.events.threshold_fit import NormalBlocks, ResponseFit, concatenate, fit_interpolation
from fedora_qa.features import Feature
from fedora_qa.sequence.declared import EventModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.event_camera import resampled_frames
from fedora_qa.views.level_samples import (
    CAPTURE_RANGE_S,
    FARTHEST_OFFSET_NS,
    FEWEST_PAIRS,
    HELD_LEVEL_BIAS,
    LadderOffset,
    ThresholdFit,
    search_offset,
    usable_pixels,
)
from fedora_qa.views.sensor_events import GRID, corrected_events, local_tick_ns, pixel_events, sorted_by_pixel, tick_ns

Float64 = NDArray[np.float64]

METHODS: Final = ("fine", "coarse", "uniform")

INTERPOLATION_CAPTURE_RANGE_S: Final = 10e-3
"""Half a frame interval at 50 Hz, s: where levels can be interpolated between frames, their slope changes little in
that time."""

INTERPOLABLE: Final = 0.3
"""Residual, in thresholds, beyond which the frames do not determine the level between them, or events do not follow the
frames. A random level within its thresholds leaves a residual of 0.3 to 0.6."""

FEWEST_PARTS: Final = 4
"""Least number of windows or tiles with an estimated delay for a comparison of them."""

ROUNDS: Final = 5
"""Fits of a window. Each leaves at most a third of the offset that the last one left, so 20 ms become 0.2 ms."""

_CONVERGED_S: Final = 3e-3
"""Largest offset that a last fit may give, s: one fit of level samples estimates up to this offset without bias."""

_PREFERRED_WITHIN: Final = 2.0
"""Largest ratio of the error of the search, in a few windows, to that of one fit of all windows at which the search is
stated."""


@dataclass(frozen=True, slots=True)
class InterpolationSums:
    """Normal equations of a window's interpolated levels, a block for each tile.

    Attributes
    ----------
    fine
        From the edge-aware reconstruction of frames, interpolated through six frames.
    coarse
        As ``fine``, interpolated through four frames.
    uniform
        From the uniform reconstruction, interpolated through six frames.
    start_ns, stop_ns
        Ends of the window, ns from the file's origin.
    """

    fine: NormalBlocks
    coarse: NormalBlocks
    uniform: NormalBlocks
    start_ns: int
    stop_ns: int


@dataclass(frozen=True, slots=True)
class InterpolationFits:
    """The fit of a file by its interpolated levels, and the fits by the methods that bound its error.

    Attributes
    ----------
    fit
        From the edge-aware reconstruction, interpolated through six frames.
    coarse
        As ``fit``, interpolated through four frames.
    uniform
        From the uniform reconstruction, interpolated through six frames.
    """

    fit: ResponseFit
    coarse: ResponseFit
    uniform: ResponseFit


@dataclass(frozen=True, slots=True)
class ClockOffset(Feature):
    """Clock offset of the events at the middle of a file, and its growth; standard errors and bounds on bias.

    Beyond ``capture_range_s`` the fit underestimates the offset.

    Attributes
    ----------
    offset_s, error_s, bound_s
        Clock offset (positive: timestamps of events too late), its standard error, and a bound on its bias, s.
    rate, rate_error, rate_bound
        Growth of the offset with its standard error and bound on bias, s/s.
    capture_range_s
        Largest offset that the fit estimates without bias, s; infinite where the offset was found by a search.
    """

    offset_s: float
    error_s: float
    bound_s: float
    rate: float
    rate_error: float
    rate_bound: float
    capture_range_s: float


@dataclass(frozen=True, slots=True)
class LocalOffset:
    """A part whose delay differs from the rest, with the delays of all parts.

    Attributes
    ----------
    step
        The part, and the difference of its delay.
    delays_s, errors_s
        (k,) delays and standard errors by window or by tile, s; NaN where no delay is estimated.
    """

    step: DelayStep
    delays_s: Float64
    errors_s: Float64


@dataclass(frozen=True, slots=True)
class OffsetTrial:
    """Sums of a window after subtraction of a clock offset from the timestamps of its events.

    Attributes
    ----------
    offset_ns
        The subtracted offset, ns; positive where timestamps of events are too late.
    sums
        Normal equations of the corrected events.
    """

    offset_ns: int
    sums: InterpolationSums


OffsetSearch = LadderOffset | OffsetTrial
"""Result of the search in a window."""


def interpolation_sums(window: Window) -> InterpolationSums | None:
    """Return the normal equations of a window; None where frames can be interpolated at too few events."""
    return _sums_of(window, pixel_events(window))


def fit_all(state: Sequence[InterpolationSums]) -> InterpolationFits | None:
    """Fit a file; None where it has too few samples.

    Errors of the frames may be common to a window, to a tile throughout, or to a row or column of a window's tiles,
    along which a straight edge lies. The standard errors are the largest of four jackknives that leave out one such
    group at a time.
    """
    if not state:
        return None
    present = np.concatenate([sums.fine.counts > 0 for sums in state])
    # Blocks are numbered window by window, GRID^2 tiles each, rows first.
    windows, tiles = np.divmod(np.flatnonzero(present), GRID**2)
    rows, columns = windows * GRID + tiles // GRID, windows * GRID + tiles % GRID
    groups = windows, tiles, rows, columns
    fits = [
        fit_interpolation(concatenate([getattr(sums, method) for sums in state]), groups=groups) for method in METHODS
    ]
    fitted = [fit for fit in fits if fit is not None]
    return InterpolationFits(*fitted) if len(fitted) == len(METHODS) else None


def expected_delay_ms(declared: EventModel | None, facts: Facts) -> tuple[float, float]:
    """Return the mean delay of events of a correct file, and the error of that expectation.

    Parameters
    ----------
    declared
        The event sensor; None where none is declared.
    facts
        With the tick of the event timestamps.

    Returns
    -------
    delay_ms
        Mean time from a change of light to the timestamp of its event, ms.
    error_ms
        Bound of its error, ms: 0 where the tick is declared.
    """
    if declared is None:
        return 0.0, 0.0
    # A first-order low-pass of cut-off f (Hz) delays slow changes by its time constant 1 / (2 pi f).
    low_pass_ms = 1e3 / (2 * pi * declared.bandwidth_hz) if declared.bandwidth_hz > 0 else 0.0
    tick_ms = tick_ns(facts) / 1e6
    if declared.model == "linear":
        return low_pass_ms, 0.0
    declared_ms = max(declared.packet_interval_us, 1) * NS_PER_US / 1e6
    # An undeclared grid may come from rounding up, down or to the nearest tick.
    return declared_ms / 2 + low_pass_ms, max(tick_ms - declared_ms, 0.0)


def offset_error_ms(estimate: ClockOffset, offset_ms: float, bound_ms: float, facts: Facts) -> float:
    """Return the error of a clock offset: standard error, bound on bias, and underestimation beyond the capture range.

    Let an intensity change have the angular frequency w. A linear fit of such a change that is displaced by d gives
    sin(w d) / w in place of d. Frames at intervals of h resolve changes up to w = pi / h; half of that is assumed for
    edges. An offset that was found by a search is subtracted before the fit, so the fit does not underestimate it.

    Parameters
    ----------
    estimate
        With the standard error and the capture range.
    offset_ms
        The offset, or its difference from that of a correct file, ms.
    bound_ms
        Bound on its bias, ms.
    facts
        With the interval between colour frames.

    Returns
    -------
    float
        Root of the sum of squares of the three errors, ms.
    """
    interval_ms = float(np.median(np.diff(facts.clocks["rgb"].times_ns))) / 1e6
    fraction = 1.0
    if isfinite(estimate.capture_range_s):
        # sin(w d) / (w d) at w = pi / (2 h), with np.sinc(x) = sin(pi x) / (pi x)
        fraction = max(float(np.sinc(0.5 * offset_ms / max(interval_ms, 1e-6))), 0.0)
    return hypot(1e3 * estimate.error_s, bound_ms, offset_ms * (1.0 - fraction))


def offset_by_levels(fitted: ThresholdFit, declared: EventModel) -> ClockOffset:
    """Return the clock offset from bracketed level samples.

    With the linear model, levels jump at events and hold until the next event. Where edges pass within a few rendered
    steps, this causes errors that scatter about the fit and may have a common part of up to ``HELD_LEVEL_BIAS`` times
    their scatter.

    Parameters
    ----------
    fitted
        Thresholds and delay of the file.
    declared
        The model, ``log`` or ``linear``.

    Returns
    -------
    ClockOffset
        Capture range ``CAPTURE_RANGE_S``.
    """
    fit, bounds = fitted.fit, fitted.model_errors
    held_s = HELD_LEVEL_BIAS * fit.coherent_delay_s if declared.model == "linear" else 0.0
    errors = fit.standard_errors
    return ClockOffset(
        fit.delay_s,
        errors.delay_s,
        bounds.delay_s + held_s,
        fit.delay_rate,
        errors.delay_rate,
        bounds.delay_rate,
        CAPTURE_RANGE_S,
    )


def offset_by_interpolation(fits: InterpolationFits) -> ClockOffset | None:
    """Return the clock offset from frames interpolated at events; None where events do not follow the frames."""
    fit, coarse, uniform = fits.fit, fits.coarse, fits.uniform
    if fit.relative_sigma > INTERPOLABLE or min(fit.threshold_on, fit.threshold_off) <= 0:
        return None

    def bound(name: str) -> float:
        """Return the change of an estimate by four frames in place of six, plus that by the uniform reconstruction."""
        own = getattr(fit, name)
        return float(abs(own - getattr(coarse, name)) + LEFT_BY_SHARP * abs(own - getattr(uniform, name)))

    errors = fit.standard_errors
    return ClockOffset(
        fit.delay_s,
        errors.delay_s,
        bound("delay_s"),
        fit.delay_rate,
        errors.delay_rate,
        bound("delay_rate"),
        INTERPOLATION_CAPTURE_RANGE_S,
    )


def segment_offset(state: Sequence[InterpolationSums]) -> LocalOffset | None:
    """Return the segment of windows whose delay differs most; None where too few windows have a delay."""
    return _local_offset(state, 1)


def region_offset(state: Sequence[InterpolationSums]) -> LocalOffset | None:
    """Return the rectangle of tiles whose delay differs most; None where too few tiles have a delay."""
    return _local_offset(state, 0)


def search_window(window: Window, start_s: float | None, searched: Sequence[OffsetSearch]) -> OffsetSearch | None:
    """Search the clock offset of a window's events; None where the events follow the frames at no offset.

    Parameters
    ----------
    start_s
        Offset by one fit of all windows, s; None where the fit gave none.
    searched
        Results of the search in other windows.

    Returns
    -------
    OffsetSearch or None
        The window's sums with the offset subtracted; the offset alone where no fit converges; None where no offset is
        found.
    """
    trials = [search.offset_ns for search in searched if isinstance(search, OffsetTrial)]
    # Sums can be fitted together only if the same offset is undone in all of them.
    if trials:
        return _trial(window, trials[0])
    by_ladder = search_offset(window)
    starts_s = [start for start in (start_s, None if by_ladder is None else by_ladder.offset_s) if start is not None]
    # Gauss-Newton from each start, ROUNDS times. It has converged if the last fit gives almost no further offset.
    converged: list[tuple[OffsetTrial, float]] = []
    for offset_s in starts_s:
        estimate_s = offset_s
        last: tuple[OffsetTrial, float] | None = None
        for _ in range(ROUNDS):
            offset_ns = round(estimate_s * 1e9)
            trial = _trial(window, offset_ns) if abs(offset_ns) <= FARTHEST_OFFSET_NS else None
            fits = fit_all([trial.sums]) if trial is not None else None
            residual = offset_by_interpolation(fits) if fits is not None else None
            if trial is None or fits is None or residual is None:
                last = None
                break
            estimate_s += residual.offset_s
            last = (trial, fits.fit.relative_sigma) if abs(residual.offset_s) <= _CONVERGED_S else None
        if last is not None:
            converged.append(last)
    return min(converged, key=lambda ending: ending[1])[0] if converged else by_ladder


def searched_offset(searched: Sequence[OffsetSearch]) -> ClockOffset | None:
    """Return the clock offset of all events from a fit of all trials, or else the mean of the offsets of the ladder."""
    trials = [search for search in searched if isinstance(search, OffsetTrial)]
    fits = fit_all([trial.sums for trial in trials])
    residual = offset_by_interpolation(fits) if fits is not None else None
    if residual is not None and abs(residual.offset_s) > _CONVERGED_S:
        return None  # the other windows have another offset than the first one
    if residual is not None:
        offset_s = 1e-9 * trials[0].offset_ns + residual.offset_s
        return ClockOffset(offset_s, residual.error_s, residual.bound_s, 0.0, np.inf, np.inf, np.inf)
    ladder = [search for search in searched if isinstance(search, LadderOffset)]
    if not ladder:
        return None
    each_s = np.array([offset.offset_s for offset in ladder])
    # Half the range covers the scatter between a few windows, which the formal errors do not include.
    error_s = max(float(np.ptp(each_s)) / 2, *(offset.standard_error_s for offset in ladder))
    bound_s = max(offset.bound_s for offset in ladder)
    return ClockOffset(float(each_s.mean()), error_s, bound_s, 0.0, np.inf, np.inf, np.inf)


def search_is_preferred(searched: ClockOffset, fitted: ClockOffset, facts: Facts) -> bool:
    """Whether the clock offset by search is stated in place of that by one fit of all windows.

    The search is preferred where its error is below ``_PREFERRED_WITHIN`` times that of the fit: the fit underestimates
    the offset where light changes from frame to frame, by more than its error states.

    Parameters
    ----------
    searched, fitted
        Clock offset by search, and clock offset by one fit of all windows.
    facts
        With the interval between colour frames.
    """
    fitted_ms = offset_error_ms(fitted, 1e3 * fitted.offset_s, 1e3 * fitted.bound_s, facts)
    return offset_error_ms(searched, 1e3 * searched.offset_s, 1e3 * searched.bound_s, facts) < (
        _PREFERRED_WITHIN * fitted_ms
    )


def _sums_of(window: Window, events: PixelEvents) -> InterpolationSums | None:
    frames, declared = resampled_frames(window), window.facts.declared.events
    if declared is None or len(frames) < FINE:
        return None
    usable = usable_pixels(window, frames, declared)
    linear = declared.model == "linear"
    levels = interpolate_frames(
        events,
        frames.times_ns,
        frames.edge_aware_dn,
        frames.uniform_dn,
        usable,
        log_eps_dn=None if linear else declared.log_eps_dn,
        threshold=min(declared.threshold_on, declared.threshold_off),
        tick_s=local_tick_ns(window) * 1e-9 if linear else 0.0,
        leak_rate_hz=declared.leak_rate_hz,
    )
    if levels is None or len(levels) < FEWEST_PAIRS:
        return None
    weights, (height, width) = interpolation_weights(levels), usable.shape[1:]
    rows, columns = np.divmod(levels.pixels, width)
    tiles: NDArray[np.intp] = GRID * (GRID * rows // height) + GRID * columns // width

    def blocks(method: InterpolationMethod) -> NormalBlocks:
        return interpolation_blocks(levels, weights, tiles, GRID**2, method=method)

    return InterpolationSums(
        blocks("fine"), blocks("coarse"), blocks("uniform"), window.span.start_ns, window.span.stop_ns
    )


def _local_offset(state: Sequence[InterpolationSums], summed: int) -> LocalOffset | None:
    """Fit each window (``summed`` = 1) or each tile (0), and return the part whose delay differs most."""
    fits = fit_all(state)
    if fits is None:
        return None
    # Sums of windows by tiles, of C+, C- and delay. Kappa is the file's, as a cell may hold one edge only. The normal
    # equations of levels less kappa |L'|: with y' = y - kappa z, X'y' = X'y - kappa X'z, and
    # y'y' = yy - 2 kappa yz + kappa^2 zz.
    kappas_s = fits.fit.kappa_s, fits.coarse.kappa_s, fits.uniform.kappa_s
    cell_sums = []
    for method, kappa_s in zip(METHODS, kappas_s, strict=True):
        cells = []
        for sums in state:
            blocks: NormalBlocks = getattr(sums, method)
            sizes = blocks.matrices[:, :, 3]
            vectors = blocks.vectors[:, :3] - kappa_s * sizes[:, :3]
            squares = blocks.squares - 2 * kappa_s * blocks.vectors[:, 3] + kappa_s**2 * sizes[:, 3]
            cells.append((blocks.matrices[:, :3, :3], vectors, squares, blocks.weights, blocks.counts))
        cell_sums.append(CellSums(*(np.stack(arrays) for arrays in zip(*cells, strict=True))))
    fine, coarse, uniform = cell_sums
    parts = delays_of_parts(fine, summed)
    values = np.where(parts.follows_frames & (parts.relative_sigmas <= INTERPOLABLE), parts.seconds, np.nan)
    # The bias that the other methods bound for a whole file differs from part to part: in their comparison it is noise.
    by_time = values - delays(coarse.over(summed)).seconds
    by_place = LEFT_BY_SHARP * (values - delays(uniform.over(summed)).seconds)
    # Standard error and both differences of methods add in squares, as both differences scatter from part to part.
    errors = np.sqrt(parts.errors_s**2 + by_time**2 + by_place**2)
    if np.count_nonzero(np.isfinite(values) & np.isfinite(errors)) < FEWEST_PARTS:
        return None
    windows = len(state) - 1.0
    step = (
        largest_segment_step(values, errors)
        if summed == 1
        else largest_rectangle_step(values, errors, (GRID, GRID), windows)
    )
    return LocalOffset(step, values, errors) if step is not None else None


def _trial(window: Window, offset_ns: int) -> OffsetTrial | None:
    """Return the sums of a window after subtraction of a clock offset from the timestamps of its events."""
    sums = _sums_of(window, sorted_by_pixel(corrected_events(window, offset_ns), window.facts.declared))
    return None if sums is None else OffsetTrial(offset_ns, sums)
