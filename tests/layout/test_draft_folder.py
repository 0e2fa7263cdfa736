"""A drafted dialect opens the folder that it was drafted from, and says what it could not place."""

import json
from contextlib import closing
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import OpenEXR
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.layout.dialect import load_dialect
from fedora_qa.layout.draft_file import draft_dialect
from fedora_qa.layout.draft_folder import draft_folder
from fedora_qa.layout.folder import OpenFolder, match_folder
from fedora_qa.layout.resolve import Layout, resolve
from fedora_qa.sequence.sequence import open_sequence
from tests.support.dsec_folder import T_OFFSET_US, write_dsec_folder, write_png
from tests.support.handmade import write_handmade

EPOCH_NS = 1_504_645_177_000_000_000


def drafted(folder: Path, tmp_path: Path) -> tuple[str, Path]:
    text = draft_folder(folder, "drafted")
    path = tmp_path / "drafted.toml"
    path.write_text(text, "utf-8")
    return text, path


def layout_of(folder: Path, dialect: Path) -> Layout:
    with closing(OpenFolder(match_folder(folder, load_dialect(dialect)))) as opened:
        return resolve(opened)


def test_a_folder_like_dsec(tmp_path: Path) -> None:
    """All streams are placed; the matrix of disparity is asked for, and cameras of unknown names are remarks."""
    write_handmade(tmp_path / "source.h5")
    folder = write_dsec_folder(tmp_path / "source.h5", tmp_path / "dsec")
    text, dialect = drafted(folder, tmp_path)
    layout = layout_of(folder, dialect)
    assert layout.streams == {"rgb", "events", "flow/10hz"}
    assert [problem.stream for problem in layout.problems] == ["depth"]
    assert "supply it (--metadata)" in layout.problems[0].message
    assert layout.bindings["path/events/t"].offset_ns == T_OFFSET_US * 1000
    assert "#   events_left_rectify_map: rectify_map" in text
    assert 'but of which? "metadata/cameras/.../K"' in text
    assert "distortion_coeffs" not in text


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """Images whose names are times, depth of 16 bits, a trajectory, an IMU table, events in NPZ, poses as matrices."""
    folder, random = tmp_path / "robot", np.random.default_rng(5)
    for name in ("cam0/data", "depth"):
        (folder / name).mkdir(parents=True)
    times_ns = EPOCH_NS + np.arange(6) * 50_000_000
    for time_ns in times_ns:
        write_png(folder / f"cam0/data/{time_ns}.png", random.integers(0, 255, (8, 10), np.uint8))
        write_png(folder / f"depth/{len(list((folder / 'depth').iterdir()))}.png", np.full((8, 10), 2000, np.uint16))
    lines = [f"{time_ns / 1e9:.6f} depth/{number}.png" for number, time_ns in enumerate(times_ns)]
    (folder / "depth.txt").write_text("\n".join(lines) + "\n")
    poses = [
        [time_ns / 1e9, *random.normal(size=3), *Rotation.random(random_state=1).as_quat()] for time_ns in times_ns
    ]
    (folder / "groundtruth.txt").write_text("# t x y z qx qy qz qw\n" + "\n".join(" ".join(map(str, p)) for p in poses))
    imu_ns = EPOCH_NS + np.arange(300) * 1_000_000
    rows = [
        f"{t},{w[0]},{w[1]},{w[2]},0.1,-0.2,9.8"
        for t, w in zip(imu_ns, random.normal(size=(300, 3)) * 0.1, strict=True)
    ]
    (folder / "imu.csv").write_text("#timestamp [ns],w_x,w_y,w_z,a_x,a_y,a_z\n" + "\n".join(rows))
    events = np.column_stack(
        [EPOCH_NS // 1000 + np.arange(400) * 700.0, random.integers(0, 10, (400, 2)), np.arange(400) % 2]
    )
    np.savez(folder / "events.npz", events=events)
    (folder / "calib.yaml").write_text("events:\n  intrinsics: [9.0, 9.0, 4.5, 3.5]\n")
    (folder / "broken.npy").write_bytes(b"no array")
    (folder / "readme.md").write_text("hello")
    return folder


def test_a_folder_of_a_robot(robot: Path, tmp_path: Path) -> None:
    """Every stream has a place, in its unit, and reads as it was written."""
    text, path = drafted(robot, tmp_path)
    dialect = load_dialect(path)
    layout = layout_of(robot, path)
    assert layout.streams == {"rgb", "depth", "events", "imu", "pose"}, text
    assert not layout.problems
    assert dialect.datasets["path/rgb_ts"].time_unit == "ns"
    assert dialect.datasets["path/imu/linear_acceleration"].columns == (4, 5, 6)
    with open_sequence(robot, dialect) as sequence:
        assert sequence.rows("path/depth", 0, 1).tolist() == [[[2000.0] * 10] * 8]
        steps = np.diff(sequence.rows("path/rgb_ts", 0, 6))
        np.testing.assert_allclose(steps, 50_000_000)
        assert abs(sequence.rows("path/imu/ts", 0, 1)[0]) < 1_000_000
        np.testing.assert_allclose(np.linalg.norm(sequence.rows("path/pose/orientation", 0, 6), axis=1), 1.0)
        np.testing.assert_array_equal(sequence.rows("path/events/p", 0, 4), [0, 1, 0, 1])
    assert dialect.metadata["metadata/cameras/events/K"] is not None
    assert "Expected an array of NumPy in broken.npy" in text
    assert "#   readme.md: a format that is not read" in text


def test_poses_as_matrices(tmp_path: Path) -> None:
    """4 x 4 transformations with timestamps are a trajectory, also in a file by itself."""
    path = tmp_path / "pose.h5"
    matrices = np.tile(np.eye(4), (9, 1, 1))
    matrices[:, :3, :3] = Rotation.random(9, random_state=2).as_matrix()
    with h5py.File(path, "w") as file:
        file["Cn_T_C0"], file["ts"] = matrices, np.arange(9) * 10_000
        text = draft_dialect(file, "drafted")
    (tmp_path / "mine.toml").write_text(text, "utf-8")
    with open_sequence(path, load_dialect(tmp_path / "mine.toml")) as sequence:
        assert sequence.layout.streams == {"pose"}
        read = Rotation.from_quat(sequence.rows("path/pose/orientation", 0, 9))
        np.testing.assert_allclose(read.as_matrix(), matrices[:, :3, :3], atol=1e-9)


def test_names_cannot_break_the_draft(tmp_path: Path) -> None:
    """Quotes and odd letters in names are text in the draft."""
    folder = tmp_path / 'a "b" # c'
    (folder / 'x = 1 "y').mkdir(parents=True)
    for number in range(2):
        write_png(folder / f'x = 1 "y/{number}.png', np.zeros((2, 3, 3), np.uint8))
    _, dialect = drafted(folder, tmp_path)
    assert load_dialect(dialect).files == {"x_1_y": ('x = 1 "y/*.png',), "times_2": ("times_2.txt",)}


def test_intrinsics_that_have_names(tmp_path: Path) -> None:
    """The table of a calibration that names the four is offered as a matrix, which reads as it is stated."""
    folder = tmp_path / "flight"
    (folder / "images").mkdir(parents=True)
    for number in range(2):
        write_png(folder / f"images/{number}.png", np.zeros((8, 10, 3), np.uint8))
    (folder / "times.txt").write_text("0\n50000\n")
    named = {"fx": 9.0, "fy": 8.0, "cx": 4.5, "cy": 3.5, "k1": 0.0}
    (folder / "calibration.json").write_text(json.dumps({"cameras": [{"intrinsics": named, "kind": "kb4"}]}))
    text, path = drafted(folder, tmp_path)
    assert (
        '# The matrix of a camera, but of which? "metadata/cameras/.../K" = { file = "calibration", '
        'path = "cameras/0/intrinsics", convert = "fx_fy_cx_cy" }'
    ) in text
    stated = text.replace('# The matrix of a camera, but of which? "metadata/cameras/...', '"metadata/cameras/rgb')
    sizes = '"metadata/cameras/rgb/width" = 10\n"metadata/cameras/rgb/height" = 8\n'
    path.write_text(f'{stated}{sizes}"metadata/cameras/rgb/T_body_camera" = {np.eye(4).tolist()}\n', "utf-8")
    with open_sequence(folder, load_dialect(path)) as sequence:
        K = sequence.declared.cameras["rgb"].K
    np.testing.assert_array_equal(K, [[9, 0, 4.5], [0, 8, 3.5], [0, 0, 1]])


def write_events(folder: Path, form: str) -> dict[str, np.ndarray]:
    """Write events in a form: a file a part, with or without a beginning in common, in pairs, or in one NPZ."""
    random = np.random.default_rng(8)
    events: dict[str, Any] = {
        "x": random.integers(0, 40, 500).astype(np.uint16),
        "y": random.integers(0, 30, 500).astype(np.uint16),
        "t": np.sort(random.uniform(0, 0.4, 500)),
        "p": (random.integers(0, 2, 500) * 2 - 1).astype(np.int8),
    }
    folder.mkdir(exist_ok=True)
    if form == "npz":
        np.savez(folder / "events.npz", **events)
    elif form == "pair":
        np.save(folder / "events_xy.npy", np.column_stack([events["x"], events["y"]]))
        np.save(folder / "events_t.npy", events["t"])
        np.save(folder / "events_p.npy", events["p"])
    else:
        for name, values in events.items():
            np.save(folder / f"{form}{name}.npy", values)
    return events


@pytest.mark.parametrize("form", ["", "events_", "npz", "pair"])
def test_events_apart(form: str, tmp_path: Path) -> None:
    """Parts of events in files of their own, or in NPZ, are placed, and read as they were written."""
    events = write_events(tmp_path / "flight", form)
    text, path = drafted(tmp_path / "flight", tmp_path)
    with open_sequence(tmp_path / "flight", load_dialect(path)) as sequence:
        assert sequence.layout.streams == {"events"}, text
        np.testing.assert_array_equal(sequence.rows("path/events/x", 0, 500), events["x"])
        np.testing.assert_array_equal(sequence.rows("path/events/y", 0, 500), events["y"])
        np.testing.assert_array_equal(sequence.rows("path/events/p", 0, 500), events["p"] > 0)
        times_s = sequence.rows("path/events/t", 0, 500) / 1e9
        np.testing.assert_allclose(times_s - times_s[0], events["t"] - events["t"][0], atol=2e-9)
    assert "Nothing was guessed for" not in text


@pytest.mark.parametrize(
    ("lines", "column", "unit"),
    [
        ([f"{n} {25_000 * n}" for n in range(8)], 1, "us"),
        ([f"{n} {0.05 * n:.6f}" for n in range(8)], 1, "s"),
        ([f"{2 * n},{50 * n},7" for n in range(8)], 1, "ms"),
        ([f"{0.05 * n:.6f} {n}" for n in range(8)], 0, "s"),
        ([f"{n} {n * n} {1000 + 40.5 * n}" for n in range(8)], 2, "ms"),
    ],
)
def test_a_count_beside_times_is_no_time(lines: list[str], column: int, unit: str, tmp_path: Path) -> None:
    """Which column of a table is time follows from its steps, and from how long the events last."""
    folder = tmp_path / "flight"
    (folder / "rgb").mkdir(parents=True)
    for number in range(8):
        write_png(folder / f"rgb/{number:04d}.png", np.zeros((8, 10, 3), np.uint8))
    (folder / "rgb/timestamps.txt").write_text("\n".join(lines))
    write_events(folder, "npz")
    text, path = drafted(folder, tmp_path)
    place = load_dialect(path).datasets["path/rgb_ts"]
    assert (place.columns, place.time_unit) == ((column,), unit), text


def test_a_column_that_counts_alone_is_no_time(tmp_path: Path) -> None:
    """Frames beside a table whose only rising column counts have no times: they are still to be written."""
    folder = tmp_path / "flight"
    (folder / "rgb").mkdir(parents=True)
    for number in range(8):
        write_png(folder / f"rgb/{number:04d}.png", np.zeros((8, 10, 3), np.uint8))
    (folder / "labels.txt").write_text("\n".join(f"{n} {n % 3}" for n in range(8)))
    assert load_dialect(drafted(folder, tmp_path)[1]).datasets["path/rgb_ts"].file == "times_8"


def test_a_count_before_a_trajectory_and_before_intervals(tmp_path: Path) -> None:
    """Tables of poses and of intervals may begin with a count."""
    folder, random = tmp_path / "flight", np.random.default_rng(6)
    folder.mkdir()
    quaternions = Rotation.random(9, random_state=3).as_quat()
    poses = np.column_stack([np.arange(9), 0.01 * np.arange(9), random.normal(size=(9, 3)), quaternions])
    np.savetxt(folder / "poses.txt", poses)
    np.save(folder / "flow.npy", random.normal(size=(4, 8, 10, 2)).astype(np.float32))
    np.savetxt(folder / "flow_times.txt", [[n, 0.1 * n, 0.1 * n + 0.1] for n in range(4)])
    with open_sequence(folder, load_dialect(drafted(folder, tmp_path)[1])) as sequence:
        assert sequence.layout.streams == {"pose", "flow/10hz"}
        np.testing.assert_allclose(np.diff(sequence.rows("path/pose/ts", 0, 9)), 10_000_000)
        np.testing.assert_allclose(sequence.rows("path/pose/position", 0, 9), poses[:, 2:5])
        np.testing.assert_allclose(np.diff(sequence.rows("path/flow/10hz_ts", 0, 4), axis=1), 100_000_000)


def fields_of_flow(frames: int) -> np.ndarray:
    return np.random.default_rng(7).normal(size=(frames, 8, 10, 2)).astype(np.float32)


def test_names_with_different_endings_are_different_streams(tmp_path: Path) -> None:
    """Flow and its masks in one folder, and two views, come apart; what has no place is a line a kind of name."""
    folder = tmp_path / "flight"
    for name in ("flow", "images"):
        (folder / name).mkdir(parents=True)
    flow = fields_of_flow(12)
    for number in range(12):
        np.save(folder / f"flow/{number:06d}_{number + 1:06d}_flow.npy", flow[number])
        np.save(folder / f"flow/{number:06d}_{number + 1:06d}_mask.npy", np.zeros((8, 10), np.uint8))
        np.save(folder / f"flow/{number}.npy", np.zeros(3))
        for view, value in (("left", 1), ("right", 2)):
            write_png(folder / f"images/{view}_{number}.png", np.full((8, 10, 3), value, np.uint8))
    np.savetxt(folder / "flow_times.txt", [[0.1 * n, 0.1 * n + 0.1] for n in range(12)])
    (folder / "times.txt").write_text("".join(f"{100_000 * n}\n" for n in range(12)))
    text, path = drafted(folder, tmp_path)
    dialect = load_dialect(path)
    assert dialect.files[dialect.datasets["path/rgb"].file] == ("images/left_*.png",)
    with open_sequence(folder, dialect) as sequence:
        assert sequence.layout.streams == {"rgb", "flow/10hz"}, text
        assert not sequence.layout.problems
        np.testing.assert_array_equal(sequence.rows("path/flow/10hz", 0, 12), flow)
    unplaced = text.partition("# Nothing was guessed for:\n")[2].splitlines()[:3]
    assert {line.split()[1] for line in unplaced} == {"flow/*_mask.npy", "flow/*[0-9].npy", "images/right_*.png"}


def test_images_and_events_in_archives(tmp_path: Path) -> None:
    """A member of H x W x 3 is one image; many are a stream, and so are the events of an NPZ a frame."""
    folder, random = tmp_path / "flight", np.random.default_rng(4)
    (folder / "events").mkdir(parents=True)
    images: dict[str, Any] = {f"colour_{n:04d}": random.integers(0, 255, (8, 10, 3), np.uint8) for n in range(9)}
    depths: dict[str, Any] = {f"depth_{n:04d}": np.full((8, 10), 2000 + n, np.uint16) for n in range(9)}
    masks: dict[str, Any] = {f"mask_{n:04d}": np.zeros((8, 10), np.uint16) for n in range(9)}
    np.savez(folder / "images.npz", **images)
    np.savez(folder / "depth.npz", **depths)
    np.savez(folder / "a_mask.npz", **masks)
    np.savez(folder / "info.npz", one_image=images["colour_0000"], meta=np.array({"a": 1}, dtype=object))
    (folder / "times.txt").write_text("".join(f"{50_000 * n}\n" for n in range(9)))
    parts = write_events(tmp_path / "source", "npz")
    bounds = [0, 40, 90, 90, 300, 350, 500]
    for number in range(6):
        frame = slice(bounds[number], bounds[number + 1])
        of_frame: dict[str, Any] = {name: values[frame] for name, values in parts.items()}
        np.savez(folder / f"events/{number:04d}_events.npz", **of_frame)
    text, path = drafted(folder, tmp_path)
    with open_sequence(folder, load_dialect(path)) as sequence:
        assert sequence.layout.streams == {"rgb", "depth", "events"}, text
        np.testing.assert_array_equal(sequence.rows("path/rgb", 4, 5)[0], images["colour_0004"])
        np.testing.assert_array_equal(sequence.rows("path/depth", 8, 9)[0], np.full((8, 10), 2008.0))
        np.testing.assert_array_equal(sequence.rows("path/events/x", 0, 500), parts["x"])
    assert "#   info.npz/one_image  8 x 10 x 3  uint8" in text
    assert "Expected numbers in meta of info.npz, got object" in text


def test_poses_and_images_without_times(tmp_path: Path) -> None:
    """They are placed with times that are still to be written, and the draft states how."""
    folder, random = tmp_path / "flight", np.random.default_rng(4)
    (folder / "rgb").mkdir(parents=True)
    # On a straight way a position rises like a time.
    positions = random.normal(size=(9, 3)) + np.arange(9)[:, None] * [0.02, 10, 0]
    poses = np.column_stack([positions, Rotation.random(9, random_state=3).as_quat()])
    np.savetxt(folder / "pose_left.txt", poses)
    np.savetxt(folder / "velocity.txt", positions[:, 1:])
    for number in range(9):
        write_png(folder / f"rgb/{number:06d}_left.png", np.zeros((8, 10, 3), np.uint8))
    text, path = drafted(folder, tmp_path)
    assert "#   seq 0 50000 400000 > times_9.txt" in text
    problems = [problem.message for problem in layout_of(folder, path).problems]
    assert len(problems) == 2
    assert all(message.startswith("Expected times_9.txt beside") for message in problems)
    (folder / "times_9.txt").write_text("".join(f"{50_000 * n}\n" for n in range(9)))
    with open_sequence(folder, load_dialect(path)) as sequence:
        assert sequence.layout.streams == {"rgb", "pose"}
        np.testing.assert_allclose(sequence.rows("path/pose/position", 0, 9), poses[:, :3])
        np.testing.assert_allclose(np.diff(sequence.rows("path/pose/ts", 0, 9)), 50_000_000)


def test_a_depth_beyond_all_others_is_invalid(tmp_path: Path) -> None:
    """Sky of 10000 m is no depth."""
    folder = tmp_path / "flight"
    folder.mkdir()
    depth = np.full((6, 8, 10), 7, np.float32)
    depth[:, :3] = 10_000
    np.save(folder / "depth.npy", depth)
    (folder / "times.txt").write_text("".join(f"{50_000 * n}\n" for n in range(6)))
    assert load_dialect(drafted(folder, tmp_path)[1]).datasets["path/depth"].invalid == 10_000


def test_flow_from_each_frame_to_the_next(tmp_path: Path) -> None:
    """Flow without intervals, one field fewer than frames, has those between the frames."""
    folder = tmp_path / "flight"
    (folder / "rgb").mkdir(parents=True)
    for number in range(6):
        write_png(folder / f"rgb/{number}.png", np.zeros((8, 10, 3), np.uint8))
    (folder / "times.txt").write_text("".join(f"{40_000 * n}\n" for n in range(6)))
    np.save(folder / "flow.npy", fields_of_flow(5))
    with open_sequence(folder, load_dialect(drafted(folder, tmp_path)[1])) as sequence:
        assert sequence.layout.streams == {"rgb", "flow/25hz"}
        assert not sequence.layout.problems
        intervals_ms = sequence.rows("path/flow/25hz_ts", 0, 5) / 1e6
        np.testing.assert_allclose(intervals_ms - intervals_ms[0, 0], [[40 * n, 40 * n + 40] for n in range(5)])
        np.testing.assert_array_equal(sequence.rows("path/flow/25hz", 4, 5), fields_of_flow(5)[4:])


@pytest.mark.parametrize(
    ("frames", "has_times", "remark"),
    [
        (11, True, "intervals may be 2 steps long each, which is 10 Hz"),
        (6, False, "If they reach from each frame to the next, times_6.txt suffices"),
        (9, True, "Write 5 lines, each with the times"),
    ],
)
def test_flow_without_intervals(frames: int, has_times: bool, remark: str, tmp_path: Path) -> None:
    """The draft states what to write."""
    folder = tmp_path / "flight"
    (folder / "rgb").mkdir(parents=True)
    for number in range(frames):
        write_png(folder / f"rgb/{number}.png", np.zeros((8, 10, 3), np.uint8))
    if has_times:
        (folder / "times.txt").write_text("".join(f"{50_000 * n}\n" for n in range(frames)))
    np.save(folder / "flow.npy", fields_of_flow(5))
    assert remark in drafted(folder, tmp_path)[0]


def write_images(folder: Path, image: np.ndarray) -> None:
    folder.mkdir(parents=True)
    for number in range(6):
        write_png(folder / f"{number}.png", image)


def test_pictures_of_depth_are_no_colour(tmp_path: Path) -> None:
    """What lies in a folder of depth in 8 bits is left out; grey images of a camera of that name are not."""
    folder = tmp_path / "flight"
    grey = np.zeros((8, 10), np.uint8)
    write_images(folder / "depthmaps", grey)
    write_images(folder / "images", grey)
    (folder / "times.txt").write_text("".join(f"{50_000 * n}\n" for n in range(6)))
    text, path = drafted(folder, tmp_path)
    assert load_dialect(path).files["images"] == ("images/*.png",)
    assert "#   depthmaps/*.png" in text
    write_images(tmp_path / "other" / "depth_camera" / "rgb", grey)
    assert '"path/rgb" = { file = "depth_camera_rgb"' in draft_folder(tmp_path / "other", "drafted")


@pytest.mark.parametrize(
    ("mark", "words"),
    [(np.inf, "infinity is taken for invalid"), (0.0, "; 0 is taken for invalid"), (np.nan, "is m\n")],
)
def test_depth_in_three_equal_channels(mark: float, words: str, tmp_path: Path) -> None:
    """It is read from the first one, without its invalid pixels; three different channels are no depth."""
    folder = tmp_path / "flight"
    folder.mkdir()
    depth = np.linspace(2, 9, 6 * 80, dtype=np.float32).reshape(6, 8, 10)
    depth[:, 0, 0] = mark
    np.save(folder / "depth.npy", np.stack([depth, depth, depth], axis=-1))
    (folder / "times.txt").write_text("".join(f"{50_000 * n}\n" for n in range(6)))
    text, path = drafted(folder, tmp_path)
    assert "float images of equal channels; median 2.58" in text
    assert words in text
    with open_sequence(folder, load_dialect(path)) as sequence:
        read_mm = sequence.rows("path/depth", 0, 6)
    expected_mm = np.where(np.arange(80).reshape(8, 10) > 0, depth * np.float32(1000), np.float32(np.nan))
    np.testing.assert_allclose(read_mm, expected_mm, rtol=1e-6)
    np.save(folder / "depth.npy", np.stack([depth, depth + 1, depth], axis=-1))
    assert '"path/depth"' not in draft_folder(folder, "drafted")


@pytest.mark.parametrize("columns", [12, 16])
@pytest.mark.parametrize("has_time", [False, True])
def test_poses_as_rows_of_matrices(columns: int, has_time: bool, tmp_path: Path) -> None:
    """Trajectories of KITTI (12 numbers) and of Replica (16), with times in front or in another file."""
    folder = tmp_path / "flight"
    folder.mkdir()
    matrices = np.tile(np.eye(4), (6, 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = (
        Rotation.random(6, random_state=4).as_matrix(),
        np.arange(18).reshape(6, 3),
    )
    times_s = 0.05 * np.arange(6)
    rows = matrices.reshape(6, 16)[:, :columns]
    np.savetxt(folder / "traj.txt", np.column_stack([times_s, rows]) if has_time else rows)
    if not has_time:
        np.savetxt(folder / "poses_ts.txt", times_s)
    text, path = drafted(folder, tmp_path)
    assert f"{columns} columns that are rotations beside positions" in text
    with open_sequence(folder, load_dialect(path)) as sequence:
        assert sequence.layout.streams == {"pose"}
        np.testing.assert_allclose(sequence.rows("path/pose/position", 0, 6), matrices[:, :3, 3])
        read = Rotation.from_quat(sequence.rows("path/pose/orientation", 0, 6))
        np.testing.assert_allclose(read.as_matrix(), matrices[:, :3, :3], atol=1e-12)
        np.testing.assert_allclose(np.diff(sequence.rows("path/pose/ts", 0, 6)), 50_000_000, atol=1)


def test_files_of_other_formats_are_named(tmp_path: Path) -> None:
    """Depth in a format that is not read is no silent gap."""
    folder = tmp_path / "flight"
    (folder / "depth").mkdir(parents=True)
    for number in range(3):
        (folder / f"depth/{number}.tiff").write_bytes(b"II*")
    np.savetxt(folder / "times.txt", 0.05 * np.arange(3))
    assert "# Not read:\n#   *.tiff, 3 files: a format that is not read" in drafted(folder, tmp_path)[0]


def test_depth_of_a_renderer(tmp_path: Path) -> None:
    """OpenEXR with depth as R, G and B, infinite at the sky."""
    folder = tmp_path / "flight"
    (folder / "Depth_exr").mkdir(parents=True)
    depth_m = np.full((8, 10), 3.5, np.float32)
    depth_m[:2] = np.inf
    for number in range(6):
        channels = dict.fromkeys("RGB", depth_m)
        OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, channels).write(str(folder / f"Depth_exr/{number}.exr"))
    np.savetxt(folder / "poses_ts.txt", 0.05 * np.arange(6))
    with open_sequence(folder, load_dialect(drafted(folder, tmp_path)[1])) as sequence:
        read_mm = sequence.rows("path/depth", 5, 6)[0]
    np.testing.assert_array_equal(read_mm, np.where(np.isinf(depth_m), np.nan, 3500))


def test_one_matrix_is_no_trajectory(tmp_path: Path) -> None:
    """A mounting without a rotation has four rows of unit length, and these are no quaternions."""
    folder = tmp_path / "flight"
    folder.mkdir()
    np.save(folder / "extrinsics.npy", np.eye(4))
    text, _ = drafted(folder, tmp_path)
    assert "path/pose" not in text
    assert "#   extrinsics.npy  4 x 4" in text


def test_depth_of_three_channels_names_the_remedy(tmp_path: Path) -> None:
    """Without columns the message says how a channel is chosen."""
    folder = tmp_path / "flight"
    folder.mkdir()
    np.save(folder / "depth.npy", np.ones((6, 8, 10, 3), np.float32))
    (folder / "times.txt").write_text("".join(f"{50_000 * n}\n" for n in range(6)))
    path = tmp_path / "mine.toml"
    lines = '[files]\ndepth = "depth.npy"\ntimes = "times.txt"\n[datasets]\n"path/depth_ts" = { file = "times" }\n'
    path.write_text(f'name = "mine"\n{lines}"path/depth" = {{ file = "depth" }}\n', "utf-8")
    (problem,) = layout_of(folder, path).problems
    assert problem.message.endswith("got (6, 8, 10, 3); columns = [0] reads the first of the channels")
