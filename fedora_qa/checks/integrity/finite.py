"""Values that are no numbers, or stand for none: NaN and infinity, and how invalid pixels are marked."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.families import over_all_rates
from fedora_qa.checks.integrity.flow_bound import longest_displacement_px
from fedora_qa.checks.protocol import Notice, Observation, Statistic, Suspect, WindowCheck
from fedora_qa.conventions import MM_PER_M
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.images.value_tallies import Tally, add_up, tally_depth, tally_flow, tally_samples
from fedora_qa.layout.binding import INVALID_TIMESTAMP_NS
from fedora_qa.layout.canonical import DATASETS, STREAMS
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

_FLOAT_KEYS: Final = tuple(
    key for key, spec in DATASETS.items() if spec.dtype.startswith("float") and spec.stream in STREAMS
)
_MOST: Final = 0.9
"""Share of the values that a wrong unit must explain to be suspected: it befalls all of them, edge cases aside."""

_FULL: Final = 0.5
"""Share of valid pixels beyond which a neighbouring frame cannot be empty: half of a 60 degree view would have to
leave it, and come back, within an interval of frames."""


class IntegrityFinite(WindowCheck[tuple[Tally, ...]]):
    """Are all values finite where they must be, and invalid pixels NaN?

    The values that no honest file holds, counted for each dataset, and the images that hold nothing among full ones.

    Why it matters
    --------------
    One NaN ends an integral over IMU samples; a zero that stands for "no depth" is a surface at the camera, and pulls
    every mean towards it.

    How
    ---
    Samples of IMU and pose must be finite, stamps too. Depth is finite and within ``depth_range`` (above zero where
    none is declared) or NaN; flow is NaN or a displacement that a surface in view can have; neither is ever infinite.
    Images that are NaN throughout although
    those before and after are mostly valid are counted: half of a 60 degree view would have to leave it, and come
    back, within an interval. When depth outside the range falls into it once multiplied by 1000, metres are
    suspected; when it is all one number, a code for invalid pixels.

    Noise model
    -----------
    None: counts are exact for what was decoded. Depth may exceed its range by the rounding of float32 to the stored
    value and to the range itself, 2^-24 relative each, with two bits to spare. Flow grows without end for what comes
    to lie beside the camera, by 1 over its depth: K fields of W x H pixels with diagonal D stay below
    1e6 K (W + H) D^2 px in all files but one in a million.

    Cannot see
    ----------
    A wrong value that is finite and in range, and flow below that bound (1e11 px in a file of 1000 pixels, 1e17 in one
    of seconds at 1440 x 1080); whether NaN lie where they must (``flow_geometry.validity``). Images that are empty for
    as long as the file is looked at are noted, and no fault: a camera may see nothing nearer than
    30 m.

    Sources
    -------
    The canonical layout, version 1.0; IEEE 754-2019 for the rounding.
    """

    name = "integrity.finite"

    def measure(self, window: Window) -> tuple[Tally, ...]:
        """Tally every float dataset of the window."""
        streams = ((key, DATASETS[key].stream) for key in _FLOAT_KEYS)
        present = [(key, stream) for key, stream in streams if stream in window.facts.streams]
        return add_up(tally for key, stream in present for tally in _tallies(window, key, window.owned(stream)))

    def conclude(self, state: Sequence[tuple[Tally, ...]], facts: Facts) -> Observation:
        """Add up, in the order of time."""
        totals = add_up(tally for window in state for tally in window)
        measured = [m for total in totals for m in _measured(total, facts)]
        measured += [_timestamps(facts, stream) for stream in sorted(facts.clocks)]
        seen = sum(total.values for total in totals)
        return Observation(
            Coverage(seen, max(seen, _of(facts)), "values"),
            over_all_rates(measured, set(facts.flow_streams)),
            tuple(_void(total) for total in totals if total.filled and total.nan == total.values),
            unobservable="" if measured else "there is no stream whose values could be other than finite",
        )


def empty_between_full(filled: Sequence[tuple[int, float]]) -> list[int]:
    """Return the rows of images without a value whose neighbours are mostly valid, (row, share) in any order.

    A run of empty images counts when it is bounded by full ones on both sides, or on one side and by the end of the
    stream on the other. Rows that were not looked at bound nothing.
    """
    share = dict(filled)
    empty: list[int] = []
    run: list[int] = []
    last = max(share, default=-1)
    for row in sorted(share):
        if share[row] > 0.0:
            run = []
            continue
        run = [*run, row] if run and run[-1] == row - 1 else [row]
        if row + 1 in share and share[row + 1] == 0.0:
            continue
        before = share.get(run[0] - 1, 1.0 if run[0] == 0 else 0.0)
        after = share.get(row + 1, 1.0 if row == last else 0.0)
        whole = run[0] == 0 and row == last
        if before > _FULL and after > _FULL and not whole:
            empty.extend(run)
    return empty


def _tallies(window: Window, key: str, owned: range) -> Iterator[Tally]:
    """Tally what decodes; the rest is a finding of ``integrity.readable``."""
    image = DATASETS[key].is_image
    blocks = [(row, row + 1) for row in owned] if image else [(owned.start, owned.stop)]
    for start, stop in blocks:
        with suppress(UnreadableRowsError):
            yield _tally(key, start, window.rows(key, start, stop), window.facts)


def _tally(key: str, start: int, rows: NDArray[Any], facts: Facts) -> Tally:
    if not DATASETS[key].is_image:
        return tally_samples(key, start, rows)
    if key == "path/depth":
        return tally_depth(key, start, rows[0], facts.declared.depth_range_m)
    return tally_flow(key, start, rows[0], _longest_px(facts, key))


def _longest_px(facts: Facts, key: str) -> float:
    intervals, height, width, *_ = facts.layout.bindings[key].shape
    return longest_displacement_px(intervals, height, width)


def _measured(total: Tally, facts: Facts) -> Iterator[Statistic]:
    stream, where = DATASETS[total.key].stream, _where(facts, total)
    if not DATASETS[total.key].is_image:
        name = total.key.removeprefix("path/")
        said = f"{total.nan} of {total.values} samples of {name} are not finite; integration would end there"
        yield _count(f"{name}.not_finite", total.nan, "samples", said, where, _nan(stream, total.nan))
        return
    said = f"{total.infinite} pixels of {stream} are infinite; where there is no value it must be NaN"
    encoding = Suspect("invalid_encoding", stream, 1.0)
    yield _count(f"{stream}.infinite", total.infinite, "pixels", said, where, encoding)
    if total.key == "path/depth":
        said = _outside_statement(total, facts)
        yield _count("depth.outside_range", total.outside, "pixels", said, where, *_outside_suspects(total))
    else:
        odd = (Suspect("invalid_encoding", stream, 0.6), Suspect("corrupt_chunk", stream, 0.4))
        yield _count(f"{stream}.outside_range", total.outside, "pixels", _far_statement(total, facts), where, *odd)
    yield _empty(total, facts)


def _empty(total: Tally, facts: Facts) -> Statistic:
    stream = DATASETS[total.key].stream
    rows = empty_between_full(total.filled)
    said = f"{len(rows)} images of {stream} are NaN throughout between images that are mostly valid"
    where = Where(stream=stream)
    if rows:
        said += f", first number {rows[0]}"
        start_us = _file_us(facts, stream, rows[0])
        where = Where(stream, start_us, index_start=rows[0], index_stop=rows[-1] + 1, frame=rows[0])
    return _count(f"{stream}.empty_images", len(rows), "samples", said, where, _nan(stream, len(rows)))


def _void(total: Tally) -> Notice:
    stream = DATASETS[total.key].stream
    return Notice("integrity.finite.void", f"{stream} holds no valid pixel at all", Where(stream=stream))


def _outside_statement(total: Tally, facts: Facts) -> str:
    range_m = facts.declared.depth_range_m
    expected = f"{range_m[0]:g} to {range_m[1]:g} m" if range_m else "above zero"
    return (
        f"{total.outside} of {total.values} depth pixels lie between {total.low / MM_PER_M:.6g} and "
        f"{total.high / MM_PER_M:.6g} m; expected {expected}, or NaN"
    )


def _far_statement(total: Tally, facts: Facts) -> str:
    return (
        f"{total.outside} of {total.values} pixels of {DATASETS[total.key].stream} are displaced by {total.low:.3g} to "
        f"{total.high:.3g} px; beyond {_longest_px(facts, total.key):.3g} px no surface in view is"
    )


def _outside_suspects(total: Tally) -> tuple[Suspect, ...]:
    """Metres read as millimetres if that explains the values; one constant is a code; scattered values, unknown."""
    finite = total.values - total.nan - total.infinite
    if total.rescaled > _MOST * finite:
        return (Suspect("unit_mm_m", "depth", 0.9, 1 / MM_PER_M, "1"),)
    if total.low == total.high:
        return (Suspect("invalid_encoding", "depth", 1.0),)
    if total.rescaled > _MOST * total.outside:  # a part of the file, or of the image
        return (Suspect("unit_mm_m", "depth", 0.85, 1 / MM_PER_M, "1"), Suspect("invalid_encoding", "depth", 0.4))
    return (Suspect("invalid_encoding", "depth", 0.5), Suspect("unit_mm_m", "depth", 0.3))


def _timestamps(facts: Facts, stream: str) -> Statistic:
    clock = facts.clocks[stream]
    bad = clock.times_ns == INVALID_TIMESTAMP_NS
    if clock.ends_ns is not None:
        bad = bad | (clock.ends_ns == INVALID_TIMESTAMP_NS)
    count = int(np.count_nonzero(bad))
    said = f"{count} stamps of {stream} are NaN; these samples have no place in time"
    where = Where(stream=stream, index_start=int(np.argmax(bad)) if count else None)
    return _count(f"{stream}.stamps_not_finite", count, "samples", said, where, _nan(stream, count))


def _nan(stream: str, count: int) -> Suspect:
    return Suspect("nan_in_stream", stream, 1.0, float(count), "samples")


def _count(name: str, value: int, unit: str, statement: str, where: Where, *suspects: Suspect) -> Statistic:
    return count_of_faults(
        name,
        value,
        unit,
        statement=statement,
        code=f"integrity.finite.{name.rsplit('.', 1)[1]}",
        where=where,
        severity="critical",
        suspects=suspects,
    )


def _where(facts: Facts, total: Tally) -> Where:
    spec = DATASETS[total.key]
    row, flat = total.first
    if row < 0:
        return Where(stream=spec.stream)
    start_us = _file_us(facts, spec.stream, row)
    if not spec.is_image:
        return Where(stream=spec.stream, start_us=start_us, index_start=row)
    width = facts.layout.bindings[total.key].shape[2]
    return Where(spec.stream, start_us, index_start=row, frame=row, pixel=(flat % width, flat // width))


def _file_us(facts: Facts, stream: str, row: int) -> float | None:
    time_ns = int(facts.clocks[stream].times_ns[row])
    return None if time_ns == INVALID_TIMESTAMP_NS else facts.to_file_us(time_ns)


def _of(facts: Facts) -> int:
    """Count the values that a whole reading would look at."""
    of = 0
    for key in _FLOAT_KEYS:
        if DATASETS[key].stream in facts.streams:
            binding = facts.layout.bindings[key]
            of += binding.rows * (binding.shape[1] * binding.shape[2] if DATASETS[key].is_image else 1)
    return of
