"""The checks of each subject, with the causes that their findings suggest and their canaries, a module a subject.

Read ``row`` and then ``rows``. ``fedora_qa/catalogue.py`` puts all together. A run takes its checks from ``selection``,
which imports no subject: causes and canaries are needed seldom.
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
