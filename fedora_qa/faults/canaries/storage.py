"""Faults of how values are stored."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.canary_conditions import CanaryConditions, UnplantableError
from fedora_qa.faults.fault import Fault, values

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
