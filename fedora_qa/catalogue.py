"""The checks in the order in which they run, each with what proposes causes for its alarms, and with its canary.

Functions are listed by name, and imported where they are called: a run that selects a few checks loads no others, and
causes and canaries are seldom needed.
"""

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

from fedora_qa.check_names import module_of, selected_explanations

if TYPE_CHECKING:  # loads what measures, causes and faults
    from fedora_qa.checks.protocol import Check
    from fedora_qa.diagnosis.hypothesis import Hypothesis, Propose
    from fedora_qa.faults.canary_conditions import PlantCanary
    from fedora_qa.judgement.judge import Alarm
    from fedora_qa.sequence.facts import Facts

CATALOGUE: Final[Mapping[str, tuple[str, str]]] = {
    "integrity.layout": ("integrity.propose_layout", "declarations.absent_stream"),
    "integrity.readable": ("integrity.propose_readable", "damage.undecodable"),
    "integrity.finite": ("integrity.propose_finite", "damage.not_finite"),
    "integrity.resolution": ("integrity.propose_resolution", "damage.coarse_values"),
    "metadata.complete": ("metadata.propose_complete", "declarations.missing_attribute"),
    "metadata.units": ("metadata.propose_units", "declarations.wrong_label"),
    "metadata.cameras": ("metadata.propose_cameras", "declarations.stretched_mounting"),
    "metadata.profile": ("metadata.propose_profile", "declarations.wider_camera"),
    "clocks.order": ("clocks.propose_order", "clocks.exchanged_timestamps"),
    "clocks.unit": ("clocks.propose_unit", "clocks.in_nanoseconds"),
    "clocks.rate": ("clocks.propose_rate", "clocks.wrong_rate"),
    "clocks.gaps": ("clocks.propose_gaps", "clocks.lost_samples"),
    "clocks.span": ("clocks.propose_span", "clocks.begins_late"),
    "clocks.resolution": ("clocks.propose_resolution", "clocks.coarse_grid"),
    "index_maps.rgb": ("clocks.propose_frame_to_event", "clocks.next_event_rgb"),
    "index_maps.depth": ("clocks.propose_frame_to_event", "clocks.next_event_depth"),
    "index_maps.milliseconds": ("clocks.propose_milliseconds", "clocks.next_event_milliseconds"),
    "event_stream.bounds": ("event_stream.propose_bounds", "pixels.outside_of_the_sensor"),
    "event_stream.duplicates": ("event_stream.propose_duplicates", "pixels.repeated"),
    "event_stream.gaps": ("event_stream.propose_gaps", "clocks.gap_in_events"),
    "event_stream.rates": ("event_stream.propose_rates", "pixels.hot_pixel"),
    "event_response.orientation": ("event_response.propose_orientation", "pixels.inverted_polarity"),
    "event_response.model": ("event_response.propose_model", "declarations.other_event_model"),
    "event_response.threshold": ("event_response.propose_threshold", "declarations.smaller_thresholds"),
    "event_response.timing": ("event_response.propose_timing", "clocks.late_events"),
    "event_response.jitter": ("event_response.propose_jitter", "clocks.scattered_events"),
    "event_response.alignment": ("event_response.propose_alignment", "pixels.shifted"),
    "event_response.frames": ("event_response.propose_frames", "images.exchanged_colour"),
    "event_response.conservation": ("event_conservation.propose_conservation", "pixels.mirrored"),
    "event_response.interpolation": ("event_response.propose_interpolation", "pixels.interpolated"),
    "alignment.depth": ("alignment.propose_depth", "images.shifted_depth"),
    "alignment.events": ("alignment.propose_events", "images.displaced_events"),
    "flow_photometric.residual": ("flow.propose_residual", "flow.larger"),
    "flow_geometry.endpoint": ("flow_geometry.propose_endpoint", "flow.off_by_a_constant"),
    "flow_geometry.validity": ("flow_geometry.propose_validity", "flow.other_validity"),
    "flow_rates.composition": ("flow.propose_composition", "flow.one_rate_off"),
    "depth.range": ("depth.propose_range", "images.far_depth"),
    "depth.consistency": ("depth.propose_consistency", "images.uneven_depth"),
    "depth.scale": ("depth.propose_scale", "images.scaled_depth"),
    "depth.projection": ("depth.propose_projection", "images.ray_depth"),
    "images.repeats": ("images.propose_repeats", "images.frozen_colour"),
    "images.order": ("images.propose_order", "images.exchanged_colour"),
    "images.exposure": ("images.propose_exposure", "images.darker_colour"),
    "images.channels": ("images.propose_channels", "images.exchanged_channels"),
    "images.transfer": ("images.propose_transfer", "images.other_transfer"),
    "images.vignetting": ("images.propose_vignetting", "images.darker_corners"),
    "flow_events.sharpness": ("flow.propose_sharpness", "flow.backwards"),
    "pose.orientation": ("pose.propose_orientation", "motion.long_quaternions"),
    "pose.continuity": ("pose.propose_continuity", "motion.teleport"),
    "pose.noise": ("pose.propose_noise", "declarations.other_pose_noise"),
    "imu.rotation": ("imu.propose_rotation", "motion.gyro_bias"),
    "imu.translation": ("imu.propose_translation", "motion.accel_bias"),
    "imu.timing": ("imu.propose_timing", "clocks.late_imu"),
    "imu.noise": ("imu.propose_noise", "declarations.other_imu_noise"),
}
"""By check: the function of ``diagnosis/`` that proposes causes, and that of ``faults/`` that plants the canary.

All other checks depend on those of integrity, metadata and clocks, which are therefore the first.
"""


@cache
def _check_of(name: str) -> "Check[Any]":
    """Return a check: ``event_stream.gaps`` is an ``EventStreamGaps`` of ``checks/event_stream/gaps.py``."""
    class_name = "".join(word.capitalize() for word in name.replace(".", "_").split("_"))
    check: Check[Any] = getattr(import_module(module_of(name)), class_name)()
    return check


def all_checks() -> "tuple[Check[Any], ...]":
    """Return every check, in the order in which they run."""
    return tuple(map(_check_of, CATALOGUE))


def select_checks(select: tuple[str, ...], ignore: tuple[str, ...]) -> "tuple[Check[Any], ...]":
    """Return the checks that are asked for, in their fixed order.

    Raises
    ------
    MisuseError
        A name is that of no subject and no check.
    """
    return tuple(_check_of(explained.check) for explained in selected_explanations(select, ignore))


def canary_of(check: str) -> "PlantCanary | None":
    """Return the canary of a check, by its name; None where there is none."""
    if check not in CATALOGUE:
        return None
    canary: PlantCanary = _function("faults", CATALOGUE[check][1])
    return canary


def hypotheses_of(alarm: "Alarm", facts: "Facts") -> "tuple[Hypothesis, ...]":
    """Return the hypotheses for an alarm, best supported first.

    Raises
    ------
    KeyError
        The check is not in the catalogue.
    """
    # The code of a finding is ``<subject>.<property>.<rule>``: without the rule it is the name of the check.
    propose: Propose = _function("diagnosis", CATALOGUE[alarm.finding.code.rpartition(".")[0]][0])
    of_cameras: Propose = _function("diagnosis", "declared_cameras.of_declared_cameras")
    of_delays: Propose = _function("diagnosis", "clocks.of_varying_delays")
    return (*propose(alarm, facts), *of_cameras(alarm, facts), *of_delays(alarm, facts))


def _function(package: str, name: str) -> Any:
    module, _, function = name.partition(".")
    return getattr(import_module(f"fedora_qa.{package}.{module}"), function)
