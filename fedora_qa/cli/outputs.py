"""What commands write: refused before the work when it cannot be written, and never half written."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from fedora_qa.cli.arrays import arrays_beside, write_arrays
from fedora_qa.cli.html import require_renderer, write_html
from fedora_qa.errors import MisuseError
from fedora_qa.record.atomic import write_text
from fedora_qa.record.json_io import write_record
from fedora_qa.record.markdown import record_to_markdown
from fedora_qa.record.types import Record


@dataclass(frozen=True, slots=True)
class Outputs:
    """Where to write what; None is not written. ``own`` is what a command writes by itself: a dialect, tables."""

    json: Path | None = None
    markdown: Path | None = None
    html: Path | None = None
    own: tuple[Path | None, ...] = ()

    @property
    def arrays(self) -> Path | None:
        """Where the evidence arrays lie: beside the record."""
        return arrays_beside(self.json) if self.json else None

    @property
    def show_evidence(self) -> bool:
        """Whether anything is written in which a person can see the evidence."""
        return self.json is not None or self.html is not None

    def require_writable(self, inputs: Sequence[Path]) -> None:
        """Raise ``MisuseError`` where an output cannot be written, or would overwrite an input or another output."""
        targets = [p for p in (self.json, self.arrays, self.markdown, self.html, *self.own) if p is not None]
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
        if self.html:
            require_renderer()

    def write(self, record: Record, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write everything; the arrays first, so that no record refers to what is not there."""
        if self.json and self.arrays:
            write_arrays(self.arrays, arrays)
            write_record(record, self.json)
        if self.markdown:
            write_text(self.markdown, record_to_markdown(record))
        if self.html:
            write_html(self.html, record, arrays)
