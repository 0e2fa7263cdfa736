"""What has been checked already, one small file each, so that a study goes on where it was stopped."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from fedora_qa.errors import MisuseError
from fedora_qa.power.checked_file import CheckedFile
from fedora_qa.power.manifest import CorpusItem
from fedora_qa.record.atomic import write_text
from fedora_qa.record.documents import read_json
from fedora_qa.storage.digest import file_digest


@dataclass(frozen=True, slots=True)
class _Kept:
    key: str
    checked: CheckedFile


_ADAPTER = TypeAdapter(_Kept)


@dataclass(frozen=True, slots=True)
class State:
    """A folder of results. ``measured_with`` identifies everything but the file that decides what is found."""

    folder: Path
    corpus: Path
    measured_with: str

    def load(self, item: CorpusItem) -> CheckedFile | None:
        """Return what is known of a file; None where nothing is, or it is of another file, tool or configuration."""
        try:
            kept = read_json(self._path(item), _ADAPTER, "a kept result", "it is measured again")
        except MisuseError:
            return None
        return kept.checked if kept.key == self._key(item) else None

    def store(self, item: CorpusItem, checked: CheckedFile) -> None:
        """Keep what was found of a file, entirely or not at all."""
        path = self._path(item)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, _ADAPTER.dump_json(_Kept(self._key(item), checked)).decode() + "\n")

    def _path(self, item: CorpusItem) -> Path:
        return self.folder / f"{item.file}.json"

    def _key(self, item: CorpusItem) -> str:
        """Return what the result depends on: the file's digest, and how it was checked."""
        # The digest of the manifest saves reading the file; the study compares it with what was read.
        content = item.sha256 or file_digest(self.corpus / item.file).sha256
        parts = [content, self.measured_with]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()
