"""Releases in a folder, of sequences written by hand."""

import subprocess
from pathlib import Path

from tests.support.handmade import write_handmade


def write_release(folder: Path, *names: str) -> Path:
    """Write sequences of these names, a datasheet, a licence and checksums; return the folder."""
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        write_handmade(folder / name)
    (folder / "DATASHEET.md").write_text("# Datasheet\n")
    (folder / "LICENSE").write_text("CC-BY-4.0\n")
    write_checksums(folder, *names, "LICENSE")
    return folder


def write_checksums(folder: Path, *names: str) -> None:
    """Write SHA256SUMS with the tool that everybody uses for it."""
    listed = subprocess.run(["sha256sum", *names], cwd=folder, capture_output=True, check=True)
    (folder / "SHA256SUMS").write_bytes(listed.stdout)
