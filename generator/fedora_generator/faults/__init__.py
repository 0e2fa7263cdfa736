"""Faults planted in a copy of a file: each small, exact, and of one stream.

``FAULTS`` says which cause can befall which stream; the work is done one file a stream, and in ``clocks``, ``samples``,
``images`` and ``storage`` for what befalls several.
"""

from fedora_generator.faults.fault import Fault, FaultError, Region
from fedora_generator.faults.plant import plant_fault
from fedora_generator.faults.table import BYTE_FAULTS, FAULTS, knows_region, knows_time, legal_causes, legal_streams

__all__ = [
    "BYTE_FAULTS",
    "FAULTS",
    "Fault",
    "FaultError",
    "Region",
    "knows_region",
    "knows_time",
    "legal_causes",
    "legal_streams",
    "plant_fault",
]
