"""The checks of flow at several rates, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.flow_rates.composition import FlowRatesComposition
from fedora_qa.diagnosis import flow_rates
from fedora_qa.faults.canaries import flow
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (CatalogueRow(FlowRatesComposition(), flow_rates.propose_composition, flow.one_rate_off),)
