"""Rules about single sequences, about sums, and about sequences beside each other: copies, and splits that leak."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_qa.config import RULESET_VERSION
from fedora_qa.engine.executors.executor import OpenFile, Worker
from fedora_qa.gating.contents import Contents, read_contents
from fedora_qa.gating.policy import Bounds, Policy
from fedora_qa.gating.release import Release
from fedora_qa.gating.rules import (
    amount_of,
    release_results_of,
    rule_on_distinct,
    rule_on_identity,
    rule_on_intrinsics,
    rule_on_names,
    rule_on_splits,
    rule_on_streams,
    rule_on_totals,
)
from fedora_qa.sequence.declared import Camera, Lens
from tests.support.handmade import write_handmade
from tests.support.records import file_record, passed

CAMERA = Camera(36, 27, np.array([[31.2, 0, 17.5], [0, 31.2, 13.0], [0, 0, 1]]), np.eye(4))
STREAMS = ("rgb", "events", "imu", "pose")
WORKER = Worker(OpenFile(keeps=False))
SPLITS = {"train": ("train/*",), "test": ("test/*",)}


def holding(*streams: str, **cameras: Camera) -> Contents:
    """The contents of a sequence with these streams and cameras."""
    return Contents(frozenset(streams), {"imu": "there is no path/imu"}, cameras, {}, {})


def test_names_match_as_a_whole() -> None:
    """A name that only contains the pattern is broken."""
    release_result = rule_on_names(["day-01.h5", "a/day-01.h5", "day-01.h5.bak"], r"day-\d\d\.h5")
    assert [violation.name for violation in release_result.violations] == ["a/day-01.h5", "day-01.h5.bak"]


def test_required_streams() -> None:
    """A missing stream is named with the reason why it is absent."""
    release_result = rule_on_streams({"a": holding("rgb", "imu"), "b": holding("rgb")}, ["rgb", "imu"])
    (violation,) = release_result.violations
    assert (violation.name, violation.stream) == ("b", "imu")
    assert "there is no path/imu" in violation.message


def test_flow_of_any_rate_is_flow() -> None:
    """Required flow is that of the rates of the sequence; equal fields of one rate are found, whatever the rate."""
    assert not rule_on_streams({"a": holding("rgb", "flow/20hz", "flow/12.5hz")}, ["flow"]).violations
    violations = rule_on_streams({"a": holding("rgb")}, ["flow"]).violations
    assert [violation.stream for violation in violations] == ["flow/10hz", "flow/25hz", "flow/50hz"]
    (violation,) = rule_on_streams({"a": holding("flow/20hz")}, ["flow/12.5hz"]).violations
    assert violation.stream == "flow/12.5hz"
    copies = {name: replace(holding("flow/20hz"), digests={"flow/20hz": "same"}) for name in "ab"}
    (violation,) = rule_on_distinct(copies, ["flow"]).violations
    assert (violation.name, violation.stream) == ("b", "flow/20hz")


def test_same_intrinsics() -> None:
    """A camera that differs, by a millionth of its focal length or in size, or is undeclared, is named."""
    longer = replace(CAMERA, K=CAMERA.K * [[1 + 1e-6], [1], [1]])
    rounded = replace(CAMERA, K=CAMERA.K * (1 + 1e-13))
    known = {
        "a": holding(rgb=CAMERA), "b": holding(rgb=rounded), "c": holding(rgb=longer), "d": holding(),
        "e": holding(rgb=replace(CAMERA, width=37)),
    }  # fmt: skip
    violations = rule_on_intrinsics(known, ["rgb"]).violations
    assert [(violation.name, violation.code) for violation in violations] == [
        ("c", "differ"), ("d", "undeclared"), ("e", "differ"),
    ]  # fmt: skip
    assert "f 31.2, 31.2" in violations[0].message


def test_the_lens_is_intrinsic() -> None:
    """A camera of another lens, or of none, differs, and the message has its coefficients."""
    bent = replace(CAMERA, lens=Lens("radtan", (-0.3, 0.1, 0.0, 0.0)))
    other = replace(CAMERA, lens=Lens("radtan", (-0.31, 0.1, 0.0, 0.0)))
    known = {"a": holding(rgb=bent), "b": holding(rgb=bent), "c": holding(rgb=other), "d": holding(rgb=CAMERA)}
    violations = rule_on_intrinsics(known, ["rgb"]).violations
    assert [violation.name for violation in violations] == ["c", "d"]
    assert "radtan -0.31, 0.1, 0, 0" in violations[0].message


def test_mounting_is_no_intrinsic() -> None:
    """Cameras that are mounted otherwise project alike."""
    turned = replace(CAMERA, T_body_camera=np.diag([-1.0, -1.0, 1.0, 1.0]))
    assert not rule_on_intrinsics({"a": holding(rgb=CAMERA), "b": holding(rgb=turned)}, ["rgb"]).violations


def test_totals() -> None:
    """Sums on their bounds are in order, outside them not, and what a sequence does not tell is no zero."""
    files = [file_record(passed()), file_record(passed())]
    assert amount_of(files, "duration_s") == 4.0
    assert amount_of(files, "bytes") == 102_600_000
    assert not rule_on_totals(files, {"sequences": Bounds(2, 2), "duration_s": Bounds(4.0, 4.0)}).violations
    broken = rule_on_totals(files, {"sequences": Bounds(3), "duration_s": Bounds(most=3.9), "distance_m": Bounds(0)})
    assert [violation.code for violation in broken.violations] == ["sequences", "duration_s", "distance_m"]
    assert "at least 3, got 2" in broken.violations[0].message
    assert "at most 3.9, got 4" in broken.violations[1].message


def contents(path: Path) -> Contents:
    """What a file holds, all streams digested."""
    held = read_contents(path, None, STREAMS, True, (), WORKER)
    assert held
    return held


@pytest.fixture
def moving(tmp_path: Path) -> Path:
    """A file whose poses move, by a random walk."""
    path = write_handmade(tmp_path / "moving.h5")
    with h5py.File(path, "r+") as file:
        positions: Any = file["path/pose/position"]
        positions[:] = np.cumsum(np.random.default_rng(3).normal(size=positions.shape), axis=0)
    return path


def edited(source: Path, name: str, key: str, edit: Any) -> Path:
    """A copy of a file with one dataset edited."""
    path = source.with_name(name)
    path.write_bytes(source.read_bytes())
    with h5py.File(path, "r+") as file:
        dataset: Any = file[key]
        dataset[:] = edit(dataset[:])
    return path


def test_what_never_changes_has_no_digest(moving: Path) -> None:
    """A grey wall and an IMU at rest are alike everywhere; events and a flight are not."""
    assert set(contents(moving).digests) == {"events", "pose"}


def test_later_timestamps_make_no_other_stream(moving: Path) -> None:
    """A copy whose clock starts elsewhere has the same content."""
    late = edited(moving, "late.h5", "path/events/t", lambda t: t + 5)
    assert contents(late).digests == contents(moving).digests


def test_one_value_makes_another_stream(moving: Path) -> None:
    """One event that lies elsewhere is another content."""
    other = edited(moving, "other.h5", "path/events/x", lambda x: np.concatenate([[x[0] ^ 1], x[1:]]))
    assert contents(other).digests["events"] != contents(moving).digests["events"]
    assert contents(other).digests["pose"] == contents(moving).digests["pose"]


def test_a_truncated_file_has_no_contents(moving: Path) -> None:
    """What cannot be opened is left to its record."""
    moving.write_bytes(moving.read_bytes()[:5000])
    assert read_contents(moving, None, STREAMS, True, (), WORKER) is None


def test_copies_are_named(moving: Path) -> None:
    """The later of two sequences with one stream in common names the earlier."""
    other = edited(moving, "other.h5", "path/events/x", lambda x: x[::-1])
    known = {"a": contents(moving), "b": contents(other)}
    (violation,) = rule_on_distinct(known, ["events", "pose"]).violations
    assert (violation.name, violation.stream) == ("b", "pose")
    assert "the same pose as in a" in violation.message


def test_a_name_with_other_data_is_named(moving: Path) -> None:
    """The later of two files that declare one sequence, with other events, names the earlier and what differs."""
    other = edited(moving, "other.h5", "path/events/x", lambda x: x[::-1])
    with h5py.File(other, "r+") as file:
        file.attrs["illumination"] = "night"
    (violation,) = rule_on_identity({"a": contents(moving), "b": contents(other)}).violations
    assert (violation.name, violation.code) == ("b", "other_data")
    assert "'rest' (world 'wall', light 'night'), which a declares (world 'wall', light 'day')" in violation.message
    assert "with other events;" in violation.message


def test_copies_and_names_of_their_own_keep_their_identity(moving: Path) -> None:
    """The same data under one name are a copy; other data under another name, or none, are in order."""
    other = edited(moving, "other.h5", "path/events/x", lambda x: x[::-1])
    first, different = contents(moving), contents(other)
    assert not rule_on_identity({"a": first, "b": contents(moving)}).violations
    assert not rule_on_identity({"a": first, "b": replace(different, sequence="turn")}).violations
    assert not rule_on_identity({"a": replace(first, sequence=""), "b": replace(different, sequence="")}).violations


@pytest.mark.parametrize("allowed", [False, True])
def test_a_policy_may_allow_one_name_for_several_files(allowed: bool, tmp_path: Path) -> None:
    """The rule holds unless the policy says otherwise."""
    policy = Policy(RULESET_VERSION, same_sequence=allowed)
    release_results = release_results_of(policy, Release(tmp_path, ()), (), {}, {})
    assert ("release.identity" in {release_result.rule for release_result in release_results}) != allowed


def test_one_sequence_in_a_file_for_each_stream(moving: Path) -> None:
    """Files that hold different streams of one sequence hold no other data."""
    first = contents(moving)
    files = {stream: replace(first, digests={stream: first.digests[stream]}) for stream in ("events", "pose")}
    assert not rule_on_identity(files).violations


def test_splits_that_leak(moving: Path) -> None:
    """One stream in two splits is a leak; the same in one split is not."""
    known = {name: contents(moving) for name in ("train/a", "train/b", "test/c")}
    violations = rule_on_splits(known, known, SPLITS).violations
    assert [(violation.name, violation.code) for violation in violations] == [("test/c", "leak"), ("test/c", "leak")]
    assert "the same events, pose and 21 of the poses of train/a" in violations[0].message


@pytest.mark.parametrize(("shared", "leaks"), [(1, False), (9, False), (10, True)])
def test_a_stretch_of_one_flight_is_a_leak(shared: int, leaks: bool, moving: Path) -> None:
    """Ten poses in common are one flight, however the rest differs; a common start is not."""

    def partly(positions: Any) -> Any:
        positions[shared:] += 0.5
        return positions

    cut = edited(moving, "cut.h5", "path/pose/position", partly)
    cut = edited(cut, "cut2.h5", "path/events/x", lambda x: x[::-1])
    known = {"train/a": contents(moving), "test/b": contents(cut)}
    violations = rule_on_splits(known, known, SPLITS).violations
    assert bool(violations) == leaks
    # Both places are stated: poses come every 5 ms, from 0 on in both files.
    for violation in violations:
        assert violation.message.endswith("these lie from 0 s to 0.045 s there, and from 0 s to 0.045 s here")
        assert (violation.start_us, violation.stop_us) == (0.0, 45e3)


def test_each_sequence_in_one_split() -> None:
    """One that is in no split, or in two, is named with them."""
    splits = {"train": ("*/a",), "val": ("x/*",)}
    violations = rule_on_splits(["x/a", "y/a", "y/b"], {}, splits).violations
    assert [(violation.name, violation.code) for violation in violations] == [("x/a", "several"), ("y/b", "unassigned")]
    assert "train, val" in violations[0].message
