"""The formats of one record, and of what a gate writes besides, as golden files hold them.

``python -m tests.record.golden_formats`` writes them anew, for a change of a format that is meant.
"""

from pathlib import Path

from fedora_qa.gating.certificate import CERTIFICATE
from fedora_qa.record.ci import record_to_badge, record_to_github, record_to_junit
from fedora_qa.record.json_io import record_to_json
from fedora_qa.record.markdown import record_to_markdown
from fedora_qa.record.sarif import record_to_sarif
from fedora_qa.record.tables import record_to_csv
from tests.support.certificates import CERTIFIED
from tests.support.records import (
    HELPS,
    crashed,
    failed,
    file_record,
    late_events,
    not_observable,
    passed,
    record,
    waived,
)

GOLDEN = Path(__file__).with_name("golden")


def formats() -> dict[str, str]:
    """Every format of a record with a finding, a warning, a crash, and a clean file, by the name of its golden file."""
    late = file_record(failed(), passed(), not_observable(), path="a b/late.h5", diagnoses=(late_events(),))
    shown = record(late, file_record(passed(), crashed(), path="crashed.h5"), file_record(passed(), path="clean.h5"))
    return {
        "record.json": record_to_json(shown),
        "record.xml": record_to_junit(shown),
        "record.sarif": record_to_sarif(shown, HELPS),
        "badge.json": record_to_badge(shown),
        "record.github.txt": record_to_github(shown),
        "record.md": record_to_markdown(shown),
        **record_to_csv(shown),
        "waived.sarif": record_to_sarif(record(file_record(waived(), path="waived.h5")), HELPS),
        "certificate.json": CERTIFICATE.to_json(CERTIFIED),
    }


if __name__ == "__main__":
    GOLDEN.mkdir(exist_ok=True)
    for name, text in formats().items():
        (GOLDEN / name).write_text(text, encoding="utf-8", newline="")
