"""The checks of stored values, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.integrity.finite import IntegrityFinite
from fedora_qa.checks.integrity.layout import IntegrityLayout
from fedora_qa.checks.integrity.readable import IntegrityReadable
from fedora_qa.checks.integrity.resolution import IntegrityResolution
from fedora_qa.diagnosis import integrity
from fedora_qa.faults.canaries import damage, declarations, storage
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(IntegrityLayout(), integrity.propose_layout, declarations.absent_stream),
    CatalogueRow(IntegrityReadable(), integrity.propose_readable, damage.undecodable),
    CatalogueRow(IntegrityFinite(), integrity.propose_finite, damage.not_finite),
    CatalogueRow(IntegrityResolution(), integrity.propose_resolution, storage.coarse_values),
)
