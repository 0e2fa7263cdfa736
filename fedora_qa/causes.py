"""The causes of faults as pure data, shared by judgement, fault planting and the power study.

A cause is written ``stream:identifier`` where the stream matters (``events:time_offset``). Magnitudes are signed:
positive means timestamps too late, or values too large. Programs rely on identifiers: they never change.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

FRAMES: Final = ("rgb", "depth")
TIMED: Final = ("rgb", "depth", "events", "imu", "pose", "flow")
INDEX_MAPS: Final = ("rgb_to_event", "depth_to_event")
STREAMS: Final = (*TIMED, *INDEX_MAPS, "ms_to_event", "metadata")
"""Streams by name. ``flow`` is every rate together; one rate is ``flow/10hz`` and so on."""


@dataclass(frozen=True, slots=True)
class Cause:
    """One way in which a stream can be wrong.

    Attributes
    ----------
    identifier
        The stable name.
    streams
        The streams that it can affect.
    unit
        Unit of the magnitude; ``"1"`` for a pure number, ``""`` where the fault has no size.
    meaning
        What is wrong, as a clause that follows the stream's name.
    remedy
        What the maker of the file should do.
    """

    identifier: str
    streams: tuple[str, ...]
    unit: str
    meaning: str
    remedy: str


_ALL: Final = (
    Cause("time_offset", TIMED, "ms", "timestamps are late by a constant",
          "Subtract the offset from the timestamps, or remove the latency where they are taken."),
    Cause("clock_rate", TIMED, "ppm", "the clock has a wrong rate",
          "Take all timestamps from one clock."),
    Cause("dropped_samples", TIMED, "samples", "samples are missing",
          "Record again, or mark the gap; check for a full queue where the stream is written."),
    Cause("duplicated_samples", TIMED, "samples", "samples occur twice",
          "Write each sample once; check for a packet that is written twice."),
    Cause("unsorted", TIMED, "samples", "samples are not in the order of time",
          "Sort by time before writing."),
    Cause("quantised_time", TIMED, "ms", "timestamps lie on a coarse grid",
          "Keep the full resolution of the clock: no rounding to milliseconds, no float32 seconds."),
    Cause("time_jitter", ("events",), "ms", "timestamps scatter at random",
          "Take the timestamp of each event when its pixel fires, not when it is read or received."),
    Cause("quantised_values", ("depth", "flow", "pose", "imu"), "percent", "values are rounded to a coarse step",
          "Store the values as they are computed: float32 for images, float64 for samples."),
    Cause("time_unit", TIMED, "1", "timestamps are in another unit than microseconds",
          "Write int64 microseconds."),
    Cause("index_off_by_one", (*INDEX_MAPS, "ms_to_event"), "events", "indices are shifted by a constant",
          "Use searchsorted(t_event, t, side='left'), counted from 0, with t of each frame or millisecond."),
    Cause("index_side", INDEX_MAPS, "", "indices point after equal timestamps",
          "Use side='left': the earliest event with t >= t_frame."),
    Cause("polarity_inverted", ("events",), "", "polarity is inverted",
          "Write 1 for brighter and 0 for darker (the simulated DVS plugin uses the opposite)."),
    Cause("axes_swapped", ("events", "flow", "imu", "pose", "metadata"), "", "two axes are exchanged",
          "Write x as the column and y as the row; flow is (u right, v down)."),
    Cause("mirrored", ("events", "rgb", "depth", "flow"), "", "the image is mirrored",
          "Write columns from left to right and rows from top to bottom."),
    Cause("spatial_offset", ("events", "rgb", "depth", "flow"), "px", "the image is shifted",
          "Check crops, and half-pixel conventions between renderer and intrinsics."),
    Cause("threshold_misdeclared", ("events",), "percent", "the contrast threshold is not the declared one",
          "Declare the threshold that the sensor model used."),
    Cause("event_model_misdeclared", ("events",), "", "events follow another sensor model than the declared one",
          "Declare the model that the simulator computes: model='log' or model='linear'."),
    Cause("interpolated_frames", ("events",), "", "events are interpolated between frames",
          "Render at least once per pixel of image motion, and compute events from these renders."),
    Cause("dead_region", ("events",), "px", "a region of the sensor gives no events",
          "Check for a mask, a crop, or a lost tile."),
    Cause("hot_pixels", ("events",), "pixels", "pixels fire without a change of light",
          "Declare them in /metadata/events, or remove their events."),
    Cause("unit_mm_m", ("depth", "pose"), "1", "lengths are in another unit than declared",
          "Write depth in millimetres and positions in metres."),
    Cause("unit_deg_rad", ("imu",), "1", "angles are in another unit than radians",
          "Write angular velocity in rad/s."),
    Cause("flow_unit", ("flow",), "1", "flow is not in pixels over its interval",
          "Write the displacement over the interval, in px, neither divided nor multiplied by the time."),
    Cause("flow_sign", ("flow",), "", "flow points backwards",
          "Write the displacement from the start of the interval to its end, u right and v down."),
    Cause("flow_gain", ("flow",), "percent", "flow is too large by a factor",
          "Check the focal length, image size and interval from which the flow was computed."),
    Cause("flow_rate_mixed", ("flow",), "", "flow belongs to another rate",
          "Store each rate under its own name."),
    Cause("flow_interval_shifted", ("flow",), "intervals", "flow belongs to a neighbouring interval",
          "Write the start and end of each field's own interval."),
    Cause("intrinsics_focal", ("metadata", "flow"), "percent", "the focal length is wrong",
          "Declare the K with which the images were rendered, and compute the flow with the same K."),
    Cause("intrinsics_centre", ("metadata", "flow"), "px", "the principal point is wrong",
          "Use cx = (W-1)/2, cy = (H-1)/2 where integer coordinates are pixel centres."),
    Cause("extrinsic_rotation", ("metadata", "flow"), "deg", "the camera has another mounting rotation than declared",
          "Compare T_body_camera with the vehicle's description."),
    Cause("rectification_misdeclared", ("metadata",), "", "the lens of events, or the map that rectifies, is wrong",
          "Declare the lens of the stored events; compute the map once: cv2.undistortPoints with that K, lens and R."),
    Cause("lever_arm", ("imu", "pose", "metadata"), "m", "the stream belongs to another point of the body",
          "Refer IMU and pose to the same body origin, or declare the lever arm."),
    Cause("quaternion_order", ("pose",), "", "quaternions are in another order than x, y, z, w",
          "Write x, y, z, w."),
    Cause("quaternion_inverted", ("pose",), "", "quaternions, or whole poses, take the world to the body",
          "Write the rotation from body to world, and the position of the body in the world."),
    Cause("quaternion_not_unit", ("pose",), "1", "quaternions are not of unit length",
          "Normalise; add rotation noise as q * Exp(n), not by component."),
    Cause("frame_convention", ("imu", "pose", "flow", "metadata"), "", "axes follow another convention",
          "Body is X forward, Y left, Z up; world is ENU."),
    Cause("gravity_missing", ("imu",), "", "gravity has been removed from the accelerometer",
          "Write specific force: +g on Z at rest."),
    Cause("gravity_sign", ("imu",), "", "gravity has the wrong sign",
          "Write specific force: +g on Z at rest."),
    Cause("gravity_magnitude", ("imu", "metadata"), "m/s^2", "gravity is not the declared one",
          "Declare the simulator's gravity (9.8, 9.8066 and 9.81 are in use)."),
    Cause("gyro_bias", ("imu",), "rad/s", "the gyro has an undeclared bias",
          "Remove the bias or declare it."),
    Cause("accel_bias", ("imu",), "m/s^2", "the accelerometer has an undeclared bias",
          "Remove the bias or declare it."),
    Cause("teleport", ("pose",), "m", "the position jumps",
          "Check for a reset of the simulator or a loop closure."),
    Cause("interpolated_pose", ("pose",), "Hz", "poses are interpolated from a lower rate",
          "Record the pose at its own rate."),
    Cause("noise_misdeclared", ("imu", "pose", "events"), "percent", "noise is not the declared one",
          "Declare the noise that was added."),
    Cause("frozen_frames", ("rgb", "depth", "flow", "pose", "imu"), "samples", "values are frozen",
          "Check for a buffer that is written again without being refreshed."),
    Cause("swapped_frames", ("rgb", "depth", "flow"), "samples", "neighbouring frames are exchanged",
          "Write frames in the order of their timestamps."),
    Cause("other_sequence", TIMED, "", "the stream belongs to another sequence",
          "Check which files were merged."),
    Cause("channel_order", ("rgb",), "", "channels are in another order than R, G, B",
          "Convert from BGR before writing."),
    Cause("exposure_or_gamma", ("rgb",), "percent", "the transfer curve or exposure is not the declared one",
          "Declare the transfer (linear, srgb, gamma2.2)."),
    Cause("vignetting", ("rgb",), "percent", "frames get darker towards the corners",
          "Turn off the lens model of the camera, or divide by its flat field in linear light, before rounding."),
    Cause("depth_ray_not_z", ("depth",), "", "depth is the length of the ray instead of z",
          "Store the component along the optical axis."),
    Cause("invalid_encoding", ("depth", "flow"), "", "invalid pixels are not NaN",
          "Write NaN, not 0 or infinity, where there is no value."),
    Cause("truncated", (*TIMED, *INDEX_MAPS), "percent", "the stream or the file ends early",
          "Write the file again; close it before the process ends."),
    Cause("corrupt_chunk", (*TIMED, *INDEX_MAPS, "metadata"), "chunks", "stored bytes are damaged",
          "Copy the file again, and compare the checksums."),
    Cause("nan_in_stream", (*TIMED, *INDEX_MAPS, "metadata"), "samples", "values are not finite",
          "Check for a division by zero or an unset buffer where the stream is computed."),
    Cause("missing_stream", (*TIMED, *INDEX_MAPS, "metadata"), "", "is declared but absent",
          "Write the stream, or remove its declaration from the metadata."),
    Cause("wrong_shape", (*TIMED, *INDEX_MAPS, "metadata"), "", "has the wrong shape",
          "Follow the layout: see `fedora-qa layout`."),
    Cause("wrong_dtype", (*TIMED, *INDEX_MAPS, "metadata"), "", "has the wrong type",
          "Follow the layout: see `fedora-qa layout`."),
    Cause("flow_from_noisy_pose", ("flow",), "", "flow was computed from the noisy pose",
          "Compute flow from the noise-free pose."),
    Cause("unknown", STREAMS, "", "no known cause fits",
          "Read the findings and their evidence."),
)  # fmt: skip

CAUSES: Final[Mapping[str, Cause]] = MappingProxyType({cause.identifier: cause for cause in _ALL})
"""Every cause by its identifier, in a fixed order."""


def stream_family(stream: str) -> str:
    """``flow/10hz`` belongs to the family ``flow``; every other stream is its own family."""
    return stream.split("/", 1)[0]


def in_families(stream: str, families: frozenset[str] | None) -> bool:
    """Whether a stream is of one of the families; with None every stream is."""
    return families is None or stream_family(stream) in families


def allowed(cause: str, stream: str) -> bool:
    """Whether the cause can affect the stream (a single flow rate counts as flow)."""
    return stream_family(stream) in CAUSES[cause].streams
