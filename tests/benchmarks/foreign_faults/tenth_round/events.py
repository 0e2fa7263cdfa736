"""Events that augmentations, readers, writers and rectifications change, and maps into them."""

import cv2
import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.benchmarks.foreign.rows import replace_values, update_index_maps
from tests.benchmarks.foreign_faults.fourth_round.events import COLUMNS, ROWS
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA, COLOUR_MAP, DEPTH_MAP
from tests.benchmarks.foreign_faults.second_round.events import TIME, keep_events, sensor_size, sort_events


def _move(file: h5py.File, columns: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
    """Give events the whole pixels next to these places; what leaves the sensor is lost."""
    width, height = sensor_size(file)
    columns, rows = np.rint(columns), np.rint(rows)
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    for key, values, extent in ((COLUMNS, columns, width), (ROWS, rows, height)):
        replace_values(file, key, np.clip(values, 0, extent - 1).astype(file[key].dtype))
    keep_events(file, inside)


def columns_wrap_round(file: h5py.File, plan: Plan) -> None:
    """Columns are those so many pixels further, and begin again behind the last one."""
    columns = file[COLUMNS][...]
    moved = (columns.astype(np.int64) + int(plan.size)) % sensor_size(file)[0]
    replace_values(file, COLUMNS, moved.astype(columns.dtype))
    sort_events(file)


def skewed(file: h5py.File, plan: Plan) -> None:
    """Times since the first event are stretched by so many percent, and 1.7 to 6.3 ms are added."""
    timestamps_us = file[TIME][...]
    stretched_us = (timestamps_us - timestamps_us[0]) * (1 + plan.size / 100)
    late_us = 1000 * plan.random.uniform(1.7, 6.3)
    replace_values(file, TIME, timestamps_us[0] + np.rint(stretched_us + late_us).astype(np.int64))
    update_index_maps(file)


def scattered(file: h5py.File, plan: Plan) -> None:
    """Places have white noise of that standard deviation, px."""
    noise = plan.random.normal(0.0, plan.size, (2, len(file[TIME])))
    _move(file, file[COLUMNS][...] + noise[0], file[ROWS][...] + noise[1])
    sort_events(file)


def held_behind_an_outlier(file: h5py.File, plan: Plan) -> None:
    """One time, at the plan's begin, is that of the plan's end, and none after it may be less."""
    timestamps_us = file[TIME][...]
    within = np.flatnonzero(plan.times_us(timestamps_us))
    timestamps_us[within[0]] = timestamps_us[within[-1]]
    replace_values(file, TIME, np.maximum.accumulate(timestamps_us))
    sort_events(file)


def chunk_of_the_next(file: h5py.File, plan: Plan) -> None:
    """The plan's events are cut into two chunks of equal length, and the second was written in place of the first."""
    rows = plan.rows(len(file[TIME]))
    half = (rows.stop - rows.start) // 2
    for name in "xytp":
        key = f"path/events/{name}"
        values = file[key][...]
        values[rows.start : rows.start + half] = values[rows.start + half : rows.start + 2 * half]
        replace_values(file, key, values)
    sort_events(file)


def rectified_for_stereo(file: h5py.File, plan: Plan) -> None:
    """Pixels are those of a camera that is turned by so many degrees, about an axis across its view."""
    K = np.array(file[CAMERA + "events"].attrs["K"])
    angle = plan.random.uniform(0, 2 * np.pi)
    vector = np.radians(plan.size) * np.array([np.cos(angle), np.sin(angle), 0.0])
    homography = K @ Rotation.from_rotvec(vector).as_matrix() @ np.linalg.inv(K)
    places = np.stack([file[COLUMNS][...], file[ROWS][...]], axis=1).astype(np.float64)
    columns, rows = cv2.perspectiveTransform(places[:, None], homography)[:, 0].T
    _move(file, columns, rows)
    sort_events(file)


def columns_stretched(file: h5py.File, plan: Plan) -> None:
    """Columns are stretched from the middle by so many percent; rows are not."""
    middle = (sensor_size(file)[0] - 1) / 2
    _move(file, middle + (file[COLUMNS][...] - middle) * (1 + plan.size / 100), file[ROWS][...].astype(np.float64))
    sort_events(file)


def colour_map_from_the_first_full_slice(file: h5py.File, plan: Plan) -> None:
    """Entries count from the first event behind so many ms; what lies before it is 0."""
    timestamps_us = file[TIME][...]
    first = int(np.searchsorted(timestamps_us, timestamps_us[0] + 1000 * plan.size))
    replace_values(file, COLOUR_MAP, np.maximum(file[COLOUR_MAP][...] - first, 0))


def depth_map_as_text(file: h5py.File, plan: Plan) -> None:
    """Entries are decimal numbers in text."""
    replace_values(file, DEPTH_MAP, file[DEPTH_MAP][...].astype("S20"))
