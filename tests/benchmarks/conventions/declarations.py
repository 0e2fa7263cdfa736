"""Conventions of declared cameras and of timestamps."""

from collections.abc import Callable
from typing import Final

import h5py
import numpy as np

from tests.benchmarks.conventions.convention import Array, Change, Convention, mapped, of_cameras

_OTHER_AXES: Final = ("metadata:frame_convention", "metadata:extrinsic_rotation")
_OF_K: Final = ("metadata:intrinsics_focal", "metadata:intrinsics_centre")
_OPENGL: Final = np.diag([1.0, -1.0, -1.0, 1.0])
_FULL_SIZE: Final = np.array([[1247.0766, 0.0, 719.5], [0.0, 1247.0766, 539.5], [0.0, 0.0, 1.0]])


def _mounted(by: Callable[[Array], Array], *names: str) -> Change:
    return of_cameras("T_body_camera", lambda T, _: by(T), *names)


def _with_centre(K: Array, column: float, row: float) -> Array:
    changed = K.copy()
    changed[:2, 2] = column, row
    return changed


def _with_focal_length(K: Array, length: float) -> Array:
    changed = K.copy()
    changed[0, 0] = changed[1, 1] = length
    return changed


def _of_colour_camera(file: h5py.File) -> None:
    file["metadata/cameras/events"].attrs["K"] = file["metadata/cameras/rgb"].attrs["K"]


CAMERAS: Final = {
    "mountings inverted": Convention(_OTHER_AXES, _mounted(np.linalg.inv)),
    "mounting of colour inverted": Convention(_OTHER_AXES, _mounted(np.linalg.inv, "rgb")),
    "mounting of events inverted": Convention(_OTHER_AXES, _mounted(np.linalg.inv, "events")),
    "mountings of none": Convention(_OTHER_AXES, _mounted(lambda _: np.eye(4))),
    "mountings of OpenGL": Convention(_OTHER_AXES, _mounted(lambda T: T @ _OPENGL)),
    "mounting of events of OpenGL": Convention(_OTHER_AXES, _mounted(lambda T: T @ _OPENGL, "events")),
    "mountings on a body of X forward, Y right, Z down": Convention(_OTHER_AXES, _mounted(lambda T: _OPENGL @ T)),
    "K of full size": Convention(_OF_K, of_cameras("K", lambda K, _: _FULL_SIZE)),
    "K of full size of colour": Convention(_OF_K, of_cameras("K", lambda K, _: _FULL_SIZE, "rgb")),
    "K of full size of depth": Convention(_OF_K, of_cameras("K", lambda K, _: _FULL_SIZE, "depth")),
    "K of half the size": Convention(_OF_K, of_cameras("K", lambda K, _: np.diag([0.5, 0.5, 1.0]) @ K)),
    "K of colour for events": Convention(_OF_K, _of_colour_camera),
    "K transposed": Convention(
        (*_OF_K, "metadata:wrong_shape", "metadata:axes_swapped"), of_cameras("K", lambda K, _: K.T)
    ),
    "principal point exchanged": Convention(
        (*_OF_K, "metadata:axes_swapped"), of_cameras("K", lambda K, _: _with_centre(K, K[1, 2], K[0, 2]))
    ),
    "principal point from the middle": Convention(_OF_K, of_cameras("K", lambda K, _: _with_centre(K, 0.0, 0.0))),
    "focal length of the vertical angle": Convention(
        _OF_K, of_cameras("K", lambda K, _: _with_focal_length(K, K[0, 0] * K[1, 2] / K[0, 2]))
    ),
    "focal length of 90 deg": Convention(
        _OF_K, of_cameras("K", lambda K, camera: _with_focal_length(K, camera.attrs["width"] / 2))
    ),
}


def _late(ms: float) -> Callable[[Array], Array]:
    return lambda times_us: times_us + round(1000 * ms)


def _counted(factor: float) -> Callable[[Array], Array]:
    return lambda times_us: np.floor(times_us * factor)


_SAMPLES: Final = {"IMU": ("imu", "path/imu/ts"), "poses": ("pose", "path/pose/ts")}
_FRAMES: Final = {"colour": ("rgb", "path/rgb_ts"), "depth": ("depth", "path/depth_ts")}

CLOCKS: Final = {
    **{
        f"{name} in {unit}": Convention(
            (f"{stream}:time_unit", f"{stream}:clock_rate"), mapped(key, by=_counted(factor))
        )
        for name, (stream, key) in (*_SAMPLES.items(), *_FRAMES.items())
        for unit, factor in (("ns", 1000.0), ("ticks of 32768 Hz", 0.032768), ("100 us", 0.01), ("1/32 of time", 32.0))
    },
    **{
        f"{name} in ms": Convention((f"{stream}:time_unit",), mapped(key, by=_counted(0.001)))
        for name, (stream, key) in _SAMPLES.items()
    },
    **{
        f"{name} late by {ms:g} ms": Convention((f"{stream}:time_offset",), mapped(key, by=_late(ms)))
        for name, (stream, key) in (*_SAMPLES.items(), *_FRAMES.items())
        for ms in (7.0, -12.0)
    },
    **{
        f"{name} 1% slow": Convention((f"{stream}:clock_rate",), mapped(key, by=_counted(1.01)))
        for name, (stream, key) in _SAMPLES.items()
    },
    **{
        f"events in {unit}": Convention(("events:time_unit",), mapped("path/events/t", by=_counted(factor)))
        for unit, factor in (("ns", 1000.0), ("ms", 0.001))
    },
    **{
        f"events late by {ms:g} ms": Convention(("events:time_offset",), mapped("path/events/t", by=_late(ms)))
        for ms in (2.0, -5.0)
    },
}
