"""The checks of flow against events, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.flow_events.sharpness import FlowEventsSharpness
from fedora_qa.diagnosis import flow_events
from fedora_qa.faults.canaries import flow
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (CatalogueRow(FlowEventsSharpness(), flow_events.propose_sharpness, flow.backwards),)
