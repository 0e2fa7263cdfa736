"""Draft a dialect for an unknown file: a TOML text to be read, corrected and then used."""

from collections.abc import Iterable, Iterator, Mapping

import h5py

from fedora_qa.layout.canonical import DATASETS, STREAMS, datasets_of
from fedora_qa.layout.guess import Guess, guess_places
from fedora_qa.layout.inventory import StoredObject, take_inventory

# One hint suffices to prefer a dialect; the second covers a file that lacks the first dataset.
_MOST_HINTS = 2


def draft_dialect(file: h5py.File, name: str) -> str:
    """Return the text of a dialect with every guess and its reason, and what nothing was guessed for.

    Parameters
    ----------
    file
        Open for reading. Only the first rows of each dataset are looked at.
    name
        Name of the dialect.
    """
    items = take_inventory(file)
    guesses = {guess.key: guess for guess in guess_places(items)}
    ordered = [guesses[key] for key in DATASETS if key in guesses]
    lines = [*_head(name), *_hints(ordered), "[datasets]"]
    for guess in ordered:
        lines += [_comment(guess.reason), f"{_quoted(guess.key)} = {_table(guess.fields)}"]
    lines += ["", *_partial_streams(guesses), *_unused(items, ordered)]
    return "\n".join(lines).rstrip() + "\n"


def _head(name: str) -> Iterator[str]:
    yield "# A draft, guessed from names, shapes, types and first values. Every line wants a look before it is used:"
    yield "# a wrong unit here is a finding about the draft, not about the file."
    yield f"name = {_quoted(name)}"
    yield 'description = "drafted"'
    yield ""


def _hints(guesses: Iterable[Guess]) -> Iterator[str]:
    # A path equal to the canonical key does not distinguish this dialect from the canonical one.
    paths = list(dict.fromkeys(str(guess.fields["path"]) for guess in guesses if guess.fields["path"] != guess.key))
    for path in paths[:_MOST_HINTS]:
        yield "[[hints]]"
        yield f"path = {_quoted(path)}"
        yield ""


def _partial_streams(guesses: Mapping[str, Guess]) -> Iterator[str]:
    """List the streams that cannot be read yet, because a part of them was not found."""
    for stream in STREAMS:
        keys = [spec.key for spec in datasets_of(stream)]
        missing = [key for key in keys if key not in guesses]
        # A stream without any guess counts as absent; only an incomplete one needs a correction by hand.
        if missing and len(missing) < len(keys):
            yield f"# {stream} cannot be read before there is a place for {', '.join(missing)}."


def _unused(items: Iterable[StoredObject], guesses: Iterable[Guess]) -> Iterator[str]:
    used = {guess.fields["path"] for guess in guesses}
    rest = [item for item in items if item.path not in used]
    if rest:
        yield "# Nothing was guessed for:"
    for item in rest:
        yield _comment(f"  {item.path}  {' x '.join(map(str, item.shape))}  {item.dtype}")


def _table(fields: Mapping[str, str | list[int]]) -> str:
    parts = (f"{name} = {_quoted(value) if isinstance(value, str) else value}" for name, value in fields.items())
    return f"{{ {', '.join(parts)} }}"


def _quoted(text: str) -> str:
    """Write a TOML basic string; names in HDF5 may hold any character."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    # TOML 1.0 basic strings must escape U+0000 to U+001F, but for the tab, and U+007F.
    return '"' + "".join(f"\\u{ord(c):04x}" if _is_control(c) else c for c in escaped) + '"'


def _comment(text: str) -> str:
    # A line break in a stored name would end the comment and add TOML of its own.
    return "# " + "".join(" " if _is_control(c) else c for c in text)


def _is_control(character: str) -> bool:
    return ord(character) < 32 or ord(character) == 127
