"""Bags of ROS 1, read chunk by chunk, and of ROS 2 (SQLite, MCAP), read by ``rosbags``; and their topics.

``rosbags`` needs no ROS; it also makes objects of messages of either version. Topics are the usual ones, or those of a
TOML file.
"""

import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final, Protocol

from fedora_qa.errors import MisuseError, first_line
from fedora_qa.importing.recording import Block, Recording, Resolution
from fedora_qa.importing.ros1_bag import Ros1Bag
from fedora_qa.importing.ros_header import UnreadableMessageError
from fedora_qa.importing.ros_messages import (
    EVENT_ARRAYS,
    EVENT_PACKETS,
    READERS,
    EventPackets,
    event_array,
)
from fedora_qa.importing.ros_transforms import BODY, TRANSFORMS, BodyTransforms

if TYPE_CHECKING:
    from rosbags.rosbag2 import Reader

TopicMap = Mapping[str, tuple[str, ...]]
"""By stream: topics, of which the first that the bag has is read; ``/tf:base_link`` is a frame in a topic of ``tf``."""

_COLOUR_TOPICS: Final = ("/camera/rgb/image_raw", "/camera/color/image_raw", "/camera/image_raw", "/dvs/image_raw")
_DEPTH_TOPICS: Final = ("/camera/depth/image_raw", "/camera/depth/image_rect_raw")

DEFAULT_TOPICS: Final[TopicMap] = MappingProxyType(
    {
        # The route of the paper: the DVS plugin, the OpenNI Kinect plugin of Gazebo, and PX4 by MAVROS.
        "events": ("/dvs/events", "/cam0/events", "/davis/left/events", "/prophesee/camera/cd_events_buffer",
                   "/event_camera/events"),
        "rgb": (*_COLOUR_TOPICS, *(f"{topic}/compressed" for topic in _COLOUR_TOPICS)),
        "depth": (*_DEPTH_TOPICS, *(f"{topic}/compressedDepth" for topic in _DEPTH_TOPICS)),
        "imu": ("/mavros/imu/data_raw", "/mavros/imu/data", "/imu/data", "/imu", "/dvs/imu"),
        "pose": (
            "/ground_truth/odom", "/ground_truth/pose", "/mavros/local_position/odom", "/mavros/local_position/pose",
            "/pose", f"/tf:{BODY}",
        ),
    }
)  # fmt: skip
"""The paper prints no names of topics: these are the names that the packages of its route use, and some others. Images
are also read from the topic that ``compressed_image_transport`` adds, where their own was not recorded."""

_TOPICS_SHOWN = 8

_COMPRESSED: Final = ("/compressed", "/compressedDepth")
"""Ends of the topics in which ``image_transport`` copies images, compressed."""

_DESERIALISED: Final = frozenset(type_name for types, _ in READERS.values() for type_name in types)
"""Types of which objects are made."""


@contextmanager
def open_bag(path: Path, resolution: Resolution | None, topics: TopicMap | None) -> Iterator[Recording]:
    """Open a bag, whose blocks can be read within the block.

    Parameters
    ----------
    path
        A file ``.bag``, ``.db3`` or ``.mcap``, or the folder of a bag of ROS 2.
    resolution
        Of the events; takes precedence over that of their messages.
    topics
        Which topic holds which stream; None: ``DEFAULT_TOPICS``.

    Raises
    ------
    MisuseError
        The package is not installed, the bag cannot be read, or it has none of the topics.
    """
    try:
        from rosbags.rosbag2 import Reader  # noqa: PLC0415 - an extra
    except ImportError as missing:
        raise MisuseError(
            f"Expected what reads bags, got: {missing}; install it with pip install 'fedora-qa[bags]'"
        ) from None
    with ExitStack() as opened:
        with _reading(path):
            bag: _Bag
            if path.is_file() and path.suffix == ".bag":
                bag = _Ros1(opened.enter_context(Ros1Bag(path)))
            else:
                bag = _Ros2(opened.enter_context(Reader(path)))
        usual = topics or DEFAULT_TOPICS
        present = {
            stream: next((name for name in names if _topic_and_frame(name)[0] in bag.types), "")
            for stream, names in usual.items()
        }
        chosen = {stream: name for stream, name in present.items() if name}
        if not chosen:
            names = sorted(bag.types)
            more = f" and {len(names) - _TOPICS_SHOWN} more" if len(names) > _TOPICS_SHOWN else ""
            raise MisuseError(
                f"Expected a topic of events, images, IMU samples or poses in {path}, got "
                f"{', '.join(names[:_TOPICS_SHOWN]) or 'none'}{more}; map topics to streams with --topics FILE.toml"
            )
        streams = {_topic_and_frame(name)[0]: stream for stream, name in chosen.items()}
        for topic, stream in streams.items():
            types = TRANSFORMS if ":" in chosen[stream] else _types_of(stream)
            for other in sorted(bag.types[topic] - types):
                raise MisuseError(
                    f"Expected {stream} of the type {' or '.join(sorted(types))} in {topic}, got {other}; map another "
                    "topic with --topics FILE.toml"
                )
        recording = Recording(
            format=bag.format,
            blocks=iter(()),
            size=bag.message_count(streams),
            cameras={"events": resolution} if resolution else {},
            facts={f"topic.{stream}": topic for stream, topic in chosen.items()},
            unread=tuple(_unread(bag, chosen)),
        )
        transforms = BodyTransforms(_topic_and_frame(chosen.get("pose", ""))[1])
        recording.blocks = _blocks(path, bag, streams, transforms, recording)
        yield recording


def _unread(bag: "_Bag", chosen: Mapping[str, str]) -> Iterator[str]:
    """Yield which other topics of a bag have messages of streams, in sentences."""
    read_topics = {_topic_and_frame(name)[0] for name in chosen.values()}
    for topic, types in sorted(bag.types.items()):
        count = bag.message_count({topic})
        streams = [stream for stream in DEFAULT_TOPICS if types & _types_of(stream)]
        # Most bags have topics of transforms, of which few are poses of the body.
        is_beside_poses = "pose" in chosen and types <= TRANSFORMS
        # The compressed copy of images that are read.
        is_copy = topic.rpartition("/")[0] in read_topics and topic.endswith(_COMPRESSED)
        if topic in read_topics or not count or not streams or is_beside_poses or is_copy:
            continue
        held = f"{count} message{'s' * (count != 1)} of {' and '.join(sorted(types))}"
        if len(streams) == 1 and (read := chosen.get(streams[0])):
            yield f"{streams[0]}: {read} is read, and not {topic}, which has {held}; choose with --topics FILE.toml"
        else:
            yield f"{topic} has {held} and is not read; map it to a stream with --topics FILE.toml"


def _topic_and_frame(name: str) -> tuple[str, str]:
    """Return a topic, and the frame behind its colon; names of topics have none."""
    topic, _, frame = name.partition(":")
    return topic, frame


def _types_of(stream: str) -> frozenset[str]:
    return EVENT_ARRAYS | EVENT_PACKETS if stream == "events" else READERS[stream][0]


def load_topics(path: Path) -> TopicMap:
    """Read a map from a TOML file with a table ``[topics]``: ``events = "/dvs/events"``, or a list of topics.

    Raises
    ------
    MisuseError
        There is no such file, it is not TOML, or it names other streams or no topics.
    """
    try:
        document = tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise MisuseError(f"Expected topics in a TOML file, got {path}: {error}; give another file") from error
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise MisuseError(f"Expected {path} to be TOML, got: {error}; correct it") from error
    topics = document.get("topics")
    if set(document) != {"topics"} or not isinstance(topics, dict) or not topics:
        raise MisuseError(f"Expected one table [topics] in {path}, got {', '.join(document) or 'none'}; write it")
    streams = ", ".join(DEFAULT_TOPICS)
    chosen: dict[str, tuple[str, ...]] = {}
    for stream, names in topics.items():
        listed = [names] if isinstance(names, str) else names
        if stream not in DEFAULT_TOPICS:
            raise MisuseError(f"Expected a stream ({streams}) in {path}, got {stream!r}; correct it")
        if not isinstance(listed, list) or not listed or not all(isinstance(name, str) for name in listed):
            raise MisuseError(f"Expected a topic or a list of topics for {stream} in {path}, got {names!r}; correct it")
        chosen[stream] = tuple(listed)
    return chosen


class _Bag(Protocol):
    """What is read of a bag of either version.

    Attributes
    ----------
    format
        In words.
    is_cdr
        Whether messages are serialised as in ROS 2.
    types
        Types of the messages by topic.
    """

    format: str
    is_cdr: bool
    types: dict[str, set[str]]

    def message_count(self, topics: Collection[str]) -> int:
        """Return how many messages topics have."""
        ...

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, str, bytes | memoryview]]:
        """Yield topic, type and bytes of each message, of each topic in the order of the bag."""
        ...

    def deserialised(self, raw: bytes, type_name: str) -> Any:
        """Return a message as an object."""
        ...


class _Ros1:
    format = "ROS 1 bag"
    is_cdr = False

    def __init__(self, bag: Ros1Bag) -> None:
        self._bag = bag
        self.types = _types((each.topic, each.type_name) for each in bag.connections.values())
        self._store: Any = None

    def message_count(self, topics: Collection[str]) -> int:
        return sum(each.count for each in self._bag.connections.values() if each.topic in topics)

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, str, bytes | memoryview]]:
        connections = self._bag.connections
        wanted = {number for number, each in connections.items() if each.topic in topics}
        for number, raw in self._bag.messages(wanted):
            yield connections[number].topic, connections[number].type_name, raw

    def deserialised(self, raw: bytes, type_name: str) -> Any:
        if self._store is None:
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415 - an extra

            self._store = get_typestore(Stores.EMPTY)
            for each in self._bag.connections.values():
                if each.type_name in _DESERIALISED:
                    self._store.register(get_types_from_msg(each.definition, each.type_name))
        return self._store.deserialize_ros1(raw, type_name)


class _Ros2:
    format = "ROS 2 bag"
    is_cdr = True

    def __init__(self, bag: "Reader") -> None:
        self._bag = bag
        self.types = _types((each.topic, each.msgtype) for each in bag.connections)
        self._store: Any = None

    def message_count(self, topics: Collection[str]) -> int:
        return sum(each.msgcount for each in self._bag.connections if each.topic in topics)

    def messages(self, topics: Collection[str]) -> Iterator[tuple[str, str, bytes | memoryview]]:
        connections = [each for each in self._bag.connections if each.topic in topics]
        for connection, _, raw in self._bag.messages(connections):
            yield connection.topic, connection.msgtype, raw

    def deserialised(self, raw: bytes, type_name: str) -> Any:
        if self._store is None:
            from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415 - an extra

            # Not the definitions of the bag: bags before 2023 hold none, others hold IDL that includes files they lack.
            # Those of the types read are the same in every release of ROS 2.
            self._store = get_typestore(Stores.ROS2_HUMBLE)
        return self._store.deserialize_cdr(raw, type_name)


def _types(topics: Iterable[tuple[str, str]]) -> dict[str, set[str]]:
    types: dict[str, set[str]] = {}
    for topic, type_name in topics:
        types.setdefault(topic, set()).add(type_name)
    return types


def _blocks(
    path: Path, bag: _Bag, streams: Mapping[str, str], transforms: BodyTransforms, recording: Recording
) -> Iterator[Block]:
    """Yield the rows of each message."""
    unstamped: set[str] = set()
    packets = EventPackets(recording, is_cdr=bag.is_cdr)
    with _reading(path):
        for topic, type_name, raw in bag.messages(streams):
            recording.done += 1
            stream = streams[topic]
            try:
                if stream == "events":
                    is_packet = type_name in EVENT_PACKETS
                    block, size = packets.block(raw) if is_packet else event_array(raw, is_cdr=bag.is_cdr)
                    recording.cameras.setdefault("events", size)
                else:
                    message = bag.deserialised(bytes(raw), type_name)
                    if type_name in TRANSFORMS:
                        message = transforms.of(message, topic)
                        if message is None:
                            continue
                    _require_stamp(message, topic, unstamped)
                    block = READERS[stream][1](message)
            except UnreadableMessageError as error:
                raise MisuseError(
                    f"Expected a whole message of {topic}, got {error}; record or export it again"
                ) from error
            if stream in {"rgb", "depth"} and block is not None:
                height, width = block.columns[f"path/{stream}"].shape[1:3]
                recording.cameras.setdefault(stream, (width, height))
            if block is not None:
                yield block
    for topic, stream in streams.items():
        if stream == "pose":
            recording.unread += transforms.unread(topic)


def _require_stamp(message: object, topic: str, unstamped: set[str]) -> None:
    """Raise ``MisuseError`` at the second message of a topic without a time; a simulation may begin at 0."""
    time = message.header.stamp  # type: ignore[attr-defined]
    if time.sec or time.nanosec:
        return
    if topic in unstamped:
        raise MisuseError(
            f"Expected times in the headers of {topic}, got 0 in several messages; the times of receipt are no "
            "measurement: stamp messages where they are made, and record again"
        )
    unstamped.add(topic)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    """Turn what is raised over a damaged bag into one sentence."""
    try:
        yield
    except (MisuseError, GeneratorExit):
        raise
    # A damaged bag raises errors of many packages: of rosbags, of codecs, of SQLite, of YAML, and plain ones.
    except Exception as error:
        raise MisuseError(
            f"Expected a whole ROS bag, got: {first_line(error)}: {path}; copy it again, or reindex it "
            "(rosbag reindex, ros2 bag reindex)"
        ) from error
