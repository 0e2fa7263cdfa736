"""Files over which HDF5 dies, or which never end to open: they end a process of their own, and no command."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import pytest

from fedora_qa.cli.startup import IN_PROCESS_VARIABLE
from fedora_qa.storage.signature import OPENING_VARIABLE
from tests.fuzz.by_command import by_command
from tests.hostile import patched

Patch = Callable[[Path], None]

ENDLESS: Final = (patched.tree_that_holds_itself, patched.text_heap_without_end, patched.name_heap_without_end)
DIED: Final = "the process by which it was being opened died twice"
ENDED: Final = "the process by which it was being opened did not come to an end"

POLICY: Final = """
ruleset_version = "2"
required_streams = ["rgb"]
splits = {all = ["*"]}
[check]
select = ["integrity"]
"""

SCRIPT: Final = """
import sys
import fedora_qa

if __name__ == "__main__":
    fedora_qa.check(*sys.argv[1:], apart=True, select=["integrity"]).save("record.json")
"""


def write_endless(folder: Path, *patches: Patch) -> list[str]:
    """Write a file for each patch, all of them where none is given, and return their names."""
    clean = (folder / "clean.h5").read_bytes()
    names = []
    for patch in patches or ENDLESS:
        names.append(f"{patch.__name__}.h5")
        (folder / names[-1]).write_bytes(clean)
        patch(folder / names[-1])
    return names


def ran(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python in the folder, as somebody does who has set no variable of ours."""
    environment = {name: value for name, value in os.environ.items() if name != IN_PROCESS_VARIABLE}
    environment[OPENING_VARIABLE] = "2"
    environment["PYTHONPATH"] = os.pathsep.join(path or str(Path.cwd()) for path in sys.path)
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True, timeout=300, check=False, env=environment, cwd=folder, text=True,
    )  # fmt: skip


def command(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return ran(folder, "-m", "fedora_qa.cli.main", *arguments)


def require_lost(folder: Path, hostile: list[str], others: list[str]) -> None:
    """Hold a record to what it must say of each hostile file and of the others."""
    files = {Path(file["path"]).name: file for file in json.loads((folder / "record.json").read_text())["files"]}
    for name in hostile:
        assert files[name]["verdict"] == "incomplete", name
        own = [result for result in files[name]["results"] if not result["check"].startswith("release.")]
        assert {result["outcome"] for result in own} == {"crashed"}, name
        assert (DIED if name == f"{patched.tree_that_holds_itself.__name__}.h5" else ENDED) in own[0]["reason"]
    for name in others:
        outcomes = {result["check"]: result["outcome"] for result in files[name]["results"]}
        # The values of the clean file are constant, so that no step of storage shows.
        assert outcomes.pop("integrity.resolution", "not_observable") == "not_observable", name
        assert set(outcomes.values()) == {"passed"}, name


OTHER_COMMANDS: Final[dict[str, tuple[list[str], Patch]]] = {
    "layout died": (["layout", "patched.h5"], patched.tree_that_holds_itself),
    "layout without end": (["layout", "patched.h5"], patched.name_heap_without_end),
    "stats": (["stats", "patched.h5"], patched.text_heap_without_end),
    "export": (["export", "patched.h5", "out", "--to", "dsec"], patched.name_heap_without_end),
    "extract": (["extract", "patched.h5", "F1", "-o", "piece.h5"], patched.name_heap_without_end),
    "compare died": (["compare", "clean.h5", "patched.h5", "--json", "c.json"], patched.tree_that_holds_itself),
    "compare without end": (["compare", "patched.h5", "clean.h5", "--html", "c.html"], patched.text_heap_without_end),
}


@dataclass(frozen=True, slots=True)
class Ended:
    """A run that came to an end: how, the hostile files in its folder, and what lay there before."""

    folder: Path
    hostile: list[str]
    before: list[Path]
    process: subprocess.CompletedProcess[str]


def check(folder: Path) -> Ended:
    """Check hostile files before a clean one."""
    hostile, before = write_endless(folder), sorted(folder.iterdir())
    given = ["check", *hostile, "clean.h5", "--json", "record.json", "--select", "integrity"]
    return Ended(folder, hostile, before, command(folder, *given))


def check_from_python(folder: Path) -> Ended:
    """Check them by a script."""
    hostile = write_endless(folder)
    (folder / "script.py").write_text(SCRIPT)
    before = sorted(folder.iterdir())
    return Ended(folder, hostile, before, ran(folder, "script.py", *hostile, "clean.h5"))


def gate(folder: Path) -> Ended:
    """Hold two of them, and the clean one, to a policy."""
    hostile = write_endless(folder, patched.tree_that_holds_itself, patched.name_heap_without_end)
    (folder / "policy.toml").write_text(POLICY)
    before = sorted(folder.iterdir())
    options = ["--json", "record.json", "--certificate", "certificate.json"]
    return Ended(folder, hostile, before, command(folder, "gate", ".", "--policy", "policy.toml", *options))


def run_other(name: str, folder: Path) -> Ended:
    """Run another command over one of them."""
    arguments, patch = OTHER_COMMANDS[name]
    (folder / "patched.h5").write_bytes((folder / "clean.h5").read_bytes())
    patch(folder / "patched.h5")
    before = sorted(folder.iterdir())
    return Ended(folder, ["patched.h5"], before, command(folder, *arguments))


@pytest.fixture(scope="module")
def runs(clean_bytes: bytes, tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Future[Ended]]]:
    """All runs, some at a time: each mostly waits for what does not end."""
    works: dict[str, Callable[[Path], Ended]] = {"check": check, "python": check_from_python, "gate": gate}
    works |= {name: partial(run_other, name) for name in OTHER_COMMANDS}
    with ThreadPoolExecutor(3) as pool:
        started = {}
        for name, work in works.items():
            folder = tmp_path_factory.mktemp("endless")
            (folder / "clean.h5").write_bytes(clean_bytes)
            started[name] = pool.submit(work, folder)
        yield started


def test_a_check_goes_on_with_the_other_files(runs: dict[str, Future[Ended]]) -> None:
    """HDF5 2.0 ends the process that opens them, or never ends (docs/hostile-files.md): other files stand."""
    ended = runs["check"].result()
    assert ended.process.returncode == 3, ended.process.stderr
    assert "Traceback" not in ended.process.stderr
    require_lost(ended.folder, ended.hostile, others=["clean.h5"])


def test_from_python_they_are_opened_apart_where_asked_to(runs: dict[str, Future[Ended]]) -> None:
    """With ``apart=True`` the program goes on, and has the record of the other files."""
    ended = runs["python"].result()
    assert ended.process.returncode == 0, ended.process.stderr
    require_lost(ended.folder, ended.hostile, others=["clean.h5"])


def test_a_gate_goes_on_with_the_other_files(runs: dict[str, Future[Ended]]) -> None:
    """What a policy asks of contents is read apart as well: incomplete, never clean, and nothing is certified."""
    ended = runs["gate"].result()
    assert ended.process.returncode == 3, ended.process.stderr
    assert "Traceback" not in ended.process.stderr
    require_lost(ended.folder, ended.hostile, others=["clean.h5"])
    assert not (ended.folder / "certificate.json").exists()


@pytest.mark.parametrize("name", OTHER_COMMANDS)
def test_other_commands_end_with_one_sentence(name: str, runs: dict[str, Future[Ended]]) -> None:
    """One sentence and exit code 2; nothing is left behind."""
    ended = runs[name].result()
    assert ended.process.returncode == 2, ended.process.stderr
    assert ended.process.stderr.count("\n") == 1
    assert "over which the process that read it has ended" in ended.process.stderr
    assert sorted(ended.folder.iterdir()) == ended.before


def test_what_the_command_sees_is_no_end_of_something_endless(clean_bytes: bytes, tmp_path: Path) -> None:
    """Where the fuzz did not come to an end, but the command does and calls the file seen, something else hung."""
    (tmp_path / "clean.h5").write_bytes(clean_bytes)
    assert by_command(tmp_path / "clean.h5") == "hang"
