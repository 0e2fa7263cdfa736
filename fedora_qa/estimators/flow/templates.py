"""How the recomputed flow changes under small faults of what it is recomputed from: templates for diagnosis."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.motion_fit import FlowSample
from fedora_qa.geometry.camera import RigidMotion
from fedora_qa.geometry.rigid_flow import rigid_flow

Float64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SmallFault:
    """A cause, the unit of its size, and the columns of its templates.

    ``streams`` are those that it can befall with the same effect here, each with the weight that it is given: where
    nothing else tells them apart the first is meant. A stream among ``opposite`` has it with the other sign. Beyond
    ``largest`` the template, a derivative, says nothing.
    """

    cause: str
    streams: tuple[tuple[str, float], ...]
    unit: str
    columns: slice
    largest: float
    opposite: tuple[str, ...] = ()

    def size(self, fitted: Float64) -> float:
        """Return one signed number for a fault of several components: their norm, with the largest one's sign."""
        return float(np.copysign(np.linalg.norm(fitted), fitted[np.argmax(np.abs(fitted))]))


_DECLARED: Final = (("metadata", 1.0), ("flow", 0.95))

FLOW_GAIN: Final = SmallFault("flow_gain", (("flow", 1.0),), "percent", slice(0, 1), np.inf)
TIME_OFFSET: Final = SmallFault(
    "time_offset", (("pose", 1.0), ("flow", 0.95)), "ms", slice(10, 11), 50.0, opposite=("flow",)
)

FOCAL: Final = SmallFault("intrinsics_focal", _DECLARED, "percent", slice(1, 2), 30.0, opposite=("flow",))
CENTRE: Final = SmallFault("intrinsics_centre", _DECLARED, "px", slice(2, 4), 100.0, opposite=("flow",))
MOUNTING: Final = SmallFault("extrinsic_rotation", _DECLARED, "deg", slice(4, 7), 15.0, opposite=("flow",))

SMALL_FAULTS: Final = (
    FLOW_GAIN,
    FOCAL,
    CENTRE,
    MOUNTING,
    SmallFault("lever_arm", (("metadata", 1.0), ("pose", 0.95)), "m", slice(7, 10), 3.0),
    TIME_OFFSET,
)

_PERCENT, _DEG, _MS = 0.01, np.pi / 180, 1e-3


def small_fault_templates(
    K: Float64,
    motion: RigidMotion,
    sample: FlowSample,
    remounted: Callable[[Float64, Float64], RigidMotion],
    delayed: Callable[[float], RigidMotion | None],
) -> Float64:
    """Return templates (n, 2, 11): stored minus recomputed flow in px per unit of each of ``SMALL_FAULTS``.

    Parameters
    ----------
    K, motion
        As declared.
    remounted
        The motion when the camera is really mounted with ``R_body_camera Exp(-rotation)`` and its centre ``shift``
        metres less along the body's axes, for a rotation vector (3,) and a shift (3,).
    delayed
        The motion when the poses' stamps are too late by so many seconds; None where no pose covers it.
    """

    def flow(changed_K: Float64, changed_motion: RigidMotion) -> Float64:
        return rigid_flow(changed_K, changed_motion, sample.columns, sample.rows, sample.depths_m)

    def refocused(ratio: float) -> Float64:
        scaled: Float64 = K * np.array([[1 / ratio, 1 / ratio, 1.0], [1.0, 1 / ratio, 1.0], [1.0, 1.0, 1.0]])
        return scaled

    def recentred(axis: int, shift_px: float) -> Float64:
        changed = K.copy()
        changed[axis, 2] -= shift_px
        return changed

    step, step_s = 1e-3, 1e-3
    columns = [
        flow(K, motion) * _PERCENT,
        _slope(flow(refocused(1 + step), motion), flow(refocused(1 - step), motion), step / _PERCENT),
    ]
    for axis in (0, 1):
        columns.append(_slope(flow(recentred(axis, step), motion), flow(recentred(axis, -step), motion), step))
    none = np.zeros(3)
    for turn in np.eye(3) * step:
        columns.append(_slope(flow(K, remounted(turn, none)), flow(K, remounted(-turn, none)), step / _DEG))
    for shift in np.eye(3) * step:
        columns.append(_slope(flow(K, remounted(none, shift)), flow(K, remounted(none, -shift)), step))
    later, earlier = delayed(step_s), delayed(-step_s)
    if later is None or earlier is None:
        columns.append(np.zeros_like(columns[0]))
    else:
        columns.append(_slope(flow(K, later), flow(K, earlier), step_s / _MS))
    return np.stack(columns, axis=-1)


def _slope(ahead: Float64, behind: Float64, step: float) -> Float64:
    return (ahead - behind) / (2 * step)
