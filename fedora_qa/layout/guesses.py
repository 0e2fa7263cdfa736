"""Guess what each dataset of an unknown file is, by name, shape, type and first values; each guess has a reason."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import FLOW_RATES_HZ, NS_PER_S
from fedora_qa.layout.array_forms import (
    has_equal_channels,
    is_flow,
    is_named_as_depth,
    is_named_as_inverse_depth,
    is_picture_of_depth,
    mark_of_invalid,
    transformations_of,
)
from fedora_qa.layout.canonical import MS_TO_EVENT
from fedora_qa.layout.dialect import DEPTH_RANGE, NS_PER_TIME_UNIT
from fedora_qa.layout.inventory import Fields, StoredObject

_EPOCH_S: Final = (1e9, 1e10)
"""Seconds since 1970 of timestamps between 2001 and 2286."""

_STEP_NS: Final = {"frames": (1e6, 1e9), "samples": (1e5, 1e8), "events": (0.0, 1e7)}
"""Plausible steps, ns: frames at 1 to 1000 Hz, samples at 10 Hz to 10 kHz, events less than 10 ms apart."""

_METRES_BELOW: Final = 200.0
"""A median depth below this is metres, above it millimetres: 200 m is beyond, 20 cm within the depths of a flight."""

_LARGEST_COUNT_STEP: Final = 10
"""Whole numbers in equal steps up to this may count frames: DSEC counts every second image."""

_LIKE_SPAN: Final = 2.0
"""Ratio of the spans of two streams up to which they may be of one sequence."""

_GRAVITY: Final = (8.0, 12.0)
"""Median length of specific force, m/s^2, by which an accelerometer is known."""

_SAME_RATE: Final = 0.05
"""Relative difference up to which an interval counts as that of a rate of the layout."""

_ROUNDED_RATE: Final = 1e-3
"""Intervals of other rates end on whole microseconds: 0.1% of those of 1000 Hz."""

_SLOWEST_HZ: Final = 0.999
"""Of flow, a little below 1 Hz, for the rounding of its timestamps."""

_NAMES: Final = {
    "path/imu/angular_velocity": ("angular", "gyr", "omega", "w"),
    "path/imu/linear_acceleration": ("accel", "acc", "a", "linear_acc"),
    "path/pose/position": ("pos", "trans", "p"),
}
"""Beginnings of the names of datasets with three columns."""

_MOTION: Final = ("pos", "trans", "orient", "euler", "rpy", "vel")
"""Words in the names of tables whose columns are no times."""

_NO_STREAM: Final = ("mask", "segm", "label", "instance", "semantic")
"""Words in the names of images that are no stream."""

_MILLISECONDS: Final = ("ms_to", "ms_map")
"""Beginnings of the names of maps from milliseconds to events (DSEC, M3ED, TUM-VIE)."""

_INDEX_WORDS: Final = ("to_event", "event_ind", "event_idx", "events_ind", "events_idx")
"""Words in the names of maps from frames to events."""

CAMERA_WORDS: Final = {
    "events": ("event", "dvs", "davis", "prophesee"),
    "depth": ("depth", "disparity"),
    "rgb": ("rgb", "color", "colour", "ovc", "frame"),
}
"""Words in the path of a camera by which it is known, and in that of its matrix."""

_EVENT_NAMES: Final = {
    "x": ("x", "xs"),
    "y": ("y", "ys"),
    "t": ("t", "ts", "timestamp", "timestamps", "time"),
    "p": ("p", "ps", "pol", "polarity", "polarities", "on"),
}
"""Names of the parts of events, in lower case, the usual one first."""


@dataclass(frozen=True, slots=True)
class Guess:
    """A place for a canonical dataset, as the fields of ``dialect.DatasetPlace`` that differ from their defaults."""

    key: str
    fields: Fields
    reason: str


def guess_places(items: Sequence[StoredObject]) -> tuple[Guess, ...]:
    """Return one guess for each canonical dataset for which there is a candidate, the first found."""
    guesses: dict[str, Guess] = {}
    for guess in (
        *_events_in_columns(items),
        *_events_apart(items),
        *_images(items),
        *_flow(items),
        *_tables(items),
        *_samples(items),
        *_transformations(items),
    ):
        guesses.setdefault(guess.key, guess)
    for guess in (*_index_maps(items, guesses), *_depth_range(items, guesses)):
        guesses.setdefault(guess.key, guess)
    return tuple(guesses.values())


def item_of(items: Sequence[StoredObject], guesses: Mapping[str, Guess], key: str) -> StoredObject | None:
    """Return what a dataset was placed at; None for one without a place, and for a file that is still to be written."""
    if key not in guesses:
        return None
    return next((item for item in items if item.shape and item.place.items() <= guesses[key].fields.items()), None)


def _index_maps(items: Sequence[StoredObject], guesses: Mapping[str, Guess]) -> Iterator[Guess]:
    """Guess that whole numbers with a name for it, one for each frame, name the event at that frame."""
    rows = {
        key: item.shape[0]
        for key in ("path/rgb_ts", "path/depth_ts", "path/events/t")
        for item in items
        if key in guesses and item.shape and item.place.items() <= guesses[key].fields.items()
    }
    for item in items:
        is_map = len(item.shape) == 1 and item.dtype.kind in "iu" and any(word in item.name for word in _INDEX_WORDS)
        if not is_map or not np.all(np.diff(item.head.astype(np.int64)) >= 0):
            continue
        if not 0 <= int(item.head[0]) <= int(item.head[-1]) <= rows.get("path/events/t", -1):
            continue
        for key, frames in (("metadata/rgb_to_event", "rgb"), ("metadata/depth_to_event", "depth")):
            named = [camera for camera, words in CAMERA_WORDS.items() if any(word in item.name for word in words)]
            # A map into the events has their name, too, and that of a camera where there are several.
            others = [camera for camera in named if camera not in ("events", frames)]
            if rows.get(f"path/{frames}_ts") == item.shape[0] and not others:
                yield Guess(key, item.place, f"its name; as many whole numbers as {frames} frames, which never fall")
                break


def _depth_range(items: Sequence[StoredObject], guesses: Mapping[str, Guess]) -> Iterator[Guess]:
    """Guess that two rising numbers with a name for it are the range of valid depth."""
    for item in items:
        named = "range" in item.name and "depth" in item.path.lower()
        if "path/depth" in guesses and named and item.shape == (2,) and 0 <= item.head[0] < item.head[1]:
            yield Guess(DEPTH_RANGE, item.place, "its name; two rising numbers, taken for metres")


def unit_of_timestamps(timestamps: NDArray[np.float64], kind: str) -> tuple[str, str]:
    """Return the unit in which timestamps are plausible, and why: by their magnitude since 1970, else by their step."""
    for unit, ns in NS_PER_TIME_UNIT.items():
        if _EPOCH_S[0] <= abs(float(timestamps[0])) * ns / 1e9 < _EPOCH_S[1] and kind != "events":
            return unit, f"{timestamps[0]:.10g} is a date in {unit}"
    step = float(np.median(np.diff(timestamps))) if len(timestamps) > 1 else 0.0
    if kind == "events":
        # The mean, not the median: many events share a timestamp, so that the median step can be 0.
        step = float(timestamps[-1] - timestamps[0]) / max(len(timestamps) - 1, 1)
    low, high = _STEP_NS[kind]
    # Ranges of neighbouring units overlap; the canonical unit comes first. No step between events is too short,
    # but cameras count whole microseconds: fractions are those of seconds.
    is_whole = bool(np.all(timestamps == np.floor(timestamps)))
    for unit in ("us", "ns", "s", "ms") if is_whole or kind != "events" else ("s", "us", "ns", "ms"):
        if low <= step * NS_PER_TIME_UNIT[unit] <= high:
            return unit, f"steps of {step:.4g} {unit} are plausible for {kind}"
    return "us", "no unit makes the steps plausible; microseconds assumed"


def _events_in_columns(items: Sequence[StoredObject]) -> Iterator[Guess]:
    for item in items:
        if len(item.shape) != 2 or item.shape[1] != 4:
            continue
        columns = item.head.astype(np.float64)
        codes = [set(np.unique(column)) for column in columns.T]
        polarity = [i for i, code in enumerate(codes) if code <= {0.0, 1.0} or code <= {-1.0, 1.0}]
        advancing = [i for i, column in enumerate(columns.T) if np.all(np.diff(column) >= 0) and np.ptp(column) > 0]
        # Ambiguous columns give no guess: in few rows a constant column can pass as polarity.
        if len(polarity) != 1 or len(advancing) != 1 or polarity == advancing:
            continue
        t, p = advancing[0], polarity[0]
        x, y = (i for i in range(4) if i not in {t, p})
        unit, why = unit_of_timestamps(columns[:, t], "events")
        yield Guess("path/events/x", {**item.place, "columns": [x]}, "the first column that is neither t nor p")
        yield Guess("path/events/y", {**item.place, "columns": [y]}, "the second such column")
        yield Guess("path/events/t", {**item.place, "columns": [t], "time_unit": unit}, f"it never falls; {why}")
        yield Guess("path/events/p", {**item.place, "columns": [p], **_polarity(codes[p])}, _code_reason(codes[p]))


def _events_apart(items: Sequence[StoredObject]) -> Iterator[Guess]:
    """Guess that x, y, t and p of equal length are events: in a group of HDF5, in an NPZ, or as files of a folder."""
    parts: dict[tuple[str, str, str], StoredObject] = {}
    for item in items:
        if len(item.shape) == 1 or item.shape[1:] == (1,) or (len(item.shape) == 2 and item.name.endswith("xy")):
            # Files of one folder have roles of their own, and often a beginning in common: events_x, events_y.
            home = f"{item.role}:{item.group}" if item.form == "hdf5" else item.group
            beginning, _, part = item.name.rpartition("_")
            parts[home, beginning, part] = item
    for (home, beginning, name), x in parts.items():
        is_pair = name == "xy" and x.shape[1:] == (2,)
        if name not in _EVENT_NAMES["x"] and not is_pair:
            continue
        y, t, p = (
            next(filter(None, (parts.get((home, beginning, name)) for name in _EVENT_NAMES[part])), None)
            for part in "ytp"
        )
        y = x if is_pair else y
        if y is None or t is None or p is None or len({item.shape[0] for item in (x, y, t, p)}) > 1:
            continue
        unit, why = unit_of_timestamps(t.head.astype(np.float64).reshape(-1), "events")
        codes = set(np.unique(p.head.astype(np.float64)))
        columns: list[Fields] = [{"columns": [0]}, {"columns": [1]}] if is_pair else [{}, {}]
        reason = (
            "its name, beside t and p of equal length" if is_pair else "its name, beside y, t and p of equal length"
        )
        yield Guess("path/events/x", {**x.place, **columns[0]}, reason)
        yield Guess("path/events/y", {**y.place, **columns[1]}, "its name")
        fields: Fields = {**t.place, "time_unit": unit}
        if offset := next((item for item in items if not item.shape and item.role == x.role), None):
            fields["offset_path"], why = offset.path, f"{why}; {offset.path} is taken for what is added"
        yield Guess("path/events/t", fields, why)
        yield Guess("path/events/p", {**p.place, **_polarity(codes)}, _code_reason(codes))
        for other in items:
            is_map = len(other.shape) == 1 and other.dtype.kind in "iu" and other.name.startswith(_MILLISECONDS)
            if is_map and other.form == x.form and (other.role == x.role or other.form != "hdf5"):
                yield Guess(MS_TO_EVENT, other.place, "its name; whole numbers beside the events")


def _images(items: Sequence[StoredObject]) -> Iterator[Guess]:
    images = [
        item
        for item in items
        if not any(word in item.path.lower() for word in _NO_STREAM)
        and not is_picture_of_depth(item)
        and not is_named_as_inverse_depth(item)
    ]
    # Colour comes before grey, which may be of another camera.
    for item in sorted(images, key=lambda item: len(item.shape) != 4):
        rank, kind = len(item.shape), item.dtype
        if kind == np.uint8 and rank == 4 and item.shape[3] == 3:
            yield from _with_timestamps(items, item, Guess("path/rgb", item.place, "8-bit images, three channels"))
        # H x W x 3 is one image of colour, not a stream of H grey ones.
        elif kind == np.uint8 and rank == 3 and item.shape[2] > 4:
            grey = Guess("path/rgb", {**item.place, "columns": [0, 0, 0]}, "8-bit grey images, read as R = G = B")
            yield from _with_timestamps(items, item, grey)
        elif kind == np.uint16 and rank == 3 and (item.form == "images" or is_named_as_depth(item)):
            named = any(word in item.path.lower() for word in ("disp", "stereo"))
            fields: Fields = {"value_unit": "mm", "invalid": 0.0}
            reason = "16-bit grey images, taken for millimetres; 0 is taken for invalid"
            if named:
                fields = {"convert": "disparity16", "value_unit": "m"}
                reason = "16-bit grey images, and their name; needs metadata/disparity_to_depth, the matrix Q"
            yield from _with_timestamps(items, item, Guess("path/depth", {**item.place, **fields}, reason))
        # Sides above 4 exclude stacks of 3 x 3 and 4 x 4 matrices, in which poses are stored (MVSEC).
        elif kind.kind == "f" and ((rank == 3 and min(item.shape[1:]) > 4) or has_equal_channels(item)):
            # Renderers without images of one channel write depth three times.
            channel: Fields = {"columns": [0]} if rank == 4 else {}
            head = item.head[..., 0] if rank == 4 else item.head
            marked, mark = mark_of_invalid(head)
            values = head[np.isfinite(head) & (head > 0) & (head != marked.get("invalid", 0.0))]
            median = float(np.median(values)) if values.size else 0.0
            unit = "m" if 0 < median < _METRES_BELOW else "mm"
            reason = f"float images{' of equal channels' if channel else ''}; median {median:.4g} is {unit}{mark}"
            depth = Guess("path/depth", {**item.place, **channel, "value_unit": unit, **marked}, reason)
            yield from _with_timestamps(items, item, depth)


def _flow(items: Sequence[StoredObject]) -> Iterator[Guess]:
    """Guess that fields of two components beside equally many intervals are flow, whose rate is 1 / interval."""
    for item in items:
        is_coded = item.form == "images" and item.dtype == np.uint16 and item.shape[3:] == (3,)
        if not is_coded and not is_flow(item):
            continue
        coded = {"convert": "flow16"} if is_coded else {}
        words = (
            "16-bit images of three channels in 1/128 px, as DSEC has (KITTI: 1/64 px, scale = 2.0)"
            if is_coded
            else "two float components"
        )
        candidates = [other for other in items if other.shape[:1] == item.shape[:1] and _is_of_intervals(other)]
        if not candidates:
            continue
        timestamps = max(candidates, key=lambda other: _nearness(other, item))
        lengths = np.diff(timestamps.head[:, -2:].astype(np.float64), axis=1)
        for unit in ("us", "ns", "s", "ms"):
            length_s = float(np.median(lengths)) * NS_PER_TIME_UNIT[unit] / NS_PER_S
            if rate := rate_of(length_s):
                reason = f"{words}; intervals of {timestamps.path} are 1/{rate} s in {unit}"
                yield Guess(f"path/flow/{rate}hz", {**item.place, **coded}, reason)
                columns: Fields = {"columns": [1, 2]} if timestamps.shape[1] == 3 else {}
                fields: Fields = {**timestamps.place, **columns, "time_unit": unit}
                reason = "two columns beside one that counts" if columns else "two columns"
                yield Guess(f"path/flow/{rate}hz_ts", fields, f"{reason}, as long as {item.path}")


def _is_of_intervals(item: StoredObject) -> bool:
    """Whether a table has two columns, or three of which the first counts."""
    if len(item.shape) != 2 or item.dtype.kind not in "iuf":
        return False
    counts = item.form == "text" and item.shape[1] == 3 and _count_step(item.head[:, 0].astype(np.float64)) > 0
    return item.shape[1] == 2 or counts


def rate_of(length_s: float) -> str:
    """Return the rate of intervals, Hz: a usual one, or with as few decimals as state it; empty for no plausible one.

    Units of time differ by 1000, so that a length is plausible in one of them at most: from 1 to 1000 Hz.
    """
    usual = (str(rate_hz) for rate_hz in FLOW_RATES_HZ if np.isclose(length_s * rate_hz, 1.0, rtol=_SAME_RATE))
    if not _SLOWEST_HZ * length_s <= 1.0 < 1000 * _SLOWEST_HZ * length_s:
        return next(usual, "")
    rates = (f"{1 / length_s:.{decimals}f}" for decimals in range(7))
    return next(
        chain(usual, (rate for rate in rates if np.isclose(length_s * float(rate), 1.0, rtol=_ROUNDED_RATE))), ""
    )


def _samples(items: Sequence[StoredObject]) -> Iterator[Guess]:
    for item in items:
        # One 4 x 4 matrix is a mounting, and no stream of four quaternions.
        is_matrix = item.shape == (4, 4) and np.array_equal(item.head[-1], [0, 0, 0, 1])
        if len(item.shape) != 2 or item.dtype.kind != "f" or is_matrix or transformations_of(item):
            continue
        if item.shape[1] == 3:
            for key, names in _NAMES.items():
                # Names of one letter must match whole: as beginnings they would match most names.
                if any(item.name == name or (len(name) > 1 and item.name.startswith(name)) for name in names):
                    guess = Guess(key, item.place, "three columns, and its name")
                    yield from _with_timestamps(items, item, guess)
        # Unit norm distinguishes quaternions from other tables of four columns.
        elif item.shape[1] == 4 and np.allclose(np.linalg.norm(item.head, axis=1), 1.0, atol=1e-3):
            reason = "four columns of unit length; that the order is x, y, z, w does not follow from the values"
            reason = "members of unit length, and their names" if len(item.members) > 1 else reason
            guess = Guess("path/pose/orientation", {**item.place, "quaternion": "xyzw"}, reason)
            yield from _with_timestamps(items, item, guess)


def _transformations(items: Sequence[StoredObject]) -> Iterator[Guess]:
    """Guess that matrices with a last row 0, 0, 0, 1, and rotations beside a position, are poses."""
    for item in items:
        form = transformations_of(item)
        if not form:
            continue
        reason = f"{form}; that they take the body to the world does not follow from the values"
        start = item.shape[1] % 4 if len(item.shape) == 2 else 0
        place: Fields = {"columns": list(range(1, item.shape[1]))} if start else {}
        fields: Fields = {**item.place, **place, "convert": "matrix4"}
        yield Guess("path/pose/position", fields, reason)
        orientation = Guess("path/pose/orientation", fields, "the same; where it is the inverse, add invert = true")
        if start:
            unit, why = unit_of_timestamps(item.head[:, 0].astype(np.float64), "samples")
            time: Fields = {**item.place, "columns": [0], "time_unit": unit}
            yield orientation
            yield Guess("path/pose/ts", time, f"the first column, which rises; {why}")
        else:
            yield from _with_timestamps(items, item, orientation)


def _tables(items: Sequence[StoredObject]) -> Iterator[Guess]:
    """Guess trajectories and IMU samples in tables whose first column is time (TUM, EuRoC), or is beside a count."""
    for item in items:
        if transformations_of(item):
            continue
        head = item.head.astype(np.float64) if item.head.ndim == 2 else np.empty((0, 0))
        if _is_pose_without_time(item):
            place: Fields = {**item.place, "columns": [0, 1, 2]}
            yield Guess("path/pose/position", place, "the three columns before four of unit length")
            reason = "four columns of unit length; that the order is x, y, z, w does not follow from the values"
            orientation = Guess("path/pose/orientation", {**item.place, "columns": [3, 4, 5, 6]}, reason)
            yield from _with_timestamps(items, item, orientation)
            continue
        if item.form == "hdf5" or len(head) < 2 or head.shape[1] < 7 or not np.all(np.diff(head[:, 0]) > 0):
            continue
        # A first column that counts is no time where the second one rises.
        start = int(_count_step(head[:, 0]) > 0 and bool(np.all(np.diff(head[:, 1]) > 0)))
        unit, why = unit_of_timestamps(head[:, start], "samples")
        time: Fields = {**item.place, "columns": [start], "time_unit": unit}
        rising = f"the {'second' if start else 'first'} column, which rises; {why}"
        norms = [np.linalg.norm(head[:, at : at + 4], axis=1) for at in range(head.shape[1] - 3)]
        at = next((at for at in range(start + 4, len(norms)) if np.allclose(norms[at], 1.0, atol=1e-3)), 0)
        if at:
            yield Guess("path/pose/ts", time, rising)
            place = {**item.place, "columns": [at - 3, at - 2, at - 1]}
            yield Guess("path/pose/position", place, "the three columns before four of unit length")
            reason = "four columns of unit length; that the order is x, y, z, w does not follow from the values"
            yield Guess("path/pose/orientation", {**item.place, "columns": [at, at + 1, at + 2, at + 3]}, reason)
            continue
        if head.shape[1] < start + 7:
            continue
        triples = [[at, at + 1, at + 2] for at in (start + 1, start + 4)]
        lengths = [float(np.median(np.linalg.norm(head[:, triple], axis=1))) for triple in triples]
        # At rest and in most flights the specific force is near 9.8 m/s^2.
        near = [_GRAVITY[0] < length < _GRAVITY[1] for length in lengths]
        if near in ([True, False], [False, True]):
            force, turn = triples if near[0] else triples[::-1]
            yield Guess("path/imu/ts", time, rising)
            place = {**item.place, "columns": force}
            yield Guess("path/imu/linear_acceleration", place, f"columns of about {max(lengths):.3g} m/s^2")
            yield Guess("path/imu/angular_velocity", {**item.place, "columns": turn}, "the other three columns")


def _with_timestamps(items: Sequence[StoredObject], item: StoredObject, guess: Guess) -> Iterator[Guess]:
    """Yield the guess, and one for the timestamps of equal length whose values, name and place are nearest."""
    yield guess
    frames = guess.key in {"path/rgb", "path/depth"}
    kind = "frames" if frames else "samples"
    events_ns = span_of_events_ns(items)
    candidates: list[tuple[tuple[float, ...], int, StoredObject]] = []
    for other in items:
        if other.shape[:1] != item.shape[:1] or other.dtype.kind not in "iuf" or _is_of_motion(other):
            continue
        for number, head in enumerate(other.columns):
            if not np.all(np.isfinite(head)) or not np.all(np.diff(head) >= 0):
                continue
            count = _count_step(head)
            # A column that counts is no time, unless it is the only one of a file whose name states a time.
            if count == 1 and (len(other.columns) > 1 or not _is_named_as_time(other)):
                continue
            span_ns = other.span(number) * NS_PER_TIME_UNIT[unit_of_timestamps(head, kind)[0]]
            alike = events_ns > 0 and events_ns / _LIKE_SPAN < span_ns < events_ns * _LIKE_SPAN
            order = (-1 / count if count else 0.0, *_nearness(other, item)[:1], alike, *_nearness(other, item)[1:])
            candidates.append(((*order, -number), number, other))
    if candidates:
        _, number, best = max(candidates, key=lambda candidate: candidate[0])
        unit, why = unit_of_timestamps(best.columns[number], kind)
        column: Fields = {"columns": [number]} if best.shape[1:] not in {(), (1,)} else {}
        why = f"{why}; column {number - 1} counts" if number and _count_step(best.columns[number - 1]) else why
        key = f"{guess.key}_ts" if frames else f"{guess.key.rpartition('/')[0]}/ts"
        yield Guess(key, {**best.place, **column, "time_unit": unit}, f"as long as {item.path}, never falls; {why}")


def _is_of_motion(item: StoredObject) -> bool:
    """Whether a table without times is one of positions or angles, which rise as well on a straight way."""
    if transformations_of(item) and item.shape[-1] % 4 == 0:
        return True
    if len(item.columns) < 2 or _is_named_as_time(item):
        return False
    is_vector = item.shape[1:] in {(2,), (3,)} and any(word in item.name for word in _MOTION)
    return is_vector or _is_pose_without_time(item)


def _is_pose_without_time(item: StoredObject) -> bool:
    """Whether a table of seven columns has a position, and a quaternion after it."""
    if item.form == "hdf5" or item.shape[1:] != (7,):
        return False
    return bool(np.allclose(np.linalg.norm(item.head[:, 3:].astype(np.float64), axis=1), 1, atol=1e-3))


def _count_step(numbers: NDArray[np.float64]) -> int:
    """Return the step of whole numbers that may be a count of frames; 0 where they are none."""
    steps = np.diff(numbers)
    step = float(steps[0]) if len(steps) else 0.0
    is_count = 1 <= step <= _LARGEST_COUNT_STEP and step.is_integer() and float(numbers[0]).is_integer()
    return int(step) if is_count and bool(np.all(steps == step)) else 0


def span_of_events_ns(items: Sequence[StoredObject]) -> float:
    """Return how long the events last, ns; 0 where none are found."""
    for guess in chain(_events_in_columns(items), _events_apart(items)):
        if guess.key == "path/events/t":
            item = next(item for item in items if item.place.items() <= guess.fields.items())
            columns = guess.fields.get("columns", [0])
            column = columns[0] if isinstance(columns, list) and isinstance(columns[0], int) else 0
            return item.span(column) * NS_PER_TIME_UNIT[str(guess.fields["time_unit"])]
    return 0.0


def _is_named_as_time(item: StoredObject) -> bool:
    return any(word in item.name for word in ("ts", "time", "stamp")) or item.name == "t"


def _nearness(timestamps: StoredObject, item: StoredObject) -> tuple[int, int, int]:
    """Return the order of candidates: a name for a time, the common beginning of the paths, the shorter path."""
    first, second = timestamps.address, item.address
    common = next((i for i, (a, b) in enumerate(zip(first, second, strict=False)) if a != b), len(second))
    return int(_is_named_as_time(timestamps)), common, -len(timestamps.address)


def _polarity(codes: set[float]) -> Fields:
    return {"polarity": "plus_minus"} if -1.0 in codes else {}


def _code_reason(codes: set[float]) -> str:
    return f"its values are {', '.join(f'{code:g}' for code in sorted(codes)[:4])}; that 1 is brighter is assumed"
