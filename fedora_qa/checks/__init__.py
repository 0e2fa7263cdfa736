"""The checks, in a folder for each family of streams, and the order in which they are run and shown."""

from typing import Any, Final

from fedora_qa.checks.alignment import depth as alignment_depth
from fedora_qa.checks.alignment import events as alignment_events
from fedora_qa.checks.clocks import index_maps, rates, resolution, span, stamps, units
from fedora_qa.checks.depth import consistency, projection, scale
from fedora_qa.checks.depth import range as depth_range
from fedora_qa.checks.events import alignment as event_alignment
from fedora_qa.checks.events import conservation, duplicates, frames, orientation, response, rows, silence, timing
from fedora_qa.checks.events import rates as event_rates
from fedora_qa.checks.flow import events as flow_events
from fedora_qa.checks.flow import geometry, photometric, validity
from fedora_qa.checks.flow import rates as flow_rates
from fedora_qa.checks.images import channels, exposure, order, repeats, transfer
from fedora_qa.checks.integrity import finite, readable
from fedora_qa.checks.metadata import cameras, declarations, profile
from fedora_qa.checks.motion import continuity, imu, imu_noise, imu_timing, pose
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
