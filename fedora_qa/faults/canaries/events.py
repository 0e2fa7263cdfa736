"""Faults of the coordinates and polarities of events. Faults of their timestamps are in ``timestamps.py``."""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.faults.canary_conditions import CanaryConditions, UnplantableError
from fedora_qa.faults.fault import Alteration, Fault, rows_from, values, values_by_row
from fedora_qa.faults.pixels import Mirroring, PixelShift, PolarityInversion
from fedora_qa.sequence.declared import Camera

_FEWEST_IN_PACKETS: Final = 16.0
"""Least mean number of events of a tick. If all events are doubled, nearly every tick then holds four pairs."""

_X, _Y, _T, _P = (f"path/events/{name}" for name in "xytp")


def outside_of_the_sensor(conditions: CanaryConditions) -> Fault:
    """Columns are counted from the width of the sensor on, so that all events lie outside of it."""
    return Fault(
        "columns of events begin at the width", {_X: values(lambda x: x + x.dtype.type(_sensor(conditions).width))}
    )


def repeated(conditions: CanaryConditions) -> Fault:
    """Every second event repeats the event before it, so that packets hold only pairs."""
    events = conditions.facts.events
    count, events_per_tick = 0, 0.0
    if events is not None:
        count = events.count
        if events.last_ns > events.first_ns:
            events_per_tick = events.count * events.grid_ns / (events.last_ns - events.first_ns)
    if not any(m.name == "repeats" for m in conditions.measurements) and events_per_tick < _FEWEST_IN_PACKETS:
        raise UnplantableError("too few events share a timestamp to show a packet that was written twice")
    # Row 2k + 1 takes x, y, t and p of row 2k: the same event twice.
    earlier = rows_from(lambda rows: rows - rows % 2, count)
    return Fault("every second event repeats the one before", dict.fromkeys((_X, _Y, _T, _P), earlier))


def hot_pixel(conditions: CanaryConditions) -> Fault:
    """Every k-th event is moved to the pixel (0, 0)."""
    events = conditions.facts.events
    if events is None or events.last_ns <= events.first_ns:
        raise UnplantableError("the events have no duration")
    all_hz = events.count * NS_PER_S / (events.last_ns - events.first_ns)
    rate_hz = conditions.size("loudest_pixel_excess")
    # Rounded down, so that the rate all_hz / every is at least ``rate_hz``.
    every = max(1, int(all_hz / rate_hz))

    def alter(column: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
        # By row number: x and y are read separately, and the same events must be altered.
        return np.where(rows % every == 0, column.dtype.type(0), column)

    return Fault(f"a pixel gives {all_hz / every:.3g} Hz too much", {key: values_by_row(alter) for key in (_X, _Y)})


def inverted_polarity(conditions: CanaryConditions) -> Fault:
    """Brighter and darker events are exchanged. Invalid polarities stay."""
    return conditions.planted(PolarityInversion())


def mirrored(conditions: CanaryConditions) -> Fault:
    """Columns are counted from right to left."""
    return conditions.planted(Mirroring("events"))


def interpolated(conditions: CanaryConditions) -> Fault:
    """Between two frames, pixels give three events at equal spacings each. No row is added or removed."""
    index_map = conditions.facts.index_maps.get("rgb_to_event")
    if index_map is None:
        raise UnplantableError("no index map tells which events lie between two frames")
    width, pixels = _sensor(conditions).width, _sensor(conditions).width * _sensor(conditions).height
    advancing = np.flatnonzero(conditions.facts.clocks["rgb"].advancing)
    frames_ns = conditions.facts.clocks["rgb"].times_ns[advancing]
    first_rows = index_map.expected_left[advancing]

    def places(rows: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.int64]]:
        """Return which rows lie in groups of three a pixel between two frames, their pixels, and all timestamps, ns."""
        frame = np.clip(np.searchsorted(first_rows, rows, side="right") - 1, 0, len(first_rows) - 2)
        row, count = rows - first_rows[frame], first_rows[frame + 1] - first_rows[frame]
        # Pixel q of m has events at the shares (q + 1/2) / m + 0, 1 and 2 of a third of the interval.
        columns = np.maximum(np.minimum(count // 3, pixels), 1)
        grouped = (row >= 0) & (row < 3 * columns) & (count >= 3)
        number, column = np.divmod(np.clip(row, 0, None), columns)
        third_ns = (frames_ns[frame + 1] - frames_ns[frame]) // 3
        # One spacing for all: whole steps of the phase, so that the three are equal to the nanosecond.
        times_ns = frames_ns[frame] + third_ns * number + third_ns * (2 * column + 1) // (2 * columns)
        return grouped, column * (pixels // columns), times_ns

    def alter(name: str) -> Alteration:
        def altered(values: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
            grouped, pixel, times_ns = places(rows)
            planted = {_X: pixel % width, _Y: pixel // width, _T: times_ns, _P: np.ones_like(pixel)}[name]
            return np.where(grouped, planted, values).astype(values.dtype)

        return values_by_row(altered)

    return Fault("events are interpolated between the colour frames", {key: alter(key) for key in (_X, _Y, _T, _P)})


def shifted(conditions: CanaryConditions) -> Fault:
    """Events lie too far to the right. Events that would leave the sensor enter it on the left."""
    # Whole columns, rounded up: a smaller shift can lie below the detection limit.
    return conditions.planted(PixelShift("events", math.ceil(conditions.size("shift_right", at_least=1.0))))


def _sensor(conditions: CanaryConditions) -> Camera:
    return conditions.facts.declared.cameras["events"]
