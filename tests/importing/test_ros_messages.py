"""Packets of events in EVT3, which is continued from packet to packet, are read from bags of both versions."""

from pathlib import Path

import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.importing.ros_messages import LOST_PACKETS
from tests.importing.reading import events_of, imported
from tests.support.bags import Bag
from tests.support.prophesee import evt3_words, random_events

EVENTS = random_events(300, 7)
WORDS = evt3_words(EVENTS)


def bag_of(form: str, *, left_out: bool = False) -> Bag:
    """Two packets, whose cut ignores times and rows; the clock of ROS is 5 s ahead of that of the sensor."""
    bag, cut = Bag(form), len(WORDS) // 4 * 2
    first_us = 5_000_000 + EVENTS[0][2]
    bag.add_packet(first_us, 41, WORDS[:cut])
    bag.add_packet(first_us + 1000, 44 if left_out else 42, WORDS[cut:], frame="longer")
    return bag


@pytest.mark.parametrize("form", ["ros1", "sqlite"])
def test_events_have_the_clock_of_the_headers(form: str, tmp_path: Path) -> None:
    done = imported(bag_of(form).write(tmp_path), tmp_path / "out.h5")
    assert events_of(tmp_path / "out.h5") == [(x, y, t + 5_000_000, p) for x, y, t, p in EVENTS]
    assert done.facts[LOST_PACKETS] == 0
    assert done.facts["clock of ROS less clock of the sensor, us"] == 5_000_000


def test_lost_packets_are_counted(tmp_path: Path) -> None:
    done = imported(bag_of("ros1", left_out=True).write(tmp_path), tmp_path / "out.h5")
    assert done.facts[LOST_PACKETS] == 2


@pytest.mark.parametrize(
    ("words", "encoding", "message"),
    [(b"\0" * 8, "libcaer", "encoding 'libcaer', where evt3 is read"), (b"\0" * 3, "evt3", "a packet of 3 bytes")],
)
def test_packets_that_cannot_be_read(words: bytes, encoding: str, message: str, tmp_path: Path) -> None:
    bag = Bag("sqlite")
    bag.add_packet(5, 1, words, encoding)
    with pytest.raises(MisuseError, match=message):
        imported(bag.write(tmp_path), tmp_path / "out.h5")
