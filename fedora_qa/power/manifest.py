"""The manifest of a corpus: which files there are, and what was planted in each. See docs/corpus.md.

A study uses nothing else about the origin of files. Further fields of a manifest are ignored, so that anybody can write
one for files of their own.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import copysign, cos, radians, sin
from pathlib import Path, PurePosixPath
from typing import Annotated, Final, Literal

from pydantic import Field, TypeAdapter

from fedora_qa.causes import CAUSES
from fedora_qa.errors import MisuseError
from fedora_qa.record.documents import read_json
from fedora_qa.record.power_study import Kind

MANIFEST: Final = "manifest.json"

Finite = Annotated[float, Field(allow_inf_nan=False)]


@dataclass(frozen=True, slots=True)
class PlantedFault:
    """One fault: ``start_s`` or ``region`` where it is confined to a part of the file.

    ``direction_deg`` where its size is the length of a shift in a direction of its own: degrees, clockwise from right.
    """

    cause: str
    stream: str
    magnitude: Finite | None = None
    unit: str | None = None
    start_s: Finite | None = None
    stop_s: Finite | None = None
    region: tuple[int, int, int, int] | None = None
    direction_deg: Finite | None = None

    @property
    def name(self) -> str:
        """``stream:cause``."""
        return f"{self.stream}:{self.cause}"

    @property
    def signed_magnitude(self) -> float | None:
        """The magnitude; of a shift in a direction with the sign of its larger component, right or down positive."""
        if self.magnitude is None or self.direction_deg is None:
            return self.magnitude
        right, down = cos(radians(self.direction_deg)), sin(radians(self.direction_deg))
        return copysign(self.magnitude, right if abs(right) >= abs(down) else down)

    @property
    def is_confined(self) -> bool:
        """Whether it is confined to a part of the file."""
        return any(part is not None for part in (self.start_s, self.stop_s, self.region))


@dataclass(frozen=True, slots=True)
class CorpusItem:
    """One file. ``cause`` to ``unit`` repeat the first of ``faults``, or stand alone where there is no such list."""

    file: str
    base: str | None = None
    cause: str | None = None
    stream: str | None = None
    magnitude: Finite | None = None
    unit: str | None = None
    observable: bool = True
    notes: str = ""
    faults: tuple[PlantedFault, ...] = ()
    sha256: str | None = None
    bytes: int | None = None

    @property
    def planted(self) -> tuple[PlantedFault, ...]:
        """Every fault of the file; none of a clean one."""
        if self.faults or self.cause is None:
            return self.faults
        return (PlantedFault(self.cause, self.stream or "", self.magnitude, self.unit),)

    @property
    def is_clean(self) -> bool:
        """Whether nothing was planted."""
        return not self.planted

    @property
    def kind(self) -> Kind:
        """Whether the faults are one of the whole file, one of a part of it, or several."""
        if len(self.planted) > 1:
            return "composite"
        return "local" if any(fault.is_confined for fault in self.planted) else "single"


@dataclass(frozen=True, slots=True)
class Manifest:
    """The content of a manifest."""

    corpus_version: Literal[1]
    items: Annotated[tuple[CorpusItem, ...], Field(min_length=1)]


_READER: Final = TypeAdapter(Manifest)


def read_manifest(corpus: Path) -> Manifest:
    """Read and validate the manifest of a corpus.

    Raises
    ------
    MisuseError
        There is none, it is no JSON, a field is missing or wrong, a cause is unknown, a file lies outside the corpus or
        is listed twice, or a base is no clean file of the corpus.
    """
    path = corpus / MANIFEST
    advice = "make a corpus with `fedora-generate corpus`, or see docs/corpus.md"
    manifest = read_json(path, _READER, "the manifest of a corpus", advice)
    files = [item.file for item in manifest.items]
    clean = {item.file for item in manifest.items if item.is_clean}
    for item in manifest.items:
        wrong = _problem(item, files, clean)
        if wrong:
            raise MisuseError(f"Expected a valid {path}, got at {item.file}: {wrong}; see docs/corpus.md")
    return manifest


def require_files(corpus: Path, manifest: Manifest) -> None:
    """Raise ``MisuseError`` where files are missing, or have another size than the manifest states."""
    wrong = []
    for item in manifest.items:
        path = corpus / item.file
        if not path.is_file() or item.bytes not in (None, path.stat().st_size):
            wrong.append(item.file)
    if wrong:
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        raise MisuseError(
            f"Expected the files of {corpus / MANIFEST} as it lists them, got {', '.join(wrong[:3])}{more} missing or "
            "of another size; make the corpus again"
        )


def require_other_names(manifests: Mapping[Path, Manifest]) -> None:
    """Raise ``MisuseError`` where two corpora list a file of the same name: files of a study are identified by name."""
    first_by_name: dict[str, Path] = {}
    for corpus, manifest in manifests.items():
        for item in manifest.items:
            other = first_by_name.setdefault(item.file, corpus)
            if other != corpus:
                raise MisuseError(
                    f"Expected corpora whose files have different names, got {item.file} in both {other} and {corpus}; "
                    "make one of them with another --seed"
                )


def _problem(item: CorpusItem, files: list[str], clean: set[str]) -> str:
    """Return what is wrong with an item, empty where nothing is."""
    # Anybody may write a manifest: its names must not lead to files outside the corpus.
    inside = PurePosixPath(item.file)
    if inside.is_absolute() or ".." in inside.parts or not inside.name:
        return "a path that is not beneath the manifest's folder"
    if files.count(item.file) > 1:
        return "the same file twice"
    if item.base is not None and item.base not in clean:
        return f"the base {item.base}, which is no clean file of the corpus"
    for fault in item.planted:
        if fault.cause not in CAUSES:
            return f"the cause {fault.cause!r}, which does not exist"
        if not fault.stream:
            return f"the cause {fault.cause!r} without a stream"
    return ""
