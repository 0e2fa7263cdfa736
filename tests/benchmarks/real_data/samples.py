"""Turn a path into a sequence that can be checked: by an import, by a dialect, or as a pair of frames with its flow."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import MisuseError

DIALECTS: Final = Path(__file__).parent
IMAGE_SUFFIXES: Final = frozenset({".png", ".ppm", ".jpg"})

_FLO_TAG: Final = np.float32(202021.25)
_FLO_UNKNOWN: Final = 1e9
"""Larger values mark pixels without flow (http://vision.middlebury.edu/flow/code/flow-code/README.txt)."""

_KITTI_ZERO, _KITTI_PER_PX = 1 << 15, 64
"""Flow of KITTI: ``(v - 2^15) / 64`` px and a channel of validity (development kit of KITTI 2015)."""

_INTERVAL_US: Final = 100_000
"""Assumed between the frames of a pair, whose times nobody states: a residual flow in px does not depend on it."""


@dataclass(frozen=True, slots=True)
class Sample:
    """A sequence, and how it is read.

    Attributes
    ----------
    given
        How it was given, in words.
    sequence
        What is checked.
    dialect, metadata
        Files for the options of these names; None: not needed.
    """

    given: str
    sequence: Path
    dialect: Path | None = None
    metadata: Path | None = None


def sample_of(path: Path, option: str, work: Path) -> Sample:
    """Return the sequence of a path.

    Parameters
    ----------
    path
        A recording; a folder with IMU and ground truth of EuRoC, with frames and ground truth of the DAVIS dataset, or
        with two images and a file of flow; or any sequence that is read without a dialect.
    option
        For a recording: its resolution (``640x480``), or the topic of a stream (``pose=/odom``); else empty.
    work
        An empty folder for what has to be written.

    Raises
    ------
    MisuseError
        It is none of these, or a recording that cannot be imported; the message is that of the import.
    """
    if path.is_file() or (path / "metadata.yaml").is_file():
        return _imported(path, option, work)
    if any((path / name).is_file() for name in ("mav0/imu0/data.csv", "imu.txt", "imu.csv")):
        return Sample("dialect of the study, `euroc.toml`", path, DIALECTS / "euroc.toml")
    if (path / "calib.txt").is_file() and (path / "images.txt").is_file():
        return _davis(path, work)
    flows = [file for file in sorted(path.iterdir()) if file.suffix == ".flo" or file.stem.startswith("flow")]
    images = [file for file in sorted(path.iterdir()) if file.suffix in IMAGE_SUFFIXES and file not in flows]
    if len(flows) == 1 and len(images) == 2:
        return _pair(images, flows[0], work)
    raise MisuseError(f"Expected a sample of a kind that the study knows, got {path}; see tests/benchmarks/real_data")


def _imported(path: Path, option: str, work: Path) -> Sample:
    target, options = work / "imported.h5", []
    if "=" in option:
        stream, _, topic = option.partition("=")
        (work / "topics.toml").write_text(f'[topics]\n{stream} = "{topic}"\n', "utf-8")
        options = ["--topics", str(work / "topics.toml")]
    elif option:
        options = ["--resolution", option]
    command = [
        sys.executable,
        "-m",
        "fedora_qa",
        "import",
        str(path),
        "-o",
        str(target),
        "--kind",
        "recorded",
        *options,
    ]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    if run.returncode:
        raise MisuseError(run.stderr.strip().splitlines()[-1])
    return Sample(f"`fedora-qa import {' '.join([path.name, *([option] if option else [])])}`", target)


def _davis(path: Path, work: Path) -> Sample:
    """Declare the camera: ``calib.txt`` has fx, fy, cx, cy, k1, k2, p1, p2, k3."""
    fx, fy, cx, cy, *distortion = np.loadtxt(path / "calib.txt").tolist()
    height, width = _image(next((path / "images").glob("*.png"))).shape[:2]
    K = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    # The poses are those of the camera.
    side = _camera("rgb", width, height, K, np.eye(4).tolist())
    side += f'"metadata/cameras/rgb/distortion_model" = "radtan"\n"metadata/cameras/rgb/distortion" = {distortion}\n'
    metadata = work / "side.toml"
    metadata.write_text(f"[metadata]\n{side}", "utf-8")
    return Sample("dialect of the study, `davis.toml`, and a side file", path, DIALECTS / "davis.toml", metadata)


def _pair(images: list[Path], flow: Path, work: Path) -> Sample:
    folder = work / "pair"
    (folder / "images").mkdir(parents=True)
    for number, path in enumerate(images):
        cv2.imwrite(str(folder / f"images/{number:06}.png"), _image(path))
    np.save(folder / "flow.npy", (read_flo(flow) if flow.suffix == ".flo" else read_kitti(flow))[np.newaxis])
    (folder / "image_times.txt").write_text(f"0\n{_INTERVAL_US}\n", "utf-8")
    (folder / "flow_times.txt").write_text(f"0 {_INTERVAL_US}\n", "utf-8")
    height, width = _image(images[0]).shape[:2]
    # One camera for both, of any focal length: no check of a pair without depth and poses projects.
    K = [[float(width), 0.0, (width - 1) / 2], [0.0, float(width), (height - 1) / 2], [0.0, 0.0, 1.0]]
    T_body_camera = [[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]]
    cameras = [_camera(name, width, height, K, T_body_camera) for name in ("rgb", "events")]
    metadata = work / "side.toml"
    metadata.write_text(f"[metadata]\n{''.join(cameras)}", "utf-8")
    given = "frames and flow in a folder of the study, `flow_pair.toml`"
    return Sample(given, folder, DIALECTS / "flow_pair.toml", metadata)


def read_flo(path: Path) -> NDArray[np.float32]:
    """Return the flow (H, W, 2), px, of a file of Middlebury's format; unknown flow is NaN."""
    content = path.read_bytes()
    width, height = np.frombuffer(content[4:12], "<i4").tolist() if len(content) >= 12 else (0, 0)
    if np.frombuffer(content[:4], "<f4")[:1] != _FLO_TAG or len(content) != 12 + 8 * width * height:
        raise MisuseError(f"Expected a .flo file (tag {_FLO_TAG}, width, height, pairs of float32), got {path}")
    flow = np.frombuffer(content[12:], "<f4").reshape(height, width, 2).copy()
    flow[(np.abs(flow) > _FLO_UNKNOWN).any(axis=-1)] = np.nan
    return flow


def read_kitti(path: Path) -> NDArray[np.float32]:
    """Return the flow (H, W, 2), px, of a 16-bit image of KITTI; invalid flow is NaN."""
    blue_green_red = _image(path)
    flow = ((blue_green_red[..., 2:0:-1].astype(np.float32) - _KITTI_ZERO) / _KITTI_PER_PX).astype(np.float32)
    flow[blue_green_red[..., 0] == 0] = np.nan
    return flow


def _camera(name: str, width: int, height: int, K: object, T_body_camera: object) -> str:
    values = {"width": width, "height": height, "K": K, "T_body_camera": T_body_camera}
    return "".join(f'"metadata/cameras/{name}/{key}" = {value}\n' for key, value in values.items())


def _image(path: Path) -> NDArray[Any]:
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise MisuseError(f"Expected an image that OpenCV decodes, got {path}")
    return image
