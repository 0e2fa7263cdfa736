"""Canaries that nothing undoes: bytes that do not decode, values that are not finite or are rounded."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.faults.canary_conditions import CanaryConditions, UnplantableError
from fedora_qa.faults.fault import Fault, Read, values
from fedora_qa.layout.binding import INVALID_TIMESTAMP_NS
from fedora_qa.layout.canonical import spec_of, timestamps_of

_COARSE_FLOW_PX: Final = 0.7
_COARSE: Final[Mapping[str, float]] = MappingProxyType(
    {
        "path/depth": 700.0,
        "path/imu/linear_acceleration": 0.07,
        "path/pose/position": 0.07,
    }
)
"""Steps in the unit of the dataset (mm, m/s^2, m) that no use of the values tolerates. Images come first: they hold
enough values to show a step whatever the motion is."""


def undecodable(conditions: CanaryConditions) -> Fault:
    """No row of a dataset decodes. The timestamps of its stream decode, so that windows of the stream exist."""
    keys = [key for key in conditions.facts.layout.bindings if not spec_of(key).is_timestamps]
    images = [key for key in keys if spec_of(key).is_image]
    if not keys:
        raise UnplantableError("the file holds timestamps only")
    key = (images or keys)[0]

    def fail(read: Read, start: int, stop: int) -> NDArray[Any]:
        raise UnreadableRowsError(key, start, stop, "a canary: its bytes are as if damaged")

    return Fault(f"{key} does not decode", {key: fail})


def not_finite(conditions: CanaryConditions) -> Fault:
    """The first value of each row of a float dataset is infinite.

    In a file without float datasets all timestamps of a stream are invalid.
    """
    for key in conditions.facts.layout.bindings:
        if spec_of(key).dtype.startswith("float") and spec_of(key).stream in conditions.facts.streams:
            return Fault(f"a value of each row of {key} is infinite", {key: values(_first_infinite)})
    for stream, clock in conditions.facts.clocks.items():
        if len(clock.times_ns):
            invalid = values(lambda timestamps: np.full_like(timestamps, INVALID_TIMESTAMP_NS))
            return Fault(f"the timestamps of {stream} are NaN", {timestamps_of(stream): invalid})
    raise UnplantableError("the file holds no stream whose values could be other than finite")


def _first_infinite(stored: NDArray[Any]) -> NDArray[Any]:
    """Return a copy of rows (n, ...) whose first value of each row is infinite."""
    # Other readers may share the array that was read: an alteration never writes into it.
    altered = stored.copy()
    # Index 0 of each axis except that of time: one value for each row, for any rank.
    altered[(slice(None), *(slice(1),) * (stored.ndim - 1))] = np.inf
    return altered


def coarse_values(conditions: CanaryConditions) -> Fault:
    """All values of a dataset are rounded to a coarse step."""
    steps = {"path/depth": _COARSE["path/depth"]}
    steps |= {f"path/{stream}": _COARSE_FLOW_PX for stream in conditions.facts.flow_streams} | {**_COARSE}
    key = next((key for key in steps if key in conditions.facts.layout.bindings), None)
    if key is None:
        raise UnplantableError("the file has neither depth nor flow nor poses nor an IMU")
    step = steps[key]

    def alter(rows: NDArray[Any]) -> NDArray[Any]:
        return (step * np.rint(rows / step)).astype(rows.dtype)

    return Fault(f"{key} is rounded to steps of {step:g}", {key: values(alter)})
