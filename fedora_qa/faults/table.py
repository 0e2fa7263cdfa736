"""The table of faults: for each cause and stream the fault that can be undone, or the reason why there is none."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from fedora_qa.causes import CAUSES, stream_family
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


@dataclass(frozen=True, slots=True)
class WithoutInverse:
    """A fault that cannot be undone.

    Attributes
    ----------
    reason
        The information that is lost, as a sentence.
    """

    reason: str


TableEntry = tuple[type[Any], ...] | WithoutInverse
"""Classes of ``ReversibleFault``, one a mechanism of the cause, or why there is none."""

_Rows = dict[tuple[str, str], TableEntry]


def _every(cause: str, entry: TableEntry, streams: Iterable[str] | None = None) -> _Rows:
    return {(cause, stream): entry for stream in (CAUSES[cause].streams if streams is None else streams)}


FAULTS: Final[Mapping[tuple[str, str], TableEntry]] = MappingProxyType(
    {
        **_every("time_offset", (clocks.ClockShift,)),
        **{("time_offset", stream): (clocks.ClockShift, row_order.DelayedFrames) for stream in ("depth", "rgb")},
        **{
            ("time_offset", stream): (clocks.ClockShift, sorted_clock.ClockSetBackAndSorted)
            for stream in ("imu", "pose")
        },
        **_every("clock_rate", (clocks.ClockRate,)),
        **_every("dropped_samples", WithoutInverse("The missing samples are not stored.")),
        **_every("duplicated_samples", (row_order.DuplicatedSamples,)),
        **_every("unsorted", (row_order.Unsorted,)),
        **_every("quantised_time", WithoutInverse("Rounding has removed the digits between two ticks.")),
        **_every("time_jitter", WithoutInverse("The random part of each timestamp is unknown.")),
        **_every("quantised_values", WithoutInverse("Rounding has removed the digits between two steps.")),
        **_every("time_unit", (clocks.TimeUnit,)),
        **_every("index_off_by_one", (index_maps.IndexShift,)),
        **_every("index_side", (index_maps.IndexSide,)),
        **_every("polarity_inverted", (pixels.PolarityInversion,)),
        **_every("axes_swapped", (pixels.SwappedPixelAxes,), ("events", "flow")),
        **_every("axes_swapped", (axes.VectorAxes,), ("imu", "pose")),
        ("axes_swapped", "metadata"): (axes.RectificationAxes,),
        **_every(
            "rectification_misdeclared",
            WithoutInverse("The map of the declared cameras replaces every map, so that to replace it proves nothing."),
        ),
        **_every("mirrored", (pixels.Mirroring,)),
        **_every("spatial_offset", (pixels.PixelShift,)),
        **_every("threshold_misdeclared", (declarations.ThresholdMisdeclared,)),
        **_every("event_model_misdeclared", (declarations.EventModelMisdeclared,)),
        **_every("interpolated_frames", WithoutInverse("Events between the frames were never computed.")),
        **_every("dead_region", WithoutInverse("Events of the region are not stored.")),
        **_every(
            "hot_pixels", WithoutInverse("False events of a pixel cannot be separated from its true ones in general.")
        ),
        **_every("unit_mm_m", (units.LengthUnit,)),
        **_every("unit_deg_rad", (units.AngleUnit,)),
        **_every("flow_unit", (units.FlowUnit,)),
        **_every("flow_sign", (units.FlowSign,)),
        **_every("flow_gain", (units.FlowGain,)),
        **_every("flow_rate_mixed", WithoutInverse("The correct fields of the rate are not stored.")),
        **_every("flow_interval_shifted", (flow.FlowIntervalShift,)),
        ("intrinsics_focal", "metadata"): (
            intrinsics.FocalLength,
            intrinsics.IntrinsicsOfSize,
            intrinsics.IntrinsicsOfSizes,
            intrinsic_units.FilmFocalLength,
            intrinsic_units.NormalisedIntrinsics,
        ),
        ("intrinsics_focal", "flow"): (intrinsics.FocalLength,),
        ("intrinsics_centre", "metadata"): (
            intrinsics.PrincipalPointShift,
            intrinsics.PrincipalPointFromMiddle,
            intrinsics.IntrinsicsOfAnotherImage,
            intrinsics.TransposedIntrinsics,
        ),
        ("intrinsics_centre", "flow"): (intrinsics.PrincipalPointShift,),
        **_every("extrinsic_rotation", (mountings.MountingRotation,)),
        **_every(
            "lever_arm",
            WithoutInverse(
                "The correction contains the derivative of noisy angular velocities, and depends on its filter."
            ),
            ("imu",),
        ),
        ("lever_arm", "pose"): (motion.PoseLeverArm,),
        ("lever_arm", "metadata"): (mountings.MountingLeverArm, mountings.MountingUnit),
        **_every("quaternion_order", (motion.QuaternionOrder,)),
        **_every("quaternion_inverted", (motion.QuaternionInversion, motion.PoseInversion)),
        **_every("quaternion_not_unit", (motion.QuaternionLength,)),
        ("frame_convention", "imu"): (axes.VectorAxes, gravity.SensorsInWorld),
        **_every("frame_convention", (axes.VectorAxes,), ("flow",)),
        ("frame_convention", "pose"): (axes.VectorAxes, motion.AngleOrder, motion.AngleSense),
        ("frame_convention", "metadata"): (mountings.CameraAxes, mountings.InvertedMounting),
        **_every("gravity_missing", (gravity.GravityError, gravity.GravityAlongBody)),
        **_every("gravity_sign", (gravity.GravityError, gravity.ForceSign)),
        ("gravity_magnitude", "imu"): (gravity.GravityError,),
        ("gravity_magnitude", "metadata"): (declarations.GravityMisdeclared,),
        **_every("gyro_bias", (motion.GyroBias,)),
        **_every("accel_bias", (motion.AccelBias,)),
        **_every("teleport", (motion.Teleport,)),
        **_every("interpolated_pose", WithoutInverse("The poses between those of the lower rate are not stored.")),
        **_every("noise_misdeclared", (declarations.NoiseMisdeclared,)),
        **_every("frozen_frames", WithoutInverse("The values that were not written are not stored.")),
        **_every("swapped_frames", (row_order.SwappedFrames, row_order.RotatedFrames, name_order.FramesInOrderOfNames)),
        **_every("other_sequence", WithoutInverse("The stream of this sequence is not in the file.")),
        **_every("channel_order", (images.ChannelOrder,)),
        **_every(
            "exposure_or_gamma",
            (images.ExposureGain, images.PowerCurve, images.TransferMisdeclared, images.DecodedTwice),
        ),
        **_every("vignetting", (images.Vignetting,)),
        **_every("depth_ray_not_z", (images.RayLength,)),
        **_every("invalid_encoding", (images.InvalidCode,)),
        **_every("truncated", WithoutInverse("The rows after the end are not in the file.")),
        **_every("corrupt_chunk", WithoutInverse("Damaged bytes cannot be decoded.")),
        **_every("nan_in_stream", WithoutInverse("The values that NaN has replaced are not stored.")),
        **_every("missing_stream", WithoutInverse("The stream is not in the file.")),
        **_every("wrong_shape", WithoutInverse("The correct axes and sizes are unknown.")),
        **_every(
            "wrong_dtype",
            WithoutInverse("Rows are read in the canonical type already; digits that the type cannot hold are lost."),
        ),
        **_every("flow_from_noisy_pose", WithoutInverse("The noise-free pose is not in the file.")),
        **_every("unknown", WithoutInverse("No mechanism is known.")),
    }
)
"""By cause and family of the stream (``flow`` for every rate), for each cause of ``fedora_qa.causes``."""


def faults_of(cause: str, stream: str) -> tuple[type[ReversibleFault], ...]:
    """Return the classes that undo a cause in a stream; empty where nothing does."""
    entry = FAULTS[cause, stream_family(stream)]
    return () if isinstance(entry, WithoutInverse) else entry
