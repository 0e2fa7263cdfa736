"""What is read beside sequences is bounded too, and nothing of it commands anything."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from fedora_qa.cli import arrays
from fedora_qa.cli.main import run
from fedora_qa.config import MOST_TOML_BYTES, read_config
from fedora_qa.errors import MisuseError
from fedora_qa.gating.certificate import read_certificate
from fedora_qa.gating.policy import read_policy
from fedora_qa.layout.dialect import load_dialect
from fedora_qa.record import documents
from fedora_qa.record.json_io import read_record, record_from_json
from fedora_qa.record.tables import record_to_csv
from tests.support.records import file_record, passed, record

DEEP = "[" * 100_000


def test_a_configuration_of_megabytes_is_refused(tmp_path: Path) -> None:
    """It is refused by its size, before it is parsed."""
    path = tmp_path / "fedora-qa.toml"
    path.write_bytes(b"#" * (MOST_TOML_BYTES + 1))
    with pytest.raises(MisuseError, match="bytes at most"):
        read_config(path)


def test_a_record_without_end_is_misuse(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is given for a record is read to a limit, and no further."""
    monkeypatch.setattr(documents, "MOST_BYTES", 1 << 20)
    for reader in (read_record, read_certificate):
        with pytest.raises(MisuseError, match="1 MiB at most"):
            reader(Path("/dev/zero"))


def test_nesting_without_end_is_misuse(tmp_path: Path) -> None:
    """Lists within lists end no parser: configuration, dialect, record."""
    path = tmp_path / "deep.toml"
    path.write_text("name = " + DEEP)
    with pytest.raises(MisuseError):
        read_config(path)
    with pytest.raises(MisuseError):
        load_dialect(path)
    with pytest.raises(MisuseError):
        read_policy(path)
    with pytest.raises(MisuseError):
        record_from_json(DEEP)


def test_evidence_that_unpacks_to_too_much_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Arrays beside a record are held to a size before one is read."""
    path = tmp_path / "r.json.arrays.npz"
    np.savez_compressed(path, zeros=np.zeros(100_000))
    monkeypatch.setattr(arrays, "MOST_BYTES", 1000)
    with pytest.raises(MisuseError, match="at most"):
        arrays.read_arrays(path)


def test_evidence_that_claims_too_much_is_refused(tmp_path: Path) -> None:
    """An array whose header claims an exabyte is damaged, and no memory is taken for it."""
    path = tmp_path / "r.json.arrays.npz"
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1152921504606846976,), }".ljust(117) + b"\n"
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("x.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
    with pytest.raises(MisuseError, match="damaged"):
        arrays.read_arrays(path)


@pytest.mark.parametrize("start", ["=", " =", "\uff1d", "\t+", "\uff20"])
def test_no_cell_is_a_formula_in_any_spreadsheet(start: str) -> None:
    """Also after spaces, and in full width."""
    for table in record_to_csv(record(file_record(passed(), path=f"{start}cmd()"))).values():
        for line in table.splitlines()[1:]:
            assert line.lstrip('"').startswith("'")


def test_an_internal_error_is_printed_harmlessly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever an exception quotes of a file commands no terminal."""

    def fail(_: list[str]) -> int:
        raise ValueError("\x1b[2Jowned\u202e")

    monkeypatch.setattr("fedora_qa.cli.main._invoke", fail)
    assert run(["checks"]) == 3
    said = capsys.readouterr().err
    assert "owned" in said
    assert said.strip().isprintable()
