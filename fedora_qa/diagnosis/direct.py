"""Which check measures a cause itself, and not only an effect that other causes could have too."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

_CHECKS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "dropped_samples": ("clocks.gaps", "event_stream.gaps"),
        "duplicated_samples": ("clocks.order", "event_stream.duplicates"),
        "unsorted": ("clocks.order",),
        "quantised_time": ("clocks.resolution", "clocks.rate"),
        "time_jitter": ("event_response.jitter",),
        "quantised_values": ("integrity.resolution",),
        "time_unit": ("clocks.unit",),
        "interpolated_frames": ("event_response.interpolation",),
        "dead_region": ("event_response.conservation",),
        "hot_pixels": ("event_stream.rates",),
        "quaternion_not_unit": ("pose.orientation",),
        "teleport": ("pose.continuity",),
        "interpolated_pose": ("pose.continuity",),
        "noise_misdeclared": ("imu.noise", "pose.noise"),
        "frozen_frames": ("images.repeats", "pose.continuity", "imu.noise"),
        "swapped_frames": ("images.order",),
        "exposure_or_gamma": ("images.exposure", "images.transfer"),
        "vignetting": ("images.vignetting",),
        "channel_order": ("images.channels",),
        "invalid_encoding": ("integrity.finite",),
        "truncated": ("clocks.span", "integrity.readable"),
        "corrupt_chunk": ("integrity.readable",),
        "nan_in_stream": ("integrity.finite",),
        "missing_stream": ("integrity.layout", "metadata.complete"),
        "wrong_shape": ("integrity.layout", "metadata.complete"),
        "wrong_dtype": ("integrity.layout", "metadata.complete"),
    }
)
"""Names of checks by cause."""


def is_direct(cause: str, code: str) -> bool:
    """Whether a finding, by its code, is of a check that measures the cause itself."""
    return code.rpartition(".")[0] in _CHECKS.get(cause, ())
