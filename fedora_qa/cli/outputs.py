"""What commands write: refused before the work when it cannot be written, and never half written."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import replacing, write_text
from fedora_qa.record.json_io import write_record
from fedora_qa.record.markdown import record_to_markdown
from fedora_qa.record.types import Record


@dataclass(frozen=True, slots=True)
class Outputs:
    """Where to write what; None is not written. ``draft`` is written by its own command."""

    json: Path | None = None
    markdown: Path | None = None
    draft: Path | None = None

    @property
    def arrays(self) -> Path | None:
        """Where the evidence arrays lie: beside the record."""
        return self.json.with_name(self.json.name + ".arrays.npz") if self.json else None

    def require_writable(self, inputs: Sequence[Path]) -> None:
        """Raise ``MisuseError`` where an output cannot be written, or would overwrite an input or another output."""
        targets = [path for path in (self.json, self.arrays, self.markdown, self.draft) if path is not None]
        places = [path.resolve() for path in targets]
        read = {path.resolve() for path in inputs}
        for target, place in zip(targets, places, strict=True):
            if place in read or places.count(place) > 1:
                raise MisuseError(f"Expected an output of its own, got {target}, which is an input or another output")
            if place.is_dir():
                raise MisuseError(f"Expected a file to write, got a folder: {target}")
            if not place.parent.is_dir():
                raise MisuseError(f"Expected the folder of {target} to exist; make it first")
            if not os.access(place.parent, os.W_OK):
                raise MisuseError(f"Expected the folder of {target} to be writable")

    def write(self, record: Record, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write everything; the arrays first, so that no record refers to what is not there."""
        if self.json and self.arrays:
            write_arrays(self.arrays, arrays)
            write_record(record, self.json)
        if self.markdown:
            write_text(self.markdown, record_to_markdown(record))


def write_arrays(target: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write arrays by name into one compressed file, entirely or not at all; never as pickled objects."""
    for name, array in arrays.items():
        if array.dtype.hasobject:
            raise TypeError(f"Expected numbers in the evidence {name!r}, got Python objects")
    with replacing(target) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
