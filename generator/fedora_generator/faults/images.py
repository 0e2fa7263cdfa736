"""Faults of images: of every image stream, of colour frames, and of depth frames."""

from collections.abc import Callable
from typing import Final

import h5py
import numpy as np
from scipy.ndimage import shift

from fedora_generator.faults.fault import Fault, FaultError
from fedora_generator.faults.rows import Array, edit_values


def mirrored(file: h5py.File, fault: Fault) -> None:
    """Write columns from right to left; the values, also the sign of a flow, stay as they are."""
    edit_values(file, fault, lambda images: images[:, :, ::-1])


def spatial_offset(file: h5py.File, fault: Fault) -> None:
    """Shift images to the right by whole pixels, or in any direction; the freed edge repeats the outermost, or is NaN.

    Between pixels colour follows a cubic spline and flow a straight line.
    """
    if fault.direction_deg is not None:
        angle, size_px = np.radians(fault.direction_deg), fault.magnitude_in("px")
        vector_px = size_px * float(np.cos(angle)), size_px * float(np.sin(angle))
        edit_values(file, fault, lambda images: _shifted_by_vector(images, vector_px))
        return
    columns = fault.count()
    edit_values(file, fault, lambda images: _shifted(images, columns))


def invalid_encoding(file: h5py.File, fault: Fault) -> None:
    """Write 0 where there is no value, instead of NaN."""
    edit_values(file, fault, lambda values: np.nan_to_num(values, nan=0.0))


def _shifted_by_vector(images: Array, vector_px: tuple[float, float]) -> Array:
    right_px, down_px = vector_px
    along = (0.0, down_px, right_px, 0.0)[: images.ndim]
    if images.dtype.kind == "f":
        # A spline would spread each NaN over the whole image.
        values = shift(images.astype(np.float64), along, order=1, mode="constant", cval=np.nan)
    else:
        splines = shift(images.astype(np.float64), along, order=3, mode="nearest")
        values = np.clip(np.rint(splines), 0, np.iinfo(images.dtype).max)
    return np.asarray(values).astype(images.dtype)


def _shifted(images: Array, shift: int) -> Array:
    width = images.shape[2]
    if abs(shift) >= width:
        raise FaultError(f"Expected a shift of less than {width} px, got {shift}")
    columns = np.arange(width) - shift
    shifted = images[:, :, np.clip(columns, 0, width - 1)]
    if shifted.dtype.kind == "f":
        shifted[:, :, (columns < 0) | (columns >= width)] = np.nan
    return shifted


_WHITE: Final = 255.0


def channel_order(file: h5py.File, fault: Fault) -> None:
    """Write blue first."""
    edit_values(file, fault, lambda frames: frames[..., ::-1])


def exposure_or_gamma(file: h5py.File, fault: Fault) -> None:
    """Make the values too large by a magnitude in percent, as a longer exposure would, or apply a gamma.

    Values are clipped at 255; -100 percent makes frames black. With the unit ``gamma``, a magnitude of 2.2 writes what
    a display of that gamma needs, white and black staying where they are; nothing is declared.
    """
    # What each of the 256 codes becomes.
    codes = np.arange(256, dtype=np.float64)
    if fault.unit == "gamma":
        if not fault.magnitude > 0:
            raise FaultError(f"Expected a gamma above 0, got {fault.magnitude:g}")
        values: Array = _WHITE * (codes / _WHITE) ** (1 / fault.magnitude)
    else:
        values = codes * (1 + fault.magnitude_in("percent") / 100)
    curve: Array = np.rint(np.clip(values, 0, _WHITE)).astype(np.uint8)
    edit_values(file, fault, lambda frames: curve[frames])


def vignetting(file: h5py.File, fault: Fault) -> None:
    """Darken frames towards the corners, by a magnitude in percent in the corner farthest from the principal point.

    In linear light the factor is 1 - loss r^2 / r_corner^2, with distances in pixels. Without a declared camera the
    principal point is the middle of the image. Values are clipped at 255, where a negative loss makes corners brighter.

    Raises
    ------
    FaultError
        The loss is 100% or more, or the declared transfer is not known.
    """
    loss = fault.magnitude_in("percent") / 100
    if not loss < 1:
        raise FaultError(f"Expected a loss below 100%, got {100 * loss:g}%; lower the magnitude")
    frames = file["path/rgb"]
    height, width = frames.shape[1:3]
    camera = file.get("metadata/cameras/rgb")
    K = None if camera is None else camera.attrs.get("K")
    centre_x, centre_y = ((width - 1) / 2, (height - 1) / 2) if K is None else (K[0, 2], K[1, 2])
    distances = np.hypot(np.arange(width) - centre_x, (np.arange(height) - centre_y)[:, np.newaxis])
    # The farthest pixel of a rectangle from any point is one of its corners.
    gains = (1 - loss * (distances / distances.max()) ** 2)[..., np.newaxis]
    transfer = frames.attrs.get("transfer", "linear")
    decode, encode = _curve(transfer.decode() if isinstance(transfer, bytes) else str(transfer))
    edit_values(file, fault, lambda block: _darkened(block, gains, decode, encode))


def _darkened(frames: Array, gains: Array, decode: Array, encode: Callable[[Array], Array]) -> Array:
    codes: Array = np.rint(_WHITE * encode(np.clip(decode[frames] * gains, 0, 1))).astype(np.uint8)
    return codes


def _curve(transfer: str) -> tuple[Array, Callable[[Array], Array]]:
    """Return the linear value (256,), 0 to 1, of each code, and the function from linear values back to codes / 255."""
    codes = np.arange(256) / _WHITE
    if transfer == "linear":
        return codes, lambda linear: linear
    if transfer == "gamma2.2":
        return codes**2.2, lambda linear: linear ** (1 / 2.2)
    if transfer == "srgb":
        # IEC 61966-2-1.
        return (
            np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4),
            lambda linear: np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055),
        )
    raise FaultError(f"Expected a transfer of linear, srgb or gamma2.2, got {transfer!r}; declare one of these")


CAMERA = "metadata/cameras/depth"


def unit_mm_m(file: h5py.File, fault: Fault) -> None:
    """Multiply depth by the magnitude: 0.001 writes metres."""
    factor = np.float32(fault.magnitude_in("1"))
    edit_values(file, fault, lambda depths: depths * factor)


def depth_ray_not_z(file: h5py.File, fault: Fault) -> None:
    """Write the length of the ray from the camera's centre: z times |K^-1 (u, v, 1)|."""
    if CAMERA not in file:
        raise FaultError(f"Expected {CAMERA}, got none: the intrinsics are needed")
    height, width = file["path/depth"].shape[1:]
    u, v = np.meshgrid(np.arange(width), np.arange(height))
    directions = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(file[CAMERA].attrs["K"]).T
    lengths = np.linalg.norm(directions, axis=-1)
    edit_values(file, fault, lambda depths: (depths * lengths).astype(depths.dtype))
