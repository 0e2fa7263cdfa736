"""What a person will want to see, kept by the measuring pass within a size cap: pictures, series, histograms.

Names, shapes and units of the arrays are those of ``record/evidence.py``. Nothing here judges.
"""

from fedora_qa.evidence.collector import EvidenceCollector
from fedora_qa.evidence.kept import Kept
from fedora_qa.evidence.options import EvidenceOptions

__all__ = ["EvidenceCollector", "EvidenceOptions", "Kept"]
