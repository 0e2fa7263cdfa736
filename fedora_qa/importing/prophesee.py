"""Open Prophesee recordings: choose the decoder that the header names."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Final

from fedora_qa.errors import MisuseError
from fedora_qa.importing.dat import DAT, require_events
from fedora_qa.importing.evt2 import EVT2
from fedora_qa.importing.evt3 import EVT3
from fedora_qa.importing.prophesee_file import WordDecoder, read_header
from fedora_qa.importing.recording import Recording, Resolution

DECODERS: Final[Mapping[str, WordDecoder]] = MappingProxyType({each.name: each for each in (EVT2, EVT3, DAT)})
"""By the name of the encoding."""


@contextmanager
def open_prophesee(path: Path, resolution: Resolution | None) -> Iterator[Recording]:
    """Open a recording, whose blocks can be read within the block.

    Parameters
    ----------
    resolution
        Takes precedence over that of the header; None: the header must have it.

    Raises
    ------
    MisuseError
        The header names no encoding that is read, or no resolution.
    """
    with path.open("rb") as file:
        header = read_header(path, file)
        decoder = DECODERS.get(header.encoding)
        if decoder is None:
            encoding = header.encoding or "a header that names no encoding (% format, or % evt)"
            raise MisuseError(
                f"Expected Prophesee {', '.join(DECODERS)}, got {encoding}: {path}; convert it to one of these with "
                "Metavision"
            )
        if (
            decoder is not DAT
            and header.options.get("endianness", header.entries.get("endianness", "little")) != "little"
        ):
            raise MisuseError(f"Expected words in little-endian order, got another order: {path}; record it as little")
        size = header.resolution(resolution)
        if decoder is DAT:
            require_events(header, file)
        recording = Recording(
            format=f"Prophesee {decoder.name}",
            blocks=iter(()),
            size=os.fstat(file.fileno()).st_size - file.tell(),
            cameras={"events": size},
            kind="recorded",
            facts=header.facts,
        )
        recording.blocks = decoder.blocks(file, recording)
        yield recording
