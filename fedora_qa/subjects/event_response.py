"""The checks of events against colour, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.event_response.alignment import EventResponseAlignment
from fedora_qa.checks.event_response.conservation import EventResponseConservation
from fedora_qa.checks.event_response.frames import EventResponseFrames
from fedora_qa.checks.event_response.interpolation import EventResponseInterpolation
from fedora_qa.checks.event_response.jitter import EventResponseJitter
from fedora_qa.checks.event_response.model import EventResponseModel
from fedora_qa.checks.event_response.orientation import EventResponseOrientation
from fedora_qa.checks.event_response.threshold import EventResponseThreshold
from fedora_qa.checks.event_response.timing import EventResponseTiming
from fedora_qa.diagnosis import event_conservation, event_response
from fedora_qa.faults.canaries import declarations, events, timestamps
from fedora_qa.faults.canaries import images as image_faults
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(EventResponseOrientation(), event_response.propose_orientation, events.inverted_polarity),
    CatalogueRow(EventResponseModel(), event_response.propose_model, declarations.other_event_model),
    CatalogueRow(EventResponseThreshold(), event_response.propose_threshold, declarations.smaller_thresholds),
    CatalogueRow(EventResponseTiming(), event_response.propose_timing, timestamps.late_events),
    CatalogueRow(EventResponseJitter(), event_response.propose_jitter, timestamps.scattered_events),
    CatalogueRow(EventResponseAlignment(), event_response.propose_alignment, events.shifted),
    CatalogueRow(EventResponseFrames(), event_response.propose_frames, image_faults.exchanged_colour),
    CatalogueRow(EventResponseConservation(), event_conservation.propose_conservation, events.mirrored),
    CatalogueRow(EventResponseInterpolation(), event_response.propose_interpolation, events.interpolated),
)
