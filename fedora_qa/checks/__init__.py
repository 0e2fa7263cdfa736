"""The checks, one file each: checks/<subject>/<property>.py; and the order in which they run and are shown."""

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
from fedora_qa.checks.imu.noise import ImuNoise
from fedora_qa.checks.imu.rotation import ImuRotation
from fedora_qa.checks.imu.timing import ImuTiming
from fedora_qa.checks.imu.translation import ImuTranslation
from fedora_qa.checks.index_maps.depth import IndexMapsDepth
from fedora_qa.checks.index_maps.rgb import IndexMapsRgb
from fedora_qa.checks.integrity.finite import IntegrityFinite
from fedora_qa.checks.integrity.layout import IntegrityLayout
from fedora_qa.checks.integrity.readable import IntegrityReadable
from fedora_qa.checks.metadata.cameras import MetadataCameras
from fedora_qa.checks.metadata.complete import MetadataComplete
from fedora_qa.checks.metadata.profile import MetadataProfile
from fedora_qa.checks.metadata.units import MetadataUnits
from fedora_qa.checks.pose.continuity import PoseContinuity
from fedora_qa.checks.pose.noise import PoseNoise
from fedora_qa.checks.pose.orientation import PoseOrientation
from fedora_qa.checks.protocol import Check

# Integrity, metadata and clocks come first: all later checks depend on them.
CHECKS: Final[tuple[Check[Any], ...]] = (
    IntegrityLayout(),
    IntegrityReadable(),
    IntegrityFinite(),
    MetadataComplete(),
    MetadataUnits(),
    MetadataCameras(),
    MetadataProfile(),
    ClocksOrder(),
    ClocksUnit(),
    ClocksRate(),
    ClocksGaps(),
    ClocksSpan(),
    ClocksResolution(),
    IndexMapsRgb(),
    IndexMapsDepth(),
    EventStreamBounds(),
    EventStreamDuplicates(),
    EventStreamGaps(),
    EventStreamRates(),
    EventResponseOrientation(),
    EventResponseModel(),
    EventResponseThreshold(),
    EventResponseTiming(),
    EventResponseAlignment(),
    EventResponseFrames(),
    EventResponseConservation(),
    AlignmentDepth(),
    AlignmentEvents(),
    FlowPhotometricResidual(),
    FlowGeometryEndpoint(),
    FlowGeometryValidity(),
    FlowRatesComposition(),
    DepthRange(),
    DepthConsistency(),
    DepthScale(),
    DepthProjection(),
    ImagesRepeats(),
    ImagesOrder(),
    ImagesExposure(),
    ImagesChannels(),
    ImagesTransfer(),
    FlowEventsSharpness(),
    PoseOrientation(),
    PoseContinuity(),
    PoseNoise(),
    ImuRotation(),
    ImuTranslation(),
    ImuTiming(),
    ImuNoise(),
)
