"""Work follows from what a file stores, not from what it claims; and what is honest is not touched."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.layout.binding import FEWEST_ROWS, rows_together
from fedora_qa.layout.canonical import EVENT_CHUNK_ROWS
from fedora_qa.sequence import scan as scanning
from fedora_qa.sequence.scan import scan
from fedora_qa.sequence.sequence import open_sequence
from tests.hostile.conftest import Attacked
from tests.hostile.storage import EVENTS, replace

CELL_NS = 200_000_000


@pytest.mark.parametrize(("stored", "together"), [(1, FEWEST_ROWS), (1000, 5000), (4096, 4096), (77_000, 77_000),
                                                  (EVENT_CHUNK_ROWS, EVENT_CHUNK_ROWS), (0, 0)])  # fmt: skip
def test_events_are_decoded_in_whole_chunks_and_never_alone(stored: int, together: int) -> None:
    """Blocks are whole chunks, of four thousand rows at least; what is stored well is decoded as it is stored."""
    assert rows_together("path/events/t", stored) == together


def test_images_are_decoded_one_by_one() -> None:
    """An image is a chunk, and so a block."""
    assert rows_together("path/rgb", 1) == 1


def test_timestamps_far_apart_join_their_windows(attacked: Attacked, monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand events a second apart take no more cells than are allowed, lose no row, and keep their order."""
    monkeypatch.setattr(scanning, "MOST_CELLS", 64)

    def edit(file: h5py.File) -> None:
        for path in EVENTS:
            rows = np.arange(1000) * (10**6 if path.endswith("t") else 0)
            replace(file, path, data=rows.astype(file[path].dtype), chunks=(1000,))

    with open_sequence(attacked(edit)) as sequence:
        found = scan(sequence, CELL_NS)
    events = found.runs["events"]
    assert len(np.unique(np.concatenate([runs.cells for runs in found.runs.values()]))) <= 64
    assert found.cell_ns % CELL_NS == 0
    assert found.cell_ns > CELL_NS
    assert events.count == 1000
    assert events.starts[0] == 0
    assert np.all(np.diff(events.starts) > 0)
    assert np.all(events.cells == (events.starts * 10**9) // found.cell_ns)


def test_few_windows_stay_as_they_are(clean_bytes: bytes, tmp_path: Path) -> None:
    """A sequence of ordinary length keeps the grid that it was given."""
    path = tmp_path / "clean.h5"
    path.write_bytes(clean_bytes)
    with open_sequence(path) as sequence:
        assert scan(sequence, CELL_NS).cell_ns == CELL_NS
