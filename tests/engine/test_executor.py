"""A worker keeps its file open between tasks of one survey, and no longer."""

from pathlib import Path

import pytest

from fedora_qa.engine.executors.executor import OpenFile
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.survey import OpenSurvey, Survey, survey_of
from fedora_qa.errors import FedoraError
from tests.support.handmade import write_handmade
from tests.support.killers import Counts


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return write_handmade(tmp_path / "seq.h5")


def surveyed(path: Path) -> Survey:
    survey = survey_of(path, (Counts(),), CheckOptions(evidence=None), quiet)
    assert isinstance(survey, Survey)
    return survey


def decoded_by(open_file: OpenFile, survey: Survey) -> tuple[OpenSurvey, int]:
    """Read an image in a task, and return the open file, and how many bytes were decoded for it."""
    with open_file.opened(survey) as file:
        before = file.ready.decoder.decoded_bytes
        file.ready.decoder.rows("path/depth", 0, 1)
        return file, file.ready.decoder.decoded_bytes - before


def is_open(file: OpenSurvey) -> bool:
    return bool(file.sequence._file)


def test_the_next_task_of_a_survey_finds_its_rows(path: Path) -> None:
    """The file stays open, and what is decoded of it is there."""
    open_file, survey = OpenFile(keeps=True), surveyed(path)
    first, decoded = decoded_by(open_file, survey)
    assert decoded > 0
    second, decoded = decoded_by(open_file, survey)
    assert decoded == 0
    assert first.sequence is second.sequence
    open_file.close()
    assert not is_open(first)


def test_another_survey_closes_the_file(path: Path) -> None:
    """One file is open at most: that of another survey, or of another view, takes its place."""
    open_file = OpenFile(keeps=True)
    first, _ = decoded_by(open_file, surveyed(path))
    second, decoded = decoded_by(open_file, surveyed(path))
    assert decoded > 0
    assert (is_open(first), is_open(second)) == (False, True)
    open_file.close()


def test_a_task_that_fails_closes_the_file(path: Path) -> None:
    """What it leaves may be half read."""
    open_file, survey = OpenFile(keeps=True), surveyed(path)
    with pytest.raises(ZeroDivisionError), open_file.opened(survey) as file:
        raise ZeroDivisionError
    assert not is_open(file)
    assert decoded_by(open_file, survey)[1] > 0
    open_file.close()


def test_a_process_that_is_no_worker_keeps_nothing(path: Path) -> None:
    """Each task opens the file anew, and closes it."""
    open_file, survey = OpenFile(keeps=False), surveyed(path)
    for _ in range(2):
        file, decoded = decoded_by(open_file, survey)
        assert decoded > 0
        assert not is_open(file)


def test_a_file_that_was_changed_is_refused(path: Path) -> None:
    """Also where it is open already."""
    open_file, survey = OpenFile(keeps=True), surveyed(path)
    decoded_by(open_file, survey)
    path.touch()
    with pytest.raises(FedoraError, match="got a change"):
        decoded_by(open_file, survey)
    open_file.close()
