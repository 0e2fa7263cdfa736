"""The checks, in a folder for each family of streams, and the order in which they are run and shown."""

from typing import Any, Final

from fedora_qa.checks.clocks import index_maps, rates, stamps
from fedora_qa.checks.events import alignment, conservation, frames, orientation, response, rows, silence, timing
from fedora_qa.checks.events import rates as event_rates
from fedora_qa.checks.flow import geometry, photometric, validity
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
    rates.Unit(),
    rates.Rate(),
    stamps.Gaps(),
    stamps.Span(),
    stamps.Resolution(),
    index_maps.Rgb(),
    index_maps.Depth(),
    rows.Bounds(),
    rows.Repeats(),
    silence.Gaps(),
    event_rates.Rates(),
    orientation.Orientation(),
    response.Model(),
    response.Threshold(),
    timing.Timing(),
    alignment.Alignment(),
    frames.Frames(),
    conservation.Conservation(),
    photometric.Residual(),
    geometry.Endpoint(),
    validity.Validity(),
    pose.Orientation(),
    continuity.Continuity(),
    pose.Noise(),
    imu.Rotation(),
    imu.Translation(),
    imu_timing.Timing(),
    imu_noise.Noise(),
)
