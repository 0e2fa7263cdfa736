"""The formats are, to the letter, what golden files hold: other programs read them."""

import pytest

from fedora_qa.gating.certificate import read_certificate
from fedora_qa.record.json_io import read_record, record_to_json
from tests.record.golden_formats import GOLDEN, formats
from tests.support.certificates import CERTIFIED

FORMATS = formats()


@pytest.mark.parametrize("name", FORMATS)
def test_the_format_has_not_changed(name: str) -> None:
    """Where a change is meant, ``python -m tests.record.golden_formats`` writes the golden files anew."""
    assert FORMATS[name] == (GOLDEN / name).read_bytes().decode("utf-8")


def test_every_golden_file_is_held() -> None:
    """No golden file lies about unread."""
    assert {path.name for path in GOLDEN.iterdir()} == set(FORMATS)


def test_the_golden_record_is_still_read() -> None:
    """The JSON that was written then reads, and writes the same again."""
    assert record_to_json(read_record(GOLDEN / "record.json")) == FORMATS["record.json"]


def test_the_golden_certificate_still_verifies() -> None:
    """A certificate that was written then is read, and its own digest is still right."""
    certificate = read_certificate(GOLDEN / "certificate.json")
    assert certificate == CERTIFIED
    assert certificate.digest == certificate.own_digest
