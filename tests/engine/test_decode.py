"""Blocks are decoded once while wanted, and a damaged one costs itself alone."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_generator.faults import plant_fault
from fedora_qa.engine.decode import BlockDecoder
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.plan import WINDOW_NS
from fedora_qa.engine.tasks import check_file
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.faults.fault import Fault, FaultySequence
from fedora_qa.layout.binding import Binding, canonical_rows
from fedora_qa.sequence.scan import scan
from fedora_qa.sequence.sequence import Sequence, open_sequence
from fedora_qa.sequence.window import Sampling, Span
from tests.support.films import FACTS, IMAGE_BYTES, NOTHING_SCANNED, Films, images_of


@pytest.mark.parametrize("limit_bytes", [1, 1 << 28])
def test_rows_are_those_of_the_file(park_day: Path, limit_bytes: int) -> None:
    """Whatever the limit, any range of rows is what the file holds."""
    with open_sequence(park_day) as sequence:
        decoder = BlockDecoder(sequence, scan(sequence, WINDOW_NS), limit_bytes)
        for key, start, stop in [
            ("path/rgb", 3, 7),
            ("path/events/t", 10, 5000),
            ("path/imu/ts", 0, 1),
            ("path/rgb", 5, 5),
        ]:
            assert np.array_equal(decoder.rows(key, start, stop), sequence.rows(key, start, stop))


def test_each_block_is_decoded_once_while_it_fits(park_day: Path) -> None:
    """Asking again costs nothing."""
    with open_sequence(park_day) as sequence:
        decoder = BlockDecoder(sequence, scan(sequence, WINDOW_NS), 1 << 28)
        first = decoder.rows("path/depth", 0, 5)
        decoded = decoder.decoded_bytes
        assert decoded == first.nbytes
        decoder.rows("path/depth", 0, 5)
        assert decoder.decoded_bytes == decoded


def test_event_index_counts_earlier_events(park_day: Path) -> None:
    """The index of a time is the number of events before it."""
    with open_sequence(park_day) as sequence:
        scanned = scan(sequence, WINDOW_NS)
        decoder = BlockDecoder(sequence, scanned, 1 << 28)
        times = decoder.rows("path/events/t", 0, len_of(sequence, "path/events/t"))
        for instant in (-1, 0, int(times[0]), int(times[100]), int(times[100]) + 1, int(times[-1]), int(times[-1]) + 1):
            assert decoder.event_index(instant) == int(np.count_nonzero(times < instant))


def test_damaged_block_is_named_and_the_rest_goes_on(park_day: Path, tmp_path: Path) -> None:
    """One corrupt depth frame: its rows raise, its neighbours decode, and the file is found damaged in that stream."""
    damaged = tmp_path / "damaged.h5"
    plant_fault(park_day, damaged, "corrupt_chunk", "depth", 1.0)
    with open_sequence(damaged) as sequence:
        decoder = BlockDecoder(sequence, scan(sequence, WINDOW_NS), 1 << 28)
        unreadable = []
        for frame in range(len_of(sequence, "path/depth")):
            try:
                decoder.rows("path/depth", frame, frame + 1)
            except UnreadableRowsError as error:
                unreadable.append(error.start)
    assert len(unreadable) == 1
    run = check_file(damaged, CheckOptions(select=("integrity", "clocks")))
    assert run.record.verdict == "findings"
    assert [(d.cause, d.stream) for d in run.record.diagnoses] == [("corrupt_chunk", "depth")]
    readable = next(result for result in run.record.results if result.check == "integrity.readable")
    assert readable.findings[0].where.index_start == unreadable[0]


def test_a_window_ends_the_leases_of_the_one_before_the_last() -> None:
    """Images that two neighbouring windows request are decoded once; later ones are decoded again."""
    decoder = BlockDecoder(Films(), NOTHING_SCANNED, 1 << 28)

    def decoded(*frames: int) -> int:
        decoder.window(Span(0, 0, 1, {}), FACTS, Sampling())
        return images_of(decoder, *frames)

    assert [decoded(0, 1, 2), decoded(2, 3), decoded(3, 4), decoded(2, 3)] == [3, 1, 1, 1]


def test_rows_ahead_of_their_window_are_decoded_once() -> None:
    """Images that a window reads ahead are leased until the window that owns them, over windows that own none."""
    decoder = BlockDecoder(Films(), NOTHING_SCANNED, 1 << 28)

    def decoded(owned: dict[str, tuple[int, int]], *frames: int) -> int:
        decoder.window(Span(0, 0, 1, owned), FACTS, Sampling())
        return images_of(decoder, *frames)

    assert decoded({"depth": (0, 1)}, 0, 1, 5) == 3
    assert [decoded({}), decoded({"depth": (1, 2)}, 1), decoded({"depth": (5, 6)}, 5)] == [0, 0, 0]
    assert [decoded({"depth": (6, 7)}, 6), decoded({"depth": (7, 8)}, 7, 5)] == [1, 2]


@pytest.fixture
def large(tmp_path: Path) -> Path:
    """Two depth images of 2 MB, the second of which is damaged."""
    path = tmp_path / "large.h5"
    with h5py.File(path, "w") as file:
        depth = np.arange(1 << 20, dtype=np.float32).reshape(2, 512, 1024)
        stored = file.create_dataset("d", data=depth, chunks=(1, 512, 1024), fletcher32=True)
        place = stored.id.get_chunk_info(1).byte_offset
    with path.open("r+b") as raw:
        raw.seek(place)
        raw.write(b"\x12\x34")
    return path


class Stored(Films):
    """A sequence of those, read as ``Sequence`` reads them."""

    def __init__(self, file: h5py.File) -> None:
        self._file = file
        self._binding = Binding("path/depth", "d", 2, (2, 512, 1024), np.dtype(np.float32), chunk_rows=1)
        self.layout = SimpleNamespace(bindings={"path/depth": self._binding})

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        return canonical_rows(self._file, self._binding, start, stop, 0)


def test_a_damaged_image_costs_itself_alone(large: Path) -> None:
    """One that cannot be decoded holds no memory, although its error is kept."""
    with h5py.File(large) as file:
        decoder = BlockDecoder(Stored(file), NOTHING_SCANNED, 8 * IMAGE_BYTES)
        with pytest.raises(UnreadableRowsError):
            decoder.rows("path/depth", 1, 2)
        assert decoder.leases.kept_bytes == 0
        first = decoder.rows("path/depth", 0, 1)
        assert decoder.leases.kept_bytes == IMAGE_BYTES
        np.testing.assert_array_equal(first.ravel(), np.arange(1 << 19))


def test_damage_keeps_nobody_alive_for_long() -> None:
    """An image that cannot be decoded raises the same each time, and does not remember all who asked."""

    class Damaged(Films):
        def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
            raise UnreadableRowsError(key, start, stop, "scratched")

    decoder, depths = BlockDecoder(Damaged(), NOTHING_SCANNED, IMAGE_BYTES), []
    for _ in range(3):
        with pytest.raises(UnreadableRowsError, match="scratched") as raised:
            decoder.rows("path/depth", 0, 1)
        depths.append(len(raised.traceback))
    assert depths[2] <= depths[0]


@pytest.mark.parametrize("lines", [4, 512])
def test_rows_lie_one_after_another_however_they_come(lines: int) -> None:
    """Channels that a dialect picks come transposed; compiled loops are specialised for contiguous rows."""

    class Turned(Films):
        def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
            return super().rows(key, start, stop)[:, :lines].transpose(0, 2, 1)

    decoder = BlockDecoder(Turned(), NOTHING_SCANNED, 1 << 28)
    image = decoder.rows("path/depth", 3, 4)
    assert image.flags.c_contiguous
    np.testing.assert_array_equal(image, Turned().rows("path/depth", 3, 4))


def test_a_view_of_a_sequence_is_decoded_like_a_file(park_day: Path) -> None:
    """Rows of a view, such as one with a fault, come as the view alters them, and are leased like others."""
    fault = Fault("depth doubled", rows={"path/depth": lambda rows, start, stop: 2 * rows(start, stop)})
    with open_sequence(park_day) as sequence:
        view = FaultySequence(sequence, fault)
        decoder = BlockDecoder(view, scan(sequence, WINDOW_NS), 1 << 28)
        np.testing.assert_array_equal(decoder.rows("path/depth", 1, 3), 2 * sequence.rows("path/depth", 1, 3))
        decoded = decoder.decoded_bytes
        decoder.rows("path/depth", 1, 3)
        assert decoder.decoded_bytes == decoded


def len_of(sequence: Sequence, key: str) -> int:
    return sequence.layout.bindings[key].rows
