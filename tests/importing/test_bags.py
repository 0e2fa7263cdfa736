"""Bags that the package ``rosbags`` serialises are read: events from their bytes, all else by the package."""

import json
import shutil
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Writer as Writer1

from fedora_qa.cli.import_ import import_lines
from fedora_qa.errors import MisuseError
from fedora_qa.importing.ros1_bag import Ros1Bag
from fedora_qa.importing.ros_bag import load_topics
from fedora_qa.importing.run import ImportOptions
from tests.importing.reading import events_of, imported
from tests.support.bags import FORMS, Bag
from tests.support.prophesee import random_events

EVENTS = random_events(300, 7)
COLOURS = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
POSES = (
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
    "nav_msgs/msg/Odometry",
)


def flight(form: str) -> Bag:
    """Events in three arrays, one of them empty, and two rows of every other stream."""
    bag = Bag(form)
    bag.add_events(EVENTS[:100])
    bag.add_events([])
    bag.add_events(EVENTS[100:], frame="a longer name")
    for us in (0, 20_000):
        bag.add_image("/camera/rgb/image_raw", us, "bgr8", COLOURS, padding=5)
        depth_m = np.array([[1.5, np.nan, 0.0], [np.inf, 2.0, -1.0]], np.float32)
        bag.add_image("/camera/depth/image_raw", us, "32FC1", depth_m)
        bag.add_imu(us, (0.1, 0.2, 0.3), (1.0, 2.0, 9.8))
        bag.add_pose(us, POSES[0], (1.0, 2.0, 3.0), (0.0, 0.6, 0.0, 0.8))
    return bag


@pytest.mark.parametrize("form", FORMS)
def test_streams_return(form: str, tmp_path: Path) -> None:
    """All streams of all three containers, at the times of their headers."""
    done = imported(flight(form).write(tmp_path), tmp_path / "out.h5")
    assert done.rows == {"rgb": 2, "depth": 2, "events": len(EVENTS), "imu": 2, "pose": 2}
    assert events_of(tmp_path / "out.h5") == EVENTS
    with h5py.File(tmp_path / "out.h5") as file:
        for key in ("rgb_ts", "depth_ts", "imu/ts", "pose/ts"):
            assert file[f"path/{key}"][:].tolist() == [0, 20_000]
        np.testing.assert_array_equal(file["path/rgb"][1], COLOURS[..., ::-1])
        nan = np.nan
        np.testing.assert_array_equal(file["path/depth"][0], np.array([[1500, nan, nan], [nan, 2000, nan]], np.float32))
        np.testing.assert_array_equal(file["path/imu/angular_velocity"][0], [0.1, 0.2, 0.3])
        np.testing.assert_array_equal(file["path/imu/linear_acceleration"][0], [1.0, 2.0, 9.8])
        np.testing.assert_array_equal(file["path/pose/position"][0], [1.0, 2.0, 3.0])
        np.testing.assert_array_equal(file["path/pose/orientation"][0], [0.0, 0.6, 0.0, 0.8])
        times = [event[2] for event in EVENTS]
        np.testing.assert_array_equal(file["metadata/depth_to_event"], np.searchsorted(times, [0, 20_000]))
        assert file["metadata/cameras/events"].attrs["width"] == 640
        assert "kind" not in file.attrs


@pytest.mark.parametrize("form", FORMS[:2])
@settings(max_examples=30, deadline=None)
@given(
    events=st.lists(
        st.tuples(st.integers(0, 65535), st.integers(0, 65535), st.integers(0, 4_000_000_000_000), st.integers(0, 1)),
        max_size=20,
    ),
    frame=st.text("abc", max_size=9),
)
def test_event_arrays(form: str, events: list[tuple[int, int, int, int]], frame: str) -> None:
    """Any number of events, behind a name of any length, which moves them in memory."""
    with tempfile.TemporaryDirectory() as folder:
        bag = Bag(form)
        bag.add_events(sorted(events, key=lambda event: event[2]), frame=frame)
        bag.add_events([(1, 2, 4_000_000_000_000, 1)])
        options = ImportOptions(resolution=(3, 4))
        imported(bag.write(Path(folder)), Path(folder) / "out.h5", options)
        expected = [*sorted(events, key=lambda event: event[2]), (1, 2, 4_000_000_000_000, 1)]
        assert events_of(Path(folder) / "out.h5") == expected


@pytest.mark.parametrize("form", FORMS[:2])
@pytest.mark.parametrize("kind", POSES)
def test_poses(form: str, kind: str, tmp_path: Path) -> None:
    """Four types of messages hold a pose."""
    bag = Bag(form)
    bag.add_pose(10, kind, (1.0, 2.0, 3.0), (0.0, 0.6, 0.0, 0.8))
    imported(bag.write(tmp_path), tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as file:
        np.testing.assert_array_equal(file["path/pose/position"], [[1.0, 2.0, 3.0]])
        np.testing.assert_array_equal(file["path/pose/orientation"], [[0.0, 0.6, 0.0, 0.8]])


@pytest.mark.parametrize("form", FORMS[1:])
def test_a_definition_that_cannot_be_parsed(form: str, tmp_path: Path) -> None:
    """Recorders may state types in IDL that includes files which the bag lacks: the types read need no definition."""
    bag = Bag(form, f'{"=" * 80}\nIDL: event_camera_msgs/msg/EventPacket\n#include "std_msgs/msg/Header.idl"\n')
    bag.add_events(EVENTS)
    bag.add_imu(0, (0.1, 0.2, 0.3), (1.0, 2.0, 9.8))
    assert imported(bag.write(tmp_path), tmp_path / "out.h5").rows == {"events": len(EVENTS), "imu": 1}
    assert events_of(tmp_path / "out.h5") == EVENTS


@pytest.mark.parametrize(
    ("encoding", "channels", "order"), [("rgb8", 3, [0, 1, 2]), ("bgra8", 4, [2, 1, 0]), ("mono8", 1, [0, 0, 0])]
)
def test_encodings_of_colour(encoding: str, channels: int, order: list[int], tmp_path: Path) -> None:
    """Frames are R, G, B."""
    pixels = np.arange(6 * channels, dtype=np.uint8).reshape(2, 3, channels)
    bag = Bag("ros1")
    bag.add_image("/camera/rgb/image_raw", 5, encoding, pixels)
    imported(bag.write(tmp_path), tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as file:
        np.testing.assert_array_equal(file["path/rgb"][0], pixels[..., order])


def test_depth_in_millimetres(tmp_path: Path) -> None:
    """16UC1 has millimetres, and 0 where there is none."""
    bag = Bag("sqlite")
    bag.add_image("/camera/depth/image_raw", 5, "16UC1", np.array([[0, 1500], [65535, 1]], np.uint16))
    imported(bag.write(tmp_path), tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as file:
        np.testing.assert_array_equal(file["path/depth"][0], [[np.nan, 1500], [65535, 1]])


@pytest.mark.parametrize("form", FORMS[:2])
def test_compressed_images(form: str, tmp_path: Path) -> None:
    """The topics of image_transport: colour in JPEG and grey in PNG, depth in PNG behind a header."""
    shades = np.repeat(np.linspace(0, 255, 16).astype(np.uint8)[None], 16, axis=0)
    colours = np.stack([shades, shades.T, 255 - shades], axis=-1)
    millimetres = np.array([[0, 1500], [65535, 1]], np.uint16)
    bag, topic = Bag(form), "/camera/rgb/image_raw/compressed"
    bag.add_compressed(topic, 5, "rgb8; jpeg compressed bgr8", encoded(".jpg", colours[..., ::-1]))
    bag.add_compressed(topic, 6, "mono8; png compressed ", encoded(".png", shades))
    for us, header in ((5, bytes(12)), (6, b"")):
        content = header + encoded(".png", millimetres)
        bag.add_compressed("/camera/depth/image_raw/compressedDepth", us, "16UC1; compressedDepth png", content)
    assert imported(bag.write(tmp_path), tmp_path / "out.h5").rows == {"rgb": 2, "depth": 2}
    with h5py.File(tmp_path / "out.h5") as file:
        # Of JPEG at quality 95: steps of the quantisation of a few DN, and chroma at half the resolution.
        assert np.abs(file["path/rgb"][0].astype(int) - colours).max() < 20
        np.testing.assert_array_equal(file["path/rgb"][1], np.stack([shades] * 3, axis=-1))
        for row in range(2):
            np.testing.assert_array_equal(file["path/depth"][row], [[np.nan, 1500], [65535, 1]])


def encoded(ending: str, pixels: np.ndarray[Any, Any]) -> bytes:
    return bytes(cv2.imencode(ending, pixels)[1])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(("child", "topics"), [("base_link", None), ("/base_link", None), ("drone", "/tf:drone")])
def test_poses_among_transforms(child: str, topics: str | None, form: str, tmp_path: Path) -> None:
    """The body is ``base_link``, or the frame that a map names; transforms of other frames are none of its poses."""
    bag = Bag(form)
    for us in (5, 10):
        bag.add_transforms(us, [("base", "camera", (9.0, 9.0, 9.0)), ("world", child, (us, 2.0, 3.0))])
        bag.add_transforms(us, [("base", "camera", (9.0, 9.0, 9.0))])
    options = ImportOptions(topics={"pose": (topics,)} if topics else None)
    done = imported(bag.write(tmp_path), tmp_path / "out.h5", options)
    assert (done.rows, done.unread) == ({"pose": 2}, ())
    with h5py.File(tmp_path / "out.h5") as file:
        np.testing.assert_array_equal(file["path/pose/position"], [[5.0, 2.0, 3.0], [10.0, 2.0, 3.0]])
        np.testing.assert_array_equal(file["path/pose/ts"], [5, 10])


def test_transforms_without_the_body_are_named(tmp_path: Path) -> None:
    """The sentence states the frames there are; beside poses on a topic of their own, transforms are not mentioned."""
    bag = Bag("ros1")
    bag.add_imu(5, (0, 0, 0), (0, 0, 0))
    bag.add_transforms(5, [("world", "drone", (1.0, 2.0, 3.0)), ("drone", "camera", (0.0, 0.0, 0.0))])
    done = imported(bag.write(tmp_path), tmp_path / "out.h5")
    assert done.rows == {"imu": 1}
    assert done.unread == (
        '/tf has transforms of camera, drone, and none of base_link; choose by pose = "/tf:FRAME" in --topics '
        "FILE.toml",
    )
    bag.add_pose(5, POSES[0], (0, 0, 0), (0, 0, 0, 1))
    assert imported(bag.write(tmp_path, "posed"), tmp_path / "posed.h5").unread == ()


def test_topics_of_ones_own(tmp_path: Path) -> None:
    """A file maps topics; streams that it leaves out are not read."""
    bag = flight("ros1")
    bag.add_events([(9, 9, 9, 1)], topic="/right/events")
    (tmp_path / "topics.toml").write_text('[topics]\nevents = ["/none", "/right/events"]\nimu = "/imu"\n')
    options = ImportOptions(topics=load_topics(tmp_path / "topics.toml"))
    done = imported(bag.write(tmp_path), tmp_path / "out.h5", options)
    assert done.rows == {"events": 1, "imu": 2}
    assert done.facts == {"topic.events": "/right/events", "topic.imu": "/imu"}


@pytest.mark.parametrize("form", FORMS)
def test_topics_that_are_not_read_are_named(form: str, tmp_path: Path) -> None:
    """Of types that are read, where no stream or another topic is read; and no copy of images that are read."""
    bag = flight(form)
    assert imported(bag.write(tmp_path, "whole"), tmp_path / "whole.h5").unread == ()
    bag.add_events([(9, 9, 9, 1)], topic="/cam0/events")
    bag.add_image("/right/image", 5, "mono8", COLOURS[..., :1])
    for us in (5, 6):
        bag.add_compressed("/camera/rgb/image_raw/compressed", us, "jpeg", b"")
        bag.add_compressed("/other/compressed", us, "jpeg", b"")
    done = imported(bag.write(tmp_path), tmp_path / "out.h5")
    events, plain = "dvs_msgs/msg/EventArray", "sensor_msgs/msg/Image"
    assert done.unread == (
        f"events: /dvs/events is read, and not /cam0/events, which has 1 message of {events}; choose with --topics "
        "FILE.toml",
        "/other/compressed has 2 messages of sensor_msgs/msg/CompressedImage and is not read; map it to a stream with "
        "--topics FILE.toml",
        f"/right/image has 1 message of {plain} and is not read; map it to a stream with --topics FILE.toml",
    )
    assert tuple(import_lines(done, tmp_path / "out.h5"))[-3:] == done.unread
    with h5py.File(tmp_path / "out.h5") as file:
        assert json.loads(file["provenance/import"][()])["unread"] == list(done.unread)


def test_events_on_a_topic_of_their_own_are_named(tmp_path: Path) -> None:
    """A bag whose events are on no usual topic is not taken for one without events."""
    bag = Bag("ros1")
    bag.add_imu(5, (0, 0, 0), (0, 0, 0))
    bag.add_events([(9, 9, 9, 1)], topic="/my/events")
    (sentence,) = imported(bag.write(tmp_path), tmp_path / "out.h5").unread
    assert sentence.startswith("/my/events has 1 message of dvs_msgs/msg/EventArray and is not read; map it")


@pytest.mark.parametrize(
    "text", ["", "[topics]\n", "[other]\nx = 1\n", '[topics]\nlidar = "/a"\n', "[topics]\nimu = 3\n", "= ="]
)
def test_topics_that_cannot_be_used(text: str, tmp_path: Path) -> None:
    """One sentence says which file, and what is wrong in it."""
    (tmp_path / "topics.toml").write_text(text)
    with pytest.raises(MisuseError, match=r"^Expected .*topics\.toml.*, got.*;"):
        load_topics(tmp_path / "topics.toml")


def no_topic(bag: Bag) -> None:
    bag.add_imu(5, (0, 0, 0), (0, 0, 0), topic="/elsewhere")


def another_type(bag: Bag) -> None:
    bag.add_pose(5, POSES[0], (0, 0, 0), (0, 0, 0, 1), topic="/dvs/events")


def no_stamps(bag: Bag) -> None:
    for _ in range(3):
        bag.add_imu(0, (0, 0, 0), (0, 0, 0))


def backwards(bag: Bag) -> None:
    bag.add_events([EVENTS[100], EVENTS[0]])


def bayer(bag: Bag) -> None:
    bag.add_image("/camera/rgb/image_raw", 5, "bayer_rggb8", COLOURS[..., :1])


def depth_as_colour(bag: Bag) -> None:
    bag.add_image("/camera/depth/image_raw", 5, "rgb8", COLOURS)


def cut_image(bag: Bag) -> None:
    bag.add_compressed("/camera/rgb/image_raw/compressed", 5, "jpeg", encoded(".jpg", COLOURS)[:-9])


def inverse_depth(bag: Bag) -> None:
    bag.add_compressed("/camera/depth/image_raw/compressedDepth", 5, "32FC1; compressedDepth png", b"")


def two_parents(bag: Bag) -> None:
    for parent in ("world", "map"):
        bag.add_transforms(5, [(parent, "base_link", (0.0, 0.0, 0.0))])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("fill", "part"),
    [
        (no_topic, "got /elsewhere; map topics to streams with --topics"),
        (another_type, "got geometry_msgs/msg/PoseStamped"),
        (no_stamps, "got 0 in several messages"),
        (backwards, "do not decrease"),
        (bayer, "'bayer_rggb8'"),
        (depth_as_colour, "depth in the encoding 'rgb8'"),
        (cut_image, "an image that is cut off"),
        (inverse_depth, "32FC1; compressedDepth png"),
        (two_parents, "got world and map; map another topic or frame"),
    ],
)
def test_refused(fill, part: str, form: str, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    """One sentence says what was expected, what there is, and what to do."""
    bag = Bag(form)
    fill(bag)
    with pytest.raises(MisuseError, match=r"^Expected .*, got .*;") as caught:
        imported(bag.write(tmp_path), tmp_path / "out.h5")
    assert part in str(caught.value)


def test_without_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The sentence names the extra."""
    source = flight("ros1").write(tmp_path)
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(MisuseError, match=r"pip install 'fedora-qa\[bags\]'"):
        imported(source, tmp_path / "out.h5")


def test_names_of_bags(tmp_path: Path) -> None:
    """The package goes by the ending; another one is refused before any work. A folder needs its metadata."""
    source = flight("ros1").write(tmp_path)
    renamed = source.rename(tmp_path / "flight.raw")
    with pytest.raises(MisuseError, match=r"named \*\.bag"):
        imported(renamed, tmp_path / "out.h5")
    with pytest.raises(MisuseError, match=r"a folder without metadata\.yaml"):
        imported(tmp_path, tmp_path / "out.h5")


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The flight in any form, written once. Tests must not write into it."""
    return cache(lambda form: flight(form).write(tmp_path_factory.mktemp("flights")))


@pytest.mark.parametrize("form", FORMS)
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_mutated_bags(form: str, written: Callable[[str], Path], data: st.DataObject) -> None:
    """Bytes that change or vanish give rows or one sentence."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / written(form).name
        (shutil.copytree if written(form).is_dir() else shutil.copy)(written(form), source)
        file = source if source.is_file() else next(path for path in source.iterdir() if path.suffix != ".yaml")
        content = bytearray(file.read_bytes())
        for _ in range(data.draw(st.integers(0, 4))):
            content[data.draw(st.integers(16, len(content) - 1))] = data.draw(st.integers(0, 255))
        cut = data.draw(st.booleans())
        file.write_bytes(content[: data.draw(st.integers(16, len(content)))] if cut else content)
        refusal = ""
        try:
            done = imported(source, Path(folder) / "out.h5", ImportOptions(allow_backwards=True))
        except MisuseError as error:
            refusal = str(error)
        assert refusal.startswith("Expected ") or any(done.rows.values())


def messages_of(bag: Ros1Bag) -> list[tuple[str, bytes]]:
    return [(bag.connections[number].topic, bytes(raw)) for number, raw in bag.messages(list(bag.connections))]


@pytest.mark.parametrize("compression", [None, *Writer1.CompressionFormat])
def test_chunks_of_ros_1(compression: Writer1.CompressionFormat | None, tmp_path: Path) -> None:
    """However chunks are compressed, every message is read once, in the order of the file."""
    path, sent = tmp_path / "flight.bag", [bytes([number]) * (100 * number) for number in range(40)]
    writer = Writer1(path)
    writer.chunk_threshold = 3000
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        store = Bag("ros1").store
        topics = [writer.add_connection(name, "dvs_msgs/msg/EventArray", typestore=store) for name in ("/a", "/b")]
        for number, content in enumerate(sent):
            writer.write(topics[number % 2], number, content)
    with Ros1Bag(path) as bag:
        assert messages_of(bag) == [("/" + "ab"[number % 2], content) for number, content in enumerate(sent)]
        assert [each.count for each in bag.connections.values()] == [20, 20]
        assert {each.type_name for each in bag.connections.values()} == {"dvs_msgs/msg/EventArray"}
        first = min(bag.connections)
        assert [number for number, _ in bag.messages({first})] == [first] * 20


def without_index(content: bytearray) -> None:
    place = content.index(b"index_pos=") + len(b"index_pos=")
    content[place : place + 8] = bytes(8)


def with_a_huge_chunk(content: bytearray) -> None:
    place = content.index(b"size=", content.index(b"compression=")) + len(b"size=")
    content[place : place + 4] = b"\xff\xff\xff\x7f"


def cut_in_the_index(content: bytearray) -> None:
    del content[-20:]


@pytest.mark.parametrize(
    ("damage", "part"),
    [
        (without_index, "without an index"),
        (with_a_huge_chunk, "a chunk of 2147483647 bytes"),
        (cut_in_the_index, "ends behind the end"),
    ],
)
def test_damaged_bags_of_ros_1(damage, part: str, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    """One sentence says what is wrong with a bag that was not closed, claims too much, or is cut off."""
    source = flight("ros1").write(tmp_path)
    content = bytearray(source.read_bytes())
    damage(content)
    source.write_bytes(content)
    with pytest.raises(MisuseError, match=r"^Expected a whole ROS bag, got: ") as caught:
        imported(source, tmp_path / "out.h5")
    assert part in str(caught.value)
