"""The checks, in the order in which they run and are shown, with the proposals of causes and the canary of each.

Integrity, metadata and clocks come first: all later checks depend on them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any, Final

from fedora_qa.checks.alignment.depth import AlignmentDepth
from fedora_qa.checks.alignment.events import AlignmentEvents
from fedora_qa.checks.clocks.gaps import ClocksGaps
from fedora_qa.checks.clocks.order import ClocksOrder
from fedora_qa.checks.clocks.rate import ClocksRate
from fedora_qa.checks.clocks.resolution import ClocksResolution
from fedora_qa.checks.clocks.span import ClocksSpan
from fedora_qa.checks.clocks.unit import ClocksUnit
from fedora_qa.checks.depth.consistency import DepthConsistency
from fedora_qa.checks.depth.projection import DepthProjection
from fedora_qa.checks.depth.range import DepthRange
from fedora_qa.checks.depth.scale import DepthScale
from fedora_qa.checks.event_response.alignment import EventResponseAlignment
from fedora_qa.checks.event_response.conservation import EventResponseConservation
from fedora_qa.checks.event_response.frames import EventResponseFrames
from fedora_qa.checks.event_response.interpolation import EventResponseInterpolation
from fedora_qa.checks.event_response.jitter import EventResponseJitter
from fedora_qa.checks.event_response.model import EventResponseModel
from fedora_qa.checks.event_response.orientation import EventResponseOrientation
from fedora_qa.checks.event_response.threshold import EventResponseThreshold
from fedora_qa.checks.event_response.timing import EventResponseTiming
from fedora_qa.checks.event_stream.bounds import EventStreamBounds
from fedora_qa.checks.event_stream.duplicates import EventStreamDuplicates
from fedora_qa.checks.event_stream.gaps import EventStreamGaps
from fedora_qa.checks.event_stream.rates import EventStreamRates
from fedora_qa.checks.flow_events.sharpness import FlowEventsSharpness
from fedora_qa.checks.flow_geometry.endpoint import FlowGeometryEndpoint
from fedora_qa.checks.flow_geometry.validity import FlowGeometryValidity
from fedora_qa.checks.flow_photometric.residual import FlowPhotometricResidual
from fedora_qa.checks.flow_rates.composition import FlowRatesComposition
from fedora_qa.checks.images.channels import ImagesChannels
from fedora_qa.checks.images.exposure import ImagesExposure
from fedora_qa.checks.images.order import ImagesOrder
from fedora_qa.checks.images.repeats import ImagesRepeats
from fedora_qa.checks.images.transfer import ImagesTransfer
from fedora_qa.checks.images.vignetting import ImagesVignetting
from fedora_qa.checks.imu.noise import ImuNoise
from fedora_qa.checks.imu.rotation import ImuRotation
from fedora_qa.checks.imu.timing import ImuTiming
from fedora_qa.checks.imu.translation import ImuTranslation
from fedora_qa.checks.index_maps.depth import IndexMapsDepth
from fedora_qa.checks.index_maps.milliseconds import IndexMapsMilliseconds
from fedora_qa.checks.index_maps.rgb import IndexMapsRgb
from fedora_qa.checks.integrity.finite import IntegrityFinite
from fedora_qa.checks.integrity.layout import IntegrityLayout
from fedora_qa.checks.integrity.readable import IntegrityReadable
from fedora_qa.checks.integrity.resolution import IntegrityResolution
from fedora_qa.checks.metadata.cameras import MetadataCameras
from fedora_qa.checks.metadata.complete import MetadataComplete
from fedora_qa.checks.metadata.profile import MetadataProfile
from fedora_qa.checks.metadata.units import MetadataUnits
from fedora_qa.checks.pose.continuity import PoseContinuity
from fedora_qa.checks.pose.noise import PoseNoise
from fedora_qa.checks.pose.orientation import PoseOrientation
from fedora_qa.checks.protocol import Check
from fedora_qa.diagnosis import (
    alignment,
    clocks,
    depth,
    event_conservation,
    event_response,
    event_stream,
    flow_events,
    flow_photometric,
    flow_rates,
    images,
    imu,
    index_maps,
    integrity,
    metadata,
    pose,
)
from fedora_qa.diagnosis.flow_geometry.endpoint import propose_endpoint
from fedora_qa.diagnosis.flow_geometry.validity import propose_validity
from fedora_qa.diagnosis.hypothesis import Hypothesis, Propose
from fedora_qa.faults.canaries import damage, declarations, events, flow, motion, storage, timestamps
from fedora_qa.faults.canaries import images as image_faults
from fedora_qa.faults.canary_conditions import PlantCanary
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts


@dataclass(frozen=True, slots=True)
class CatalogueRow:
    """A check, the causes that its alarms suggest, and the fault that it must detect.

    Attributes
    ----------
    check
        Knows no cause.
    propose
        Returns the hypotheses for an alarm of the check.
    canary
        Returns the fault that is planted for the check.
    """

    check: Check[Any]
    propose: Propose
    canary: PlantCanary


_NEXT_EVENT_RGB: Final = partial(timestamps.next_event, index_map="rgb_to_event")
_NEXT_EVENT_DEPTH: Final = partial(timestamps.next_event, index_map="depth_to_event")
_NEXT_EVENT_MILLISECONDS: Final = partial(timestamps.next_event, index_map="ms_to_event")

CATALOGUE: Final = (
    CatalogueRow(IntegrityLayout(), integrity.propose_layout, declarations.absent_stream),
    CatalogueRow(IntegrityReadable(), integrity.propose_readable, damage.undecodable),
    CatalogueRow(IntegrityFinite(), integrity.propose_finite, damage.not_finite),
    CatalogueRow(IntegrityResolution(), integrity.propose_resolution, storage.coarse_values),
    CatalogueRow(MetadataComplete(), metadata.propose_complete, declarations.missing_attribute),
    CatalogueRow(MetadataUnits(), metadata.propose_units, declarations.wrong_label),
    CatalogueRow(MetadataCameras(), metadata.propose_cameras, declarations.stretched_mounting),
    CatalogueRow(MetadataProfile(), metadata.propose_profile, declarations.wider_camera),
    CatalogueRow(ClocksOrder(), clocks.propose_order, timestamps.exchanged_timestamps),
    CatalogueRow(ClocksUnit(), clocks.propose_unit, timestamps.in_nanoseconds),
    CatalogueRow(ClocksRate(), clocks.propose_rate, timestamps.wrong_rate),
    CatalogueRow(ClocksGaps(), clocks.propose_gaps, timestamps.lost_samples),
    CatalogueRow(ClocksSpan(), clocks.propose_span, timestamps.begins_late),
    CatalogueRow(ClocksResolution(), clocks.propose_resolution, timestamps.coarse_grid),
    CatalogueRow(IndexMapsRgb(), index_maps.propose_frame_to_event, _NEXT_EVENT_RGB),
    CatalogueRow(IndexMapsDepth(), index_maps.propose_frame_to_event, _NEXT_EVENT_DEPTH),
    CatalogueRow(IndexMapsMilliseconds(), index_maps.propose_milliseconds, _NEXT_EVENT_MILLISECONDS),
    CatalogueRow(EventStreamBounds(), event_stream.propose_bounds, events.outside_of_the_sensor),
    CatalogueRow(EventStreamDuplicates(), event_stream.propose_duplicates, events.repeated),
    CatalogueRow(EventStreamGaps(), event_stream.propose_gaps, timestamps.gap_in_events),
    CatalogueRow(EventStreamRates(), event_stream.propose_rates, events.hot_pixel),
    CatalogueRow(EventResponseOrientation(), event_response.propose_orientation, events.inverted_polarity),
    CatalogueRow(EventResponseModel(), event_response.propose_model, declarations.other_event_model),
    CatalogueRow(EventResponseThreshold(), event_response.propose_threshold, declarations.smaller_thresholds),
    CatalogueRow(EventResponseTiming(), event_response.propose_timing, timestamps.late_events),
    CatalogueRow(EventResponseJitter(), event_response.propose_jitter, timestamps.scattered_events),
    CatalogueRow(EventResponseAlignment(), event_response.propose_alignment, events.shifted),
    CatalogueRow(EventResponseFrames(), event_response.propose_frames, image_faults.exchanged_colour),
    CatalogueRow(EventResponseConservation(), event_conservation.propose_conservation, events.mirrored),
    CatalogueRow(EventResponseInterpolation(), event_response.propose_interpolation, events.interpolated),
    CatalogueRow(AlignmentDepth(), alignment.propose_depth, image_faults.shifted_depth),
    CatalogueRow(AlignmentEvents(), alignment.propose_events, image_faults.shifted_colour),
    CatalogueRow(FlowPhotometricResidual(), flow_photometric.propose_residual, flow.larger),
    CatalogueRow(FlowGeometryEndpoint(), propose_endpoint, flow.off_by_a_constant),
    CatalogueRow(FlowGeometryValidity(), propose_validity, flow.other_validity),
    CatalogueRow(FlowRatesComposition(), flow_rates.propose_composition, flow.one_rate_off),
    CatalogueRow(DepthRange(), depth.propose_range, image_faults.far_depth),
    CatalogueRow(DepthConsistency(), depth.propose_consistency, image_faults.uneven_depth),
    CatalogueRow(DepthScale(), depth.propose_scale, image_faults.scaled_depth),
    CatalogueRow(DepthProjection(), depth.propose_projection, image_faults.ray_depth),
    CatalogueRow(ImagesRepeats(), images.propose_repeats, image_faults.frozen_colour),
    CatalogueRow(ImagesOrder(), images.propose_order, image_faults.exchanged_colour),
    CatalogueRow(ImagesExposure(), images.propose_exposure, image_faults.darker_colour),
    CatalogueRow(ImagesChannels(), images.propose_channels, image_faults.exchanged_channels),
    CatalogueRow(ImagesTransfer(), images.propose_transfer, image_faults.other_transfer),
    CatalogueRow(ImagesVignetting(), images.propose_vignetting, image_faults.darker_corners),
    CatalogueRow(FlowEventsSharpness(), flow_events.propose_sharpness, flow.backwards),
    CatalogueRow(PoseOrientation(), pose.propose_orientation, motion.long_quaternions),
    CatalogueRow(PoseContinuity(), pose.propose_continuity, motion.teleport),
    CatalogueRow(PoseNoise(), pose.propose_noise, declarations.other_pose_noise),
    CatalogueRow(ImuRotation(), imu.propose_rotation, motion.gyro_bias),
    CatalogueRow(ImuTranslation(), imu.propose_translation, motion.accel_bias),
    CatalogueRow(ImuTiming(), imu.propose_timing, timestamps.late_imu),
    CatalogueRow(ImuNoise(), imu.propose_noise, declarations.other_imu_noise),
)  # fmt: skip

CHECKS: Final[tuple[Check[Any], ...]] = tuple(row.check for row in CATALOGUE)

PROPOSALS: Final[Mapping[str, Propose]] = MappingProxyType({row.check.name: row.propose for row in CATALOGUE})
"""By the name of the check."""

CANARIES: Final[Mapping[str, PlantCanary]] = MappingProxyType({row.check.name: row.canary for row in CATALOGUE})
"""By the name of the check."""


def hypotheses_of(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm, best supported first.

    Parameters
    ----------
    alarm
        Its check has a row in ``CATALOGUE``.
    facts
        Of the same file.

    Returns
    -------
    tuple
        One at least for most checks.
    """
    # The code of a finding is ``<subject>.<property>.<rule>``: without the rule it is the name of the check.
    return PROPOSALS[alarm.finding.code.rpartition(".")[0]](alarm, facts)
