"""The checks of the alignment of cameras, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.alignment.depth import AlignmentDepth
from fedora_qa.checks.alignment.events import AlignmentEvents
from fedora_qa.diagnosis import alignment
from fedora_qa.faults.canaries import images as image_faults
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(AlignmentDepth(), alignment.propose_depth, image_faults.shifted_depth),
    CatalogueRow(AlignmentEvents(), alignment.propose_events, image_faults.shifted_colour),
)
