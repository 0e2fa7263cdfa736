"""Compiled loops are kept somewhere, or for one run; no folder that cannot be written to breaks a run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from fedora_qa.compiled_cache import CACHE_VARIABLE, choose_cache_folder

NOWHERE = Path(os.devnull) / "nowhere"
"""Neither is there, nor can it be made, whoever tries."""

COMPILED = """
import os
from pathlib import Path
from fedora_qa.compiled_cache import choose_cache_folder
folder = choose_cache_folder(Path({package!r}))
from numba import njit
from fedora_qa.layout import direct_chunks
print(folder, os.listdir(folder))
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    folder = tmp_path / "package"
    folder.mkdir()
    (folder / "module.py").touch()
    return folder


@pytest.fixture(autouse=True)
def homeless(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(CACHE_VARIABLE, raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(NOWHERE))


def test_a_folder_that_numba_has_is_kept(package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beside the sources, by the variable, or of the user."""
    assert choose_cache_folder(package) is None
    (package / "__pycache__").touch()
    for variable, value in ((CACHE_VARIABLE, "/own"), ("XDG_CACHE_HOME", str(tmp_path)), ("HOME", str(tmp_path))):
        with monkeypatch.context() as changed:
            changed.setenv(variable, value)
            assert choose_cache_folder(package) is None
            assert os.environ.get(CACHE_VARIABLE) == ("/own" if variable == CACHE_VARIABLE else None)


def test_where_nothing_can_be_written_a_temporary_folder_is_used_and_removed(package: Path, tmp_path: Path) -> None:
    """Only its user may write to it; loops compile into it; it is gone when the process ends."""
    (package / "__pycache__").touch()
    (tmp_path / "temporary").mkdir()
    environment = {**os.environ, "TMPDIR": str(tmp_path / "temporary")}
    code = COMPILED.format(package=str(package))
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "fedora-qa-compiled-" in done.stdout
    assert "layout_" in done.stdout
    assert not list((tmp_path / "temporary").glob("fedora-qa-compiled-*"))


def test_without_a_temporary_folder_nothing_is_raised(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Numba then states what it lacks, where a loop is needed."""

    def refuse(prefix: str) -> str:
        raise OSError(prefix)

    (package / "__pycache__").touch()
    monkeypatch.setattr("tempfile.mkdtemp", refuse)
    assert choose_cache_folder(package) is None
    assert CACHE_VARIABLE not in os.environ
