"""Repair from the check of a file to the check of its copy: what is chosen, kept, refused, and left behind."""

import json
from dataclasses import replace
from hashlib import sha256
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_generator.faults.plant import plant_fault
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.engine.progress import Progress, quiet
from fedora_qa.errors import MisuseError
from fedora_qa.faults.axes import VectorAxes
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.declarations import GravityMisdeclared
from fedora_qa.faults.fault import ReversibleFault
from fedora_qa.faults.images import ChannelOrder
from fedora_qa.faults.index_maps import IndexShift
from fedora_qa.faults.motion import GyroBias, PoseInversion, QuaternionOrder
from fedora_qa.faults.pixels import PolarityInversion
from fedora_qa.faults.row_order import DuplicatedSamples, Unsorted
from fedora_qa.faults.units import LengthUnit
from fedora_qa.layout.dialect import load_choice
from fedora_qa.record.types import Measurement, Outcome
from fedora_qa.repairs.repair import PROVENANCE, choose, repair
from fedora_qa.repairs.result import Repair, RepairStep, why_not_better
from tests.support.handmade import write_handmade
from tests.support.repairs import diagnosing_check, diagnosis_of, given_check, record_with

MS = 1_000_000
ORDER = "clocks.order.backward_steps"
LATE = ClockShift("imu", 2 * MS)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    """A small file."""
    return write_handmade(tmp_path / "seq.h5")


def given(file: Path, *faults: ReversibleFault, only: tuple[str, ...] = (), **check: object) -> Repair:
    """Repair with diagnoses that are given, and nothing measured."""
    made = given_check(file, *faults, **check)  # type: ignore[arg-type]
    return repair(file, file.with_name("out.h5"), CheckOptions(), quiet, only=only, check=made)


def require_nothing_left(file: Path) -> None:
    """Fail where the folder holds anything but the file."""
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_events_that_are_late_are_repaired_and_checked(small_park_day: Path, tmp_path: Path) -> None:
    """By the check of the engine: the finding is gone, and the file states what was done to it."""
    late, out = tmp_path / "late.h5", tmp_path / "out.h5"
    plant_fault(small_park_day, late, "time_offset", "events", 3.0)
    options = CheckOptions(select=("event_response.timing", "index_maps", "clocks"), profile="release")
    fault = ClockShift("events", 3 * MS)
    result = repair(late, out, options, quiet, check=diagnosing_check(late, fault))
    assert not result.refusal
    assert result.before.verdict == "findings"
    assert result.after is not None
    assert {each.outcome for each in result.after.results} <= {"passed", "not_observable", "not_applicable"}
    with h5py.File(out) as repaired, h5py.File(small_park_day) as clean:
        np.testing.assert_array_equal(repaired["path/events/t"], clean["path/events/t"])
        np.testing.assert_array_equal(repaired["metadata/rgb_to_event"], clean["metadata/rgb_to_event"])
        done = json.loads(repaired[f"{PROVENANCE}/1"][()])
    assert done["source"] == {"name": "late.h5", "sha256": sha256(late.read_bytes()).hexdigest()}
    assert done["tool"]["name"] == "fedora-qa"
    step = done["steps"][0]
    assert (step["cause"], step["magnitude"], step["unit"], step["status"]) == (
        "events:time_offset",
        3.0,
        "ms",
        "confirmed",
    )
    assert "ClockShift" in step["fault"]
    assert {each["path"] for each in done["datasets"]} == {
        "path/events/t", "metadata/rgb_to_event", "metadata/depth_to_event"
    }  # fmt: skip


@pytest.mark.parametrize(
    ("cause", "magnitude", "fault", "select"),
    [
        ("polarity_inverted", None, PolarityInversion(), "event_response.orientation"),
        ("index_off_by_one", 1, IndexShift("rgb_to_event", 1), "index_maps"),
        ("duplicated_samples", 2, DuplicatedSamples("imu"), "clocks"),
        ("unit_mm_m", 0.001, LengthUnit("depth", 0.001), "depth"),
        ("quaternion_order", None, QuaternionOrder(), "imu"),
        ("gravity_magnitude", 0.1, GravityMisdeclared(0.1), "imu"),
        ("channel_order", None, ChannelOrder("BGR"), "event_response"),
    ],
)
def test_a_fault_of_each_sort_is_repaired_and_checked(
    cause: str, magnitude: float | None, fault: ReversibleFault, select: str, small_park_day: Path, tmp_path: Path
) -> None:
    """Of codes, maps, rows, units, orders, declarations and channels, with the checks of their subject."""
    faulty = tmp_path / "faulty.h5"
    plant_fault(small_park_day, faulty, cause, fault.stream, magnitude)
    options = CheckOptions(select=(select,), profile="release")
    result = repair(faulty, tmp_path / "out.h5", options, quiet, check=diagnosing_check(faulty, fault))
    assert (result.before.verdict, result.refusal) == ("findings", "")
    assert result.after is not None
    assert not [each.check for each in result.after.results if each.outcome in {"failed", "crashed"}]


def test_a_map_of_milliseconds_is_diagnosed_and_repaired(tiny_park_day: Path, tmp_path: Path) -> None:
    """It names the event after the next: the diagnosis of the engine is confirmed, and the map is right again."""
    faulty, out = tmp_path / "faulty.h5", tmp_path / "out.h5"
    faulty.write_bytes(tiny_park_day.read_bytes())
    with h5py.File(faulty, "r+") as file:
        times_us = file["path/events/t"][()]
        entries = np.searchsorted(times_us, np.arange(0, times_us[-1], 1000))
        file["metadata/ms_to_event"] = entries + 1
    options = CheckOptions(select=("index_maps", "event_stream"), profile="release")
    result = repair(faulty, out, options, quiet)
    assert not result.refusal
    assert [step.done for step in result.steps] == ["ms_to_event back by 1 events"]
    assert result.after is not None
    assert result.after.verdict != "findings"
    with h5py.File(out) as repaired, h5py.File(tiny_park_day) as clean:
        np.testing.assert_array_equal(repaired["metadata/ms_to_event"], entries)
        np.testing.assert_array_equal(repaired["path/events/t"], clean["path/events/t"])


def test_poses_of_the_world_in_the_body_are_inverted_again(tiny_park_day: Path, tmp_path: Path) -> None:
    """As visual SLAM writes them: no position is that of the body."""
    faulty, out = tmp_path / "faulty.h5", tmp_path / "out.h5"
    faulty.write_bytes(tiny_park_day.read_bytes())
    with h5py.File(faulty, "r+") as file:
        inverse = Rotation.from_quat(file["path/pose/orientation"][()]).inv()
        file["path/pose/position"][...] = -inverse.apply(file["path/pose/position"][()])
        file["path/pose/orientation"][...] = inverse.as_quat()
    options = CheckOptions(select=("imu",), profile="release")
    result = repair(faulty, out, options, quiet, check=diagnosing_check(faulty, PoseInversion()))
    assert (result.before.verdict, result.refusal) == ("findings", "")
    with h5py.File(out) as repaired, h5py.File(tiny_park_day) as clean:
        np.testing.assert_allclose(repaired["path/pose/position"], clean["path/pose/position"], atol=1e-12)
        turned = Rotation.from_quat(repaired["path/pose/orientation"][()]).inv()
        turned *= Rotation.from_quat(clean["path/pose/orientation"][()])
        assert turned.magnitude().max() < 1e-12


@pytest.mark.parametrize("offset_ms", [-3, 1])
def test_a_wrong_fault_leaves_nothing_behind(offset_ms: int, small_park_day: Path, tmp_path: Path) -> None:
    """Events are 3 ms late; neither the other sign nor a third of it clears the finding."""
    late = tmp_path / "late.h5"
    plant_fault(small_park_day, late, "time_offset", "events", 3.0)
    options = CheckOptions(select=("event_response.timing",))
    check = diagnosing_check(late, ClockShift("events", offset_ms * MS))
    result = repair(late, tmp_path / "out.h5", options, quiet, check=check)
    assert result.refusal == "Expected D1 to clear what it explains, but it still breaks event_response.timing.offset."
    require_nothing_left(late)


def test_two_faults_are_undone_one_after_the_other(small_park_day: Path, tmp_path: Path) -> None:
    """Polarity and clock of the same events, in one copy."""
    once, both, out = (tmp_path / name for name in ("once.h5", "both.h5", "out.h5"))
    plant_fault(small_park_day, once, "polarity_inverted", "events")
    plant_fault(once, both, "time_offset", "events", 3.0)
    result = repair(both, out, CheckOptions(), quiet,
                    check=given_check(both, PolarityInversion(), ClockShift("events", 3 * MS)))  # fmt: skip
    assert [step.diagnosis.id for step in result.steps] == ["D1", "D2"]
    with h5py.File(out) as repaired, h5py.File(small_park_day) as clean:
        for column in "xytp":
            np.testing.assert_array_equal(repaired[f"path/events/{column}"], clean[f"path/events/{column}"])


def test_a_second_repair_adds_to_the_provenance(file: Path) -> None:
    """The first text stays."""
    assert not given(file, LATE).refusal
    once = file.with_name("out.h5").rename(file.with_name("once.h5"))
    assert not repair(once, file.with_name("twice.h5"), CheckOptions(), quiet,
                      check=given_check(once, PolarityInversion())).refusal  # fmt: skip
    with h5py.File(file.with_name("twice.h5")) as twice:
        assert list(twice[PROVENANCE]) == ["1", "2"]
        assert json.loads(twice[f"{PROVENANCE}/2"][()])["source"]["name"] == "once.h5"


def test_chunks_without_an_altered_value_keep_their_bytes(small_park_day: Path, tmp_path: Path) -> None:
    """Two frames are sorted; every other chunk is the one of the file, not decoded and encoded again."""
    faulty, out = tmp_path / "faulty.h5", tmp_path / "out.h5"
    plant_fault(small_park_day, faulty, "unsorted", "rgb", 2)
    assert not repair(faulty, out, CheckOptions(), quiet, check=given_check(faulty, Unsorted("rgb", 0, 2))).refusal
    with h5py.File(faulty) as before, h5py.File(out) as after:
        for name in ("path/rgb", "path/depth", "path/events/t"):
            old, new = before[name].id, after[name].id
            chunks = [old.get_chunk_info(number).chunk_offset for number in range(old.get_num_chunks())]
            same = [old.read_direct_chunk(chunk) == new.read_direct_chunk(chunk) for chunk in chunks]
            assert same.count(False) == (2 if name == "path/rgb" else 0)


def test_a_dry_run_writes_nothing_and_tells_the_same(file: Path) -> None:
    """Steps, datasets and rows are those of the repair."""
    check = given_check(file, LATE, PolarityInversion())
    planned = repair(file, None, CheckOptions(), quiet, check=check)
    require_nothing_left(file)
    done = repair(file, file.with_name("out.h5"), CheckOptions(), quiet, check=check)
    assert planned.steps
    assert planned == replace(done, after=None)


def test_only_confirmed_diagnoses_are_chosen() -> None:
    """Supported ones where they are named; others are left alone with a reason."""
    faults = {"D1": LATE, "D2": PolarityInversion(), "D3": GyroBias((0.1, 0, 0)), "D4": QuaternionOrder()}
    statuses = ("confirmed", "supported", "confirmed", "suggested")
    diagnoses = tuple(
        diagnosis_of(fault, name, status)  # type: ignore[arg-type]
        for (name, fault), status in zip(faults.items(), statuses, strict=True)
    )
    chosen, omissions = choose(diagnoses, faults)
    assert [diagnosis.id for diagnosis, _ in chosen] == ["D1"]
    assert {each.diagnosis.id: each.reason.split()[0] for each in omissions} == {"D2": "It", "D3": "A", "D4": "No"}
    chosen, omissions = choose(diagnoses, faults, ("D2",))
    assert [diagnosis.id for diagnosis, _ in chosen] == ["D2"]
    for name, kind in (("D9", "no diagnosis"), ("D4", "a diagnosis without a tested fault")):
        with pytest.raises(MisuseError, match=rf"D1 \(imu:time_offset, confirmed\), D2 .*, got '{name}', {kind}"):
            choose(diagnoses, faults, (name,))


REFUSED = {
    "nothing is found": ((), {"before": ()}, "No check fails: the file has no finding to repair."),
    "nothing is diagnosed": ((), {}, "No cause of the findings is known; `fedora-qa check` lists them."),
    "only supported": ((LATE,), {"status": "supported"}, "Nothing that is confirmed can be repaired."),
    "an estimate": ((GyroBias((0.1, 0.0, 0.0)),), {}, "Nothing that is confirmed can be repaired."),
    "something new": ((LATE,), {"after": ("imu.timing.offset",)}, "the repaired file breaks imu.timing.offset"),
    "not cleared": ((LATE,), {"after": (ORDER,)}, f"it still breaks {ORDER}"),
    "nothing explained": ((LATE,), {"before": ()}, "it explains no finding of this file"),
    "nothing to alter": ((DuplicatedSamples("imu"),), {}, "it changes none"),
    "a gain called a unit": ((LengthUnit("depth", 1.013),), {}, "it changes none"),
    "a stream that is absent": ((ClockShift("flow/25hz", MS),), {}, "Expected a file with the stream flow/25hz"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_refused_repairs_leave_nothing_behind(case: str, file: Path) -> None:
    """The reason is one sentence."""
    faults, check, reason = REFUSED[case]
    with h5py.File(file, "r+") as opened:
        opened.pop("path/flow/25hz", None)
        opened.pop("path/flow/25hz_ts", None)
    result = given(file, *faults, **check)
    assert reason in result.refusal
    require_nothing_left(file)


def test_a_supported_diagnosis_is_repaired_where_it_is_named(file: Path) -> None:
    """``--only D1``."""
    assert not given(file, LATE, status="supported", only=("D1",)).refusal
    assert file.with_name("out.h5").exists()


def test_values_that_the_stored_type_cannot_hold_are_refused(file: Path) -> None:
    """Timestamps without a sign begin at 0, and would begin before."""
    with h5py.File(file, "r+") as opened:
        times = opened["path/imu/ts"][()].astype(np.uint32)
        del opened["path/imu/ts"]
        opened["path/imu/ts"] = times
    assert "Expected path/imu/ts to hold the repaired values, got uint32" in given(file, LATE).refusal
    require_nothing_left(file)


def test_rows_that_cannot_be_decoded_are_refused(small_park_day: Path, tmp_path: Path) -> None:
    """A chunk is damaged of the stream that is altered; that of another stream stays as it is."""
    faulty = tmp_path / "seq.h5"
    faulty.write_bytes(small_park_day.read_bytes())
    with h5py.File(faulty) as opened:
        chunk = opened["path/imu/linear_acceleration"].id.get_chunk_info(0)
    with faulty.open("r+b") as damaged:
        damaged.seek(chunk.byte_offset + chunk.size // 2)
        damaged.write(bytes(16))
    assert not given(faulty, LATE).refusal
    faulty.with_name("out.h5").unlink()
    swapped = VectorAxes("imu", ((0, 1, 0), (1, 0, 0), (0, 0, 1)))
    assert "of path/imu/linear_acceleration to decode" in given(faulty, swapped).refusal
    require_nothing_left(faulty)


def test_a_declaration_of_the_side_file_is_not_changed(file: Path) -> None:
    """It would take precedence over what is written. All else is repaired, and the side file is named."""
    side = file.with_name("side.toml")
    side.write_text('[metadata]\n"metadata/imu/gravity" = 9.9\n')
    options = CheckOptions(dialect=load_choice(None, str(side)))
    out = file.with_name("out.h5")
    gravity = repair(file, out, options, quiet, check=given_check(file, GravityMisdeclared(0.1)))
    assert gravity.refusal.startswith(
        "Expected declarations that the file makes itself, got metadata/imu.gravity by side.toml; change it to 9.8 "
    )
    assert not out.exists()
    assert not repair(file, out, options, quiet, check=given_check(file, LATE)).refusal
    with h5py.File(out) as repaired, h5py.File(file) as before:
        assert json.loads(repaired[f"{PROVENANCE}/1"][()])["metadata"] == "side.toml"
        assert repaired["metadata/imu"].attrs["gravity"] == before["metadata/imu"].attrs["gravity"]


def test_a_file_made_of_several_is_refused(file: Path) -> None:
    """A link to another file would lead elsewhere from the folder of the copy."""
    with h5py.File(file, "r+") as opened:
        opened["more"] = h5py.ExternalLink("other.h5", "/path")
    assert "holds all its data, got more of another file" in given(file, LATE).refusal
    require_nothing_left(file)


def test_rows_do_not_move_away_from_what_no_dialect_knows(file: Path) -> None:
    """A temperature for each sample would stay where it was."""
    with h5py.File(file, "r+") as opened:
        opened["path/imu/temperature"] = np.zeros(len(opened["path/imu/ts"]))
        opened["path/imu/ts"][3] = opened["path/imu/ts"][1] - 1
    assert "got path/imu/temperature, which would stay behind" in given(file, Unsorted("imu", 1, 3)).refusal
    require_nothing_left(file)
    assert not given(file, LATE).refusal  # moves no row


def test_an_interrupt_leaves_nothing_behind(file: Path) -> None:
    """The copy is complete, and not checked yet."""
    check = given_check(file, LATE)

    def interrupted(path: Path, options: CheckOptions, progress: Progress) -> FileRun:
        if path != file:
            assert path.stat().st_size >= file.stat().st_size
            raise KeyboardInterrupt
        return check(path, options, progress)

    with pytest.raises(KeyboardInterrupt):
        repair(file, file.with_name("out.h5"), CheckOptions(), quiet, check=interrupted)
    require_nothing_left(file)


def test_a_file_that_changes_meanwhile_is_refused(file: Path) -> None:
    """What was checked is not what was copied."""
    check = given_check(file, LATE)

    def changing(path: Path, options: CheckOptions, progress: Progress) -> FileRun:
        run = check(path, options, progress)
        with file.open("ab") as appended:
            appended.write(b"more")
        return run

    result = repair(file, file.with_name("out.h5"), CheckOptions(), quiet, check=changing)
    assert "to stay as it is, got a change" in result.refusal
    require_nothing_left(file)


def test_an_immaterial_deviation_of_before_is_nothing_new() -> None:
    """The limits alone judge the copy: what they find of both is as it was. What they find of the copy alone is new."""
    path, step = Path("seq.h5"), RepairStep(diagnosis_of(LATE), "", "")
    before, after = record_with(path, ORDER), record_with(path, "flow.gain")
    assert "breaks flow.gain" in why_not_better(before, after, [step])
    deviation = Measurement("gain", 1.01, "", 0.001, 1.0, 0.004, 0.008, material=0.02, code="flow.gain")
    results = (replace(before.results[0], measurements=(deviation,)),)
    assert why_not_better(replace(before, results=results), after, [step]) == ""


@pytest.mark.parametrize(
    ("outcome", "reason"),
    [
        ("not_observable", "to be cleared, but clocks.order can no longer be observed"),
        ("crashed", "no longer be observed"),
    ],
)
def test_what_cannot_be_observed_is_not_cleared(outcome: Outcome, reason: str) -> None:
    """No check shows that the fault is gone."""
    path, step = Path("seq.h5"), RepairStep(diagnosis_of(LATE), "", "")
    before, after = record_with(path, ORDER), record_with(path)
    after = replace(after, results=(replace(after.results[0], outcome=outcome),))
    assert reason in why_not_better(before, after, [step])


@pytest.mark.parametrize(
    ("outcome", "better"), [("crashed", False), ("not_applicable", False), ("not_observable", True)]
)
def test_every_check_still_measures(outcome: Outcome, better: bool) -> None:
    """Of a check that passed before: a correct file may show less, and may not lack a stream."""
    path, step = Path("seq.h5"), RepairStep(diagnosis_of(LATE), "", "")
    before, after = record_with(path, ORDER), record_with(path)
    other = replace(after.results[0], check="imu.timing")
    before = replace(before, results=(*before.results, other))
    after = replace(after, results=(*after.results, replace(other, outcome=outcome)))
    assert (why_not_better(before, after, [step]) == "") == better
