"""Plants real faults, most of which have no check of their own: ``python -m tests.benchmarks.blind_spots``.

Prints, as markdown, from which size each is found; docs/blind-spots.md holds the table. The planters share nothing
with the faults of the generator. Some minutes on one core.
"""

import shutil
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, map_coordinates
from scipy.spatial.transform import Rotation

from fedora_qa.conventions import MM_PER_M
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from tests.support.sequences import make_sequence

Floats = NDArray[np.floating[Any]]

SCENES, TRAFFIC = ("park-day", "park-noisy"), "park-traffic"
GYRO, ACCEL = "path/imu/angular_velocity", "path/imu/linear_acceleration"
POSITION, ORIENTATION = "path/pose/position", "path/pose/orientation"
EVENTS: Final = tuple(f"path/events/{column}" for column in "xytp")
INDEX_MAPS: Final = {"metadata/rgb_to_event": "path/rgb_ts", "metadata/depth_to_event": "path/depth_ts"}
EVENT_STREAM: Final = (*EVENTS, *INDEX_MAPS)
FLOW: Final = tuple(f"path/flow/{rate_hz}hz" for rate_hz in (10, 25, 50))
MOVING: Final = tuple(f"{path}_moving" for path in FLOW)
DEPTH, RGB = "path/depth", "path/rgb"


class Fault(NamedTuple):
    """A fault, its sizes from small to large, and all objects of a file that it alters."""

    name: str
    plant: Callable[[h5py.File, float], None]
    sizes: tuple[float, ...]
    unit: str
    changes: tuple[str, ...]
    scenes: tuple[str, ...] = SCENES


def gain(file: h5py.File, percent: float, path: str) -> None:
    """Multiply all values."""
    file[path][...] = file[path][:] * (1 + percent / 100)


def saturation(file: h5py.File, percent: float, path: str) -> None:
    """Clip all axes at a share of the largest value of any axis."""
    values = file[path][:]
    limit = percent / 100 * np.abs(values).max()
    file[path][...] = np.clip(values, -limit, limit)


def smoothed_poses(file: h5py.File, sigma_ms: float) -> None:
    """Filter positions and orientations by a Gaussian; ends are continued so that a constant speed stays."""
    sigma = sigma_ms * 1e3 / np.median(np.diff(file["path/pose/ts"][:]))
    orientations = file[ORIENTATION][:]
    orientations[1:] *= np.cumprod(np.sign(np.sum(orientations[1:] * orientations[:-1], axis=1)))[:, None]
    file[POSITION][...] = _smooth(file[POSITION][:], sigma)
    orientations = _smooth(orientations, sigma)
    file[ORIENTATION][...] = orientations / np.linalg.norm(orientations, axis=1, keepdims=True)


def _smooth(values: Floats, sigma: float) -> Floats:
    margin = len(values) - 1
    padded = np.pad(values, ((margin, margin), (0, 0)), mode="reflect", reflect_type="odd")
    return np.asarray(gaussian_filter1d(padded, sigma, axis=0)[margin:-margin])


def yaw_jump(file: h5py.File, yaw_deg: float, poses: int | None = None) -> None:
    """Turn the heading of poses from the middle of the file on, of all of them by default."""
    middle = len(file[ORIENTATION]) // 2
    rows = slice(middle, middle + poses if poses else None)
    R_world_body = Rotation.from_quat(file[ORIENTATION][rows])
    file[ORIENTATION][rows] = (Rotation.from_euler("z", yaw_deg, degrees=True) * R_world_body).as_quat()


def flow_noise(file: h5py.File, sigma_px: float) -> None:
    """Add white noise to both components of all rates."""
    random = np.random.default_rng(1)
    for path in FLOW:
        file[path][...] = file[path][:] + random.normal(0.0, sigma_px, file[path].shape)


def depth_noise(file: h5py.File, percent: float) -> None:
    """Add white noise in proportion to depth, except where depth would leave its declared range."""
    depth_mm = file[DEPTH][:]
    noisy_mm = depth_mm * (1 + np.random.default_rng(2).normal(0.0, percent / 100, depth_mm.shape))
    nearest_mm, farthest_mm = MM_PER_M * file["metadata/depth_range"][:]
    file[DEPTH][...] = np.where((noisy_mm >= nearest_mm) & (noisy_mm <= farthest_mm), noisy_mm, depth_mm)


def shot_noise(file: h5py.File, rate_hz: float) -> None:
    """Add events of random pixel, time and polarity."""
    random = np.random.default_rng(3)
    camera = file["metadata/cameras/events"].attrs
    first_us, last_us = file["path/rgb_ts"][0], file["path/rgb_ts"][-1]
    count = random.poisson(rate_hz * camera["width"] * camera["height"] * (last_us - first_us) / 1e6)
    ranges = ((0, camera["width"]), (0, camera["height"]), (first_us + 1, last_us + 1), (0, 2))
    added = [random.integers(*limits, count) for limits in ranges]
    _store_events(file, [np.concatenate([file[path][:], new]) for path, new in zip(EVENTS, added, strict=True)])


def dead_pixels(file: h5py.File, count: float) -> None:
    """Remove all events of some pixels that have events."""
    pixels = _pixels(file)
    dead = np.random.default_rng(4).choice(np.unique(pixels), int(count), replace=False)
    _store_events(file, [file[path][:][~np.isin(pixels, dead)] for path in EVENTS])


def refractory_time(file: h5py.File, time_ms: float) -> None:
    """Remove events that follow a kept event of their pixel within a time, and declare no such time."""
    pixels, times_us = _pixels(file).tolist(), file["path/events/t"][:].tolist()
    last_us: dict[int, int] = {}
    keep = np.zeros(len(times_us), dtype=np.bool_)
    for row, (pixel, time_us) in enumerate(zip(pixels, times_us, strict=True)):
        if pixel not in last_us or time_us - last_us[pixel] >= time_ms * 1e3:
            keep[row], last_us[pixel] = True, time_us
    _store_events(file, [file[path][:][keep] for path in EVENTS])
    file["metadata/events"].attrs["refractory_us"] = 0


def _pixels(file: h5py.File) -> NDArray[np.int64]:
    width = int(file["metadata/cameras/events"].attrs["width"])
    return np.asarray(file["path/events/y"][:].astype(np.int64) * width + file["path/events/x"][:])


def _store_events(file: h5py.File, columns: Sequence[NDArray[Any]]) -> None:
    """Replace events, in canonical order (t, y, x, p), and the index maps that follow from them."""
    x, y, t, p = columns
    order = np.lexsort((p, x, y, t))
    for path, values in zip(EVENTS, columns, strict=True):
        file[path].resize(len(order), axis=0)
        file[path][...] = values[order]
    for path, frames in INDEX_MAPS.items():
        file[path][...] = np.searchsorted(t[order], file[frames][:])


def motion_blur(file: h5py.File, exposure_ms: float) -> None:
    """Average each frame along the flow over an exposure about its stamp, which stays undeclared."""
    steps_ms = exposure_ms * (np.arange(5) - 2) / 5
    _read_frames_at(file, lambda flow_px_ms: [-step_ms * flow_px_ms for step_ms in steps_ms])


def rolling_shutter(file: h5py.File, readout_ms: float) -> None:
    """Move each row by its flow times its delay after the stamp, which is the middle row's."""
    delays_ms = readout_ms * np.linspace(-0.5, 0.5, file[RGB].shape[1])[:, None, None]
    _read_frames_at(file, lambda flow_px_ms: [-delays_ms * flow_px_ms])


def lens_distortion(file: h5py.File, k1: float) -> None:
    """Show at p (1 + k1 r^2) what lies at p, both over the focal length (Brown 1966)."""
    K = file["metadata/cameras/rgb"].attrs["K"]
    grid_px = np.moveaxis(np.indices(file[RGB].shape[1:3])[::-1], 0, -1)
    distorted = ideal = (grid_px - K[:2, 2]) / np.diag(K)[:2]
    for _ in range(50):
        ideal = distorted / (1 + k1 * np.sum(ideal**2, axis=-1, keepdims=True))
    _read_frames_at(file, lambda _: [(ideal - distorted) * np.diag(K)[:2]])


def _read_frames_at(file: h5py.File, offsets_px: Callable[[Floats], Sequence[Floats]]) -> None:
    """Replace frames by their mean at offsets (h, w, 2) that follow from flow; the last flow serves the last frame."""
    flow, intervals_us = file[FLOW[-1]], file[f"{FLOW[-1]}_ts"][:]
    for frame, image in enumerate(file[RGB][:].astype(np.float64)):
        row = min(frame, len(flow) - 1)
        flow_px_ms = 1e3 * flow[row].astype(np.float64) / np.diff(intervals_us[row])
        flow_px_ms = np.where(np.isnan(flow_px_ms), np.nanmedian(flow_px_ms, axis=(0, 1)), flow_px_ms)
        places = [np.indices(image.shape[:2]) + np.moveaxis(px, -1, 0)[::-1] for px in offsets_px(flow_px_ms)]
        for channel in range(3):
            read = np.mean([map_coordinates(image[..., channel], place, mode="mirror") for place in places], axis=0)
            file[RGB][frame, ..., channel] = np.rint(np.clip(read, 0, 255))


def static_flow(file: h5py.File, rates: float) -> None:
    """Compute the flow of all pixels from depth and pose, as if nothing moved, and leave out the masks."""
    file["metadata/flow"].attrs["model"] = "rigid"
    K, T_body_camera = (file["metadata/cameras/depth"].attrs[name] for name in ("K", "T_body_camera"))
    T_world_body = np.tile(np.eye(4), (len(file[POSITION]), 1, 1))
    T_world_body[:, :3, :3] = Rotation.from_quat(file[ORIENTATION][:]).as_matrix()
    T_world_body[:, :3, 3] = file[POSITION][:]
    rows, columns = np.indices(file[DEPTH].shape[1:])
    pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1)
    for path in FLOW[: int(rates)]:
        del file[f"{path}_moving"]
        for row, interval_us in enumerate(file[f"{path}_ts"][:]):
            start, stop = np.searchsorted(file["path/pose/ts"][:], interval_us)
            T_1_0 = np.linalg.inv(T_world_body[stop] @ T_body_camera) @ T_world_body[start] @ T_body_camera
            depth_m = file[DEPTH][np.searchsorted(file["path/depth_ts"][:], interval_us[0])] / MM_PER_M
            projected = (depth_m[..., None] * (pixels @ np.linalg.inv(K).T) @ T_1_0[:3, :3].T + T_1_0[:3, 3]) @ K.T
            ahead = np.where(projected[..., 2:] > 0, projected[..., 2:], np.nan)
            file[path][row] = projected[..., :2] / ahead - pixels[..., :2]


FAULTS: Final = (
    Fault("nothing", lambda file, size: None, (0.0,), "", (), (*SCENES, TRAFFIC)),
    Fault("gain of the gyro", partial(gain, path=GYRO), (1.0, 2.0, 5.0), "%", (GYRO,)),
    Fault("gain of the accelerometer", partial(gain, path=ACCEL), (1.0, 2.0, 5.0), "%", (ACCEL,)),
    Fault("range of the gyro, of its largest value", partial(saturation, path=GYRO), (95.0, 80.0, 50.0), "%", (GYRO,)),
    Fault("range of the accelerometer", partial(saturation, path=ACCEL), (95.0, 80.0, 50.0), "%", (ACCEL,)),
    Fault("smoothed poses (sigma)", smoothed_poses, (10.0, 20.0, 50.0, 100.0), "ms", (POSITION, ORIENTATION)),
    Fault("heading modulo pi", lambda file, n: yaw_jump(file, 180.0, int(n)), (1.0, 10.0), "poses", (ORIENTATION,)),
    Fault("yaw that jumps, and stays so", yaw_jump, (0.2, 1.0, 5.0), "deg", (ORIENTATION,)),
    Fault("noise of flow", flow_noise, (0.05, 0.2, 0.5), "px", FLOW),
    Fault("noise of depth", depth_noise, (0.2, 1.0, 3.0), "%", (DEPTH,)),
    Fault("shot noise of events, a pixel", shot_noise, (0.1, 1.0, 5.0), "Hz", EVENT_STREAM),
    Fault("motion blur (exposure)", motion_blur, (2.0, 5.0, 10.0), "ms", (RGB,)),
    Fault("rolling shutter (first to last row)", rolling_shutter, (5.0, 10.0, 20.0), "ms", (RGB,)),
    Fault("lens distortion of frames (k1)", lens_distortion, (-0.01, -0.05, -0.2), "", (RGB,)),
    Fault("moving objects, static flow", static_flow, (3.0,), "rates", (*FLOW, *MOVING, "metadata/flow"), (TRAFFIC,)),
    Fault("dead pixels", dead_pixels, (1.0, 10.0, 100.0), "px", EVENT_STREAM),
    Fault("refractory time", refractory_time, (0.1, 1.0, 5.0), "ms", (*EVENT_STREAM, "metadata/events")),
)


def main() -> None:
    """Plant, check, and print the table."""
    print("| fault | unit | scene | found | not found | first check that fails | first diagnosis |\n|" + " --- |" * 7)
    with tempfile.TemporaryDirectory() as folder:
        clean = {scene: make_sequence(Path(folder) / f"{scene}.h5", scene) for scene in (*SCENES, TRAFFIC)}
        for fault in FAULTS:
            for scene in fault.scenes:
                print(row_of(fault, clean[scene]), flush=True)


def row_of(fault: Fault, clean: Path) -> str:
    """Plant all sizes of a fault in a scene, and return their row; check and diagnosis are of the first size found."""
    sizes: dict[bool, list[str]] = {True: [], False: []}
    first = " | "
    for size in fault.sizes:
        target = Path(shutil.copy(clean, clean.with_name("faulty.h5")))
        with h5py.File(target, "r+") as file:
            fault.plant(file, size)
        record = check_file(target, CheckOptions(effort="full", profile="release", evidence=None)).record
        if record.verdict == "findings" and not sizes[True]:
            check = next(result.check for result in record.results if result.outcome == "failed")
            first = f"`{check}` | `{record.diagnoses[0].stream}:{record.diagnoses[0].cause}`"
        sizes[record.verdict == "findings"].append(f"{size:g}")
    found, missed = ", ".join(sizes[True]), ", ".join(sizes[False])
    return f"| {fault.name} | {fault.unit} | {clean.stem} | {found} | {missed} | {first} |"


if __name__ == "__main__":
    main()
