"""Lines of drafted dialects, of files (``draft_file``) and of folders (``draft_folder``).

``guesses`` states what each dataset may be.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from fedora_qa.layout.canonical import BESIDE, STREAMS, datasets_of, datasets_of_all, in_file_order, spec_of
from fedora_qa.layout.guesses import CAMERA_WORDS, Guess
from fedora_qa.layout.inventory import Fields, StoredObject

_NUMBER: Final = re.compile(r"\d+")

_INTRINSICS: Final = ("intrinsic", "camera_matrix", "fx_fy")


def in_order(guesses: Mapping[str, Guess]) -> list[Guess]:
    """Return guesses, by key, in the order of the layout."""
    streams = {spec_of(key).stream for key in guesses}
    beside = (spec for stream in ("depth_range", *BESIDE) for spec in datasets_of(stream))
    return [guesses[spec.key] for spec in (*datasets_of_all(streams), *beside) if spec.key in guesses]


def draft_lines(guesses: Sequence[Guess], items: Sequence[StoredObject]) -> list[str]:
    """Return the table of datasets, with every guess and its reason, and what nothing was guessed for."""
    lines = ["[datasets]"]
    for guess in guesses:
        lines += [comment(guess.reason), f"{quoted(guess.key)} = {toml_table(guess.fields)}"]
    lines.append("")
    keys_guessed = {guess.key for guess in guesses}
    # Streams that cannot be read yet: a stream without any guess counts as absent, and needs no correction by hand.
    for stream in in_file_order({*STREAMS, *(spec_of(key).stream for key in keys_guessed)}):
        keys = [spec.key for spec in datasets_of(stream)]
        missing = [key for key in keys if key not in keys_guessed]
        if missing and len(missing) < len(keys):
            lines.append(f"# {stream} cannot be read before there is a place for {', '.join(missing)}.")
    used = {(guess.fields.get("file"), guess.fields.get(name)) for guess in guesses for name in ("path", "offset_path")}
    used_members = {
        (guess.fields.get("file"), guess.fields.get("path"), member)
        for guess in guesses
        for member in _members_of(guess.fields)
    }
    unused: list[StoredObject] = []
    for item in items:
        place = item.place.get("file"), item.place.get("path")
        is_used = any((*place, name) in used_members for name in item.members) if item.members else place in used
        # A vector is listed by its members.
        if not is_used and len(item.members) < 2:
            unused.append(item)
    if unused:
        lines.append("# Nothing was guessed for:")
    # Names that differ in their numbers alone are one line.
    alike: dict[tuple[str, str], list[StoredObject]] = {}
    for item in unused:
        alike.setdefault((_NUMBER.sub("*", _path_in_folder(item)), str(item.dtype)), []).append(item)
    for (pattern, dtype), group in alike.items():
        shapes = sorted({" x ".join(map(str, item.shape)) for item in group})
        shape = shapes[0] if len(shapes) == 1 else f"{shapes[0]} and others"
        path = _path_in_folder(group[0]) if len(group) == 1 else f"{pattern}  {len(group)} of"
        lines.append(comment(f"  {path}  {shape}  {dtype}"))
    return lines


def _members_of(fields: Fields) -> list[str]:
    members = fields.get("members")
    return [str(member) for member in members] if isinstance(members, list) else []


def toml_table(fields: Fields) -> str:
    """Return the fields of a place as an inline table of TOML."""
    return f"{{ {', '.join(f'{field} = {_toml_value(value)}' for field, value in fields.items())} }}"


def _toml_value(value: str | float | list[int] | list[str]) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_toml_value, value))}]"
    return quoted(value) if isinstance(value, str) else str(value)


def _path_in_folder(item: StoredObject) -> str:
    path = f"{item.members[0]} of {item.path}" if item.members else item.path
    return f"{item.role}: {path}" if item.role and item.form == "hdf5" else path


def camera_lines(items: Iterable[StoredObject]) -> list[str]:
    """Return what may be the matrices of cameras, as remarks where no name identifies the camera."""
    lines: list[str] = []
    for item in items:
        if item.members:  # declarations are not read from members
            continue
        is_matrix = item.shape == (3, 3) and item.head[2].tolist() == [0, 0, 1] and item.head[0, 0] > 1
        is_list = item.shape == (4,) and names_intrinsics(item.path)
        if not is_matrix and not is_list:
            continue
        fields = {**item.place, **({} if is_matrix else {"convert": "fx_fy_cx_cy"})}
        lines += camera_line(item.path, ", ".join(f"{name} = {quoted(str(v))}" for name, v in fields.items()))
    return lines


def names_intrinsics(path: str) -> bool:
    """Whether a path is that of four intrinsics, by its name."""
    words = path.lower()
    return any(word in words for word in _INTRINSICS) and "dist" not in words.rpartition("/")[2]


def camera_line(path: str, fields: str) -> list[str]:
    """Return the line of a camera's matrix at a path, commented out where the path does not tell whose it is."""
    words = path.lower()
    camera = next((name for name, hints in CAMERA_WORDS.items() if any(hint in words for hint in hints)), "")
    if camera:
        return [comment("its name and values"), f'"metadata/cameras/{camera}/K" = {{ {fields} }}']
    return [comment(f'The matrix of a camera, but of which? "metadata/cameras/.../K" = {{ {fields} }}')]


def quoted(text: str) -> str:
    """Return text as a TOML basic string; names in HDF5 may hold any character."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    # TOML 1.0 basic strings must escape U+0000 to U+001F, but for the tab, and U+007F.
    return '"' + "".join(f"\\u{ord(c):04x}" if _is_control(c) else c for c in escaped) + '"'


def comment(text: str) -> str:
    """Return text as a comment of TOML, on one line."""
    # A line break in a stored name would end the comment and add TOML of its own.
    return "# " + "".join(" " if _is_control(c) else c for c in text)


def _is_control(character: str) -> bool:
    return ord(character) < 32 or ord(character) == 127
