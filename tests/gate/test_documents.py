"""Documents are there, and checksums are what ``sha256sum`` says."""

from pathlib import Path

import pytest

from fedora_qa.gating.policy import Documents
from fedora_qa.gating.release import Violation
from fedora_qa.gating.rules import rule_on_checksums, rule_on_documents
from fedora_qa.storage.digest import whole_digest
from tests.support.releases import write_checksums


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A release of two files that need not be sequences, with checksums from ``sha256sum``."""
    for name, text in (("a b.h5", "one"), ("c.h5", "two"), ("LICENSE", "CC")):
        (tmp_path / name).write_text(text)
    write_checksums(tmp_path, "a b.h5", "c.h5", "LICENSE")
    return tmp_path


def broken(folder: Path) -> list[tuple[str, str]]:
    """Which file breaks which rule."""
    digests = {name: whole_digest(folder / name) for name in ("a b.h5", "c.h5")}
    violations: tuple[Violation, ...] = rule_on_checksums(folder, "SHA256SUMS", digests).violations
    return [(violation.name, violation.code) for violation in violations]


def appended(folder: Path, line: str) -> None:
    """Add a line to the checksums."""
    with (folder / "SHA256SUMS").open("a") as file:
        file.write(line + "\n")


def test_what_sha256sum_wrote_is_right(folder: Path) -> None:
    """Names with spaces, and files that are no sequences, among them."""
    assert broken(folder) == []


def test_changed_files(folder: Path) -> None:
    """A changed sequence is named itself, another changed file by the release."""
    (folder / "c.h5").write_text("three")
    (folder / "LICENSE").unlink()
    assert broken(folder) == [("c.h5", "wrong"), (".", "wrong")]


def test_unlisted_sequence(folder: Path) -> None:
    """A sequence without a line is named."""
    write_checksums(folder, "c.h5")
    assert broken(folder) == [("a b.h5", "unlisted")]


@pytest.mark.parametrize(("unlisted", "ending"), [(1, "d/0.h5"), (3, "d/0.h5, nor for 2 others")])
def test_unlisted_files_of_a_folder(unlisted: int, ending: str, tmp_path: Path) -> None:
    """The first is named, and the others are counted where there are any."""
    (tmp_path / "d").mkdir()
    for number in range(unlisted):
        (tmp_path / f"d/{number}.h5").write_text("x")
    (tmp_path / "SHA256SUMS").touch()
    (violation, *_) = rule_on_checksums(tmp_path, "SHA256SUMS", {"d": "0"}).violations
    assert violation.message.endswith(f"got no line for {ending}")


def test_no_listing_lists_nothing(folder: Path) -> None:
    """Without the file every sequence is unlisted."""
    (folder / "SHA256SUMS").unlink()
    assert broken(folder) == [("a b.h5", "unlisted"), ("c.h5", "unlisted")]


def test_binary_marks_and_leading_dots(folder: Path) -> None:
    """``*name`` and ``./name`` are names, and capital digits are digits."""
    digest = whole_digest(folder / "c.h5")
    first = (folder / "SHA256SUMS").read_text().splitlines()[0]
    (folder / "SHA256SUMS").write_text(f"{first}\n{digest.upper()} *./c.h5\n")
    assert broken(folder) == []


def test_hostile_lines(folder: Path) -> None:
    """A line that is no checksum, and a name that leads out of the folder, are named and not followed."""
    appended(folder, "hello")
    appended(folder, f"{'0' * 64}  ../secret")
    assert broken(folder) == [(".", "unreadable"), (".", "wrong")]


def test_documents(folder: Path) -> None:
    """One that is missing, and one that holds nothing but spaces, are named; what is not asked for is not."""
    (folder / "DATASHEET.md").write_text(" \n")
    (folder / "SHA256SUMS").unlink()
    asked = Documents("DATASHEET.md", "LICENSE", "SHA256SUMS")
    assert [v.code for v in rule_on_documents(folder, asked).violations] == ["datasheet", "checksums"]
    assert not rule_on_documents(folder, Documents()).violations
