"""``fedora-qa gate`` and ``verify`` from end to end: one verdict in every form, waivers, baseline, certificate."""

import json
from pathlib import Path
from typing import Any

import h5py
import pytest
from junitparser import JUnitXml

from fedora_qa.record.json_io import read_record
from fedora_reports.html import render_html
from tests.cli.conftest import Command, Outcome
from tests.support.releases import write_checksums, write_release

POLICY = """
ruleset_version = "2"
naming = '[a-z0-9/]+\\.h5'
required_streams = ["rgb", "events", "imu", "flow"]
same_intrinsics = ["rgb"]
[check]
select = ["clocks.order", "index_maps"]
[documents]
datasheet = "DATASHEET.md"
licence = "LICENSE"
checksums = "SHA256SUMS"
"""

WAIVER = """
[[waivers]]
file = "b.h5"
check = "clocks.order"
cause = "imu:unsorted"
reason = "two stamps exchanged by the recorder"
owner = "anna"
expires = 2099-12-31
"""


def damage_clock(path: Path) -> None:
    """Exchange two stamps of the IMU."""
    with h5py.File(path, "r+") as file:
        timestamps: Any = file["path/imu/ts"]
        timestamps[20:22] = timestamps[20:22][::-1]


@pytest.fixture
def policy(tmp_path: Path) -> Path:
    """A policy that looks at stamps only."""
    path = tmp_path / "policy.toml"
    path.write_text(POLICY)
    return path


def damaged(folder: Path, *names: str) -> Path:
    """The release with the IMU's clock of its second sequence damaged, and right checksums."""
    damage_clock(folder / names[1])
    write_checksums(folder, *names)
    return folder


def told(folder: Path) -> int:
    """The exit code that the written formats tell, one and the same."""
    verdicts = {file.verdict for file in read_record(folder / "out.json").files}
    junit = JUnitXml.fromfile(str(folder / "out.xml"))
    (run,) = json.loads((folder / "out.sarif").read_text(encoding="utf-8"))["runs"]
    incomplete = {
        "incomplete" in verdicts, junit.errors > 0, not run["invocations"][0]["executionSuccessful"],
    }  # fmt: skip
    findings = {
        "findings" in verdicts, junit.failures > 0, any(result["level"] == "error" for result in run["results"]),
    }  # fmt: skip
    assert len(incomplete) == 1
    if incomplete == {True}:
        return 3
    assert len(findings) == 1
    return int(findings == {True})


def held(fedora_qa: Command, folder: Path, policy: Path, *options: str | Path) -> Outcome:
    """Run the gate; its formats tell its exit code, and lie beside the policy."""
    out = policy.parent
    written = ("--json", out / "out.json", "--junit", out / "out.xml", "--sarif", out / "out.sarif")
    done = fedora_qa("gate", folder, "--policy", policy, *written, *options)
    assert told(out) == done.code, done.out
    return done


def test_clean_and_certified(fedora_qa: Command, policy: Path) -> None:
    """A release in order exits with 0, and its certificate verifies until a byte is changed."""
    folder, certificate = write_release(policy.parent / "release", "a.h5", "b.h5"), policy.with_name("certificate.json")
    done = held(fedora_qa, folder, policy, "--certificate", certificate)
    assert done.code == 0
    assert [file.verdict for file in read_record(policy.with_name("out.json")).files] == ["clean"] * 3
    assert fedora_qa("verify", certificate, folder).code == 0
    damage_clock(folder / "b.h5")
    changed = fedora_qa("verify", certificate, folder)
    assert (changed.code, changed.out) == (1, "differs: b.h5 was changed\n")


def test_many_sequences_one_verdict(fedora_qa: Command, policy: Path) -> None:
    """Of eight sequences one has a finding and one a bad name: exit code and formats agree, and name both."""
    names = [f"s{i:02}.h5" for i in range(7)] + ["Odd.h5"]
    done = held(fedora_qa, damaged(write_release(policy.parent / "release", *names), *names), policy)
    assert done.code == 1
    failed = [
        (Path(file.path).name, result.check)
        for file in read_record(policy.with_name("out.json")).files
        for result in file.results
        if result.outcome == "failed"
    ]
    assert failed == [("Odd.h5", "release.naming"), ("s01.h5", "clocks.order")]


def test_a_waiver_is_needed_narrow_and_answered_for(fedora_qa: Command, policy: Path) -> None:
    """A finding fails, waived it does not; of another file, or expired, the waiver fails itself."""
    names = ("a.h5", "b.h5")
    folder = damaged(write_release(policy.parent / "release", *names), *names)
    assert held(fedora_qa, folder, policy).code == 1
    policy.write_text(POLICY + WAIVER)
    done = held(fedora_qa, folder, policy)
    assert done.code == 0
    assert "Waived until 2099-12-31 by anna" in " ".join(done.out.split())
    for waiver, code in ((WAIVER.replace("b.h5", "a.h5"), "unused"), (WAIVER.replace("2099", "2020"), "expired")):
        policy.write_text(POLICY + waiver)
        done = held(fedora_qa, folder, policy)
        assert done.code == 1
        assert f"release.waivers.{code}" in done.out


def test_a_baseline_knows_what_was_there(fedora_qa: Command, policy: Path) -> None:
    """Against its own record a release with a finding is clean; a new finding fails; no certificate is written."""
    names = ("a.h5", "b.h5")
    folder, certificate = (
        damaged(write_release(policy.parent / "release", *names), *names),
        policy.with_name("certificate.json"),
    )
    done = held(fedora_qa, folder, policy, "--certificate", certificate)
    assert done.code == 1
    assert "no certificate is written" in done.err
    assert not certificate.exists()
    baseline = policy.with_name("out.json").rename(policy.with_name("old.json"))
    assert held(fedora_qa, folder, policy, "--baseline", baseline).code == 0
    damage_clock(folder / "a.h5")
    write_checksums(folder, *names)
    assert held(fedora_qa, folder, policy, "--baseline", baseline).code == 1


def test_what_must_tell_and_cannot(fedora_qa: Command, policy: Path) -> None:
    """A required check that does not apply makes the release incomplete, before the finding of its missing stream."""
    folder = write_release(policy.parent / "release", "a.h5")
    with h5py.File(folder / "a.h5", "r+") as file:
        del file["path/imu"]
        del file["path/events"]
        del file["metadata/rgb_to_event"]
        del file["metadata/depth_to_event"]
    write_checksums(folder, "a.h5")
    assert held(fedora_qa, folder, policy).code in {1, 3}
    policy.write_text('required_checks = ["index_maps"]\n' + POLICY)
    done = held(fedora_qa, folder, policy)
    assert done.code == 3
    assert "less was seen than required: index_maps" in " ".join(done.out.split())
    assert "release.streams.missing" in done.out


def test_documents_and_report_again(fedora_qa: Command, policy: Path) -> None:
    """A missing licence is a finding of the release, in markdown, HTML and annotations, and in a later report."""
    folder = write_release(policy.parent / "release", "a.h5")
    (folder / "LICENSE").unlink()
    write_checksums(folder, "a.h5")
    out = policy.parent
    done = held(fedora_qa, folder, policy, "--github", "--markdown", out / "out.md")
    assert done.code == 1
    assert f"::error file={folder},title=release.documents.licence::" in done.out
    assert "Expected the licence in LICENSE" in render_html(read_record(out / "out.json"), {})
    fedora_qa("report", out / "out.json", "--markdown", out / "again.md", "--sarif", out / "again.sarif")
    assert (out / "again.md").read_text() == (out / "out.md").read_text()
    assert (out / "again.sarif").read_text() == (out / "out.sarif").read_text()


MISUSED = {
    "no folder": ("none", ()),
    "no policy": (".", ("--policy", "none.toml")),
    "a record that no gate wrote": (".", ("--baseline", "policy.toml")),
    "an output over the policy": (".", ("--certificate", "policy.toml")),
}


@pytest.mark.parametrize(("folder", "options"), MISUSED.values(), ids=MISUSED.keys())
def test_misuse(
    folder: str, options: tuple[str, ...], fedora_qa: Command, policy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What cannot be carried out is refused before any work."""
    made = write_release(policy.parent / "release", "a.h5")
    monkeypatch.chdir(policy.parent)
    before = policy.read_bytes()
    done = fedora_qa("gate", made / folder, "--policy", policy, *options)
    assert done.code == 2
    assert not done.out
    assert policy.read_bytes() == before


def test_verify_needs_a_certificate(fedora_qa: Command, policy: Path) -> None:
    """A policy given as a certificate is misuse."""
    assert fedora_qa("verify", policy, write_release(policy.parent / "release", "a.h5")).code == 2
