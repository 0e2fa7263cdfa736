"""Recompute what must hold between the streams of an event-camera sequence, and report what does not.

::

    import fedora_qa

    record = fedora_qa.check("seq.h5", select=["clocks", "imu"])
    record.verdict        # "clean", "findings" or "incomplete"
    record.findings       # a data frame
    record.save("seq.json")

What is named here is imported when it is used, so that importing the package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from fedora_qa.api.check import check, read_record
    from fedora_qa.api.checked import CheckedRecord
    from fedora_qa.api.repair import repair

__version__ = "0.1.0"

__all__ = ["CheckedRecord", "__version__", "check", "read_record", "repair"]

_HOMES: Final = {
    "check": "fedora_qa.api.check",
    "read_record": "fedora_qa.api.check",
    "repair": "fedora_qa.api.repair",
    "CheckedRecord": "fedora_qa.api.checked",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
