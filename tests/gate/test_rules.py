"""Rules about single sequences and about sums."""

from dataclasses import replace

import numpy as np

from fedora_qa.gate.contents import Contents
from fedora_qa.gate.policy import Bounds
from fedora_qa.gate.rules import rule_on_intrinsics, rule_on_names, rule_on_streams
from fedora_qa.gate.totals import amount_of, rule_on_totals
from fedora_qa.sequence.declared import Camera
from tests.support.records import file_record, passed

CAMERA = Camera(36, 27, np.array([[31.2, 0, 17.5], [0, 31.2, 13.0], [0, 0, 1]]), np.eye(4))


def holding(*streams: str, **cameras: Camera) -> Contents:
    """The contents of a sequence with these streams and cameras."""
    return Contents(frozenset(streams), {"imu": "there is no path/imu"}, cameras, {}, frozenset())


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
