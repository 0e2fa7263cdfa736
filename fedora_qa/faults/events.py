"""Faults of events: where and of which sign they are. Their stamps are in ``stamps.py``."""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.faults.canary_conditions import CanaryConditions, UnplantableError
from fedora_qa.faults.fault import Fault, rows_from, values, values_by_row
from fedora_qa.sequence.declared import Camera

_FEWEST_IN_PACKETS: Final = 16.0
"""Mean events of an instant from which on nearly all hold four pairs, should they be doubled."""

_X, _Y, _T, _P = (f"path/events/{name}" for name in "xytp")


def outside_of_the_sensor(conditions: CanaryConditions) -> Fault:
    """Columns are counted from the width on."""
    return Fault(
        "columns of events begin at the width", {_X: values(lambda x: x + x.dtype.type(_sensor(conditions).width))}
    )


def repeated(conditions: CanaryConditions) -> Fault:
    """Every second event is the one before it once more, so that packets hold pairs only."""
    events = conditions.facts.events
    count = events.count if events else 0
    if (
        not any(m.name == "repeats" for m in conditions.measurements)
        and _events_in_an_instant(conditions) < _FEWEST_IN_PACKETS
    ):
        raise UnplantableError("too few events share their stamps to be told from a packet that was written twice")
    earlier = rows_from(lambda rows: rows - rows % 2, count)
    return Fault("every second event repeats the one before", dict.fromkeys((_X, _Y, _T, _P), earlier))


def hot_pixel(conditions: CanaryConditions) -> Fault:
    """Every k-th event is one of the pixel (0, 0)."""
    events = conditions.facts.events
    if events is None or events.last_ns <= events.first_ns:
        raise UnplantableError("the events have no duration")
    all_hz = events.count * NS_PER_S / (events.last_ns - events.first_ns)
    rate_hz = conditions.size("loudest_pixel_excess")
    every = max(1, int(all_hz / rate_hz))

    def alter(column: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
        return np.where(rows % every == 0, column.dtype.type(0), column)

    return Fault(f"a pixel gives {all_hz / every:.3g} Hz too much", {key: values_by_row(alter) for key in (_X, _Y)})


def inverted_polarity(conditions: CanaryConditions) -> Fault:
    """Brighter is darker; what is neither stays."""
    return Fault("polarity is inverted", {_P: values(lambda p: np.where(p <= 1, 1 - p, p).astype(p.dtype))})


def mirrored(conditions: CanaryConditions) -> Fault:
    """Columns run from right to left."""
    last = _sensor(conditions).width - 1
    return Fault("events are mirrored", {_X: values(lambda x: np.where(x <= last, last - x, x).astype(x.dtype))})


def shifted(conditions: CanaryConditions) -> Fault:
    """Events lie too far to the right; what would leave the sensor comes back on its left."""
    columns, width = math.ceil(conditions.size("shift_right", at_least=1.0)), _sensor(conditions).width

    def alter(x: NDArray[Any]) -> NDArray[Any]:
        return np.where(x < width, (x.astype(np.int64) + columns) % width, x).astype(x.dtype)

    return Fault(f"events lie {columns} px too far to the right", {_X: values(alter)})


def _events_in_an_instant(conditions: CanaryConditions) -> float:
    events = conditions.facts.events
    if events is None or events.last_ns <= events.first_ns:
        return 0.0
    return events.count * events.grid_ns / (events.last_ns - events.first_ns)


def _sensor(conditions: CanaryConditions) -> Camera:
    return conditions.facts.declared.cameras["events"]
