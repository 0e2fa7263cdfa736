"""A comparison as JSON."""

from typing import Final

from pydantic import TypeAdapter

from fedora_qa.comparison.types import COMPARISON_VERSION, Comparison
from fedora_qa.record.documents import DocumentKind

COMPARISON: Final = DocumentKind(
    name="comparison",
    noun="a comparison",
    version=COMPARISON_VERSION,
    adapter=TypeAdapter(Comparison),
    written_by="fedora-qa compare --json",
    again="compare again with this version",
)

comparison_to_json = COMPARISON.to_json
comparison_from_json = COMPARISON.from_json
