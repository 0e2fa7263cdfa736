"""Turn messages of ROS into rows in canonical units.

Sources: the definitions of ``dvs_msgs``, ``sensor_msgs``, ``geometry_msgs`` and ``nav_msgs``; REP 103 (bodies have X
forward, Y left, Z up, as the layout has); the definition and the README of ``event_camera_msgs``. Of the encodings of
its ``EventPacket``, what the sensor sent behind a header of ROS, EVT3 is read, which continues from packet to packet.

Events of packets have the clock of the sensor, and all other streams that of ROS. One offset takes the first event to
the time of the first header, so that the intervals between events stay those of the sensor. The header is stamped when
a packet arrives: the delay of the first packet remains in the offset.
"""

import struct
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S, NS_PER_US
from fedora_qa.importing.evt3 import EVT3
from fedora_qa.importing.recording import Block, Recording, Resolution, event_block
from fedora_qa.importing.ros_header import UnreadableMessageError, header_time_us
from fedora_qa.importing.ros_images import IMAGES, colour_block, depth_block
from fedora_qa.importing.ros_transforms import TRANSFORMS

EVENT_ARRAYS: Final = frozenset({"dvs_msgs/msg/EventArray", "prophesee_event_msgs/msg/EventArray"})
"""Types with the same content: a header, height, width, and events of x, y, time and polarity."""

# An event in ROS 1 is packed; in CDR of ROS 2 each member lies at a multiple of its own size.
_PACKED_EVENT: Final = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
_CDR_EVENT_BYTES: Final = 16

EVENT_PACKETS: Final = frozenset({"event_camera_msgs/msg/EventPacket"})

LOST_PACKETS: Final = "packets that are missing by their numbers"
_PACKET_ENCODING: Final = "evt3"


def event_array(raw: bytes | memoryview, *, is_cdr: bool) -> tuple[Block | None, Resolution]:
    """Return the events of a serialised ``EventArray``, None where it has none, and the size of the sensor.

    The bytes are read directly: made into an object of each event they would take a hundred times as long.
    """
    try:
        if is_cdr:
            if raw[:2] != b"\0\1":
                raise UnreadableMessageError("a message that is not CDR in little-endian order")
            raw = raw[4:]
            name_bytes = struct.unpack_from("<I", raw, 8)[0]
            place = 12 + name_bytes + -name_bytes % 4
        else:
            place = 16 + struct.unpack_from("<I", raw, 12)[0]
        height, width, count = struct.unpack_from("<III", raw, place)
        first = place + 12
        if not count:
            return None, (int(width), int(height))
        if not is_cdr:
            events = np.frombuffer(raw, _PACKED_EVENT, count, first)
            x, y, seconds, nanoseconds, p = (events[name] for name in ("x", "y", "s", "ns", "p"))
        else:
            # The first event begins at a multiple of four; each ends with one byte, so that the next x lies two bytes
            # behind the last one's end, and its time at the next multiple of four.
            times = np.ndarray((count, 2), "<u4", raw, first + 4, (_CDR_EVENT_BYTES, 4))
            seconds, nanoseconds = times[:, 0], times[:, 1]
            p = np.ndarray((count,), "u1", raw, first + 12, (_CDR_EVENT_BYTES,))
            x, y = np.empty(count, np.uint16), np.empty(count, np.uint16)
            x[0], y[0] = struct.unpack_from("<HH", raw, first)
            if count > 1:
                later = np.ndarray((count - 1, 2), "<u2", raw, first + 14, (_CDR_EVENT_BYTES, 2))
                x[1:], y[1:] = later[:, 0], later[:, 1]
    except (struct.error, ValueError, TypeError) as error:
        raise UnreadableMessageError(f"an array of events that ends too early ({error})") from error
    t_us = seconds.astype(np.int64) * (NS_PER_S // NS_PER_US) + nanoseconds // NS_PER_US
    return event_block(x, y, t_us, p != 0), (int(width), int(height))


def _imu_block(message: Any) -> Block:
    """Return a sample of ``sensor_msgs/Imu``."""
    return Block(
        {
            "path/imu/angular_velocity": _vector(message.angular_velocity, "xyz"),
            "path/imu/linear_acceleration": _vector(message.linear_acceleration, "xyz"),
            "path/imu/ts": np.array([header_time_us(message.header)], np.int64),
        }
    )


def _pose_block(message: Any) -> Block:
    """Return a pose of ``PoseStamped``, ``PoseWithCovarianceStamped``, ``Odometry`` or ``TransformStamped``."""
    pose = message.transform if hasattr(message, "transform") else message.pose
    pose = getattr(pose, "pose", pose)  # beside its covariance
    position, orientation = (
        (pose.translation, pose.rotation) if hasattr(pose, "translation") else (pose.position, pose.orientation)
    )
    return Block(
        {
            "path/pose/position": _vector(position, "xyz"),
            "path/pose/orientation": _vector(orientation, "xyzw"),
            "path/pose/ts": np.array([header_time_us(message.header)], np.int64),
        }
    )


READERS: Final[Mapping[str, tuple[frozenset[str], Callable[[Any], Block]]]] = {
    "rgb": (IMAGES, colour_block),
    "depth": (IMAGES, depth_block),
    "imu": (frozenset({"sensor_msgs/msg/Imu"}), _imu_block),
    "pose": (
        frozenset(
            {
                "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped",
                "geometry_msgs/msg/TransformStamped", "nav_msgs/msg/Odometry",
            }
        )
        | TRANSFORMS,
        _pose_block,
    ),
}  # fmt: skip
"""By stream: the types of messages that are read, and what reads them. Events are read from their bytes."""


def _vector(members: Any, names: str) -> NDArray[np.float64]:
    return np.array([[getattr(members, name) for name in names]], np.float64)


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
        if encoding != _PACKET_ENCODING:
            raise UnreadableMessageError(f"events in the encoding {encoding!r}, where {_PACKET_ENCODING} is read")
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
