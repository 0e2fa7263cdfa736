"""Index maps count the events before each frame, in whatever order both arrive."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_qa.importing.recording import Block, event_block
from fedora_qa.importing.sequence_writer import SequenceWriter
from fedora_qa.layout.direct_chunks import ChunkWriter


@pytest.mark.parametrize("is_sorted", [True, False])
def test_frames_and_events_in_any_order(is_sorted: bool, tmp_path: Path) -> None:
    """Over several chunks of events, with frames before, at, between and after them."""
    random = np.random.default_rng(6)
    times_us = random.integers(0, 5_000_000, 600_000)
    times_us = np.sort(times_us) if is_sorted else times_us
    zeros = np.zeros(len(times_us), np.uint16)
    frames_us = np.concatenate([times_us[:3], [9_000_000, 0, 0], random.integers(0, 5_000_000, 20)])
    with h5py.File(tmp_path / "a.h5", "w") as file, ChunkWriter(2) as chunks:
        writer = SequenceWriter(file, chunks, level=1, allow_backwards=True)
        writer.append(event_block(zeros[:9], zeros[:9], times_us[:9], zeros[:9]))
        writer.append(Block({"path/depth": np.ones((len(frames_us), 2, 3), np.float32), "path/depth_ts": frames_us}))
        writer.append(event_block(zeros[9:], zeros[9:], times_us[9:], zeros[9:]))
        writer.finish(cameras={}, root={})
        expected = np.searchsorted(np.sort(times_us), frames_us)
        np.testing.assert_array_equal(file["metadata/depth_to_event"], expected)
        np.testing.assert_array_equal(file["path/events/t"], times_us)
