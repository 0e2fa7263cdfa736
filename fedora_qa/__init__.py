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
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from fedora_qa.compiled_cache import choose_cache_folder

if TYPE_CHECKING:
    from fedora_qa.api.check import CheckedRecord, check, read_record
    from fedora_qa.api.compare import ComparedSubjects, compare
    from fedora_qa.api.explain import ExplainedChecks, explain
    from fedora_qa.api.gate import gate
    from fedora_qa.api.repair import RepairedFile, repair
    from fedora_qa.api.score import ScoredPredictions, score
    from fedora_qa.api.sequence import open_sequence
    from fedora_qa.api.stats import MeasuredStatistics, stats

__version__ = "0.3.0"

__all__ = [
    "CheckedRecord",
    "ComparedSubjects",
    "ExplainedChecks",
    "MeasuredStatistics",
    "RepairedFile",
    "ScoredPredictions",
    "__version__",
    "check",
    "compare",
    "explain",
    "gate",
    "open_sequence",
    "read_record",
    "repair",
    "score",
    "stats",
]

_HOMES: Final = {
    "CheckedRecord": "fedora_qa.api.check",
    "ComparedSubjects": "fedora_qa.api.compare",
    "ExplainedChecks": "fedora_qa.api.explain",
    "MeasuredStatistics": "fedora_qa.api.stats",
    "RepairedFile": "fedora_qa.api.repair",
    "ScoredPredictions": "fedora_qa.api.score",
    "check": "fedora_qa.api.check",
    "compare": "fedora_qa.api.compare",
    "explain": "fedora_qa.api.explain",
    "gate": "fedora_qa.api.gate",
    "open_sequence": "fedora_qa.api.sequence",
    "read_record": "fedora_qa.api.check",
    "repair": "fedora_qa.api.repair",
    "score": "fedora_qa.api.score",
    "stats": "fedora_qa.api.stats",
}


# Before Numba is imported, which reads its environment then.
TEMPORARY_CACHE: Final = choose_cache_folder(Path(__file__).parent)
"""Folder of compiled loops that is removed at exit; None where they are kept."""


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
