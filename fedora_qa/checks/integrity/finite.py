"""Values that are not finite: NaN, infinity, and the codes of invalid pixels."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import hypot
from typing import Final

import numpy as np

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.flow_rate_deviations import with_flow_rate_deviations
from fedora_qa.checks.protocol import Notice, Observation, Statistic, WindowCheck
from fedora_qa.conventions import MM_PER_M
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.images.values import DatasetCounts, add_up, tally_depth, tally_flow, tally_samples
from fedora_qa.features import Feature
from fedora_qa.layout.canonical import DatasetSpec, datasets_of_all, spec_of
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts, has_place
from fedora_qa.sequence.window import Window

_FULL: Final = 0.5
"""Ratio of valid pixels above which a neighbouring frame cannot be empty: half of a 60 degree view would have to leave
it, and return, within an interval of frames."""


BESIDE_RANGE: Final = 2.0
"""Largest ratio of a depth beside the range to its end: a larger scale is another unit. The value is not derived."""

FALSE_ALARMS: Final = 1e-6
"""Probability that a correct file exceeds the bound of displacements: a hundredth of the default false-alarm rate of a
file."""


@dataclass(frozen=True, slots=True)
class OutOfRange(Feature):
    """Depth values that no correct file holds.

    Attributes
    ----------
    finite
        Number of finite values.
    outside
        Number of values out of range.
    in_range_times_1000
        Number of values out of range that lie in the range after multiplication by 1000.
    constant
        Whether all values out of range are one number.
    rescaled_rows
        First row, and the one behind the last, of the images of which most values lie in the range only after
        multiplication by 1000; None where there is no such image, or where others lie between.
    continue_range
        Whether the values differ and lie beside an end of the range, within a factor of two: as depths do that are
        too large or too small, and codes do not.
    """

    finite: int
    outside: int
    in_range_times_1000: int
    constant: bool
    rescaled_rows: tuple[int, int] | None = None
    continue_range: bool = False


class IntegrityFinite(WindowCheck[tuple[DatasetCounts, ...]]):
    """Are all values finite where they must be, and invalid pixels NaN?

    For each dataset, the number of values that no correct file holds, and the number of images without any value
    between images that are mostly valid.

    Why it matters
    --------------
    One NaN makes every later value of an integral over IMU samples NaN. A zero that stands for "no depth" is a surface
    at the camera, and biases every mean towards zero.

    How
    ---
    IMU and pose samples must be finite. Timestamps must be finite, less than 73 years from the file's origin, and,
    where only one or two in a row are, no farther from the others of their stream than 100 times as long as these last.
    Depth must be NaN, or finite and within ``depth_range`` (above zero where no range is declared). Flow must be NaN,
    or a displacement that a surface in view can have. Neither depth nor flow may be infinite. Images that are NaN
    throughout are counted where the images before and after are more than half valid: within one interval of frames,
    half of a 60 degree view would have to leave the range and return. Where depth values outside the range fall into it
    after multiplication by 1000, the suspected unit is metres. Where all of them are one number, the suspected cause is
    a code for invalid pixels.

    Noise model
    -----------
    None: counts are exact for the decoded rows. Depth may exceed its range by half the step in which it is stored, and
    by the float32 rounding of the stored value and of the range, 2^-24 relative each, with a margin of a factor of 4.
    The flow of a point that ends beside the camera is proportional to 1/Z and has no upper bound. With probability
    1 - 1e-6, all K fields of W x H pixels with diagonal D stay below 1e6 K (W + H) D^2 px.

    Cannot detect
    -------------
    Wrong values that are finite and in range. Flow below the bound (1e11 px for a file with images of 1000 pixels, 1e17
    px for seconds at 1440 x 1080). Whether NaN lie at the correct pixels (``flow_geometry.validity``). A stream whose
    decoded images are all empty gives a notice and no finding, because a camera may have no surface within 30 m.

    Sources
    -------
    The canonical layout, version 1.0; IEEE 754-2019 for the rounding.
    """

    name = "integrity.finite"
    looks_at = ("depth",)

    def measure(self, window: Window) -> tuple[DatasetCounts, ...]:
        """Count the values of every float dataset of the window."""
        facts = window.facts
        tallies: list[DatasetCounts] = []
        for spec in _float_datasets(facts):
            key = spec.key
            owned = window.owned(spec.stream)
            # Image by image, so that a damaged chunk costs one image.
            blocks = [(row, row + 1) for row in owned] if spec.is_image else [(owned.start, owned.stop)]
            for start, stop in blocks:
                # What does not decode is a finding of integrity.readable.
                with suppress(UnreadableRowsError):
                    rows = window.rows(key, start, stop)
                    if not spec.is_image:
                        tallies.append(tally_samples(key, start, rows))
                    elif key == "path/depth":
                        tallies.append(tally_depth(key, start, rows[0], _stored_range_m(facts)))
                    else:
                        tallies.append(tally_flow(key, start, rows[0], _longest_px(facts, key)))
        return add_up(tallies)

    def conclude(self, state: Sequence[tuple[DatasetCounts, ...]], facts: Facts) -> Observation:
        """Add the counts of all windows, in the order of time."""
        totals = add_up(tally for window in state for tally in window)
        statistics = [m for total in totals for m in _statistics(total, facts)]
        for stream in sorted(facts.clocks):
            clock = facts.clocks[stream]
            bad = ~has_place(clock.times_ns)
            if clock.ends_ns is not None:
                bad = bad | ~has_place(clock.ends_ns)
            statistics.append(_unplaced(stream, int(np.count_nonzero(bad)), int(np.argmax(bad)) if len(bad) else -1))
        if facts.events is not None:
            statistics.append(_unplaced("events", facts.events.unplaced, facts.events.first_unplaced))
        looked_at = sum(total.values for total in totals)
        # The values of all streams that are there, decoded or not.
        stored = 0
        for spec in _float_datasets(facts):
            binding = facts.layout.bindings[spec.key]
            stored += binding.rows * (binding.shape[1] * binding.shape[2] if spec.is_image else 1)
        void = [spec_of(total.key).stream for total in totals if total.filled and total.nan == total.values]
        return Observation(
            Coverage(looked_at, max(looked_at, stored), "values"),
            with_flow_rate_deviations(statistics, set(facts.flow_streams)),
            tuple(
                Notice("integrity.finite.void", f"{stream} holds no valid pixel at all", Where(stream=stream))
                for stream in void
            ),
            unobservable="" if statistics else "no stream has floating-point values",
        )


def _float_datasets(facts: Facts) -> list[DatasetSpec]:
    """Return the datasets of the file's streams whose values may be other than finite."""
    return [spec for spec in datasets_of_all(facts.streams) if spec.dtype.startswith("float")]


def _stored_range_m(facts: Facts) -> tuple[float, float] | None:
    """Return the declared range of depth, wider by the rounding to the step in which depth is stored; m."""
    range_m, step = facts.declared.depth_range_m, facts.steps.get("path/depth")
    if range_m is None or step is None:
        return range_m
    low_mm, high_mm = (MM_PER_M * bound_m for bound_m in range_m)
    low_error_mm, high_error_mm = step.error_bounds([low_mm, high_mm])
    # A zero stands for an invalid pixel, however coarse the step.
    nearest_mm = max(low_mm - low_error_mm, float(np.finfo(np.float32).smallest_subnormal))
    return nearest_mm / MM_PER_M, float(high_mm + high_error_mm) / MM_PER_M


def longest_displacement_px(intervals: int, height: int, width: int) -> float:
    """Return the displacement that one correct file in a million exceeds, px.

    A point that ends at depth Z beside the camera is displaced by f R / Z, where R is its distance from the optical
    axis; the layout holds its flow until Z reaches zero. So no length is impossible, and a bound needs a false-alarm
    rate.

    A surface that meets the plane Z = 0 meets it along a curve, which takes W + H pixels of an image at most, about.
    From one pixel to the next across the curve Z changes by some g, and the pixel nearest to the curve has a Z that is
    uniform between 0 and g: it is displaced by more than B with probability f R / (g B). A wall along the optical axis,
    r px from the middle, has Z = f R / r, so g = Z / r and f R / g = r^2; one that leans towards the camera by a
    slope t has f R / g = r^2 + r f t. Slopes of surfaces in all directions exceed t with probability 1 / t, so that up
    to 100, beyond which the camera flies into the surface, their mean is ln 100. Over an image of diagonal D, with
    r^2 = D^2 / 12 and r = 0.28 D on average and f = 0.69 D (60 degrees of view), that is 0.97 D^2 px; D^2 is taken.

    Parameters
    ----------
    intervals
        Number of fields of the rate. Each is counted with a curve through the whole image.
    height, width
        Of a field, px.

    Returns
    -------
    float
        Px, with a probability of ``FALSE_ALARMS`` that a correct file exceeds it.
    """
    # K (W + H) D^2 / B is the chance that any pixel of the file is displaced by more than B.
    return intervals * (height + width) * hypot(height, width) ** 2 / FALSE_ALARMS


def empty_between_full(filled: Sequence[tuple[int, float]]) -> list[int]:
    """Return the rows of images without a value whose neighbours are mostly valid.

    A run of empty images counts when it is bounded by full ones on both sides, or on one side and by the end of the
    stream on the other. Rows that were not read bound nothing.

    Parameters
    ----------
    filled
        Row, and ratio of valid pixels, of each image that was read, in any order.

    Returns
    -------
    list[int]
        Rows in ascending order.
    """
    valid_ratio = dict(filled)
    empty: list[int] = []
    run: list[int] = []
    last = max(valid_ratio, default=-1)
    for row in sorted(valid_ratio):
        if valid_ratio[row] > 0.0:
            run = []
            continue
        run = [*run, row] if run and run[-1] == row - 1 else [row]
        # The last row of a run decides for the run.
        if row + 1 in valid_ratio and valid_ratio[row + 1] == 0.0:
            continue
        # A row that was not read counts as empty; an end of the stream counts as full.
        before = valid_ratio.get(run[0] - 1, 1.0 if run[0] == 0 else 0.0)
        after = valid_ratio.get(row + 1, 1.0 if row == last else 0.0)
        # A stream that is empty throughout gives a notice, and is no run between full images.
        whole = run[0] == 0 and row == last
        if before > _FULL and after > _FULL and not whole:
            empty.extend(run)
    return empty


def run_of(rows: Sequence[int]) -> tuple[int, int] | None:
    """Return the first of some rows and the one behind the last; None without any, or where some between are absent.

    Parameters
    ----------
    rows
        In any order, each once.
    """
    if not rows or max(rows) - min(rows) + 1 != len(rows):
        return None
    return min(rows), max(rows) + 1


def _unplaced(stream: str, count: int, first: int) -> Statistic:
    noun, verb = ("timestamp", "is") if count == 1 else ("timestamps", "are")
    text = f"{count} {noun} of {stream} {verb} NaN or far from all others: such samples have no valid time"
    where = Where(stream=stream, index_start=first if count else None)
    return _count(f"{stream}.stamps_not_finite", count, "samples", text, where)


def _longest_px(facts: Facts, key: str) -> float:
    intervals, height, width, *_ = facts.layout.bindings[key].shape
    return longest_displacement_px(intervals, height, width)


def _statistics(total: DatasetCounts, facts: Facts) -> Iterator[Statistic]:
    spec = spec_of(total.key)
    stream, where = spec.stream, Where(stream=spec.stream)
    # The first value that is counted; row -1 where there is none.
    row, flat = total.first
    if row >= 0:
        where = Where(stream, _file_us(facts, stream, row), index_start=row)
        if spec.is_image:
            width = facts.layout.bindings[total.key].shape[2]
            where = replace(where, frame=row, pixel=(flat % width, flat // width))
    if not spec.is_image:
        name = total.key.removeprefix("path/")
        text = f"{total.nan} of {total.values} samples of {name} are not finite; an integral over them is NaN"
        yield _count(f"{name}.not_finite", total.nan, "samples", text, where)
        return
    text = f"{total.infinite} pixels of {stream} are infinite; a pixel without a value must be NaN"
    yield _count(f"{stream}.infinite", total.infinite, "pixels", text, where)
    features: tuple[Feature, ...] = ()
    if total.key == "path/depth":
        range_m = facts.declared.depth_range_m
        expected = f"{range_m[0]:g} to {range_m[1]:g} m" if range_m else "above zero"
        text = (
            f"{total.outside} of {total.values} depth pixels lie between {total.low / MM_PER_M:.6g} and "
            f"{total.high / MM_PER_M:.6g} m; expected {expected}, or NaN"
        )
        finite = total.values - total.nan - total.infinite
        is_constant, run = total.low == total.high, run_of(total.rescaled_rows)
        beside = range_m is not None and (
            range_m[0] / BESIDE_RANGE <= total.low / MM_PER_M and total.high / MM_PER_M <= BESIDE_RANGE * range_m[1]
        )
        features = (OutOfRange(finite, total.outside, total.rescaled, is_constant, run, beside and not is_constant),)
    else:
        text = (
            f"{total.outside} of {total.values} pixels of {stream} are displaced by {total.low:.3g} to "
            f"{total.high:.3g} px; flow of surfaces in view stays below {_longest_px(facts, total.key):.3g} px"
        )
    yield _count(f"{stream}.outside_range", total.outside, "pixels", text, where, *features)
    rows = empty_between_full(total.filled)
    text = f"{len(rows)} images of {stream} are NaN throughout between images that are mostly valid"
    where = Where(stream=stream)
    if rows:
        text += f", first number {rows[0]}"
        start_us = _file_us(facts, stream, rows[0])
        where = Where(stream, start_us, index_start=rows[0], index_stop=rows[-1] + 1, frame=rows[0])
    yield _count(f"{stream}.empty_images", len(rows), "samples", text, where)


def _count(name: str, value: int, unit: str, statement: str, where: Where, *features: Feature) -> Statistic:
    return count_of_faults(
        name,
        value,
        unit,
        statement=statement,
        code=f"integrity.finite.{name.rsplit('.', 1)[1]}",
        where=where,
        severity="critical",
        features=features,
    )


def _file_us(facts: Facts, stream: str, row: int) -> float | None:
    time_ns = facts.clocks[stream].times_ns[row]
    return facts.to_file_us(int(time_ns)) if has_place(time_ns) else None
