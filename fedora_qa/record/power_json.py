"""A study of detection as JSON."""

from typing import Final

from pydantic import TypeAdapter

from fedora_qa.record.documents import DocumentKind
from fedora_qa.record.power_types import POWER_VERSION, Power

POWER: Final = DocumentKind(
    name="power",
    noun="a study",
    version=POWER_VERSION,
    adapter=TypeAdapter(Power),
    written_by="fedora-qa power --json",
    again="measure again with this version",
)

power_to_json = POWER.to_json
power_from_json = POWER.from_json
