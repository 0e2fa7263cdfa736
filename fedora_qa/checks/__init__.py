"""The checks, in a folder for each family of streams, and the order in which they are run and shown."""

from typing import Any, Final

from fedora_qa.checks.alignment import depth as alignment_depth
from fedora_qa.checks.alignment import events as alignment_events
from fedora_qa.checks.clocks import rate as rates
from fedora_qa.checks.clocks import resolution, span, stamps
from fedora_qa.checks.clocks import unit as units
from fedora_qa.checks.depth import consistency, projection, scale
from fedora_qa.checks.depth import range as depth_range
from fedora_qa.checks.event_response import alignment as event_alignment
from fedora_qa.checks.event_response import conservation, frames, orientation, timing
from fedora_qa.checks.event_response import threshold as response
from fedora_qa.checks.event_stream import bounds as rows
from fedora_qa.checks.event_stream import duplicates
from fedora_qa.checks.event_stream import gaps as silence
from fedora_qa.checks.event_stream import rates as event_rates
from fedora_qa.checks.flow_events import sharpness as flow_events
from fedora_qa.checks.flow_geometry import endpoint as geometry
from fedora_qa.checks.flow_geometry import validity
from fedora_qa.checks.flow_photometric import residual as photometric
from fedora_qa.checks.flow_rates import composition as flow_rates
from fedora_qa.checks.images import channels, exposure, order, repeats, transfer
from fedora_qa.checks.imu import noise as imu_noise
from fedora_qa.checks.imu import timing as imu_timing
from fedora_qa.checks.imu import translation as imu
from fedora_qa.checks.index_maps import index_maps
from fedora_qa.checks.integrity import finite, readable
from fedora_qa.checks.metadata import cameras, declarations, profile
from fedora_qa.checks.pose import continuity
from fedora_qa.checks.pose import orientation as pose
from fedora_qa.checks.protocol import Check

CHECKS: Final[tuple[Check[Any], ...]] = (
    readable.LayoutHolds(),
    readable.Readable(),
    finite.Finite(),
    declarations.Complete(),
    declarations.Units(),
    cameras.Cameras(),
    profile.Profile(),
    stamps.Order(),
    units.Unit(),
    rates.Rate(),
    stamps.Gaps(),
    span.Span(),
    resolution.Resolution(),
    index_maps.Rgb(),
    index_maps.Depth(),
    rows.Bounds(),
    duplicates.Repeats(),
    silence.Gaps(),
    event_rates.Rates(),
    orientation.Orientation(),
    response.Model(),
    response.Threshold(),
    timing.Timing(),
    event_alignment.Alignment(),
    frames.Frames(),
    conservation.Conservation(),
    alignment_depth.Depth(),
    alignment_events.Events(),
    photometric.Residual(),
    geometry.Endpoint(),
    validity.Validity(),
    flow_rates.Composition(),
    depth_range.Range(),
    consistency.Consistency(),
    scale.Scale(),
    projection.Projection(),
    repeats.Repeats(),
    order.Order(),
    exposure.Exposure(),
    channels.Channels(),
    transfer.Transfer(),
    flow_events.Sharpness(),
    pose.Orientation(),
    continuity.Continuity(),
    pose.Noise(),
    imu.Rotation(),
    imu.Translation(),
    imu_timing.Timing(),
    imu_noise.Noise(),
)
