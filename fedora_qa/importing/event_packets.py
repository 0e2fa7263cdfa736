"""Events of ``event_camera_msgs/EventPacket``: what the sensor sent, packet by packet, behind a header of ROS.

Source: the definition and the README of ``event_camera_msgs``. Of its encodings EVT3 is read, which is continued from
packet to packet.

Events have the clock of the sensor, and all other streams that of ROS. One offset takes the first event to the time of
the first header, so that the intervals between events stay those of the sensor. The header is stamped when a packet
arrives: the delay of the first packet remains in the offset.
"""

import struct
from typing import Final

import numpy as np

from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.importing.evt3 import EVT3
from fedora_qa.importing.recording import Block, Recording, Resolution, event_block
from fedora_qa.importing.ros_messages import UnreadableMessageError

EVENT_PACKETS: Final = frozenset({"event_camera_msgs/msg/EventPacket"})

LOST_PACKETS: Final = "packets that are missing by their numbers"
_ENCODING: Final = "evt3"


class EventPackets:
    """The packets of one topic, in the order of the bag.

    Parameters
    ----------
    recording
        Gets the offset of the clocks and the counts.
    is_cdr
        Whether messages are serialised as in ROS 2.
    """

    def __init__(self, recording: Recording, *, is_cdr: bool) -> None:
        self._facts = recording.facts
        self._is_cdr = is_cdr
        self._state = np.array(EVT3.initial_state, np.int64)
        self._offset_us: int | None = None
        self._next_number: int | None = None

    def block(self, raw: bytes | memoryview) -> tuple[Block | None, Resolution]:
        """Return the events of a serialised packet, None where it has none, and the size of the sensor.

        Raises
        ------
        UnreadableMessageError
            The packet ends too early, or has another encoding.
        """
        try:
            stamp_us, size, number, encoding, data = self._fields(memoryview(raw))
        except (struct.error, ValueError, TypeError) as error:
            raise UnreadableMessageError(f"a packet of events that ends too early ({error})") from error
        if encoding != _ENCODING:
            raise UnreadableMessageError(f"events in the encoding {encoding!r}, where {_ENCODING} is read")
        if len(data) % 2:
            raise UnreadableMessageError(f"a packet of {len(data)} bytes, where words have two")
        lost = number - (number if self._next_number is None else self._next_number)
        self._facts[LOST_PACKETS] = int(self._facts.get(LOST_PACKETS, 0)) + max(lost, 0)
        self._next_number = number + 1
        words = np.frombuffer(data, EVT3.word_dtype)
        most = len(words) * EVT3.events_per_word
        x, y, p = np.empty(most, np.uint16), np.empty(most, np.uint16), np.empty(most, np.uint8)
        t_us = np.empty(most, np.int64)
        count = EVT3.decode(words, self._state, x, y, t_us, p)
        for name, place in EVT3.counts.items():
            self._facts[name] = int(self._state[place])
        if not count:
            return None, size
        if self._offset_us is None:
            self._offset_us = stamp_us - int(t_us[0])
            self._facts["clock of ROS less clock of the sensor, us"] = self._offset_us
        return event_block(x[:count], y[:count], t_us[:count] + self._offset_us, p[:count]), size

    def _fields(self, raw: memoryview) -> tuple[int, Resolution, int, str, memoryview]:
        """Return time, us, size of the sensor, number, encoding and data of a packet."""
        if self._is_cdr:
            if bytes(raw[:2]) != b"\0\1":
                raise UnreadableMessageError("a message that is not CDR in little-endian order")
            raw = raw[4:]
        place = 0 if self._is_cdr else 4  # ROS 1 numbers its headers

        def read(form: str, place: int) -> tuple[tuple[int, ...], int]:
            # In CDR each member lies at a multiple of its own size.
            start = place + (-place % struct.calcsize(form[:2]) if self._is_cdr else 0)
            return struct.unpack_from(form, raw, start), start + struct.calcsize(form)

        (seconds, nanoseconds, name_bytes), place = read("<III", place)
        (height, width), place = read("<II", place + name_bytes)
        (number, _), place = read("<QQ", place)
        (encoding_bytes,), place = read("<I", place)
        encoding = bytes(raw[place : place + encoding_bytes]).rstrip(b"\0").decode("ascii", "replace")
        # A byte for the order of bytes stands before the data.
        (data_bytes,), place = read("<I", place + encoding_bytes + 1)
        data = raw[place : place + data_bytes]
        if len(data) != data_bytes:
            raise ValueError(f"{data_bytes} bytes of events, got {len(data)}")
        stamp_us = seconds * (NS_PER_S // NS_PER_US) + nanoseconds // NS_PER_US
        return stamp_us, (width, height), number, encoding, data
