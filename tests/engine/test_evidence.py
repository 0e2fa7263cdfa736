"""What a run leaves for a person to see."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator.faults import plant_fault
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.tasks import check_file
from fedora_qa.evidence.collector import EvidenceCollector
from fedora_qa.evidence.options import EvidenceOptions
from tests.support.handmade import write_handmade

FAST = ("clocks",)


def groups(run: FileRun) -> set[str]:
    """The first parts of the names of all arrays."""
    return {name.split("/")[0] for name in run.arrays}


def check_evidence(run: FileRun) -> None:
    """Every array has a title and every title an array; pictures keep to their size."""
    assert run.arrays.keys() == run.record.evidence.keys()
    for group in ("moments", "places"):
        pictures = sum(array.nbytes for name, array in run.arrays.items() if name.startswith(group))
        assert pictures <= EvidenceOptions().size_bytes + 4096


def test_clean_file_shows_no_worst_place(park_day: Path) -> None:
    """A clean file keeps moments, trajectory, frusta, timeline, histograms and distributions, and no place."""
    run = check_file(park_day, CheckOptions(select=("depth.range", "images.repeats")))
    check_evidence(run)
    assert groups(run) == {"moments", "trajectory", "frusta", "timeline", "histograms", "distributions"}
    assert run.arrays["moments/rgb"].shape == (EvidenceOptions().snapshots, 200, 270, 3)
    with h5py.File(park_day) as file:
        times_us = np.asarray(file["path/rgb_ts"])
        frames = np.searchsorted(times_us, run.arrays["moments/rgb_times_us"])
        np.testing.assert_array_equal(run.arrays["moments/rgb"], [file["path/rgb"][int(frame)] for frame in frames])


def test_failed_finding_shows_its_place(park_day: Path, tmp_path: Path) -> None:
    """A gap in depth is shown where it is, under the identifier of its finding."""
    faulty = tmp_path / "gap.h5"
    plant_fault(park_day, faulty, "dropped_samples", "depth", 3.0)
    run = check_file(faulty, CheckOptions(select=("clocks.gaps",)))
    check_evidence(run)
    (finding,) = (one for result in run.record.results for one in result.findings)
    where = finding.where
    assert where.start_us is not None
    assert where.stop_us is not None
    shown_us = float(run.arrays[f"places/{finding.id}/depth_times_us"])
    assert where.start_us <= shown_us <= where.stop_us
    assert run.arrays[f"places/{finding.id}/box"].tolist() == [0, 0, 1, 1]


def test_checks_keep_arrays_under_their_own_name(park_day: Path) -> None:
    """What a check keeps lies under ``<check>/<name>``, also where nothing else is kept."""
    run = check_file(park_day, CheckOptions(select=("imu.rotation",), evidence=None))
    assert list(run.arrays) == ["imu.rotation/residual"]
    assert "; x time [s]; y length [mrad]" in run.record.evidence["imu.rotation/residual"]
    times_s, lengths = run.arrays["imu.rotation/residual"].T
    assert 0 <= times_s[0] < times_s[-1] <= 1
    assert (lengths >= 0).all()


def damage_timestamps(path: Path) -> None:
    """Let every clock of images stand still and the motion's run backwards."""
    with h5py.File(path, "r+") as file:
        for name in ("rgb_ts", "depth_ts", "flow/10hz_ts", "flow/25hz_ts", "flow/50hz_ts"):
            file[f"path/{name}"][...] = 7
        for name in ("imu/ts", "pose/ts", "events/t"):
            timestamps = file[f"path/{name}"]
            timestamps[...] = timestamps[...][::-1]


def test_broken_clocks_break_nothing(tmp_path: Path) -> None:
    """Stamps that say nothing leave a record with evidence and without a crash."""
    path = write_handmade(tmp_path / "broken.h5")
    damage_timestamps(path)
    run = check_file(path, CheckOptions(select=FAST))
    check_evidence(run)
    assert run.record.verdict == "findings"
    assert "timeline" in groups(run)


def test_one_frame_is_enough(tmp_path: Path) -> None:
    """A file of a single colour frame and nothing else is shown."""
    path = tmp_path / "single.h5"
    with h5py.File(path, "w") as file:
        file["path/rgb"] = np.full((1, 6, 8, 3), 9, np.uint8)
        file["path/rgb_ts"] = np.array([5], np.int64)
    run = check_file(path, CheckOptions(select=("images",)))
    check_evidence(run)
    assert run.arrays["moments/rgb"].tolist() == [[[[9, 9, 9]] * 8] * 6]
    assert run.arrays["timeline/rgb"].tolist() == [1]


@pytest.mark.parametrize("step", ["start", "update", "conclude"])
def test_lost_evidence_is_told(step: str, park_day: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Evidence that cannot be made is a crashed result, and an incomplete verdict; the checks stand."""

    def fail(*arguments: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(EvidenceCollector, step, fail)
    record = check_file(park_day, CheckOptions(select=FAST)).record
    crashed = [result for result in record.results if result.outcome == "crashed"]
    assert [result.check for result in crashed] == ["evidence"]
    assert "ZeroDivisionError" in crashed[0].traceback
    assert record.verdict == "incomplete"
    assert sum(result.outcome == "passed" for result in record.results) >= 3
