"""Do two commits measure and conclude the same? ``make same-results BASE=<commit>``.

Checks the same files with the code of a commit, in an environment of its own, and with the code that lies here, and
compares the records and their arrays field by field. Exit code 1 where a result differs by more than the order of
arithmetic explains; other wording is counted and shown, and is no difference. Files and the base's records are kept in
out/same-results.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import tarfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import click
import numpy as np

from tests.same_results.comparison import Change, Comparison, Kind, compare_arrays, compare_values
from tests.same_results.corpus import corpus_files, make_corpus

ROOT: Final = Path(__file__).parents[2]
FOLDER: Final = ROOT / "out" / "same-results"
BATCH: Final = 16
"""Files a command checks."""

NOT_HDF5: Final = ("broken/a_text_file.h5", "broken/no_such_path.h5", "broken/a_folder.h5")
"""Misuse of the command: its exit code and message are compared, there is no record."""


@dataclass(frozen=True, slots=True)
class Run:
    """One command: the files that it checks, and its options."""

    files: tuple[Path, ...]
    options: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Code:
    """The code of one commit: how to run it, and where its records go."""

    python: Path
    path: tuple[Path, ...]
    records: Path

    @property
    def compiled(self) -> Path:
        """Where its compiled loops are kept.

        A loop that may reassociate sums is compiled otherwise, in the last bits, where a loop that it calls was kept
        from an earlier run. So both codes begin with nothing compiled, and check the same files in the same order.
        """
        return self.records.with_name("compiled")

    def check(self, arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
        """Run ``fedora-qa check``."""
        environment = os.environ | {
            "PYTHONPATH": os.pathsep.join(map(str, self.path)),
            "NUMBA_CACHE_DIR": str(self.compiled),
            "OMP_NUM_THREADS": "1",
        }
        command = [str(self.python), "-P", "-m", "fedora_qa", "check", *arguments]
        return subprocess.run(command, env=environment, cwd=FOLDER, capture_output=True, text=True, check=False)


@click.command()
@click.option("--base", required=True, help="The commit whose results are to be kept.")
@click.option("--jobs", default=2, show_default=True)
@click.option(
    "--every", default=1, show_default=True, help="Of the faulty files of small frames take every so-manieth."
)
@click.option("--canaries/--no-canaries", default=True, show_default=True, help="Plant canaries in three clean files.")
def main(base: str, jobs: int, every: int, canaries: bool) -> None:
    """Check all files with both codes and print how the results differ."""
    files_folder = FOLDER / "files"
    make_corpus(files_folder, lambda text: click.echo(text, err=True))
    files = [path.relative_to(FOLDER) for path in corpus_files(files_folder, every)]
    runs: list[Run] = []
    for kind in ("clean", "large", "faults", "broken", "hostile"):
        of_kind = [path for path in files if path.parts[1] == kind and str(Path(*path.parts[1:])) not in NOT_HDF5]
        # Clean and large files come first, in one process, so that all loops are compiled in one order.
        options = ("--jobs", "1" if kind in {"clean", "large"} else str(jobs))
        runs += [Run(tuple(of_kind[first : first + BATCH]), options) for first in range(0, len(of_kind), BATCH)]
    runs += [Run((Path("files") / path,), ()) for path in NOT_HDF5]
    if canaries:
        clean = tuple(Path("files", "clean", f"{name}.h5") for name in ("park-day", "park-noisy", "racetrack"))
        runs.append(Run(clean, ("--canary", "--jobs", str(jobs))))
    here = Code(Path(sys.executable), (ROOT, ROOT / "generator", ROOT / "reports"), FOLDER / "records")
    shutil.rmtree(here.records, ignore_errors=True)
    shutil.rmtree(here.compiled, ignore_errors=True)
    comparison = compare_codes(base_code(base), here, runs)
    click.echo(report(comparison, base))
    sys.exit(0 if comparison.same else 1)


def base_code(base: str) -> Code:
    """Return the code of a commit, installed into an environment of its own where it is not there yet."""
    commit = _git("rev-parse", "--verify", f"{base}^{{commit}}").decode().strip()
    folder = FOLDER / commit
    python = folder / "environment" / "bin" / "python"
    if not (folder / "installed").exists():
        click.echo(f"installing {commit[:12]} into {folder}", err=True)
        shutil.rmtree(folder, ignore_errors=True)
        with tarfile.open(fileobj=BytesIO(_git("archive", commit))) as archive:
            archive.extractall(folder / "source", filter="data")
        subprocess.run([sys.executable, "-m", "venv", str(folder / "environment")], check=True)
        pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
        subprocess.run([*pip, str(folder / "source")], check=True)
        (folder / "installed").touch()
    return Code(python, (), folder / "records")


def _git(*arguments: str) -> bytes:
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, check=True).stdout


def compare_codes(base: Code, here: Code, runs: Iterable[Run]) -> Comparison:
    """Check the files of every run with both codes and compare what they say."""
    comparison = Comparison()
    for run in runs:
        label = f"{run.files[0]} and {len(run.files) - 1} more {' '.join(run.options)}"
        click.echo(f"checking {label}", err=True)
        before, after = check_with(base, run), check_with(here, run)
        changes = [*compare_values("exit_code", before["exit_code"], after["exit_code"])]
        changes += compare_values("message", before["message"], after["message"])
        if changes:
            comparison.add(f"command {label}", iter(changes))
        for path, old, new in zip(run.files, before["files"], after["files"], strict=True):
            arrays = (load_arrays(before, old), load_arrays(after, new))
            file_changes = [*compare_values("file", old, new), *compare_arrays(*arrays)]
            comparison.add(f"{path} {' '.join(run.options)}", iter(file_changes))
    return comparison


def check_with(code: Code, run: Run) -> dict[str, Any]:
    """Return the exit code, the message and the records of the files of a run; they are kept beside the record."""
    # Batches may begin with the same file and hold others: with another --every, or after the corpus has changed.
    places = [FOLDER / path for path in run.files]
    content = [
        f"{path} {place.stat().st_size if place.is_file() else 0}"
        for path, place in zip(run.files, places, strict=True)
    ]
    digest = hashlib.sha256("\n".join(content).encode()).hexdigest()[:12]
    name = "_".join([*run.files[0].with_suffix("").parts[1:], *run.options, digest]).replace("-", "")
    target = code.records / f"{name}.json"
    summary = target.with_suffix(".summary.json")
    if not summary.exists():
        target.parent.mkdir(parents=True, exist_ok=True)
        done = code.check([*map(str, run.files), "--json", str(target), *run.options])
        if done.returncode not in {0, 1, 2, 3} or (not target.exists() and done.returncode != 2):
            raise click.ClickException(f"{code.python} ended with {done.returncode}: {done.stderr[-2000:]}")
        record = json.loads(target.read_text()) if target.exists() else {"files": [{} for _ in run.files]}
        message = "" if target.exists() else done.stderr
        document = {"exit_code": done.returncode, "message": message, "files": record["files"], "record": str(target)}
        summary.write_text(json.dumps(document), encoding="utf-8")
    document = json.loads(summary.read_text())
    assert isinstance(document, dict)
    return document


def load_arrays(document: Mapping[str, Any], file: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return the evidence of one file by name, without what a record of several files puts before it."""
    path = Path(f"{document['record']}.arrays.npz")
    if not path.exists() or not file:
        return {}
    with np.load(path) as arrays:
        return {name: arrays[name] for name in file["evidence"] if name in arrays.files}


def report(comparison: Comparison, base: str) -> str:
    """Return the result in words: counts, and the first changes of each kind."""
    identical = sum(not changes for changes in comparison.changes.values())
    lines = [f"{comparison.files} files against {base}: {identical} identical to the last bit and word"]
    kinds: tuple[tuple[Kind, str], ...] = (
        ("wording", "other words"),
        ("rounding", "within rounding"),
        ("different", "DIFFERENT"),
    )
    for kind, title in kinds:
        changes = comparison.of_kind(kind)
        lines.append(f"{title}: {len(changes)} fields of {len({file for file, _ in changes})} files")
        lines += [f"  {file}: {_sentence(change)}" for file, change in changes[: 40 if kind == "different" else 5]]
    lines.append("same results" if comparison.same else "the results differ")
    return "\n".join(lines)


def _sentence(change: Change) -> str:
    return f"{change.path}: {str(change.before)[:200]!r} -> {str(change.after)[:200]!r}"


if __name__ == "__main__":
    main()
