"""Read a dialect that somebody else has written: strictly, so that what does not fit is named."""

from collections.abc import Mapping
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from fedora_qa.layout.canonical import DATASETS
from fedora_qa.layout.dialect import Dialect

_READER: Final = TypeAdapter(Dialect)


def validated_dialect(document: Mapping[str, Any]) -> Dialect:
    """Return the dialect of a document; raises ``ValueError``, which names the first key that does not fit."""
    try:
        dialect = _READER.validate_python(document)
    except ValidationError as error:
        raise ValueError(_first_problem(error)) from error
    for key in dialect.datasets:
        if key not in DATASETS:
            raise ValueError(f"datasets.{key}: Expected a canonical key such as path/events/t, got {key!r}")
    return dialect


def _first_problem(error: ValidationError) -> str:
    problem = error.errors()[0]
    return f"{'.'.join(str(part) for part in problem['loc']) or 'the document'}: {problem['msg']}"
