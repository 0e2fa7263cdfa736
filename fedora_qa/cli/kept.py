"""What has been found of single files, kept in a folder, so that a run over many goes on where it was stopped.

Each file has an ordinary record there, with its arrays beside it, which ``fedora-qa report`` can show. It counts only
for the same content, checked by the same code, with the same configuration.
"""

import hashlib
import json
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from fedora_qa import __version__
from fedora_qa.cli.arrays import arrays_beside, read_arrays, write_arrays
from fedora_qa.cli.host import PACKAGES, package_version
from fedora_qa.cli.record import record_of
from fedora_qa.config import RULESET_VERSION, CheckConfig
from fedora_qa.engine.code import code_digest
from fedora_qa.engine.digest import file_digest
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.errors import MisuseError
from fedora_qa.record.json_io import read_record, write_record
from fedora_qa.storage.place import Place
from fedora_qa.storage.server import version_of

_KEY: Final = "resume_key"
"""Where the record says of what it holds: among the facts of its run."""


@dataclass(frozen=True, slots=True)
class KeptFolder:
    """A folder of what was found. ``checked_with`` identifies everything but the file that decides what a run gives."""

    folder: Path
    settings: CheckConfig
    checked_with: str

    def place(self, path: Place) -> "KeptFile":
        """Return a file's place in the folder, and note how the file is now."""
        whole = path.absolute()
        name = f"{path.stem}-{hashlib.sha256(os.fsencode(str(whole))).hexdigest()[:12]}.json"
        return KeptFile(path, self.folder / name, version_of(path).tag, self)


@dataclass(frozen=True, slots=True)
class KeptFile:
    """Where the run of one file is kept."""

    path: Place
    target: Path
    tag: str
    kept: KeptFolder

    def load(self) -> FileRun | None:
        """Return the file's run; None where it is not known, or of another content, code or configuration."""
        if not self.target.exists():
            return None
        digest = file_digest(self.path)
        try:
            record = read_record(self.target)
            arrays = read_arrays(arrays_beside(self.target))
        except MisuseError:
            return None
        file = record.files[0] if len(record.files) == 1 else None
        if file is None or record.run.host.get(_KEY) != self._key(digest.sha256, digest.kind):
            return None
        if list(arrays) != list(file.evidence):
            return None
        reached = str(record.run.host.get("budget_reached", ""))
        whole = replace(file, path=str(self.path))
        stated = record.run.host.get("decoded_bytes")
        decoded_bytes = stated if isinstance(stated, int) else 0
        return FileRun(whole, arrays, record.run.seconds, decoded_bytes, reached=reached)

    def store(self, run: FileRun, started: str) -> None:
        """Keep what was found of the file, entirely or not at all; nothing where the file was changed meanwhile."""
        if version_of(self.path).tag != self.tag:
            return
        key = self._key(run.record.sha256, run.record.digest_kind)
        write_arrays(arrays_beside(self.target), run.arrays)
        write_record(record_of([run], self.kept.settings, started, {_KEY: key}), self.target)

    def _key(self, sha256: str, kind: str) -> str:
        """Return what the run depends on. A partial digest does not see every change; the version's tag does."""
        tag = self.tag if kind == "partial" else None
        parts = [sha256, kind, tag, self.kept.checked_with]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def kept_folder(folder: Path, settings: CheckConfig, options: CheckOptions) -> KeptFolder:
    """Make the folder where it is missing; raises ``MisuseError`` where it cannot be written to.

    Parameters
    ----------
    options
        What the settings come to: the dialect as it is read, and whether evidence is kept.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise MisuseError(f"Expected to be able to keep results in {folder}, got: {problem.strerror}") from None
    if not os.access(folder, os.W_OK):
        raise MisuseError(f"Expected to be able to write into {folder}, got no permission; choose another folder")
    libraries = [package_version(name) for name in PACKAGES]
    parts = [__version__, RULESET_VERSION, code_digest(), libraries, settings.digest, repr(options)]
    return KeptFolder(folder, settings, hashlib.sha256(json.dumps(parts).encode()).hexdigest())
