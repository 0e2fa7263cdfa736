"""The checks of index maps, with the proposals of causes and the canary of each."""

from functools import partial
from typing import Final

from fedora_qa.checks.index_maps.depth import IndexMapsDepth
from fedora_qa.checks.index_maps.milliseconds import IndexMapsMilliseconds
from fedora_qa.checks.index_maps.rgb import IndexMapsRgb
from fedora_qa.diagnosis import index_maps
from fedora_qa.faults.canaries import timestamps
from fedora_qa.subjects.row import CatalogueRow

_NEXT_EVENT_RGB: Final = partial(timestamps.next_event, index_map="rgb_to_event")
_NEXT_EVENT_DEPTH: Final = partial(timestamps.next_event, index_map="depth_to_event")
_NEXT_EVENT_MILLISECONDS: Final = partial(timestamps.next_event, index_map="ms_to_event")

ROWS: Final = (
    CatalogueRow(IndexMapsRgb(), index_maps.propose_frame_to_event, _NEXT_EVENT_RGB),
    CatalogueRow(IndexMapsDepth(), index_maps.propose_frame_to_event, _NEXT_EVENT_DEPTH),
    CatalogueRow(IndexMapsMilliseconds(), index_maps.propose_milliseconds, _NEXT_EVENT_MILLISECONDS),
)
