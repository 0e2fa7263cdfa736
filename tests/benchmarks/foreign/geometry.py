"""Which pixels a camera has: crops and decimation, with its intrinsics."""

from typing import NamedTuple

import h5py
import numpy as np

from fedora_qa.layout.canonical import DATASETS
from tests.benchmarks.foreign.rows import keep_rows, present_keys, replace_values, update_index_maps


class Box(NamedTuple):
    """Columns and rows of a crop, px."""

    column: int
    row: int
    width: int
    height: int


def crop_colour(file: h5py.File) -> None:
    """Keep the middle of the colour frames."""
    _crop_frames(file, "rgb", _middle(file, "rgb"))


def crop_colour_off_centre(file: h5py.File) -> None:
    """Keep the upper left of the colour frames, so that the principal point lies off the middle."""
    _crop_frames(file, "rgb", _corner(file, "rgb"))


def crop_depth_off_centre(file: h5py.File) -> None:
    """Keep the upper left of depth and flow."""
    _crop_frames(file, "depth", _corner(file, "depth"))


def crop_events(file: h5py.File) -> None:
    """Keep the events of the middle of the sensor."""
    box = _middle(file, "events")
    columns, lines = file["path/events/x"][...].astype(int), file["path/events/y"][...].astype(int)
    inside = (columns >= box.column) & (columns < box.column + box.width)
    inside &= (lines >= box.row) & (lines < box.row + box.height)
    keep_rows(file, "events", inside)
    for key, first in (("path/events/x", box.column), ("path/events/y", box.row)):
        replace_values(file, key, file[key][...] - np.uint16(first))
    attributes = file["metadata/events"].attrs
    if "hot_pixels" in attributes:
        hot_pixels = attributes["hot_pixels"] - np.array(box[:2])
        attributes["hot_pixels"] = hot_pixels[np.all((hot_pixels >= 0) & (hot_pixels < box[2:]), axis=1)]
    _crop_camera(file, "events", box)
    update_index_maps(file)


def crop_all(file: h5py.File) -> None:
    """Keep the middle of every camera."""
    crop_colour(file)
    _crop_frames(file, "depth", _middle(file, "depth"))
    crop_events(file)


def decimate_depth(file: h5py.File) -> None:
    """Keep every second column and row of depth and flow: pixel (c, r) becomes (c / 2, r / 2), and so does flow."""
    for key in _image_keys(file, "depth"):
        values = file[key][:, ::2, ::2]
        replace_values(file, key, values / np.float32(2) if _is_displacement(key) else values)
    attributes = file["metadata/cameras/depth"].attrs
    attributes["K"] = np.diag([0.5, 0.5, 1.0]) @ attributes["K"]
    attributes["height"], attributes["width"] = file["path/depth"].shape[1:]


def _is_displacement(key: str) -> bool:
    return DATASETS[key].units == "px"


def _image_keys(file: h5py.File, camera: str) -> list[str]:
    """Return the keys of the images on the grid of a camera; flow lies on that of depth."""
    streams = ("rgb",) if camera == "rgb" else ("depth", "flow/")
    return [key for key in present_keys(file) if DATASETS[key].is_image and DATASETS[key].stream.startswith(streams)]


def _size(file: h5py.File, camera: str) -> tuple[int, int]:
    attributes = file[f"metadata/cameras/{camera}"].attrs
    return int(attributes["width"]), int(attributes["height"])


def _middle(file: h5py.File, camera: str) -> Box:
    width, height = _size(file, camera)
    return Box(width // 8, height // 8, width - 2 * (width // 8), height - 2 * (height // 8))


def _corner(file: h5py.File, camera: str) -> Box:
    width, height = _size(file, camera)
    return Box(0, 0, width - width // 5, height - height // 5)


def _crop_frames(file: h5py.File, camera: str, box: Box) -> None:
    columns, lines = slice(box.column, box.column + box.width), slice(box.row, box.row + box.height)
    for key in _image_keys(file, camera):
        replace_values(file, key, file[key][:, lines, columns])
    _crop_camera(file, camera, box)


def _crop_camera(file: h5py.File, camera: str, box: Box) -> None:
    attributes = file[f"metadata/cameras/{camera}"].attrs
    K = attributes["K"]
    K[:2, 2] -= box[:2]
    attributes["K"] = K
    attributes["width"], attributes["height"] = np.int64(box.width), np.int64(box.height)
