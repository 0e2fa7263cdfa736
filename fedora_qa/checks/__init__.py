"""The checks, one file a subject, in the order in which they are run and shown."""

from typing import Any, Final

from fedora_qa.checks import clocks, index_maps
from fedora_qa.checks.protocol import Check

CHECKS: Final[tuple[Check[Any], ...]] = (
    clocks.Order(),
    clocks.Unit(),
    clocks.Rate(),
    clocks.Gaps(),
    clocks.Span(),
    clocks.Resolution(),
    index_maps.Rgb(),
    index_maps.Depth(),
)
