"""The checks of declarations, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.metadata.cameras import MetadataCameras
from fedora_qa.checks.metadata.complete import MetadataComplete
from fedora_qa.checks.metadata.profile import MetadataProfile
from fedora_qa.checks.metadata.units import MetadataUnits
from fedora_qa.diagnosis import metadata
from fedora_qa.faults.canaries import declarations
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(MetadataComplete(), metadata.propose_complete, declarations.missing_attribute),
    CatalogueRow(MetadataUnits(), metadata.propose_units, declarations.wrong_label),
    CatalogueRow(MetadataCameras(), metadata.propose_cameras, declarations.stretched_mounting),
    CatalogueRow(MetadataProfile(), metadata.propose_profile, declarations.wider_camera),
)
