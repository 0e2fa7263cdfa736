"""Faults planted in a copy of a file: each small, exact, and of one stream.

Read ``fault`` (what to plant), then ``table`` (which causes a stream can have, and the function that plants each) and
``plant`` (from a clean file to a faulty copy, also in a part of the image). Faults of one stream are in the file of its
name; those of several in ``samples``, ``images`` and ``storage``; others in ``index_maps`` and ``metadata``. ``rows``
edits datasets block by block. ``cli`` is the command.
"""

from fedora_generator.faults.fault import Fault, FaultError, Region
from fedora_generator.faults.plant import plant_fault
from fedora_generator.faults.table import (
    BYTE_FAULTS,
    FAULTS,
    allows_direction,
    allows_interval,
    allows_region,
    legal_causes,
    legal_streams,
)

__all__ = [
    "BYTE_FAULTS",
    "FAULTS",
    "Fault",
    "FaultError",
    "Region",
    "allows_direction",
    "allows_interval",
    "allows_region",
    "legal_causes",
    "legal_streams",
    "plant_fault",
]
