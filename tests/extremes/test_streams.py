"""Every combination of missing streams: what needs them is not applicable, and nothing else changes."""

from itertools import combinations
from pathlib import Path

import h5py
import pytest

from tests.extremes.files import alarms, edited, outcomes, record_of
from tests.support.all_checks import CHECKS
from tests.support.handmade import write_handmade

PARTS = {
    "rgb": ("path/rgb", "path/rgb_ts", "metadata/rgb_to_event", "metadata/cameras/rgb"),
    "depth": ("path/depth", "path/depth_ts", "metadata/depth_to_event", "metadata/cameras/depth"),
    "events": (
        "path/events", "metadata/events", "metadata/cameras/events", "metadata/rgb_to_event", "metadata/depth_to_event",
    ),
    "imu": ("path/imu", "metadata/imu"),
    "pose": ("path/pose", "metadata/pose"),
    "flow": ("path/flow", "metadata/flow"),
}  # fmt: skip
"""What goes with each stream, its declarations among it."""

ALL = tuple(PARTS)


@pytest.fixture(scope="module")
def handmade(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_handmade(tmp_path_factory.mktemp("streams") / "whole.h5")


def without(file: h5py.File, streams: tuple[str, ...], *, declared: bool) -> None:
    """Leave streams out, and their declarations unless they stay ``declared``."""
    for part in {part for stream in streams for part in PARTS[stream]}:
        if part in file and not (declared and part.startswith("metadata")):
            del file[part]


@pytest.mark.parametrize("count", range(len(ALL)))
def test_what_is_left_is_judged_alone(count: int, handmade: Path, tmp_path: Path) -> None:
    """Right for each combination: no alarm; checks that need what is missing are not applicable, never passed.

    With nothing left that could be held against another stream the verdict is incomplete, never clean.
    """
    whole = outcomes(record_of(handmade))
    for streams in combinations(ALL, count):
        record = record_of(edited(handmade, tmp_path / "part.h5", lambda f, s=streams: without(f, s, declared=False)))
        assert not alarms(record), streams
        told = {"passed", "warned"}
        crossing = [c.name for c in CHECKS if len(c.needs) > 1 and outcomes(record)[c.name] in told]
        assert record.comparisons == len(crossing)
        crossing = [name for name in crossing if not name.startswith("index_maps")]
        assert record.verdict == ("clean" if crossing else "incomplete"), streams
        for check in CHECKS:
            found = outcomes(record)[check.name]
            if set(check.needs) & set(streams):
                assert found == "not_applicable", (check.name, streams)
            elif whole[check.name] not in told:
                assert found != "passed", (check.name, streams)


def test_a_file_without_anything_is_no_pass(handmade: Path, tmp_path: Path) -> None:
    """Right: an empty file is never clean."""

    def emptied(file: h5py.File) -> None:
        without(file, ALL, declared=False)

    assert record_of(edited(handmade, tmp_path / "empty.h5", emptied)).verdict != "clean"


@pytest.mark.parametrize("stream", ALL)
def test_a_stream_that_stays_declared_is_missed(stream: str, handmade: Path, tmp_path: Path) -> None:
    """Right: what the metadata declares and the file does not hold is a missing stream, by name."""

    def removed(file: h5py.File) -> None:
        without(file, (stream,), declared=True)

    record = record_of(edited(handmade, tmp_path / "part.h5", removed))
    found = {(diagnosis.stream, diagnosis.cause) for diagnosis in record.diagnoses}
    assert (stream, "missing_stream") in found
    assert "crashed" not in outcomes(record).values()
