"""Gross offsets in time: what one fit reads too small is read again with itself undone."""

from dataclasses import replace
from pathlib import Path

import pytest

from fedora_qa.record.types import Measurement
from tests.checks.event_file import EventFile, log_file
from tests.estimators.event_world import MS
from tests.support.checked import run_check

CHECK = "event_response.timing"


def late(file: EventFile, late_ms: int) -> EventFile:
    return file.altered(events=replace(file.events, times_ns=file.events.times_ns + late_ms * MS))


def offset_of(file: EventFile, path: Path) -> Measurement:
    result = run_check(file.write(path), CHECK)
    return next(one for one in result.measurements if one.name == "time_offset")


@pytest.mark.parametrize("late_ms", [-24, -8, 8, 14, 24])
def test_gross_offset_is_told_as_surely_as_none(late_ms: int, tmp_path: Path) -> None:
    """To a millisecond, though one fit of frames 20 ms apart reads 14 ms as 9."""
    told = offset_of(late(log_file(), late_ms), tmp_path / "late.h5")
    assert told.value == pytest.approx(late_ms, abs=1.0)
    assert told.standard_error is not None
    assert told.standard_error < 0.5


def test_without_an_offset_nothing_is_read_again(tmp_path: Path) -> None:
    """The first fit stands, with its rate."""
    result = run_check(log_file().write(tmp_path / "clean.h5"), CHECK)
    assert {"time_offset", "clock_rate"} <= {one.name for one in result.measurements}
    assert not result.findings
