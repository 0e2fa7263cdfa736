"""Small files of other makers, written by hand from what is known of them."""

from pathlib import Path

import h5py
import numpy as np

EPOCH_S = 1_504_645_177.0


def write_purdue_lab(path: Path) -> Path:
    """The lab's logging scripts: float64 microseconds, metres, events in columns, no attributes."""
    with h5py.File(path, "w") as file:
        file["path/depth"] = np.full((3, 6, 8), 2.5, dtype=np.float32)
        file["path/depth_ts"] = np.array([0.25, 20_000.5, 40_000.75])
        file["path/img"] = np.full((3, 6, 8, 3), 9, dtype=np.uint8)
        file["path/imgts"] = np.array([0.25, 20_000.5, 40_000.75])
        file["path/events"] = np.array([[1, 2, 100.5, 1], [7, 5, 200.0, 0], [3, 4, 30_000.0, 1]], dtype=np.float64)
        file["path/a"] = np.zeros((4, 3))
        file["path/w"] = np.zeros((4, 3))
    return path


def write_dsec(path: Path) -> Path:
    """DSEC's events.h5: unsigned 32-bit microseconds from an offset."""
    with h5py.File(path, "w") as file:
        file["events/x"] = np.array([1, 2], dtype=np.uint16)
        file["events/y"] = np.array([3, 4], dtype=np.uint16)
        file["events/t"] = np.array([10, 20], dtype=np.uint32)
        file["events/p"] = np.array([1, 0], dtype=np.uint8)
        file["ms_to_idx"] = np.array([0], dtype=np.uint64)
        file["t_offset"] = np.int64(49_599_300_523)
    return path


def write_mvsec(path: Path) -> Path:
    """MVSEC's data file: seconds since 1970, polarity of both signs, grey images."""
    with h5py.File(path, "w") as file:
        rows = [[1, 2, EPOCH_S, 1], [5, 6, EPOCH_S + 0.001, -1], [3, 4, EPOCH_S + 0.04, 1]]
        file["davis/left/events"] = np.array(rows)
        file["davis/left/image_raw"] = np.full((2, 6, 8), 50, dtype=np.uint8)
        file["davis/left/image_raw_ts"] = EPOCH_S + np.array([0.0, 0.03125])
        file["davis/left/image_raw_event_inds"] = np.array([-1, 1])
        file["davis/left/imu"] = np.zeros((5, 6))
    return path


def write_v2e(path: Path) -> Path:
    """v2e's file: events t, x, y, p in 32 bits, grey frames, the number of events until each."""
    with h5py.File(path, "w") as file:
        file["events"] = np.array([[10, 1, 3, 1], [20, 2, 4, 0], [30, 2, 4, 0]], dtype=np.uint32)
        file["frame"] = np.full((2, 6, 8), 50, dtype=np.uint8)
        file["frame_ts"] = np.array([0, 20], dtype=np.uint32)
        file["frame_idx"] = np.array([0, 2], dtype=np.uint64)
    return path


def write_m3ed(path: Path) -> Path:
    """M3ED's data file: left Prophesee, colour OVC, IMU."""
    with h5py.File(path, "w") as file:
        for name, values in (("x", [1, 2]), ("y", [3, 4]), ("t", [10, 20_000]), ("p", [1, 0])):
            file[f"prophesee/left/{name}"] = np.array(values)
        file["prophesee/left/ms_map_idx"] = np.array([0, 1])
        file["ovc/rgb/data"] = np.zeros((2, 6, 8, 3), dtype=np.uint8)
        file["ovc/ts"] = np.array([0, 40_000])
        for camera in ("prophesee/left", "ovc/rgb"):
            file[f"{camera}/calib/camera_model"] = "pinhole"
            file[f"{camera}/calib/distortion_model"] = "radtan"
            file[f"{camera}/calib/distortion_coeffs"] = np.array([-0.05, 0.09, 1e-4, -2e-4])
            file[f"{camera}/calib/intrinsics"] = np.array([9.0, 9.0, 3.5, 2.5])
            file[f"{camera}/calib/resolution"] = np.array([8, 6])
            file[f"{camera}/calib/T_to_prophesee_left"] = np.eye(4)
        file["ovc/ts_map_prophesee_left_t"] = np.array([0, 2])
        file["ovc/imu/accel"] = np.zeros((3, 3))
        file["ovc/imu/omega"] = np.zeros((3, 3))
        file["ovc/imu/ts"] = np.array([0, 2_500, 5_000])
    return path
