"""The checks, one file a subject, in the order in which they are run and shown."""

from typing import Any, Final

from fedora_qa.checks import (
    clock_rates,
    clocks,
    index_maps,
    integrity,
    integrity_finite,
    metadata,
    metadata_cameras,
    metadata_profile,
)
from fedora_qa.checks.protocol import Check

CHECKS: Final[tuple[Check[Any], ...]] = (
    integrity.LayoutHolds(),
    integrity.Readable(),
    integrity_finite.Finite(),
    metadata.Complete(),
    metadata.Units(),
    metadata_cameras.Cameras(),
    metadata_profile.Profile(),
    clocks.Order(),
    clock_rates.Unit(),
    clock_rates.Rate(),
    clocks.Gaps(),
    clocks.Span(),
    clocks.Resolution(),
    index_maps.Rgb(),
    index_maps.Depth(),
)
