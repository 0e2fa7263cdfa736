"""A planted fault is found again in a piece; one that the piece cannot show is said not to be."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from fedora_generator.faults import plant_fault
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.extract.extract import CheckFinding, Extraction, extract
from fedora_qa.record.types import Where

PLANTED = {
    "a gap": ("clocks.gaps", "dropped_samples", "imu", 3.0, 0.5),
    "another unit of time": ("clocks.unit", "time_unit", "pose", None, None),
    "a wrong map": ("index_maps.depth", "index_off_by_one", "depth_to_event", 1.0, None),
    "a frozen frame": ("images.repeats", "frozen_frames", "rgb", 2.0, 0.5),
    "a lasting offset": ("event_response.timing", "time_offset", "events", 5.0, None),
    "a stream that is not there": ("integrity.layout", "missing_stream", "imu", None, None),
}


def planted(park_day: Path, target: Path, name: str) -> CheckFinding:
    """Plant a fault in a copy, and return the finding that tells of it."""
    check, cause, stream, magnitude, start_s = PLANTED[name]
    plant_fault(park_day, target, cause, stream, magnitude, start_s=start_s)
    (result,) = check_file(target, CheckOptions(select=(check,), evidence=None)).record.results
    return CheckFinding(check, result.findings[0])


def cut(folder: Path, wanted: CheckFinding, longest_s: float = 1.0) -> Extraction:
    """Extract the finding from ``bad.h5`` to ``piece.h5``."""
    return extract(folder / "bad.h5", folder / "piece.h5", wanted, CheckOptions(), longest_s, lambda *_: None)


@pytest.mark.parametrize("name", PLANTED)
def test_found_again_in_less(name: str, park_day: Path, tmp_path: Path) -> None:
    """Faults of an instant and lasting ones show in less than the whole file."""
    wanted = planted(park_day, tmp_path / "bad.h5", name)
    extracted = cut(tmp_path, wanted)
    assert extracted.finding is not None
    assert not extracted.is_whole
    assert (tmp_path / "piece.h5").stat().st_size < 0.7 * (tmp_path / "bad.h5").stat().st_size
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.h5", "piece.h5"]


def test_pieces_grow_until_the_finding_shows(park_day: Path, tmp_path: Path) -> None:
    """The first piece that shows it is kept: 0.4 s are too short for a gap between streams that is 0.6 s away."""
    wanted = planted(park_day, tmp_path / "bad.h5", "a gap")
    elsewhere = CheckFinding(wanted.check, replace(wanted.finding, where=Where("imu", start_us=0.0)))
    tried: list[tuple[str, int, int]] = []

    def report(*progress: Any) -> None:
        tried.append(progress)

    extracted = extract(tmp_path / "bad.h5", tmp_path / "piece.h5", elsewhere, CheckOptions(), 2.0, report)
    assert tried == [("a piece of 0.4 s", 0, 3), ("a piece of 0.8 s", 1, 3), ("a piece of 1.6 s", 2, 3)]
    assert extracted.finding is not None


def test_not_found_is_said(park_day: Path, tmp_path: Path) -> None:
    """Where no piece that may be tried shows the finding, the last one is written, and nothing is claimed."""
    wanted = planted(park_day, tmp_path / "bad.h5", "a gap")
    elsewhere = CheckFinding(wanted.check, replace(wanted.finding, where=Where("imu", start_us=0.0)))
    extracted = cut(tmp_path, elsewhere, longest_s=0.5)
    assert extracted.finding is None
    assert (tmp_path / "piece.h5").is_file()
