"""Bags of ROS 1 and ROS 2, written message by message with the serialisers of ``rosbags``."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.support.prophesee import Event

EVENT = "uint16 x\nuint16 y\ntime ts\nbool polarity\n"
EVENT_ARRAY = "std_msgs/Header header\nuint32 height\nuint32 width\ndvs_msgs/Event[] events\n"
EVENT_PACKET = (
    "std_msgs/Header header\nuint32 height\nuint32 width\nuint64 seq\nuint64 time_base\nstring encoding\n"
    "bool is_bigendian\nuint8[] events\n"
)
TRANSFORMS = "geometry_msgs/TransformStamped[] transforms\n"
FORMS = ("ros1", "sqlite", "mcap")


class Bag:
    """Messages of one version of ROS, and the topics that they are written to."""

    def __init__(self, form: str, definition: str | None = None) -> None:
        """``definition`` is stated for every message of ROS 2; None: that of its type."""
        self.form = form
        self.definition = definition
        self.store = get_typestore(Stores.ROS1_NOETIC if form == "ros1" else Stores.ROS2_HUMBLE)
        self.messages: list[tuple[str, str, int, Any]] = []
        event = EVENT if form == "ros1" else EVENT.replace("time ts", "builtin_interfaces/Time ts")
        self.store.register(
            {
                **get_types_from_msg(event, "dvs_msgs/msg/Event"),
                **get_types_from_msg(EVENT_ARRAY, "dvs_msgs/msg/EventArray"),
                **get_types_from_msg(EVENT_PACKET, "event_camera_msgs/msg/EventPacket"),
            }
        )
        if form == "ros1":  # the store of ROS 2 has it
            self.store.register(get_types_from_msg(TRANSFORMS, "tf2_msgs/msg/TFMessage"))

    def make(self, kind: str, *values: Any) -> Any:
        return self.store.types[kind](*values)

    def time(self, us: int) -> Any:
        return self.make("builtin_interfaces/msg/Time", us // 1_000_000, us % 1_000_000 * 1000)

    def header(self, us: int, frame: str = "") -> Any:
        return self.make("std_msgs/msg/Header", *([0] if self.form == "ros1" else []), self.time(us), frame)

    def add(self, topic: str, kind: str, us: int, message: Any) -> None:
        self.messages.append((topic, kind, us * 1000 + 5_000_000, message))  # received 5 ms later

    def add_events(self, events: Sequence[Event], topic: str = "/dvs/events", frame: str = "cam") -> None:
        made = [self.make("dvs_msgs/msg/Event", x, y, self.time(t), bool(p)) for x, y, t, p in events]
        us = events[-1][2] if events else 0
        array = self.make("dvs_msgs/msg/EventArray", self.header(us, frame), 480, 640, made)
        self.add(topic, "dvs_msgs/msg/EventArray", us, array)

    def add_packet(self, us: int, number: int, words: bytes, encoding: str = "evt3", frame: str = "cam") -> None:
        data, kind = np.frombuffer(words, np.uint8), "event_camera_msgs/msg/EventPacket"
        packet = self.make(kind, self.header(us, frame), 480, 640, number, 0, encoding, False, data)
        self.add("/event_camera/events", kind, us, packet)

    def add_image(self, topic: str, us: int, encoding: str, pixels: np.ndarray[Any, Any], padding: int = 0) -> None:
        lines = np.ascontiguousarray(pixels).view(np.uint8).reshape(len(pixels), -1)
        data = np.pad(lines, ((0, 0), (0, padding)))
        image = self.make(
            "sensor_msgs/msg/Image", self.header(us), *pixels.shape[:2], encoding, 0, data.shape[1], data.reshape(-1)
        )
        self.add(topic, "sensor_msgs/msg/Image", us, image)

    def add_compressed(self, topic: str, us: int, form: str, content: bytes) -> None:
        kind = "sensor_msgs/msg/CompressedImage"
        self.add(topic, kind, us, self.make(kind, self.header(us), form, np.frombuffer(content, np.uint8)))

    def add_transforms(self, us: int, placed: Sequence[tuple[str, str, Sequence[float]]], topic: str = "/tf") -> None:
        """Add one message with the transforms (parent, child, position), each turned by nothing."""
        orientation = self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
        made = []
        for parent, child, position in placed:
            vector = self.make("geometry_msgs/msg/Vector3", *position)
            transform = self.make("geometry_msgs/msg/Transform", vector, orientation)
            made.append(self.make("geometry_msgs/msg/TransformStamped", self.header(us, parent), child, transform))
        self.add(topic, "tf2_msgs/msg/TFMessage", us, self.make("tf2_msgs/msg/TFMessage", made))

    def add_imu(self, us: int, rate: Sequence[float], force: Sequence[float], topic: str = "/imu") -> None:
        vector = "geometry_msgs/msg/Vector3"
        orientation = self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
        none = np.zeros(9)
        message = self.make(
            *("sensor_msgs/msg/Imu", self.header(us), orientation, none, self.make(vector, *rate), none),
            *(self.make(vector, *force), none),
        )
        self.add(topic, "sensor_msgs/msg/Imu", us, message)

    def add_pose(self, us: int, kind: str, position: Sequence[float], q: Sequence[float], topic: str = "/pose") -> None:
        orientation = self.make("geometry_msgs/msg/Quaternion", *q)
        pose = self.make("geometry_msgs/msg/Pose", self.make("geometry_msgs/msg/Point", *position), orientation)
        vector, covariance = self.make("geometry_msgs/msg/Vector3", *position), np.zeros(36)
        uncertain = self.make("geometry_msgs/msg/PoseWithCovariance", pose, covariance)
        if kind == "geometry_msgs/msg/TransformStamped":
            transform = self.make("geometry_msgs/msg/Transform", vector, orientation)
            message = self.make(kind, self.header(us), "body", transform)
        elif kind == "nav_msgs/msg/Odometry":
            twist = self.make("geometry_msgs/msg/Twist", vector, vector)
            moving = self.make("geometry_msgs/msg/TwistWithCovariance", twist, covariance)
            message = self.make(kind, self.header(us), "body", uncertain, moving)
        else:
            message = self.make(kind, self.header(us), uncertain if "Covariance" in kind else pose)
        self.add(topic, kind, us, message)

    def write(self, folder: Path, name: str = "flight") -> Path:
        """Write all messages in the order of their receipt."""
        path = folder / (f"{name}.bag" if self.form == "ros1" else name)
        plugin = StoragePlugin.MCAP if self.form == "mcap" else StoragePlugin.SQLITE3
        with ExitStack() as stack:
            writer: Any = Writer1(path) if self.form == "ros1" else Writer2(path, version=9, storage_plugin=plugin)
            stack.enter_context(writer)
            topics: dict[str, Any] = {}
            for topic, kind, received_ns, message in sorted(self.messages, key=lambda each: each[2]):
                if topic not in topics:
                    definition: dict[str, Any] = {"typestore": self.store}
                    if self.definition:
                        definition = {"msgdef": self.definition, "rihs01": f"RIHS01_{0:064}"}
                    topics[topic] = writer.add_connection(topic, kind, **definition)
                serialise = self.store.serialize_ros1 if self.form == "ros1" else self.store.serialize_cdr
                writer.write(topics[topic], received_ns, serialise(message, kind))
        return path
