"""The checks of colour images, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.images.channels import ImagesChannels
from fedora_qa.checks.images.exposure import ImagesExposure
from fedora_qa.checks.images.order import ImagesOrder
from fedora_qa.checks.images.repeats import ImagesRepeats
from fedora_qa.checks.images.transfer import ImagesTransfer
from fedora_qa.checks.images.vignetting import ImagesVignetting
from fedora_qa.diagnosis import images
from fedora_qa.faults.canaries import images as image_faults
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(ImagesRepeats(), images.propose_repeats, image_faults.frozen_colour),
    CatalogueRow(ImagesOrder(), images.propose_order, image_faults.exchanged_colour),
    CatalogueRow(ImagesExposure(), images.propose_exposure, image_faults.darker_colour),
    CatalogueRow(ImagesChannels(), images.propose_channels, image_faults.exchanged_channels),
    CatalogueRow(ImagesTransfer(), images.propose_transfer, image_faults.other_transfer),
    CatalogueRow(ImagesVignetting(), images.propose_vignetting, image_faults.darker_corners),
)
