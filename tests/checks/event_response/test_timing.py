"""Gross offsets in time: what one fit underestimates is fitted again with itself undone."""

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
    return next(measured for measured in result.measurements if measured.name == "time_offset")


@pytest.mark.parametrize("late_ms", [-24, -8, 8, 14, 24])
def test_gross_offset_is_estimated_as_precisely_as_none(late_ms: int, tmp_path: Path) -> None:
    """To a millisecond, though one fit of frames 20 ms apart gives 9 ms for 14."""
    offset = offset_of(late(log_file(), late_ms), tmp_path / "late.h5")
    assert offset.value == pytest.approx(late_ms, abs=1.0)
    assert offset.standard_error is not None
    assert offset.standard_error < 0.5


def test_without_an_offset_nothing_is_searched(tmp_path: Path) -> None:
    """The first fit stands, with its rate."""
    result = run_check(log_file().write(tmp_path / "clean.h5"), CHECK)
    assert {"time_offset", "clock_rate"} <= {measured.name for measured in result.measurements}
    assert not result.findings
