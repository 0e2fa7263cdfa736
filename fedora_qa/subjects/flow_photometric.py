"""The checks of flow against colour, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.flow_photometric.residual import FlowPhotometricResidual
from fedora_qa.diagnosis import flow_photometric
from fedora_qa.faults.canaries import flow
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (CatalogueRow(FlowPhotometricResidual(), flow_photometric.propose_residual, flow.larger),)
