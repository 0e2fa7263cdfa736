"""Faults of optical flow."""

from collections.abc import Callable, Iterable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.canary_conditions import CanaryConditions
from fedora_qa.faults.fault import Fault, values
from fedora_qa.faults.units import FlowGain, FlowSign

_BLOCK_PX: Final = 8


def larger(conditions: CanaryConditions) -> Fault:
    """Flow of every rate is too large by a factor."""
    return conditions.planted(FlowGain("flow", conditions.size("gain")))


def off_by_a_constant(conditions: CanaryConditions) -> Fault:
    """Flow of every rate is too large to the right by a constant."""
    size_px = conditions.size("endpoint_error")
    return _altered(conditions, f"flow is {size_px:.3g} px off", lambda flow: flow + _right(size_px))


def one_rate_off(conditions: CanaryConditions) -> Fault:
    """Flow of the slowest rate is too large to the right by a constant; flow of other rates is not altered."""
    size_px, stream = conditions.size(" error"), conditions.facts.flow_streams[0]
    return _altered(conditions, f"{stream} is {size_px:.3g} px off", lambda flow: flow + _right(size_px), [stream])


def backwards(conditions: CanaryConditions) -> Fault:
    """Flow has the opposite direction."""
    return conditions.planted(FlowSign())


def other_validity(conditions: CanaryConditions) -> Fault:
    """In one corner of 8 x 8 px NaN is replaced by 0, and values are replaced by NaN.

    Without poses they are replaced by infinity: only a pose states where a value must be.
    """
    no_value = np.float32(np.nan if "pose" in conditions.facts.streams else np.inf)

    def alter(flow: NDArray[Any]) -> NDArray[Any]:
        # Other readers may share the field that was read.
        altered = flow.copy()
        corner = altered[:, :_BLOCK_PX, :_BLOCK_PX]
        corner[:] = np.where(np.isnan(corner), np.float32(0), no_value)
        return altered

    written = "infinity" if np.isinf(no_value) else "NaN"
    return _altered(conditions, f"in a corner NaN of flow becomes 0, and values become {written}", alter)


def _right(size_px: float) -> NDArray[np.float32]:
    """Return a flow vector (u, v), px, u positive to the right."""
    return np.array([size_px, 0], dtype=np.float32)


def _altered(
    conditions: CanaryConditions,
    description: str,
    alter: Callable[[NDArray[Any]], NDArray[Any]],
    streams: Iterable[str] | None = None,
) -> Fault:
    wanted = conditions.facts.flow_streams if streams is None else streams
    return Fault(description, {f"path/{stream}": values(alter) for stream in wanted})
