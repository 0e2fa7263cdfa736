"""Results of single files, stored in a folder, so that a run over many files resumes where it was stopped.

Each file has an ordinary record there, with its arrays beside it, which ``fedora-qa report`` can show. It is used again
only for the same content, checked by the same code with the same configuration.
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
from fedora_qa.cli.outputs import require_result_folder
from fedora_qa.cli.record import record_of
from fedora_qa.code_digest import code_digest
from fedora_qa.config import RULESET_VERSION, CheckConfig
from fedora_qa.engine.options import CheckOptions, FileRun
from fedora_qa.errors import MisuseError
from fedora_qa.record.json_io import read_record, write_record
from fedora_qa.storage.digest import file_digest
from fedora_qa.storage.place import Place
from fedora_qa.storage.server import version_of

_KEY: Final = "resume_key"
"""Name of the key of the stored run, among the facts of the run in the record."""


@dataclass(frozen=True, slots=True)
class ResumeFolder:
    """A folder of stored runs. ``checked_with`` identifies all that determines their results, apart from the files."""

    path: Path
    settings: CheckConfig
    checked_with: str

    def stored_run(self, path: Place) -> "StoredRun":
        """Return where the run of a file is stored, with the present version of the file."""
        whole = path.absolute()
        # The stem is for people; the digest of the whole path keeps files of one name in different folders apart.
        name = f"{path.stem}-{hashlib.sha256(os.fsencode(str(whole))).hexdigest()[:12]}.json"
        return StoredRun(path, self.path / name, version_of(path).tag, self)


@dataclass(frozen=True, slots=True)
class StoredRun:
    """The place of one file's run in the folder."""

    path: Place
    target: Path
    tag: str
    folder: ResumeFolder

    def load(self) -> FileRun | None:
        """Return the file's run; None where none is stored, or one of other content, code or configuration."""
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
        # The record and its arrays are two files; an interrupt between the two writes leaves arrays of another run.
        if list(arrays) != list(file.evidence):
            return None
        reached = str(record.run.host.get("budget_reached", ""))
        # The present path: the stored one may be relative to another working directory.
        whole = replace(file, path=str(self.path))
        stated = record.run.host.get("decoded_bytes")
        decoded_bytes = stated if isinstance(stated, int) else 0
        return FileRun(whole, arrays, record.run.seconds, decoded_bytes, reached=reached)

    def store(self, run: FileRun, started: str) -> None:
        """Store the run of the file, entirely or not at all; nothing where the file was changed meanwhile."""
        if version_of(self.path).tag != self.tag:
            return
        key = self._key(run.record.sha256, run.record.digest_kind)
        # The arrays first: a record that exists then always has its arrays.
        write_arrays(arrays_beside(self.target), run.arrays)
        write_record(record_of([run], self.folder.settings, started, {_KEY: key}), self.target)

    def _key(self, sha256: str, kind: str) -> str:
        """Return a digest of what the run depends on. The version's tag shows changes that a partial digest misses."""
        # A full digest suffices by itself: without the tag, a run stays valid when only the time of change differs.
        tag = self.tag if kind == "partial" else None
        parts = [sha256, kind, tag, self.folder.checked_with]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def resume_folder(folder: Path, settings: CheckConfig, options: CheckOptions) -> ResumeFolder:
    """Make the folder where it is missing; raises ``MisuseError`` where it cannot be written to.

    Parameters
    ----------
    options
        The options that follow from the settings: the dialect as it was read, and whether evidence is gathered.
    """
    require_result_folder(folder, "choose another folder")
    # Another version of NumPy or OpenCV may change a measurement in its last digits, and so an outcome at a limit.
    libraries = [package_version(name) for name in PACKAGES]
    # Memory decides how often an image is decoded, and nothing that is found; its default follows the number of jobs.
    deciding = repr(replace(options, memory_bytes=0))
    parts = [__version__, RULESET_VERSION, code_digest(), libraries, settings.digest, deciding]
    return ResumeFolder(folder, settings, hashlib.sha256(json.dumps(parts).encode()).hexdigest())
