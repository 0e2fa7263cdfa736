"""Several faults in one file are named one after the other."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.progress import quiet
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.wording import status_sentence
from fedora_qa.repairs.repair import choose, repair
from tests.support.planters import TIMES, bias_gyro, delay_events, flip_polarity, planted

OPTIONS = CheckOptions(evidence=None, profile="release")


def delay_imu(file: h5py.File) -> None:
    file["path/imu/ts"][...] += 6000


def test_two_faults_of_a_stream_have_two_names(small_park_day: Path, tmp_path: Path) -> None:
    """A late clock, and a bias that is constant in the clock of its own stream."""
    run = check_file(planted(small_park_day, tmp_path / "faulty.h5", bias_gyro, delay_imu), OPTIONS)
    assert {(d.cause, d.status) for d in run.record.diagnoses} == {
        ("gyro_bias", "confirmed"),
        ("time_offset", "confirmed"),
    }
    # Every fault that was undone goes with the run, in the order in which they were undone.
    assert [fault.cause for fault in run.faults.values()] == [d.cause for d in run.record.diagnoses]


def turn_half(file: h5py.File) -> None:
    """Rows of events from bottom to top, as from an image whose origin lies there."""
    rows = file["path/events/y"]
    rows[...] = int(file["metadata/cameras/events"].attrs["height"]) - 1 - rows[()]


def test_causes_that_one_finding_shows_together_are_all_named(small_park_day: Path, tmp_path: Path) -> None:
    """Events of which either cause alone leaves nothing that agrees with the frames, undone or not."""
    record = check_file(planted(small_park_day, tmp_path / "faulty.h5", flip_polarity, turn_half), OPTIONS).record
    assert [diagnosis.cause for diagnosis in record.diagnoses] == ["polarity_inverted", "mirrored"]
    assert all(diagnosis.cleared for diagnosis in record.diagnoses)


def test_a_hidden_fault_is_named_and_repaired(small_park_day: Path, tmp_path: Path) -> None:
    """Events of inverted polarity have no delay that could be measured; without the inversion they have.

    The repaired file has the samples of the clean one; the hidden fault alone is not repaired.
    """
    faulty, target = (
        planted(small_park_day, tmp_path / "faulty.h5", flip_polarity, delay_events),
        tmp_path / "repaired.h5",
    )
    run = check_file(faulty, OPTIONS)
    first, hidden = run.record.diagnoses
    assert (first.cause, hidden.cause) == ("polarity_inverted", "time_offset")
    assert (first.id, hidden.after, hidden.explains, hidden.cleared) == ("D1", ("D1",), (), ())
    assert hidden.magnitude == pytest.approx(3.0, abs=0.3)
    assert status_sentence(hidden) == f"{hidden.status}: with D1 undone, it appears, and undoing it clears that"
    _, omissions = choose(run.record.diagnoses, run.faults, ["D2"])
    assert "--only D1 --only D2" in omissions[-1].reason
    result = repair(faulty, target, OPTIONS, quiet, only=["D1", "D2"])
    assert result.refusal == ""
    with h5py.File(target) as repaired, h5py.File(small_park_day) as clean:
        assert np.array_equal(repaired["path/events/p"][()], clean["path/events/p"][()])
        late_us = np.abs(repaired[TIMES][()].astype(np.int64) - clean[TIMES][()].astype(np.int64))
    assert late_us.max() < 200


def bias_gyro_unevenly(file: h5py.File) -> None:
    """A bias of a fifth of the file that changes within it: a constant one leaves less than is material."""
    rates = file["path/imu/angular_velocity"]
    rows = slice(round(0.4 * len(rates)), round(0.6 * len(rates)))
    course = np.linspace(0.085, 0.115, rows.stop - rows.start)
    rates[rows] += course[:, np.newaxis] * [0.0, 1.0, 0.0]


def test_what_undoing_leaves_beyond_its_limit_is_not_cleared(small_park_day: Path, tmp_path: Path) -> None:
    """It is no finding any more, because it is immaterial; the fault that was undone is not the one of the file."""
    record = check_file(planted(small_park_day, tmp_path / "faulty.h5", bias_gyro_unevenly), OPTIONS).record
    assert all(diagnosis.status != "confirmed" for diagnosis in record.diagnoses)
