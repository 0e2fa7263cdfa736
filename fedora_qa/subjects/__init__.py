"""The checks of each subject, a module each, which is imported where a check of the subject is needed.

Read ``row`` and then ``rows``. ``fedora_qa/catalogue.py`` puts all together.
"""

from typing import Final

SUBJECTS: Final = (
    "integrity",
    "metadata",
    "clocks",
    "index_maps",
    "event_stream",
    "event_response",
    "alignment",
    "flow_photometric",
    "flow_geometry",
    "flow_rates",
    "depth",
    "images",
    "flow_events",
    "pose",
    "imu",
)
"""In the order in which their checks run and are shown: all others depend on integrity, metadata and clocks."""


def subject_of(name: str) -> str:
    """Return the subject of a check ``<subject>.<property>``; of a subject, itself."""
    return name.split(".", maxsplit=1)[0]
