"""The checks of flow against depth and poses, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.flow_geometry.endpoint import FlowGeometryEndpoint
from fedora_qa.checks.flow_geometry.validity import FlowGeometryValidity
from fedora_qa.diagnosis.flow_geometry.endpoint import propose_endpoint
from fedora_qa.diagnosis.flow_geometry.validity import propose_validity
from fedora_qa.faults.canaries import flow
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(FlowGeometryEndpoint(), propose_endpoint, flow.off_by_a_constant),
    CatalogueRow(FlowGeometryValidity(), propose_validity, flow.other_validity),
)
