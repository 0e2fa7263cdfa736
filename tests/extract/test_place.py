"""Where a finding lies, and the pieces that are tried around it."""

from pathlib import Path

import pytest

from fedora_qa.extract.place import pieces_around, place_of
from fedora_qa.record.types import Where
from fedora_qa.sequence.scan import Scan, scan
from fedora_qa.sequence.sequence import open_sequence
from tests.support.handmade import write_handmade

MS = 1_000_000


@pytest.fixture
def scanned(tmp_path: Path) -> Scan:
    """A tenth of a second: frames at every 20 ms, IMU at every one, events at every 1.3 ms, from 0.7 ms on."""
    with open_sequence(write_handmade(tmp_path / "seq.h5")) as sequence:
        return scan(sequence, 20 * MS)


NAMED = {
    "times": (Where("events", start_us=40_000.0, stop_us=60_000.0), (40, 60), None),
    "an instant": (Where("imu", start_us=40_000.0), (40, 40), None),
    "rows": (Where("imu", index_start=10, index_stop=21), (10, 20), ("imu", 10, 21)),
    "a row and its time": (Where("imu", start_us=10_000.0, index_start=10), (10, 10), ("imu", 10, 11)),
    "a frame": (Where("depth", frame=3), (60, 60), ("depth", 3, 4)),
    "a frame of events is one of colour": (Where("events", frame=3), (60, 60), ("rgb", 3, 4)),
    "an entry of a map": (Where("rgb_to_event", index_start=2), (40, 40), ("rgb_to_event", 2, 3)),
    "a time that no stream has": (Where("imu", start_us=-5e9, stop_us=1e12), (0, 100), None),
}


@pytest.mark.parametrize(("where", "times_ms", "rows"), NAMED.values(), ids=NAMED.keys())
def test_what_a_finding_names(
    where: Where, times_ms: tuple[int, int], rows: tuple[str, int, int] | None, scanned: Scan
) -> None:
    """Times are taken as they are, rows have the time of their stamps, and stay together whatever these say."""
    place = place_of(where, "imu.noise", scanned)
    assert (place.start_ns / MS, place.stop_ns / MS, place.rows) == (*times_ms, rows)


def test_events_have_the_time_of_their_window(scanned: Scan) -> None:
    """Stamps of events are not kept, so that a row of them is placed by its window."""
    place = place_of(Where("events", index_start=40, index_stop=41), "event_stream.bounds", scanned)
    assert (place.start_ns, place.stop_ns) == (40 * MS, 40 * MS)


def test_a_finding_of_the_whole_file(scanned: Scan) -> None:
    """Without a time it lies where most events are, one about the layout at the end, where rows are missing."""
    anywhere = place_of(Where("events"), "event_response.model", scanned)
    assert anywhere.start_ns == anywhere.stop_ns
    assert 0 < anywhere.start_ns < 100 * MS
    assert place_of(Where("imu"), "integrity.layout", scanned).start_ns == 100 * MS


def test_margins_double(scanned: Scan) -> None:
    """Pieces hold the place, each has twice the margin of the one before, and none but the first is too long."""
    place = place_of(Where("imu", start_us=50_000.0), "imu.noise", scanned)
    lengths = [(piece.stop_ns - piece.start_ns) / MS for piece in pieces_around(place, 2000 * MS)]
    assert lengths == [400, 800, 1600]
    assert [(piece.start_ns, piece.stop_ns) for piece in pieces_around(place, 1)] == [(-150 * MS, 250 * MS)]
