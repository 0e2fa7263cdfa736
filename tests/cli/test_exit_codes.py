"""The exit code follows from the records alone."""

from dataclasses import replace
from typing import Literal

import pytest

from fedora_qa.cli.exit_codes import exit_code
from fedora_qa.record.types import FileRecord
from tests.support.records import crashed, failed, file_record, not_observable, passed

WARNED = replace(passed(), outcome="warned")
CASES = {
    "nothing": ((), "failed", 0),
    "clean": ((file_record(passed()),), "failed", 0),
    "not observable is no finding": ((file_record(passed(), not_observable()),), "failed", 0),
    "findings": ((file_record(failed(), passed()),), "failed", 1),
    "warned is no finding": ((file_record(WARNED),), "failed", 0),
    "warned is a finding when asked": ((file_record(WARNED),), "warned", 1),
    "crashed": ((file_record(passed(), crashed()),), "failed", 3),
    "crashed before findings": ((file_record(failed(), crashed()),), "failed", 3),
    "incomplete without a crash": ((replace(file_record(passed()), verdict="incomplete"),), "failed", 3),
    "one of several files": ((file_record(passed()), file_record(failed())), "failed", 1),
    "incomplete file beside one with findings": ((file_record(crashed()), file_record(failed())), "failed", 3),
}


@pytest.mark.parametrize(("files", "fail_on", "code"), CASES.values(), ids=CASES.keys())
def test_exit_code(files: tuple[FileRecord, ...], fail_on: Literal["failed", "warned"], code: int) -> None:
    """Incomplete comes before findings, findings before clean, over all files together."""
    assert exit_code(files, fail_on) == code
