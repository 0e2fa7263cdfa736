"""The fault that is planted for each check."""

from collections.abc import Callable, Mapping
from functools import partial
from types import MappingProxyType
from typing import Final

from fedora_qa.faults import damage, declarations, events, flow, images, motion, timestamps
from fedora_qa.faults.canary_conditions import CanaryConditions
from fedora_qa.faults.fault import Fault

Planter = Callable[[CanaryConditions], Fault]
"""Returns the fault, whose size follows from the conditions; raises ``UnplantableError`` where it cannot be planted."""

CANARIES: Final[Mapping[str, Planter]] = MappingProxyType(
    {
        "integrity.layout": declarations.absent_stream,
        "integrity.readable": damage.undecodable,
        "integrity.finite": damage.not_finite,
        "metadata.complete": declarations.missing_attribute,
        "metadata.units": declarations.wrong_label,
        "metadata.cameras": declarations.stretched_mounting,
        "metadata.profile": declarations.wider_camera,
        "clocks.order": timestamps.exchanged_timestamps,
        "clocks.unit": timestamps.in_nanoseconds,
        "clocks.rate": timestamps.wrong_rate,
        "clocks.gaps": timestamps.lost_samples,
        "clocks.span": timestamps.begins_late,
        "clocks.resolution": timestamps.coarse_grid,
        "index_maps.rgb": partial(timestamps.next_event, index_map="rgb_to_event"),
        "index_maps.depth": partial(timestamps.next_event, index_map="depth_to_event"),
        "event_stream.bounds": events.outside_of_the_sensor,
        "event_stream.duplicates": events.repeated,
        "event_stream.gaps": timestamps.gap_in_events,
        "event_stream.rates": events.hot_pixel,
        "event_response.orientation": events.inverted_polarity,
        "event_response.model": declarations.other_event_model,
        "event_response.threshold": declarations.smaller_thresholds,
        "event_response.timing": timestamps.late_events,
        "event_response.alignment": events.shifted,
        "event_response.frames": images.exchanged_colour,
        "event_response.conservation": events.mirrored,
        "alignment.depth": images.shifted_depth,
        "alignment.events": images.shifted_colour,
        "flow_photometric.residual": flow.larger,
        "flow_geometry.endpoint": flow.off_by_a_constant,
        "flow_geometry.validity": flow.other_validity,
        "flow_rates.composition": flow.one_rate_off,
        "depth.range": images.far_depth,
        "depth.consistency": images.uneven_depth,
        "depth.scale": images.scaled_depth,
        "depth.projection": images.ray_depth,
        "images.repeats": images.frozen_colour,
        "images.order": images.exchanged_colour,
        "images.exposure": images.darker_colour,
        "images.channels": images.exchanged_channels,
        "images.transfer": images.other_transfer,
        "flow_events.sharpness": flow.backwards,
        "pose.orientation": motion.long_quaternions,
        "pose.continuity": motion.teleport,
        "pose.noise": declarations.other_pose_noise,
        "imu.rotation": motion.gyro_bias,
        "imu.translation": motion.accel_bias,
        "imu.timing": timestamps.late_imu,
        "imu.noise": declarations.other_imu_noise,
    }
)
"""By the name of the check, in the order of the checks. Every check has one; a test verifies this."""
