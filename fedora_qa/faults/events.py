"""Faults of events: where and of which sign they are. Their timestamps are in ``timestamps.py``."""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.faults.canary_conditions import CanaryConditions, UnplantableError
from fedora_qa.faults.fault import Fault, rows_from, values, values_by_row
from fedora_qa.sequence.declared import Camera

_FEWEST_IN_PACKETS: Final = 16.0
"""Mean events of a tick of the clock from which on nearly all ticks hold four pairs, should events be doubled."""

_X, _Y, _T, _P = (f"path/events/{name}" for name in "xytp")


def outside_of_the_sensor(conditions: CanaryConditions) -> Fault:
    """Columns are counted from the width on."""
    return Fault(
        "columns of events begin at the width", {_X: values(lambda x: x + x.dtype.type(_sensor(conditions).width))}
    )


def repeated(conditions: CanaryConditions) -> Fault:
    """Every second event is the one before it once more, so that packets hold pairs only."""
    events = conditions.facts.events
    count, events_per_tick = 0, 0.0
    if events is not None:
        count = events.count
        if events.last_ns > events.first_ns:
            events_per_tick = events.count * events.grid_ns / (events.last_ns - events.first_ns)
    if not any(m.name == "repeats" for m in conditions.measurements) and events_per_tick < _FEWEST_IN_PACKETS:
        raise UnplantableError("too few events share their stamps to be told from a packet that was written twice")
    # Row 2k + 1 takes x, y, t and p of row 2k: the same event twice.
    earlier = rows_from(lambda rows: rows - rows % 2, count)
    return Fault("every second event repeats the one before", dict.fromkeys((_X, _Y, _T, _P), earlier))


def hot_pixel(conditions: CanaryConditions) -> Fault:
    """Every k-th event is one of the pixel (0, 0)."""
    events = conditions.facts.events
    if events is None or events.last_ns <= events.first_ns:
        raise UnplantableError("the events have no duration")
    all_hz = events.count * NS_PER_S / (events.last_ns - events.first_ns)
    rate_hz = conditions.size("loudest_pixel_excess")
    # Rounded down, so that the rate all_hz / every is at least the one that is wanted.
    every = max(1, int(all_hz / rate_hz))

    def alter(column: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
        # By row number: x and y are read apart and must alter the same events.
        return np.where(rows % every == 0, column.dtype.type(0), column)

    return Fault(f"a pixel gives {all_hz / every:.3g} Hz too much", {key: values_by_row(alter) for key in (_X, _Y)})


def inverted_polarity(conditions: CanaryConditions) -> Fault:
    """Brighter is darker; what is neither stays."""
    # Codes above 1 are invalid, and a sign change must not make them valid.
    return Fault("polarity is inverted", {_P: values(lambda p: np.where(p <= 1, 1 - p, p).astype(p.dtype))})


def mirrored(conditions: CanaryConditions) -> Fault:
    """Columns run from right to left."""
    last = _sensor(conditions).width - 1
    return Fault("events are mirrored", {_X: values(lambda x: np.where(x <= last, last - x, x).astype(x.dtype))})


def shifted(conditions: CanaryConditions) -> Fault:
    """Events lie too far to the right; what would leave the sensor comes back on its left."""
    # Whole columns, rounded up: a smaller shift could lie below the detection limit.
    columns, width = math.ceil(conditions.size("shift_right", at_least=1.0)), _sensor(conditions).width

    def alter(x: NDArray[Any]) -> NDArray[Any]:
        # int64: uint16 wraps at 65536 before the remainder by the width.
        return np.where(x < width, (x.astype(np.int64) + columns) % width, x).astype(x.dtype)

    return Fault(f"events lie {columns} px too far to the right", {_X: values(alter)})


def _sensor(conditions: CanaryConditions) -> Camera:
    return conditions.facts.declared.cameras["events"]
