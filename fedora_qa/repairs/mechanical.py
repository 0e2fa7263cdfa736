"""Which faults are repaired: those whose undoing follows from the definitions of the format, up to one fitted time.

Timestamps may be shifted and rescaled by a fitted size: they are coordinates, and the shift is the diagnosis.
Declarations may be replaced by what was measured. Measured values are only converted: to another unit, sign, order or
code. An estimate is never subtracted from them, because whoever reads the file would take it for a measurement.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import log10, pi
from types import MappingProxyType
from typing import Any, Final

import numpy as np

from fedora_qa.conventions import NS_PER_US
from fedora_qa.faults import (
    axes,
    clocks,
    declarations,
    flow,
    gravity,
    images,
    index_maps,
    intrinsic_units,
    intrinsics,
    motion,
    mountings,
    name_order,
    pixels,
    row_order,
    sorted_clock,
    units,
)
from fedora_qa.faults.fault import ReversibleFault
from fedora_qa.faults.image_part import ImagePart

_MECHANICAL: Final = ""

_Reason = str | Callable[[Any], str]
"""Why a fault is not repaired, empty where it is; or a function of the fault that returns this."""


def _only_declared(fault: Any) -> str:
    """Return why a fault is not repaired that concerns either a declaration or the flow made with it."""
    made = "Flow would be computed from noisy poses and rounded depth; compute it again from their source."
    return _MECHANICAL if fault.stream == "metadata" else made


def _only_permuted(fault: axes.VectorAxes) -> str:
    """Return why axes are not rotated back: only exchanged and negated ones are exact."""
    matrices = np.array([fault.axes, fault.body_axes])
    # Every entry of an orthogonal matrix that only exchanges and negates axes is -1, 0 or 1.
    turned = "The axes are rotated by a fitted rotation, whose error would enter every value; compute them again."
    return _MECHANICAL if np.all(np.isin(matrices, (-1.0, 0.0, 1.0))) else turned


def _only_lengths(fault: images.RayLength) -> str:
    fitted = "The values are not lengths of rays: the exponent is fitted."
    return _MECHANICAL if abs(fault.exponent) == 1 else fitted


_CODES: Final = "Codes of 8 bits have lost information: rounding merges codes, and white is clipped; render again."
_BIAS: Final = "A bias is an estimate, and differs between samples: declare it, or remove it at its source."
_GRAVITY: Final = "The attitude is known only from noisy orientations, whose errors would enter every sample."

MECHANICAL: Final[Mapping[type[Any], _Reason]] = MappingProxyType(
    {
        clocks.ClockShift: _MECHANICAL,
        sorted_clock.ClockSetBackAndSorted: _MECHANICAL,
        clocks.ClockRate: _MECHANICAL,
        clocks.TimeUnit: _MECHANICAL,
        row_order.DuplicatedSamples: _MECHANICAL,
        row_order.Unsorted: _MECHANICAL,
        row_order.SwappedFrames: _MECHANICAL,
        row_order.RotatedFrames: _MECHANICAL,
        name_order.FramesInOrderOfNames: _MECHANICAL,
        row_order.DelayedFrames: "Frames that the values of others have replaced are lost; export them again.",
        index_maps.IndexShift: _MECHANICAL,
        index_maps.IndexSide: _MECHANICAL,
        pixels.PolarityInversion: _MECHANICAL,
        pixels.SwappedPixelAxes: _MECHANICAL,
        pixels.Mirroring: _MECHANICAL,
        pixels.PixelShift: "Pixels that were shifted beyond the border are not stored; crop or render again.",
        axes.VectorAxes: _only_permuted,
        mountings.CameraAxes: _MECHANICAL,
        mountings.InvertedMounting: _MECHANICAL,
        axes.RectificationAxes: "A map follows from the calibration: compute it again.",
        intrinsics.FocalLength: _only_declared,
        intrinsics.PrincipalPointShift: _only_declared,
        mountings.MountingRotation: _only_declared,
        mountings.MountingLeverArm: _MECHANICAL,
        mountings.MountingUnit: _MECHANICAL,
        intrinsics.TransposedIntrinsics: _MECHANICAL,
        intrinsics.IntrinsicsOfAnotherImage: _MECHANICAL,
        intrinsics.PrincipalPointFromMiddle: _MECHANICAL,
        intrinsics.IntrinsicsOfSizes: "That both sizes have the same view is an assumption; calibrate the cameras.",
        intrinsics.IntrinsicsOfSize: "That both sizes have the same view is an assumption; calibrate the camera.",
        intrinsic_units.NormalisedIntrinsics: _MECHANICAL,
        intrinsic_units.FilmFocalLength: "The size of the film is an assumption; calibrate the camera.",
        declarations.ThresholdMisdeclared: _MECHANICAL,
        declarations.EventModelMisdeclared: _MECHANICAL,
        declarations.NoiseMisdeclared: _MECHANICAL,
        declarations.GravityMisdeclared: _MECHANICAL,
        flow.FlowIntervalShift: "The field at one end of the sequence is not stored; compute the flow again.",
        images.ChannelOrder: _MECHANICAL,
        images.ExposureGain: _CODES,
        images.DecodedTwice: _CODES,
        images.PowerCurve: _CODES,
        images.TransferMisdeclared: _MECHANICAL,
        images.Vignetting: _CODES,
        images.RayLength: _only_lengths,
        images.InvalidCode: _MECHANICAL,
        motion.GyroBias: _BIAS,
        motion.AccelBias: _BIAS,
        motion.Teleport: "The size of a jump is an estimate, and positions between the jumps may be lost.",
        motion.PoseLeverArm: "The arm is an estimate, and noise of the orientations would enter every position.",
        gravity.GravityError: _GRAVITY,
        gravity.SensorsInWorld: _GRAVITY,
        motion.QuaternionOrder: _MECHANICAL,
        motion.QuaternionInversion: _MECHANICAL,
        motion.PoseInversion: _MECHANICAL,
        motion.AngleOrder: _MECHANICAL,
        motion.AngleSense: _MECHANICAL,
        gravity.GravityAlongBody: _MECHANICAL,
        gravity.ForceSign: _MECHANICAL,
        motion.QuaternionLength: _MECHANICAL,
        units.LengthUnit: _MECHANICAL,
        units.AngleUnit: _MECHANICAL,
        units.FlowUnit: _MECHANICAL,
        units.FlowSign: _MECHANICAL,
        units.FlowGain: "The factor is an estimate, and not the ratio of two units; compute the flow again.",
    }
)
"""By class of fault: empty where it is repaired, else the reason why not."""

UNIT_FAULTS: Final = (units.LengthUnit, units.AngleUnit, units.FlowUnit, clocks.TimeUnit)
"""Faults after whose repair a label of a unit is that of the layout."""

ROW_FAULTS: Final = (row_order.DuplicatedSamples, row_order.Unsorted)
"""Faults whose repair moves whole samples to other rows."""


def why_not_mechanical(fault: ReversibleFault) -> str:
    """Return the reason why a fault is not repaired, as a sentence; empty where it is."""
    if isinstance(fault, ImagePart):
        return "The edges of the part are an estimate, and what crossed them is lost."
    reason = MECHANICAL[type(fault)]
    return reason if isinstance(reason, str) else reason(fault)


def exact(fault: ReversibleFault) -> ReversibleFault:
    """Return the fault with the exact ratio of the two units nearest to its factor, or a shift in whole microseconds.

    Lengths are in powers of ten of each other; rad and deg differ by 180 / pi. A factor between two units is a gain
    that bears the name of a unit. It is as far from the nearest ratio after the repair as before, so that the check of
    the result refuses it. Of timestamps in whole microseconds, which the format has, all move alike by a whole number:
    each event stays on its side of each frame, and the index maps are those of the timestamps as they are stored.
    """
    match fault:
        case clocks.ClockShift():
            return replace(fault, offset_ns=float(NS_PER_US * round(fault.offset_ns / NS_PER_US)))
        case units.LengthUnit():
            return replace(fault, factor=10.0 ** round(log10(fault.factor)))
        case units.AngleUnit():
            return replace(fault, factor=180 / pi if fault.factor > 1 else pi / 180)
    return fault
