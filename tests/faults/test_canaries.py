"""Canaries: every check sees its own, a deaf one is found out, and the file is never touched."""

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from fedora_qa.checks.imu.timing import ImuTiming
from fedora_qa.checks.protocol import Check, Observation
from fedora_qa.cli.main import run
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.engine.trials import canaries
from fedora_qa.faults.fault import Fault
from fedora_qa.record.types import Canary, FileRecord
from fedora_qa.sequence.facts import Facts
from tests.extremes.test_streams import ALL, without
from tests.integration.test_planted_faults import PLANTED
from tests.support.all_checks import CHECKS
from tests.support.handmade import write_handmade
from tests.support.replaced_checks import replace_checks
from tests.support.sequences import CleanSequence

CHECK_NAMES = tuple(check.name for check in CHECKS)


def proven(path: Path, *select: str) -> FileRecord:
    return check_file(path, CheckOptions(select=select, canary=True, evidence=None)).record


def by_check(record: FileRecord) -> dict[str, Canary]:
    return {canary.check: canary for canary in record.canaries}


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture(scope="module")
def park_proven(park_day: Path) -> FileRecord:
    """The park by day with all canaries; its bytes are the same before and after."""
    before = digest(park_day)
    record = proven(park_day)
    assert digest(park_day) == before
    return record


@pytest.fixture(scope="module")
def handmade(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_handmade(tmp_path_factory.mktemp("canaries") / "whole.h5")


NOT_OF_THE_GENERATOR = {"metadata.profile", "index_maps.milliseconds"}
"""Checks of what no file of the generator holds; each has a test of its own."""


@pytest.mark.parametrize("check", [name for name in CHECK_NAMES if name not in NOT_OF_THE_GENERATOR])
def test_check_sees_its_canary(check: str, park_proven: FileRecord, clean_sequence: CleanSequence) -> None:
    """A fault of three times the stated limit, or a gross one, makes the check fail.

    It is tried in the park by day, or in the scene of the check's planted fault where the park cannot show it anything.
    """
    canary = by_check(park_proven)[check]
    if canary.reason == "it was not observable on the file":
        canary = by_check(proven(clean_sequence(PLANTED[check].scene), check))[check]
    assert (canary.outcome, canary.reason) == ("seen", "")
    assert canary.fault
    assert 1 <= canary.windows <= 6


def test_faults_of_one_place_lie_where_a_sampled_run_looks(park_day: Path) -> None:
    """With four of six windows, gaps, repeats and jumps are seen still."""
    local = ("event_stream.gaps", "images.repeats", "pose.continuity", "clocks.gaps")
    record = check_file(park_day, CheckOptions("quick", select=local, canary=True, evidence=None)).record
    assert [canary.outcome for canary in record.canaries] == ["seen"] * 4


def test_validity_without_poses_detects_infinite_values(handmade: Path, tmp_path: Path) -> None:
    """Where no pose states where a value must be, the canary plants what is wrong everywhere."""
    path = tmp_path / "still.h5"
    path.write_bytes(handmade.read_bytes())
    with h5py.File(path, "r+") as file:
        without(file, ("pose",), declared=False)
    canary = by_check(proven(path, "flow_geometry.validity"))["flow_geometry.validity"]
    assert (canary.outcome, canary.reason) == ("seen", "")


def test_no_canary_where_a_check_could_not_tell(park_proven: FileRecord) -> None:
    """What was not observable or not applicable gets none, and says so; the verdict stays."""
    canary = by_check(park_proven)["metadata.profile"]
    assert (canary.outcome, canary.reason) == ("not_planted", "it was not applicable on the file")
    assert by_check(park_proven)["images.channels"].reason == "it was not observable on the file"
    assert park_proven.verdict == "clean"


def test_milliseconds_see_an_index_that_is_off(handmade: Path, tmp_path: Path) -> None:
    """Where a file has a map from milliseconds, its check sees one that names the next event."""
    path = tmp_path / "indexed.h5"
    path.write_bytes(handmade.read_bytes())
    with h5py.File(path, "r+") as file:
        file["metadata/ms_to_event"] = np.searchsorted(file["path/events/t"][:], 1000 * np.arange(100))
    record = proven(path, "index_maps.milliseconds")
    assert [result.outcome for result in record.results] == ["passed"]
    assert by_check(record)["index_maps.milliseconds"].outcome == "seen"


def test_profile_sees_a_camera_of_another_size(handmade: Path, tmp_path: Path) -> None:
    """A file that keeps the paper's promises fails with a camera that is a column too wide."""
    path = tmp_path / "promising.h5"
    path.write_bytes(handmade.read_bytes())
    with h5py.File(path, "r+") as file:
        promise_and_keep(file)
    record = proven(path, "metadata.profile")
    assert [result.outcome for result in record.results] == ["passed"]
    assert by_check(record)["metadata.profile"].outcome == "seen"


def promise_and_keep(file: h5py.File) -> None:
    """Declare the paper's profile, and all that it promises."""
    file.attrs["profile"] = "fedora-paper"
    for name, (width, height) in {"rgb": (1440, 1080), "depth": (1440, 1080), "events": (640, 480)}.items():
        camera = file[f"metadata/cameras/{name}"].attrs
        K = camera["K"] * width / camera["width"]
        K[2, 2] = 1.0
        camera.update({"width": width, "height": height, "K": K})
    threshold = {"threshold_on": 30.0, "threshold_off": 30.0}
    file["metadata/events"].attrs.update({"model": "linear", "packet_interval_us": 200, **threshold})


def test_nothing_is_seen_where_nothing_is_planted(park_day: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the few windows of a canary no check alarms by itself: what is seen is the fault."""
    growing = canaries.growing

    def few(chosen: Any, place_ns: int) -> Iterator[Any]:
        return islice(growing(chosen, place_ns), 2)

    monkeypatch.setattr(canaries, "growing", few)
    monkeypatch.setattr(canaries, "canary_of", lambda check: lambda conditions: Fault("nothing at all"))
    planted = [canary for canary in proven(park_day).canaries if canary.outcome != "not_planted"]
    assert len(planted) > 40
    assert [canary.check for canary in planted if canary.outcome not in {"silent", "withheld"}] == []


def deaf(check: Check[Any]) -> Check[Any]:
    """The check, measuring exactly what is expected whatever it is shown."""
    original = type(check).conclude

    class Deaf(type(check)):  # type: ignore[misc]  # the class is known only as the test runs
        __doc__ = type(check).__doc__

        def conclude(self, state: Any, facts: Facts) -> Observation:
            observed = original(self, state, facts)
            return replace(observed, measurements=tuple(replace(m, value=m.expected) for m in observed.measurements))

    return Deaf()


def test_every_deaf_check_is_found_out(handmade: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Checks that always measure what is expected crash, one by one; hearing ones see their canaries."""
    hearing = {canary.check for canary in proven(handmade).canaries if canary.outcome == "seen"}
    replace_checks(monkeypatch, *(deaf(check) for check in CHECKS))
    record = proven(handmade)
    crashed = {result.check: result.reason for result in record.results if result.outcome == "crashed"}
    assert len(hearing) > 20
    assert hearing <= set(crashed)
    assert all(reason.startswith("it did not see its own canary") for reason in crashed.values())
    assert record.verdict == "incomplete"


def test_deaf_check_makes_the_command_exit_with_3(
    park_day: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The verdict is incomplete, and says which canary was not seen."""

    def silent(self: ImuTiming, state: Any, facts: Facts) -> Observation:
        observed = original(self, state, facts)
        return replace(observed, measurements=tuple(replace(m, value=m.expected) for m in observed.measurements))

    original = ImuTiming.conclude
    command = ["check", str(park_day), "--select", "imu.timing", "--select", "clocks.rate"]
    assert run([*command, "--canary"]) == 0
    monkeypatch.setattr(ImuTiming, "conclude", silent)
    assert run(command) == 0
    capsys.readouterr()
    assert run([*command, "--canary"]) == 3
    description = " ".join(capsys.readouterr().out.split())  # lines are broken at the width of the terminal
    assert "canaries seen by 1 of 2 checks; not seen by imu.timing" in description
    assert "it did not see its own canary in 6 windows: imu 0.00" in description


def test_check_that_crashes_on_its_canary_shows_where(park_day: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A check that fails itself over the fault is crashed, with the traceback of that failure."""

    def break_on_faults(self: ImuTiming, state: Any, facts: Facts) -> Observation:
        if facts.clocks["imu"].times_ns[0]:
            raise ZeroDivisionError("on the canary only")
        return original(self, state, facts)

    original = ImuTiming.conclude
    monkeypatch.setattr(ImuTiming, "conclude", break_on_faults)
    (result,) = proven(park_day, "imu.timing").results
    assert result.outcome == "crashed"
    assert "on the canary only" in result.traceback


def test_canary_that_fails_itself_proves_nothing(handmade: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault that cannot be made counts as not seen: never a silent pass."""
    monkeypatch.setattr(canaries, "canary_of", lambda check: lambda conditions: 1 / 0)
    (result,) = proven(handmade, "clocks.rate").results
    assert result.outcome == "crashed"
    assert "ZeroDivisionError" in result.traceback


def test_check_that_failed_on_the_file_needs_no_canary(handmade: Path, tmp_path: Path) -> None:
    """A failed check is alive; the finding stays what it is."""
    path = tmp_path / "unsorted.h5"
    path.write_bytes(handmade.read_bytes())
    with h5py.File(path, "r+") as file:
        timestamps = file["path/imu/ts"]
        timestamps[20:22] = timestamps[20:22][::-1]
    record = proven(path, "clocks.order")
    assert by_check(record)["clocks.order"].reason == "it failed on the file itself"
    assert record.verdict == "findings"


@pytest.mark.parametrize("alone", [True, False], ids=["alone", "left out"])
@pytest.mark.parametrize("stream", ALL)
def test_canaries_do_without_streams(stream: str, alone: bool, handmade: Path, tmp_path: Path) -> None:
    """Whichever stream is missing, or alone, canaries are seen or are not planted with a reason."""
    path = tmp_path / "some.h5"
    path.write_bytes(handmade.read_bytes())
    missing = tuple(other for other in ALL if other != stream) if alone else (stream,)
    with h5py.File(path, "r+") as file:
        without(file, missing, declared=False)
    record = proven(path)
    assert [result for result in record.results if result.outcome == "crashed"] == []
    assert all(canary.outcome == "seen" or canary.reason for canary in record.canaries)
    assert any(canary.outcome == "seen" for canary in record.canaries)


def test_record_without_canaries_says_nothing_of_them(handmade: Path) -> None:
    """Where none was asked for the block is empty."""
    assert check_file(handmade, CheckOptions(evidence=None)).record.canaries == ()
