"""The study of false alarms looks at what it says it does, and counts right."""

from pathlib import Path

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from fedora_qa.layout.canonical import TIMESTAMPS_OF
from fedora_qa.record.types import Measurement, Result
from tests.benchmarks.false_alarms import study
from tests.benchmarks.false_alarms.calibration import Share, alarms, calibrations
from tests.benchmarks.false_alarms.checked import Checked, Pull, checked, pulls_of
from tests.benchmarks.false_alarms.combinations import COMBINATIONS, EPOCH_US, INERTIAL, Combination, along
from tests.benchmarks.false_alarms.study import page


def test_there_are_enough_files_of_enough_kinds() -> None:
    """At least 300 files of at least 20 kinds, each with a name of its own."""
    assert sum(kind.files for kind in COMBINATIONS) >= 300
    assert len({kind.name for kind in COMBINATIONS}) == len(COMBINATIONS) >= 20


def test_files_of_a_kind_differ() -> None:
    """The next file begins elsewhere, even in a world without noise."""
    first, second = (along("park-day", step_s=0.4)(number) for number in (0, 1))
    assert first.start_s != second.start_s
    assert first.seed != second.seed


def test_a_file_is_checked_once(tmp_path: Path) -> None:
    """What was found is kept and read again, and the sequence is not."""
    kind = Combination(name="a b", scene=along("park-noisy", step_s=0.1), duration_s=0.5, streams=INERTIAL, epoch=True)
    found = checked(kind, 0, tmp_path)
    assert found.verdict == "clean"
    assert any(pull.name == "imu.timing time_offset" for pull in found.pulls)
    assert [path.suffix for path in tmp_path.iterdir()] == [".json"]
    assert checked(kind, 0, tmp_path) == found


def test_files_are_checked_in_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A kind whose scene is a local function is checked in a process of the study."""
    monkeypatch.setattr(study, "KEPT", tmp_path)
    kind = "park-day, half a second"
    ended = CliRunner().invoke(study.main, ["--jobs", "1", "--kind", kind, "--share", "0.01"])
    assert ended.exit_code == 0, ended.output
    assert f"1/1 {kind} 0: clean" in ended.output


def test_timestamps_are_moved_to_wall_clock_time(tmp_path: Path) -> None:
    """All of them, by the same."""
    kind = Combination(name="x", scene=along("hover", step_s=0.1), duration_s=0.1, streams=INERTIAL, epoch=True)
    kind.write(0, tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        first_us = [file[key][0] for key in (TIMESTAMPS_OF["imu"], TIMESTAMPS_OF["pose"])]
    assert first_us == [EPOCH_US, EPOCH_US]


def test_pulls_leave_out_what_is_not_gaussian() -> None:
    """A maximum, a one-sided value, and one without an error have no pull."""

    def value(name: str, **changes: object) -> Measurement:
        return Measurement(name, 3.0, "1", 0.5, 1.0, 2.0, 2.5, **changes)  # type: ignore[arg-type]

    kept = value("kept")
    result = Result("a.b", "passed", "?", (kept, value("worst", tests=9), value("one side", side="upper")))
    assert pulls_of(result) == [Pull("a.b kept", 4.0)]


def test_calibration_of_gaussian_pulls() -> None:
    """Unit spread, and shares beyond as claimed; twice the scatter is noticed."""
    rng = np.random.default_rng(0)

    def files(scale: float) -> list[Checked]:
        return [Checked("kind", k, "clean", {}, (), (Pull("a", scale * rng.normal()),)) for k in range(1000)]

    (right,), (wrong,) = (calibrations(files(scale), 12) for scale in (1.0, 2.0))
    assert right.spread == pytest.approx(1.0, abs=4 * right.spread_error)
    assert right.beyond(1e-2).agrees
    assert right.beyond(1e-3).agrees
    assert wrong.spread == pytest.approx(2.0, abs=4 * wrong.spread_error)
    assert not wrong.beyond(1e-2).agrees
    assert not calibrations(files(1.0)[:11], 12)


def test_the_rate_of_alarms_has_an_interval() -> None:
    """No alarm in 300 files bounds the rate by 1.75% at 99%; three are too many at 1e-4."""
    none = Share(0, 300, 1e-4)
    assert none.agrees
    assert none.interval[1] == pytest.approx(1 - 0.005 ** (1 / 300))
    assert not Share(3, 300, 1e-4).agrees


def test_the_page_tells_of_what_failed() -> None:
    """With the kind, the number and the words of the finding."""
    files = [
        Checked("kind", 0, "clean", {"a.b": "passed", "c.d": "not_observable"}, (), ()),
        Checked("kind", 1, "findings", {"a.b": "failed", "c.d": "passed"}, ("a.b.rule: it is so",), ()),
    ]
    text = "".join(page(files))
    assert "1 of 2 files failed a check" in text
    assert "| kind | 2 | 1 | 1 | 0.5 |" in text
    assert "- kind, file 1: a.b.rule: it is so" in text
    assert alarms(files, 1e-4).count == 1
