"""A folder laid out like a sequence of DSEC, with content of the reference generator.

Written by hand from what is documented of DSEC (https://dsec.ifi.uzh.ch/data-format), so that an error of the dialect
is no error of the writer. The event camera has the lens of the source, and nothing moves by itself: in that it is no
recording.
"""

from pathlib import Path
from typing import Any

import cv2
import h5py
import hdf5plugin
import numpy as np
import yaml

BASELINE_M = 0.6
T_OFFSET_US = 49_599_300_523
IMAGE_STRIDE = 1
DEPTH_STRIDE = 5
Array = np.ndarray[Any, Any]


def write_dsec_folder(
    source: Path, folder: Path, baseline_m: float = BASELINE_M, depth_stride: int = DEPTH_STRIDE
) -> Path:
    """Write a canonical file of the generator as a folder of DSEC, and return the folder.

    Disparity of 256 px and more does not fit into 16 bits and is invalid: large images need a short baseline.
    """
    for name in ("events/left", "images/left/rectified", "optical_flow/forward", "disparity/event", "calibration"):
        (folder / name).mkdir(parents=True)
    with h5py.File(source) as file:
        _events(file, folder / "events/left")
        _images(file, folder / "images")
        _flow(file, folder / "optical_flow")
        _disparity(file, folder / "disparity", baseline_m, depth_stride)
        cameras = {name: dict(file[f"metadata/cameras/{name}"].attrs) for name in ("rgb", "depth", "events")}
    _calibration(cameras, folder / "calibration/cam_to_cam.yaml", baseline_m)
    return folder


def write_side_metadata(path: Path) -> Path:
    """Declare what is true of the stand-in and of no file of DSEC: a still world."""
    path.write_text('[metadata]\n"metadata/flow/model" = "rigid"\n', "utf-8")
    return path


def write_png(path: Path, image: Array) -> None:
    """Write an image, channels R, G, B."""
    assert cv2.imwrite(str(path), image if image.ndim == 2 else image[..., ::-1])


def encode_flow(flow_px: Array) -> Array:
    """(H, W, 2) px to (H, W, 3) of 16 bits: 2^15 + 128 u, 2^15 + 128 v, valid."""
    valid = np.isfinite(flow_px).all(axis=-1)
    values = np.rint(np.where(valid[..., None], flow_px.astype(np.float64), 0.0) * 128 + 2**15)
    valid &= ((values >= 0) & (values <= 65535)).all(axis=-1)
    return np.dstack([np.clip(values, 0, 65535), valid]).astype(np.uint16)


def _events(file: h5py.File, folder: Path) -> None:
    t = file["path/events/t"][:]
    with h5py.File(folder / "events.h5", "w") as written:
        blosc = hdf5plugin.Blosc(cname="zstd")
        for name, dtype in (("x", np.uint16), ("y", np.uint16), ("t", np.uint32), ("p", np.uint8)):
            written.create_dataset(f"events/{name}", data=file[f"path/events/{name}"][:].astype(dtype), **blosc)
        milliseconds = np.arange(int(t[-1]) // 1000 + 1) * 1000
        written["ms_to_idx"] = np.searchsorted(t, milliseconds).astype(np.uint64)
        written["t_offset"] = np.int64(T_OFFSET_US)
    events, depth = (file[f"metadata/cameras/{name}"].attrs for name in ("events", "depth"))
    width, height = int(events["width"]), int(events["height"])
    pixels = np.dstack(np.meshgrid(np.arange(width), np.arange(height))).reshape(-1, 1, 2).astype(np.float32)
    # Its default of five steps is not enough for strong lenses.
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-9)
    rectified = cv2.undistortPoints(
        pixels.astype(np.float64), events["K"], _distortion(events), R=_rectifying(events, depth), P=depth["K"],
        criteria=criteria,
    )  # fmt: skip
    with h5py.File(folder / "rectify_map.h5", "w") as written:
        written["rectify_map"] = rectified.reshape(height, width, 2).astype(np.float32)


def _images(file: h5py.File, folder: Path) -> None:
    rows = range(0, len(file["path/rgb_ts"]), IMAGE_STRIDE)
    for number, row in enumerate(rows):
        write_png(folder / f"left/rectified/{number:06d}.png", file["path/rgb"][row])
    times = file["path/rgb_ts"][:][::IMAGE_STRIDE] + T_OFFSET_US
    (folder / "timestamps.txt").write_text("".join(f"{time}\n" for time in times))


def _flow(file: h5py.File, folder: Path) -> None:
    intervals = file["path/flow/10hz_ts"][:] + T_OFFSET_US
    for row in range(len(intervals)):
        write_png(folder / f"forward/{5 * row:06d}.png", encode_flow(file["path/flow/10hz"][row]))
    lines = ["# from_timestamp_us, to_timestamp_us", *(f"{start}, {stop}" for start, stop in intervals)]
    (folder / "forward_timestamps.txt").write_text("\n".join(lines) + "\n")


def _disparity(file: h5py.File, folder: Path, baseline_m: float, stride: int) -> None:
    focal_px = file["metadata/cameras/depth"].attrs["K"][0, 0]
    rows = range(0, len(file["path/depth_ts"]), stride)
    for number, row in enumerate(rows):
        depth_m = file["path/depth"][row] / 1000
        disparity = np.rint(np.nan_to_num(256 * focal_px * baseline_m / depth_m, nan=0.0))
        write_png(folder / f"event/{5 * number:06d}.png", np.where(disparity < 65536, disparity, 0).astype(np.uint16))
    times = file["path/depth_ts"][:][::stride] + T_OFFSET_US
    (folder / "timestamps.txt").write_text("".join(f"{time}\n" for time in times))


def _distortion(camera: Any) -> Array:
    """k1, k2, p1, p2 of a camera, all 0 where it has no lens."""
    return np.array(camera.get("distortion", np.zeros(4)), np.float64)


def _rectifying(camera: Any, view: Any) -> Array:
    """The rotation (3, 3) from a camera to the view that its images are rectified to."""
    rotation: Array = view["T_body_camera"][:3, :3].T @ camera["T_body_camera"][:3, :3]
    return rotation


def _calibration(cameras: dict[str, dict[str, Any]], path: Path, baseline_m: float) -> None:
    def intrinsics(name: str) -> dict[str, Any]:
        K = cameras[name]["K"]
        numbers = [float(K[0, 0]), float(K[1, 1]), float(K[0, 2]), float(K[1, 2])]
        return {
            "camera_matrix": numbers,
            "camera_model": "pinhole",
            "distortion_coeffs": _distortion(cameras[name]).tolist(),
            "distortion_model": "radtan",
            "resolution": [int(cameras[name]["width"]), int(cameras[name]["height"])],
        }

    # A turn of half a degree between both views, taken back by the rectification of the colour camera.
    angle = np.deg2rad(0.5)
    R_rect1 = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    T_10 = np.eye(4)
    T_10[:3, :3] = R_rect1.T
    # Points of the depth camera in the colour camera.
    offset = np.linalg.inv(cameras["rgb"]["T_body_camera"]) @ cameras["depth"]["T_body_camera"]
    R_rect0 = np.eye(4)
    R_rect0[:3, :3] = _rectifying(cameras["events"], cameras["depth"])
    T_10 = T_10 @ offset @ R_rect0
    focal, cx, cy = (float(cameras["depth"]["K"][place]) for place in ((0, 0), (0, 2), (1, 2)))
    Q = [[1.0, 0, 0, -cx], [0, 1.0, 0, -cy], [0, 0, 0, focal], [0, 0, 1 / baseline_m, 0]]
    document = {
        "intrinsics": {
            "cam0": intrinsics("events"), "camRect0": intrinsics("depth"), "camRect1": intrinsics("rgb"),
        },
        "extrinsics": {"R_rect0": R_rect0[:3, :3].tolist(), "R_rect1": R_rect1.tolist(), "T_10": T_10.tolist()},
        "disparity_to_depth": {"cams_03": Q},
    }  # fmt: skip
    path.write_text(yaml.safe_dump(document), "utf-8")
