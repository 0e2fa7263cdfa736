"""Versioned documents: JSON that is written entirely or not at all, read back with every problem named, and published.

A record, a comparison, a study of detection and a certificate are each a ``DocumentKind``.
"""

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import date
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Final, Generic, Literal, TypeVar

from pydantic import TypeAdapter, ValidationError

from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import write_text

T = TypeVar("T")

MOST_BYTES: Final = 512 << 20
"""Longest document that is read; one of a thousand files takes 100 MB. A longer one could exhaust the memory."""


@dataclass(frozen=True, slots=True)
class DocumentKind(Generic[T]):
    """A kind of document, of one version.

    Attributes
    ----------
    name
        What it is called: ``record``. Its version stands under ``<name>_version``.
    noun
        The same with its article, for people.
    adapter
        Turns a value into plain values and back, and validates every type.
    written_by
        What writes such a document.
    again
        Advice where a document cannot be used.
    older
        Versions that are read as well, because later ones only added fields.
    """

    name: str
    noun: str
    version: str
    adapter: TypeAdapter[T]
    written_by: str
    again: str
    older: tuple[str, ...] = ()

    def to_json(self, value: T) -> str:
        """Return a value as a JSON document.

        NaN and infinity become null. What UTF-8 cannot carry (an undecodable byte in a path) is written as an escape.

        Raises
        ------
        ValidationError
            The value holds what its types do not allow; such a document would not be readable again.
        """
        return json_text(value, self.adapter)

    def from_json(self, text: str | bytes) -> T:
        """Return the value that a JSON document holds.

        Raises
        ------
        MisuseError
            The text is not JSON, is of another version, or does not fit the schema; the message names the place.
        """
        try:
            document = json.loads(text)
        # The JSON parser descends once for each level; a hostile document of nested lists exhausts the stack.
        except RecursionError:
            raise MisuseError(f"Expected {self.noun} as JSON, got lists within lists without end") from None
        except ValueError as problem:
            raise MisuseError(
                f"Expected {self.noun} as JSON, got: {problem}; give what `{self.written_by}` wrote"
            ) from None
        key = f"{self.name}_version"
        version = document.get(key) if isinstance(document, dict) else None
        # A record of many files fills gigabytes as objects, and the validation below builds them a second time.
        del document
        # Before the fields: of another version, some field that does not fit would be reported instead.
        if version not in (self.version, *self.older):
            raise MisuseError(f"Expected {self.noun} with {key} {self.version!r}, got {version!r}; {self.again}")
        return _validated(text, self.adapter, self.noun, self.again)

    def write(self, value: T, path: Path) -> None:
        """Write a document, entirely or not at all; raises ``ValidationError`` as ``to_json`` does."""
        write_text(path, self.to_json(value))

    def read(self, path: Path) -> T:
        """Read a document; raises ``MisuseError`` where there is none, as ``from_json`` does."""
        return _parsed(path, self.from_json, self.noun, f"give what `{self.written_by}` wrote")

    def schema(self) -> dict[str, Any]:
        """Return the JSON schema (draft 2020-12) of a document as it is written."""
        return schema_of(f"{self.name}:{self.version}", self.adapter, "serialization")


def json_text(value: T, adapter: TypeAdapter[T]) -> str:
    """Return a value as the JSON of a document; parameters and errors are those of ``DocumentKind``."""
    # Without warnings of types: the validation below raises for the same ones.
    plain = _plain(adapter.dump_python(value, warnings="none"))
    text = json.dumps(plain, ensure_ascii=False, allow_nan=False, indent=1) + "\n"
    # A wrong type is an error of the writer and must be raised here, not when the document is read.
    adapter.validate_json(text)
    return text


def schema_of(urn: str, adapter: TypeAdapter[Any], mode: Literal["validation", "serialization"]) -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of a type.

    Parameters
    ----------
    urn
        What the schema is called, below ``urn:fedora-qa:``: name and version.
    mode
        ``serialization``: of what is written; ``validation``: of what is read.
    """
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "$id": f"urn:fedora-qa:{urn}"}
    return head | adapter.json_schema(mode=mode)


def schema_text(schema: dict[str, Any]) -> str:
    """Return a schema as it is published."""
    return json.dumps(schema, indent=1) + "\n"


def read_json(path: Path, adapter: TypeAdapter[T], noun: str, advice: str) -> T:
    """Read a JSON file that has no version.

    Parameters
    ----------
    noun
        What the file holds, with its article.
    advice
        What to do where the file cannot be used.

    Raises
    ------
    MisuseError
        There is no file, it is longer than ``MOST_BYTES``, or it does not fit the type; the message names the place.
    """
    return _parsed(path, lambda text: _validated(text, adapter, noun, advice), noun, advice)


def read_published(path: Path, adapter: TypeAdapter[T], noun: str, advice: str) -> T | None:
    """Read a file of the package that a study writes, as ``read_json`` does; None where it was not published."""
    return read_json(path, adapter, noun, advice) if path.exists() else None


def _parsed(path: Path, parse: Callable[[bytes], T], noun: str, advice: str) -> T:
    """Return what a file of limited length holds; the errors of ``parse`` then name the file."""
    try:
        with path.open("rb") as file:
            # One byte more than the limit shows that the file is too long without reading the rest.
            text = file.read(MOST_BYTES + 1)
    except OSError as problem:
        raise MisuseError(f"Expected {noun} at {path}, got: {problem.strerror}; {advice}") from None
    if len(text) > MOST_BYTES:
        raise MisuseError(f"Expected {noun} of {MOST_BYTES >> 20} MiB at most, got more in {path}")
    try:
        return parse(text)
    except MisuseError as problem:
        raise MisuseError(f"{problem} (in {path})") from None


def _validated(text: str | bytes, adapter: TypeAdapter[T], noun: str, advice: str) -> T:
    try:
        return adapter.validate_json(text)
    except ValidationError as problem:
        first = problem.errors()[0]
        place = ".".join(str(part) for part in first["loc"]) or "the document"
        raise MisuseError(f"Expected {noun}, got at {place}: {first['msg']}; {advice}") from None


def _plain(value: Any) -> Any:
    """Return the value as JSON can carry it: no NaN, no infinity, no lone surrogates, no array library's scalars."""
    if isinstance(value, str | date):
        return str(value).encode("utf-8", "backslashreplace").decode("utf-8")
    if isinstance(value, Mapping):
        return {_plain(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    # Before Integral, of which bool is a subclass: flags must not become 0 and 1.
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, Integral):
        return int(value)
    if isinstance(value, Real):
        return float(value) if math.isfinite(value) else None
    raise TypeError(f"Expected a value that JSON can carry, got {type(value).__name__}")
