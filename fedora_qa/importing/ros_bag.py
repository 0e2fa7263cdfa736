"""Bags of ROS 1 and ROS 2 (SQLite and MCAP), read by the package ``rosbags``, which needs no ROS."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fedora_qa.errors import MisuseError
from fedora_qa.importing.recording import Block, Recording, Resolution
from fedora_qa.importing.ros_messages import EVENT_ARRAYS, READERS, UnreadableMessageError, event_array
from fedora_qa.importing.ros_topics import DEFAULT_TOPICS, TopicMap, choose_topics

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader
    from rosbags.interfaces import Connection

_TOPICS_SHOWN = 8


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
        from rosbags.highlevel import AnyReader  # noqa: PLC0415 - an extra
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ImportError as missing:
        raise MisuseError(
            f"Expected what reads bags, got: {missing}; install it with pip install 'fedora-qa[bags]'"
        ) from None
    with _reading(path):
        # Bags of ROS 2 before 2023 hold no definitions; those of the types that are read have not changed since.
        bag = AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        bag.open()
    try:
        by_topic: dict[str, list[Connection]] = {}
        for connection in bag.connections:
            by_topic.setdefault(connection.topic, []).append(connection)
        chosen = choose_topics(topics or DEFAULT_TOPICS, by_topic)
        if not chosen:
            names = sorted(by_topic)
            more = f" and {len(names) - _TOPICS_SHOWN} more" if len(names) > _TOPICS_SHOWN else ""
            raise MisuseError(
                f"Expected a topic of events, images, IMU samples or poses in {path}, got "
                f"{', '.join(names[:_TOPICS_SHOWN]) or 'none'}{more}; map topics to streams with --topics FILE.toml"
            )
        streams = {name: stream for stream, name in chosen.items()}
        for topic, stream in streams.items():
            for connection in by_topic[topic]:
                types = EVENT_ARRAYS if stream == "events" else READERS[stream][0]
                if connection.msgtype not in types:
                    raise MisuseError(
                        f"Expected {stream} of the type {' or '.join(sorted(types))} in {topic}, got "
                        f"{connection.msgtype}; map another topic with --topics FILE.toml"
                    )
        connections = [connection for topic in streams for connection in by_topic[topic]]
        recording = Recording(
            format="ROS 2 bag" if bag.is2 else "ROS 1 bag",
            blocks=iter(()),
            size=sum(connection.msgcount for connection in connections),
            cameras={"events": resolution} if resolution else {},
            facts={f"topic.{stream}": topic for stream, topic in chosen.items()},
        )
        recording.blocks = _blocks(path, bag, connections, streams, recording)
        yield recording
    finally:
        bag.close()


def _blocks(
    path: Path, bag: "AnyReader", connections: "list[Connection]", streams: Mapping[str, str], recording: Recording
) -> Iterator[Block]:
    """Yield the rows of each message, in the order in which they were received."""
    unstamped: set[str] = set()
    with _reading(path):
        for connection, _, raw in bag.messages(connections=connections):
            recording.done += 1
            stream = streams[connection.topic]
            try:
                if stream == "events":
                    block, size = event_array(raw, is_cdr=bag.is2)
                    recording.cameras.setdefault("events", size)
                else:
                    message = bag.deserialize(raw, connection.msgtype)
                    _require_stamp(message, connection.topic, unstamped)
                    block = READERS[stream][1](message)
            except UnreadableMessageError as error:
                raise MisuseError(
                    f"Expected a whole message of {connection.topic}, got {error}; record or export it again"
                ) from error
            if stream in {"rgb", "depth"} and block is not None:
                height, width = block.columns[f"path/{stream}"].shape[1:3]
                recording.cameras.setdefault(stream, (width, height))
            if block is not None:
                yield block


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
        reason = (str(error).splitlines() or [""])[0] or type(error).__name__
        raise MisuseError(
            f"Expected a whole ROS bag, got: {reason}: {path}; copy it again, or reindex it (rosbag reindex, "
            "ros2 bag reindex)"
        ) from error
