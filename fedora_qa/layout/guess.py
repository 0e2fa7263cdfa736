"""Guess what a dataset of an unknown file is, from its name, shape, type and first values. Each guess has a reason."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import FLOW_RATES_HZ, NS_PER_S
from fedora_qa.layout.dialect import NS_PER_TIME_UNIT
from fedora_qa.layout.inventory import StoredObject

_EPOCH_S: Final = (1e9, 1e10)
"""Seconds since 1970 of timestamps between 2001 and 2286."""

_STEP_NS: Final = {"frames": (1e6, 1e9), "samples": (1e5, 1e8), "events": (0.0, 1e7)}
"""Plausible steps, ns: frames at 1 to 1000 Hz, samples at 10 Hz to 10 kHz, events less than 10 ms apart."""

_METRES_BELOW: Final = 200.0
"""A median depth below this is metres, above it millimetres: 200 m is beyond, 20 cm within what a drone looks at."""

_SAME_RATE: Final = 0.05
"""Intervals nearer than this to those of a rate that the layout names are meant to be of that rate."""

_NAMES: Final = {
    "path/imu/angular_velocity": ("angular", "gyr", "omega", "w"),
    "path/imu/linear_acceleration": ("accel", "acc", "a", "linear_acc"),
    "path/pose/position": ("pos", "trans", "p"),
}
"""Beginnings of the names that three columns go by."""


@dataclass(frozen=True, slots=True)
class Guess:
    """A place for a canonical dataset, as the fields of ``dialect.DatasetPlace`` that differ from their defaults."""

    key: str
    fields: dict[str, str | list[int]]
    reason: str


def guess_places(items: Sequence[StoredObject]) -> tuple[Guess, ...]:
    """Return one guess for each canonical dataset for which there is a candidate, the first found."""
    guesses: dict[str, Guess] = {}
    for guess in (*_events_in_columns(items), *_events_apart(items), *_images(items), *_flow(items), *_samples(items)):
        guesses.setdefault(guess.key, guess)
    return tuple(guesses.values())


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
    # Plausible ranges of neighbouring units overlap; the canonical unit comes first.
    for unit in ("us", "ns", "s", "ms"):
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
        yield Guess("path/events/x", {"path": item.path, "columns": [x]}, "the first column that is neither t nor p")
        yield Guess("path/events/y", {"path": item.path, "columns": [y]}, "the second such column")
        yield Guess("path/events/t", {"path": item.path, "columns": [t], "time_unit": unit}, f"it never falls; {why}")
        yield Guess("path/events/p", {"path": item.path, "columns": [p], **_polarity(codes[p])}, _code_reason(codes[p]))


def _events_apart(items: Sequence[StoredObject]) -> Iterator[Guess]:
    flat = {item.path: item for item in items if len(item.shape) == 1}
    for x in flat.values():
        if x.name != "x":
            continue
        siblings = {name: flat.get("/".join(filter(None, (x.group, name)))) for name in "ytp"}
        y, t, p = siblings["y"], siblings["t"], siblings["p"]
        if y is None or t is None or p is None or len({item.shape for item in (x, y, t, p)}) > 1:
            continue
        unit, why = unit_of_timestamps(t.head.astype(np.float64), "events")
        codes = set(np.unique(p.head.astype(np.float64)))
        yield Guess("path/events/x", {"path": x.path}, "its name, beside y, t and p of equal length")
        yield Guess("path/events/y", {"path": y.path}, "its name")
        yield Guess("path/events/t", {"path": t.path, "time_unit": unit}, why)
        yield Guess("path/events/p", {"path": p.path, **_polarity(codes)}, _code_reason(codes))


def _images(items: Sequence[StoredObject]) -> Iterator[Guess]:
    for item in items:
        rank, kind = len(item.shape), item.dtype
        if kind == np.uint8 and rank == 4 and item.shape[3] == 3:
            yield from _with_timestamps(
                items, item, Guess("path/rgb", {"path": item.path}, "8-bit images, three channels")
            )
        elif kind == np.uint8 and rank == 3:
            grey = Guess("path/rgb", {"path": item.path, "columns": [0, 0, 0]}, "8-bit grey images, read as R = G = B")
            yield from _with_timestamps(items, item, grey)
        # Sides above 4 exclude stacks of 3 x 3 and 4 x 4 matrices, in which poses are stored (MVSEC).
        elif kind.kind == "f" and rank == 3 and min(item.shape[1:]) > 4:
            # Writers mark invalid depth by NaN, infinity or 0.
            values = item.head[np.isfinite(item.head) & (item.head > 0)]
            median = float(np.median(values)) if values.size else 0.0
            unit = "m" if 0 < median < _METRES_BELOW else "mm"
            depth = Guess(
                "path/depth", {"path": item.path, "value_unit": unit}, f"float images; median {median:.4g} is {unit}"
            )
            yield from _with_timestamps(items, item, depth)


def _flow(items: Sequence[StoredObject]) -> Iterator[Guess]:
    """Fields of two components beside intervals of equal number; the interval's length names the rate."""
    for item in items:
        if len(item.shape) != 4 or item.shape[3] != 2 or item.dtype.kind != "f":
            continue
        candidates = [other for other in items if other.shape == (item.shape[0], 2) and other.dtype.kind in "iuf"]
        if not candidates:
            continue
        timestamps = max(candidates, key=lambda other: _nearness(other, item))
        lengths = np.diff(timestamps.head.astype(np.float64), axis=1)
        for unit, rate_hz in ((unit, rate_hz) for unit in ("us", "ns", "s", "ms") for rate_hz in FLOW_RATES_HZ):
            length_s = float(np.median(lengths)) * NS_PER_TIME_UNIT[unit] / NS_PER_S
            if np.isclose(length_s * rate_hz, 1.0, rtol=_SAME_RATE):
                reason = f"two float components; intervals of {timestamps.path} are 1/{rate_hz} s in {unit}"
                yield Guess(f"path/flow/{rate_hz}hz", {"path": item.path}, reason)
                fields: dict[str, str | list[int]] = {"path": timestamps.path, "time_unit": unit}
                yield Guess(f"path/flow/{rate_hz}hz_ts", fields, f"two columns, as long as {item.path}")


def _samples(items: Sequence[StoredObject]) -> Iterator[Guess]:
    for item in items:
        if len(item.shape) != 2 or item.dtype.kind != "f":
            continue
        if item.shape[1] == 3:
            for key, names in _NAMES.items():
                # Names of one letter must match whole: as beginnings they would match most names.
                if any(item.name == name or (len(name) > 1 and item.name.startswith(name)) for name in names):
                    guess = Guess(key, {"path": item.path}, "three columns, and its name")
                    yield from _with_timestamps(items, item, guess)
        # Unit norm distinguishes quaternions from other tables of four columns.
        elif item.shape[1] == 4 and np.allclose(np.linalg.norm(item.head, axis=1), 1.0, atol=1e-3):
            reason = "four columns of unit length; that the order is x, y, z, w cannot be told from the values"
            guess = Guess("path/pose/orientation", {"path": item.path, "quaternion": "xyzw"}, reason)
            yield from _with_timestamps(items, item, guess)


def _with_timestamps(items: Sequence[StoredObject], item: StoredObject, guess: Guess) -> Iterator[Guess]:
    """Yield the guess, and one for the timestamps of equal length whose name and place are nearest."""
    yield guess
    candidates = [other for other in items if _may_be_timestamps(other, item.shape[0])]
    if candidates:
        best = max(candidates, key=lambda other: _nearness(other, item))
        frames = guess.key in {"path/rgb", "path/depth"}
        unit, why = unit_of_timestamps(best.head.astype(np.float64), "frames" if frames else "samples")
        key = f"{guess.key}_ts" if frames else f"{guess.key.rpartition('/')[0]}/ts"
        yield Guess(key, {"path": best.path, "time_unit": unit}, f"as long as {item.path}, never falls; {why}")


def _may_be_timestamps(item: StoredObject, length: int) -> bool:
    if item.shape != (length,) or item.dtype.kind not in "iuf":
        return False
    head = item.head.astype(np.float64)
    return bool(np.all(np.isfinite(head)) and np.all(np.diff(head) >= 0))


def _nearness(timestamps: StoredObject, item: StoredObject) -> tuple[int, int, int]:
    """Order candidates: a name that says time, the common beginning of the paths, the shorter path."""
    says_time = any(word in timestamps.name for word in ("ts", "time", "stamp")) or timestamps.name == "t"
    common = next(
        (i for i, (a, b) in enumerate(zip(timestamps.path, item.path, strict=False)) if a != b), len(item.path)
    )
    return int(says_time), common, -len(timestamps.path)


def _polarity(codes: set[float]) -> dict[str, str | list[int]]:
    return {"polarity": "plus_minus"} if -1.0 in codes else {}


def _code_reason(codes: set[float]) -> str:
    return f"its values are {', '.join(f'{code:g}' for code in sorted(codes)[:4])}; that 1 is brighter is assumed"
