"""Which topic of a bag holds which stream: the usual ones, or those of a TOML file."""

import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Final

from fedora_qa.errors import MisuseError

TopicMap = Mapping[str, tuple[str, ...]]
"""By stream: topics, of which the first that the bag has is read."""

DEFAULT_TOPICS: Final[TopicMap] = MappingProxyType(
    {
        # The route of the paper: the DVS plugin, the OpenNI Kinect plugin of Gazebo, and PX4 by MAVROS.
        "events": ("/dvs/events", "/cam0/events", "/davis/left/events", "/prophesee/camera/cd_events_buffer",
                   "/event_camera/events"),
        "rgb": ("/camera/rgb/image_raw", "/camera/color/image_raw", "/camera/image_raw", "/dvs/image_raw"),
        "depth": ("/camera/depth/image_raw", "/camera/depth/image_rect_raw"),
        "imu": ("/mavros/imu/data_raw", "/mavros/imu/data", "/imu/data", "/imu", "/dvs/imu"),
        "pose": (
            "/ground_truth/odom", "/ground_truth/pose", "/mavros/local_position/odom", "/mavros/local_position/pose",
            "/pose",
        ),
    }
)  # fmt: skip
"""The paper prints no names of topics: these are the names that the packages of its route use, and some others."""


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


def choose_topics(topics: TopicMap, present: Collection[str]) -> dict[str, str]:
    """Return the topic of each stream that a bag has."""
    chosen = {stream: next((name for name in names if name in present), "") for stream, names in topics.items()}
    return {stream: name for stream, name in chosen.items() if name}
