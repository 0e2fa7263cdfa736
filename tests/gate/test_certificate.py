"""A certificate says what was checked of which bytes, and verifying finds whatever differs."""

import json
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.gating.acceptance import Waiver
from fedora_qa.gating.certificate import (
    Certificate,
    certificate_of,
    differences,
    read_certificate,
    write_certificate,
)
from fedora_qa.gating.policy import Documents, Policy
from fedora_qa.storage.digest import whole_digest
from tests.support.records import file_record, not_observable, passed, record

TODAY = date(2026, 6, 1)
WAIVER = Waiver("train/a.h5", "imu.noise", "reason", "anna", date(2026, 6, 30), code="x")
POLICY = Policy("1", documents=Documents(licence="LICENSE"), waivers=(WAIVER,))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A release of two files, whose content does not matter here."""
    release = tmp_path / "release"
    for name in ("train/a.h5", "test/b.h5", "LICENSE"):
        (release / name).parent.mkdir(parents=True, exist_ok=True)
        (release / name).write_text(name)
    return release


@pytest.fixture
def certificate(folder: Path, tmp_path: Path) -> Certificate:
    """Its certificate, through the file that holds it."""
    names = ("train/a.h5", "test/b.h5")
    files = [file_record(passed(), not_observable(), path=str(folder / name)) for name in names]
    shown = record(*files, file_record(passed("release.documents"), path=str(folder)))
    digests = {name: whole_digest(folder / name) for name in names}
    write_certificate(certificate_of(shown, POLICY, "0" * 64, digests), tmp_path / "certificate.json")
    return read_certificate(tmp_path / "certificate.json")


def test_it_says_what_was_checked(certificate: Certificate) -> None:
    """Digests, tool, policy, waivers, and of every check outcome, coverage and least detectable fault."""
    assert [file.name for file in certificate.files] == ["train/a.h5", "test/b.h5"]
    told = certificate.files[0].checks[0]
    assert (told.check, told.outcome, told.sights[0].least_detectable) == ("clocks.order", "passed", 1.0)
    assert told.coverage is not None
    assert certificate.documents.keys() == {"LICENSE"}
    assert certificate.policy_digest == POLICY.digest
    assert certificate.waivers == (WAIVER,)
    assert certificate.tool.version == "0.1.0"


def test_an_untouched_release_is_the_same(certificate: Certificate, folder: Path) -> None:
    """Nothing differs, and files that the gate did not look at do not count."""
    (folder / "notes.txt").touch()
    assert differences(certificate, folder, TODAY) == ()


CHANGES: dict[str, tuple[Callable[[Path], Any], str]] = {
    "a byte": (lambda folder: (folder / "test/b.h5").write_text("test/B.h5"), "test/b.h5 was changed"),
    "a document": (lambda folder: (folder / "LICENSE").write_text("other"), "LICENSE was changed"),
    "removed": (lambda folder: (folder / "train/a.h5").unlink(), "train/a.h5 is missing"),
    "added": (lambda folder: (folder / "test/c.h5").touch(), "test/c.h5 was added"),
}


@pytest.mark.parametrize(("change", "told"), CHANGES.values(), ids=CHANGES.keys())
def test_changes(change: Callable[[Path], Any], told: str, certificate: Certificate, folder: Path) -> None:
    """Whatever was changed is told, and nothing else."""
    change(folder)
    assert differences(certificate, folder, TODAY) == (told,)


def test_an_expired_waiver(certificate: Certificate, folder: Path) -> None:
    """On its last day a waiver holds, on the next it is told."""
    assert differences(certificate, folder, date(2026, 6, 30)) == ()
    assert differences(certificate, folder, date(2026, 7, 1)) == (
        "the waiver of anna for train/a.h5 expired on 2026-06-30",
    )


def test_a_changed_certificate(certificate: Certificate, folder: Path) -> None:
    """Whatever value is changed, the certificate's own digest tells."""
    for changed in (
        replace(certificate, effort="quick"),
        replace(certificate, waivers=()),
        replace(certificate, digest=""),
    ):
        assert differences(changed, folder, TODAY) == ("the certificate was changed after it was issued",)


@pytest.mark.parametrize("name", ["../a.h5", "/etc/hostname", "train/../../a.h5"])
def test_no_name_leads_out(name: str, certificate: Certificate, folder: Path) -> None:
    """A name that leads out of the folder is refused, before any file is read."""
    hostile = replace(certificate, files=(replace(certificate.files[0], name=name),))
    with pytest.raises(MisuseError, match="within"):
        differences(hostile, folder, TODAY)


@pytest.mark.parametrize("pattern", ["../*.h5", "/etc/*", "**/../../*.h5", ""])
def test_no_pattern_leads_out(pattern: str, certificate: Certificate, folder: Path) -> None:
    """Patterns of a certificate that somebody made look nowhere but in the folder."""
    made_up = replace(certificate, patterns=(pattern,))
    with pytest.raises(MisuseError, match="beneath the folder"):
        differences(made_up, folder, TODAY)


def test_what_is_no_certificate(tmp_path: Path, certificate: Certificate) -> None:
    """No file, no JSON, another version, and an unknown key are refused by name."""
    path = tmp_path / "certificate.json"
    document = json.loads(path.read_text())
    texts = ["{", json.dumps(document | {"certificate_version": "9"}), json.dumps(document | {"more": 1})]
    for text in texts:
        path.write_text(text)
        with pytest.raises(MisuseError, match="Expected a certificate"):
            read_certificate(path)
    with pytest.raises(MisuseError, match="a certificate at"):
        read_certificate(tmp_path / "none.json")
