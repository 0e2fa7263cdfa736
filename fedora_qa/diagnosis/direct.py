"""What findings measure, by their codes: a cause itself or an effect of it, in the whole file or at a place."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

_CHECKS: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "polarity_inverted": ("metadata.complete",),
        "dropped_samples": ("clocks.gaps", "event_stream.gaps"),
        "duplicated_samples": ("clocks.order", "event_stream.duplicates"),
        "unsorted": ("clocks.order",),
        "quantised_time": ("clocks.resolution", "clocks.rate", "clocks.order", "event_stream.gaps"),
        "time_jitter": ("event_response.jitter",),
        "quantised_values": ("integrity.resolution",),
        "time_unit": ("clocks.unit",),
        "interpolated_frames": ("event_response.interpolation",),
        "dead_region": ("event_response.conservation",),
        "hot_pixels": ("event_stream.rates", "event_response.conservation"),
        "quaternion_not_unit": ("pose.orientation",),
        "teleport": ("pose.continuity", "pose.noise"),
        "interpolated_pose": ("pose.continuity", "pose.noise"),
        "noise_misdeclared": ("imu.noise", "pose.noise", "event_response.conservation", "metadata.complete"),
        # A declared number that nothing can have, or another gain of the events without loss.
        "threshold_misdeclared": ("metadata.complete", "event_response.conservation"),
        "gravity_magnitude": ("metadata.complete",),
        # A ratio of noise that is just the factor of a unit.
        "unit_mm_m": ("pose.noise",),
        "unit_deg_rad": ("imu.noise",),
        "frozen_frames": ("images.repeats", "pose.continuity", "imu.noise"),
        "swapped_frames": ("images.order",),
        "exposure_or_gamma": ("images.exposure", "images.transfer"),
        "vignetting": ("images.vignetting", "images.exposure"),
        "channel_order": ("images.channels",),
        "invalid_encoding": ("integrity.finite",),
        "truncated": ("clocks.span", "integrity.readable"),
        "corrupt_chunk": ("integrity.readable",),
        "nan_in_stream": ("integrity.finite",),
        "rectification_misdeclared": ("metadata.cameras",),
        "missing_stream": ("integrity.layout", "metadata.complete"),
        "wrong_shape": ("integrity.layout", "integrity.readable", "metadata.complete"),
        "wrong_dtype": ("integrity.layout", "metadata.complete"),
    }
)
"""Names of checks by cause."""


_CHECKS_OF_STREAM: Final[Mapping[tuple[str, str], tuple[str, ...]]] = MappingProxyType(
    {
        # Depth frames that repeat are counted bit by bit; a pose that is held is fitted.
        ("frozen_frames", "depth"): ("depth.consistency",),
    }
)
"""Names of checks by cause and stream, where they measure the cause in that stream alone."""

_CODES: Final[Mapping[str, str]] = MappingProxyType({"truncated": "event_stream.gaps.silent_end"})
"""Codes of findings by cause, where other findings of their check measure another cause."""

_LOCAL_CHECKS: Final = frozenset(
    {"integrity.finite", "pose.continuity", "clocks.gaps", "event_response.conservation", "images.exposure"}
)
_LOCAL_RULES: Final = frozenset(
    {
        "worst",
        "local_bias",
        "local_time_offset",
        "stretch",
        "region",
        "tile",
        "tile_match",
        "frame",
        "field",
        "worst_pixel",
        "part",
        "backward_steps",
        # Counts of single steps and intervals, and a rate that changes: what the others are is in order.
        "jump",
        "change",
        "off_frames",
        "not_abutting",
    }
)

CHECKS_OF_CLOCKS: Final = frozenset({"clocks.order", "clocks.rate"})
"""Checks whose deviation is a clock's own: what clears it is a fault of the clock, though any such fault may."""

_BY_CONSTRUCTION: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "unsorted": ("clocks.order",),
        "duplicated_samples": ("event_stream.duplicates",),
        "clock_rate": ("clocks.rate", "clocks.resolution", "clocks.span", "images.repeats"),
        "time_offset": ("clocks.resolution", "images.repeats"),
        "event_model_misdeclared": ("event_response.conservation",),
    }
)
"""Checks whose findings vanish with a fault undone, whatever their cause is: sorted timestamps are in order, events of
which the repeated ones are left out repeat no other, whatever had given them one timestamp, timestamps
that are stretched by the measured rate have the nominal one, or the span of the others, those that were moved or
stretched do not lie on the grid on which they were, frames that were moved out of the measured time repeat no other,
and the law of the linear model bounds pixels without events and those of one sign alone, which events that are lost
seldom contradict."""


def check_of_code(code: str) -> str:
    """Return the name of the check of a finding, by its code ``<subject>.<property>.<rule>``."""
    return code.rpartition(".")[0]


def is_local(code: str) -> bool:
    """Whether a finding, by its code, is the deviation of a place or of some time, not of the whole file."""
    check, _, rule = code.rpartition(".")
    return check in _LOCAL_CHECKS or rule in _LOCAL_RULES


def is_of_stretch(code: str) -> bool:
    """Whether a finding, by its code, is the deviation of one stretch of time from the rest of the file."""
    return code.rpartition(".")[2] == "stretch"


def is_declared(code: str) -> bool:
    """Whether a finding, by its code, is of what the file declares."""
    return code.startswith("metadata.")


def is_direct(cause: str, code: str, stream: str | None = None) -> bool:
    """Whether a finding, by its code, is of a check that measures the cause itself, in a stream or in any."""
    of_streams = (
        check
        for (of_cause, of_stream), checks in _CHECKS_OF_STREAM.items()
        for check in checks
        if of_cause == cause and stream in (None, of_stream)
    )
    return check_of_code(code) in (*_CHECKS.get(cause, ()), *of_streams) or _CODES.get(cause) == code


def clears_by_construction(cause: str, code: str) -> bool:
    """Whether a finding, by its code, vanishes with a cause undone even where that is not the cause."""
    return check_of_code(code) in _BY_CONSTRUCTION.get(cause, ())
