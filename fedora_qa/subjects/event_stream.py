"""The checks of the stream of events, with the proposals of causes and the canary of each."""

from typing import Final

from fedora_qa.checks.event_stream.bounds import EventStreamBounds
from fedora_qa.checks.event_stream.duplicates import EventStreamDuplicates
from fedora_qa.checks.event_stream.gaps import EventStreamGaps
from fedora_qa.checks.event_stream.rates import EventStreamRates
from fedora_qa.diagnosis import event_stream
from fedora_qa.faults.canaries import events, timestamps
from fedora_qa.subjects.row import CatalogueRow

ROWS: Final = (
    CatalogueRow(EventStreamBounds(), event_stream.propose_bounds, events.outside_of_the_sensor),
    CatalogueRow(EventStreamDuplicates(), event_stream.propose_duplicates, events.repeated),
    CatalogueRow(EventStreamGaps(), event_stream.propose_gaps, timestamps.gap_in_events),
    CatalogueRow(EventStreamRates(), event_stream.propose_rates, events.hot_pixel),
)
