"""Derivatives of the recomputed flow by the parameters that it is recomputed from: templates of small errors."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.motion_fit import FlowSample
from fedora_qa.geometry.camera import RigidMotion

Float64 = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class ParameterTemplate:
    """A parameter of the recomputed flow and the columns of its templates.

    Attributes
    ----------
    parameter, unit
        Its name, and the unit of its error.
    columns
        Of ``parameter_templates``.
    largest
        Error, in that unit, above which the template, a derivative, no longer approximates the change of the flow.
    """

    parameter: str
    unit: str
    columns: slice
    largest: float

    def size(self, fitted: Float64) -> float:
        """Return the norm of an error (k,) of several components, with the sign of the largest one."""
        return float(np.copysign(np.linalg.norm(fitted), fitted[np.argmax(np.abs(fitted))]))


FLOW_GAIN: Final = ParameterTemplate("flow_gain", "percent", slice(0, 1), np.inf)
FOCAL: Final = ParameterTemplate("intrinsics_focal", "percent", slice(1, 2), 30.0)
CENTRE: Final = ParameterTemplate("intrinsics_centre", "px", slice(2, 4), 100.0)
MOUNTING: Final = ParameterTemplate("extrinsic_rotation", "deg", slice(4, 7), 15.0)
LEVER_ARM: Final = ParameterTemplate("lever_arm", "m", slice(7, 10), 3.0)
TIME_OFFSET: Final = ParameterTemplate("time_offset", "ms", slice(10, 11), 50.0)

PARAMETER_TEMPLATES: Final = (FLOW_GAIN, FOCAL, CENTRE, MOUNTING, LEVER_ARM, TIME_OFFSET)

_PERCENT, _DEG, _MS = 0.01, np.pi / 180, 1e-3


def parameter_templates(
    K: Float64,
    motion: RigidMotion,
    sample: FlowSample,
    remounted: Callable[[Float64, Float64], RigidMotion],
    delayed: Callable[[float], RigidMotion | None],
) -> Float64:
    """Return the templates of all parameters: stored minus recomputed flow per unit of each error.

    Parameters
    ----------
    K, motion
        (3, 3) intrinsics, px, and motion of points between the camera frames, as declared.
    sample
        Pixels of the field.
    remounted
        Gives the motion if the true mounting is ``R_body_camera Exp(-rotation)`` and the true centre of the camera
        lies ``shift`` less along the axes of the body, for a rotation vector (3,), rad, and a shift (3,), m.
    delayed
        Gives the motion if the timestamps of the poses are too late by a number of seconds; None where no pose
        covers it.

    Returns
    -------
    ndarray of float64
        (n, 2, 11) px per unit of each of ``PARAMETER_TEMPLATES``; 0 for a time offset that no pose covers.
    """

    def flow(changed_K: Float64, changed_motion: RigidMotion) -> Float64:
        return sample.rigid_flow(changed_K, changed_motion)

    def refocused(ratio: float) -> Float64:
        # The declared focal length is ``ratio`` times the true one; skew scales with it, the centre stays.
        scaled: Float64 = K * np.array([[1 / ratio, 1 / ratio, 1.0], [1.0, 1 / ratio, 1.0], [1.0, 1.0, 1.0]])
        return scaled

    def recentred(axis: int, shift_px: float) -> Float64:
        changed = K.copy()
        changed[axis, 2] -= shift_px
        return changed

    # Central differences (f(x + h) - f(x - h)) / 2 h: their error is of second order in steps of a thousandth.
    step, step_s = 1e-3, 1e-3
    columns = [
        # A gain G adds G times the flow: the template needs no difference.
        flow(K, motion) * _PERCENT,
        _slope(flow(refocused(1 + step), motion), flow(refocused(1 - step), motion), step / _PERCENT),
    ]
    for axis in (0, 1):
        columns.append(_slope(flow(recentred(axis, step), motion), flow(recentred(axis, -step), motion), step))
    unchanged = np.zeros(3)
    for turn in np.eye(3) * step:
        columns.append(_slope(flow(K, remounted(turn, unchanged)), flow(K, remounted(-turn, unchanged)), step / _DEG))
    for shift in np.eye(3) * step:
        columns.append(_slope(flow(K, remounted(unchanged, shift)), flow(K, remounted(unchanged, -shift)), step))
    later, earlier = delayed(step_s), delayed(-step_s)
    if later is None or earlier is None:
        columns.append(np.zeros_like(columns[0]))
    else:
        columns.append(_slope(flow(K, later), flow(K, earlier), step_s / _MS))
    return np.stack(columns, axis=-1)


def _slope(ahead: Float64, behind: Float64, step: float) -> Float64:
    return (ahead - behind) / (2 * step)
