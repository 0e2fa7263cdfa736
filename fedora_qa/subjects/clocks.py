"""The checks of timestamps, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.clocks.gaps import ClocksGaps
from fedora_qa.checks.clocks.order import ClocksOrder
from fedora_qa.checks.clocks.rate import ClocksRate
from fedora_qa.checks.clocks.resolution import ClocksResolution
from fedora_qa.checks.clocks.span import ClocksSpan
from fedora_qa.checks.clocks.unit import ClocksUnit
from fedora_qa.diagnosis import clocks
from fedora_qa.faults.canaries import timestamps
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(ClocksOrder(), clocks.propose_order, timestamps.exchanged_timestamps),
    CatalogueRow(ClocksUnit(), clocks.propose_unit, timestamps.in_nanoseconds),
    CatalogueRow(ClocksRate(), clocks.propose_rate, timestamps.wrong_rate),
    CatalogueRow(ClocksGaps(), clocks.propose_gaps, timestamps.lost_samples),
    CatalogueRow(ClocksSpan(), clocks.propose_span, timestamps.begins_late),
    CatalogueRow(ClocksResolution(), clocks.propose_resolution, timestamps.coarse_grid),
)
