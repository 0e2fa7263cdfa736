"""The files of a folder by the role that a dialect would give them: those whose names differ in numbers together."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

from fedora_qa.layout.dialect import FORMS, Form
from fedora_qa.storage.folder import levels_above_files, list_files, root_of

MOST_SINGLE: Final = 4
"""Files, or arrays of an NPZ, of one form of name that stand by themselves; more are rows of one dataset."""

_NUMBER: Final = re.compile(r"\d+(?:\.\d+)?")
_NUMBERS: Final = re.compile(r"\*(?:[-_.]*\*)+")


@dataclass(frozen=True, slots=True)
class FileGroup:
    """The files of one role, and a pattern below the folder of the sequence that they fit."""

    role: str
    pattern: str
    paths: tuple[Path, ...]

    @property
    def form(self) -> Form:
        """Format of the files."""
        return FORMS[self.paths[0].suffix.lower()]

    @property
    def is_npz(self) -> bool:
        """Whether each file may hold several arrays."""
        return self.paths[0].suffix.lower() == ".npz"


def file_groups(folder: Path) -> dict[str, FileGroup]:
    """Return the files below a folder in formats that are read, by role."""
    root, levels_above = root_of(folder), levels_above_files(folder)
    of_folders: dict[tuple[str, str], list[str]] = {}
    for file in list_files(folder):
        inside, _, name = file.name.rpartition("/")
        suffix = Path(name).suffix
        if suffix.lower() in FORMS:
            of_folders.setdefault((inside, suffix), []).append(name)
    groups: dict[str, FileGroup] = {}
    for (below_root, suffix), names in of_folders.items():
        inside = "/".join(below_root.split("/")[levels_above:])
        by_form = by_form_of_name(name.removesuffix(suffix) for name in names)
        form = FORMS[suffix.lower()]
        if form == "images" and all(len(stems) == 1 for stems in by_form.values()):
            by_form = {"*": [name.removesuffix(suffix) for name in names]}
        for form_of_name, stems in by_form.items():
            # HDF5 and documents are files by themselves, whatever their names.
            fewest = {"images": 1, "array": MOST_SINGLE, "text": MOST_SINGLE}.get(form, len(names))
            together = len(stems) > fewest
            pattern = pattern_of(form_of_name, stems, [name.removesuffix(suffix) for name in names])
            for members in [stems] if together else [[stem] for stem in stems]:
                # A folder of one kind of files has the name of what they are.
                is_folder = together and len(by_form) == 1 and bool(inside or form == "images")
                words = "" if is_folder else pattern if together else members[0]
                role = re.sub(r"[\W_]+", "_", f"{inside}/{words}", flags=re.ASCII).strip("_").lower() or form
                # Two files may differ in their endings alone.
                role = role if role not in groups else f"{role}_{suffix[1:].lower()}"
                role = role if role not in groups else f"{role}_{len(groups)}"
                name = f"{pattern if together else members[0]}{suffix}"
                paths = tuple(root / below_root / f"{stem}{suffix}" for stem in members)
                groups[role] = FileGroup(role, f"{inside}/{name}" if inside else name, paths)
    return groups


def by_form_of_name(stems: Iterable[str]) -> dict[str, list[str]]:
    """Return names without endings by their form: that with ``*`` in place of each number."""
    by_form: dict[str, list[str]] = {}
    for stem in stems:
        by_form.setdefault(_NUMBER.sub("*", stem), []).append(stem)
    return by_form


def pattern_of(form_of_name: str, stems: Sequence[str], all_stems: Sequence[str]) -> str:
    """Return the shortest pattern that the names of one form fit, and if possible no others of the folder."""
    short = _NUMBERS.sub("*", form_of_name)
    begins, ends = f"[0-9]{short}", f"{short}[0-9]"
    # Beside 1_flow, the name 1 ends in a digit; beside left_1, it begins with one.
    candidates = [short, *([ends] if short.endswith("*") else []), *([begins] if short.startswith("*") else [])]
    for candidate in candidates:
        if [stem for stem in all_stems if fnmatchcase(stem, candidate)] == list(stems):
            return candidate
    return short
