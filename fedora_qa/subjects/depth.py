"""The checks of depth, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.depth.consistency import DepthConsistency
from fedora_qa.checks.depth.projection import DepthProjection
from fedora_qa.checks.depth.range import DepthRange
from fedora_qa.checks.depth.scale import DepthScale
from fedora_qa.diagnosis import depth
from fedora_qa.faults.canaries import images as image_faults
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(DepthRange(), depth.propose_range, image_faults.far_depth),
    CatalogueRow(DepthConsistency(), depth.propose_consistency, image_faults.uneven_depth),
    CatalogueRow(DepthScale(), depth.propose_scale, image_faults.scaled_depth),
    CatalogueRow(DepthProjection(), depth.propose_projection, image_faults.ray_depth),
)
