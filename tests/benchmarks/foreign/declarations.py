"""How the file states what it is, and what else it holds."""

from collections.abc import Iterator
from typing import Final

import h5py
import numpy as np

DEFAULTS: Final = {
    **dict.fromkeys(("exposure_us", "log_eps_dn", "packet_interval_us", "threshold_sigma", "leak_rate_hz"), 0),
    **dict.fromkeys(("shot_rate_hz", "bandwidth_hz", "refractory_us", "hot_pixel_rate_hz"), 0),
    "camera_model": "pinhole",
    "sampling": "instant",
    "transfer": "linear",
}
"""Optional attributes whose absence means this value."""

PROVENANCE: Final = ("sequence", "world", "illumination", "created_by", "scene_digest", "seed")


def capital_units(file: h5py.File) -> None:
    """Write the labels of units in capitals."""
    for holder in _holders(file):
        if "units" in holder.attrs:
            holder.attrs["units"] = holder.attrs["units"].upper()


def sizes_as_floats(file: h5py.File) -> None:
    """Write widths, heights and the packet interval as floating-point numbers."""
    for camera in file["metadata/cameras"].values():
        for name in ("width", "height"):
            camera.attrs[name] = np.float64(camera.attrs[name])
    attributes = file["metadata/events"].attrs
    attributes["packet_interval_us"] = np.float64(attributes["packet_interval_us"])


def intrinsics_float32(file: h5py.File) -> None:
    """Write matrices of cameras in single precision."""
    for camera in file["metadata/cameras"].values():
        for name in ("K", "T_body_camera"):
            camera.attrs[name] = camera.attrs[name].astype(np.float32)


def text_of_fixed_length(file: h5py.File) -> None:
    """Write texts as ASCII of fixed length."""
    for holder in _holders(file):
        for name, value in list(holder.attrs.items()):
            if isinstance(value, str):
                holder.attrs[name] = np.bytes_(value)


def arrays_of_one(file: h5py.File) -> None:
    """Write each number as an array of one."""
    for holder in _holders(file):
        for name, value in list(holder.attrs.items()):
            if isinstance(value, np.number):
                holder.attrs[name] = np.array([value])


def defaults_left_out(file: h5py.File) -> None:
    """Leave out the optional attributes that have their default."""
    for holder in _holders(file):
        for name, default in DEFAULTS.items():
            if name in holder.attrs and holder.attrs[name] == default:
                del holder.attrs[name]


def provenance_left_out(file: h5py.File) -> None:
    """Leave out who made the file, and of what."""
    for name in PROVENANCE:
        if name in file.attrs:
            del file.attrs[name]


def wider_depth_range(file: h5py.File) -> None:
    """Declare more than the range in which depth is valid, m."""
    file["metadata/depth_range"][...] = 0.05, 40.0


def more_of_everything(file: h5py.File) -> None:
    """Add attributes, groups and datasets that the format does not name."""
    file.attrs["license"], file.attrs["doi"] = "CC-BY-4.0", "10.0000/example"
    file["path/rgb"].attrs["sensor"] = "front"
    file["metadata"].create_group("weather").attrs["wind_m_s"] = 3.0
    file.create_dataset("path/battery/voltage", data=np.linspace(16.8, 16.1, 50))
    file.create_dataset("path/battery/ts", data=np.arange(50) * 7_000)
    file.create_dataset("metadata/notes", data="flown twice")


def millisecond_index(file: h5py.File) -> None:
    """Add the index of the first event of each millisecond, as DSEC has it."""
    timestamps_us = file["path/events/t"][...]
    ticks_us = np.arange(0, int(timestamps_us[-1]) + 1, 1000)
    file.create_dataset("path/events/ms_to_idx", data=np.searchsorted(timestamps_us, ticks_us, side="left"))


def _holders(file: h5py.File) -> Iterator[h5py.HLObject]:
    yield file
    paths: list[str] = []
    file.visit(paths.append)
    yield from (file[path] for path in paths)
