"""Conversions of stored rows that are more than a unit: encoded images, axis orders, transformations, intervals."""

from dataclasses import dataclass
from math import prod
from typing import Any, Final, Literal, get_args

import numpy as np
from numba import njit
from numpy.typing import NDArray

_FLOW_ZERO: Final = 1 << 15
_FLOW_PER_PX: Final = 128
"""Of 16-bit flow: ``flow = (v - 2^15) / 128`` px (DSEC, optical flow submission format)."""

_DISPARITY_PER_PX: Final = 256
"""Of 16-bit disparity: ``d = v / 256`` px, 0 invalid (DSEC, and KITTI stereo 2012)."""


ConversionName = Literal[
    "",
    "flow16",
    "chw",
    "disparity",
    "disparity16",
    "matrix4",
    "position_quaternion",
    "until_next",
    "turned",
    "event_not_before",
    "event_before",
    "event_after",
    "nearest_event",
]

MATRIX_ROWS: Final = frozenset({(4, 4), (3, 4), (16,), (12,)})
"""Shapes of a row that is a transformation: 4 x 4, without its last row, or either row by row, as in text."""

MapDefinition = Literal["event_not_before", "event_before", "event_after", "nearest_event"]
"""What an entry of a map from frames to events names. The earliest event not before the frame as in the layout, but
event 0 where none is left; the last event before it; the first event after it; the event nearest in time."""

MAP_DEFINITIONS: Final[frozenset[str]] = frozenset(get_args(MapDefinition))


@dataclass(frozen=True, slots=True)
class Conversion:
    """What is done with rows of one dataset.

    Attributes
    ----------
    name
        As ``dialect.DatasetPlace.convert``; empty: only what is invalid is marked.
    invert
        Whether transformations are inverted.
    invalid
        Stored value that stands for an invalid pixel.
    T_posed_body
        (4, 4), from the body to the frame whose transformations are stored; empty: it is the body.
    R_body_sensor
        (3, 3), from the axes of a sensor to those of the body.
    depth_from_disparity
        (a, b, c, e): ``Z = (a d + b) / (c d + e)``, m, for a disparity d in px.
    """

    name: ConversionName = ""
    invert: bool = False
    invalid: float | None = None
    T_posed_body: tuple[tuple[float, ...], ...] = ()
    R_body_sensor: tuple[tuple[float, ...], ...] = ()
    depth_from_disparity: tuple[float, float, float, float] = (0.0, 1.0, 1.0, 0.0)


# Compiled: of a frame of 1440x1080, one pass takes 4 and 7 ms of processor, and passes by NumPy take 29 and 25.
@njit(cache=True)
def _flow_px(codes: NDArray[Any]) -> NDArray[np.float32]:
    """Return flow (n, H, W, 2), px, of codes (n, H, W, 3) of 16 bits, NaN where the third is 0."""
    pixels = codes.reshape(codes.size // 3, 3)
    flow_px = np.empty((len(pixels), 2), np.float32)
    for pixel in range(len(pixels)):
        is_valid = pixels[pixel, 2] != 0
        for axis in range(2):
            of_axis_px = (np.float32(pixels[pixel, axis]) - np.float32(_FLOW_ZERO)) / np.float32(_FLOW_PER_PX)
            flow_px[pixel, axis] = of_axis_px if is_valid else np.float32(np.nan)
    return flow_px.reshape((*codes.shape[:3], 2))


@njit(cache=True, error_model="numpy")
def _depth_m(
    codes: NDArray[Any], per_px: np.float32, a: np.float32, b: np.float32, c: np.float32, e: np.float32
) -> NDArray[np.float32]:
    """Return ``Z = (a d + b) / (c d + e)``, m, of codes (n,) of disparities d, ``per_px`` a pixel; NaN where d <= 0."""
    depth_m = np.empty(len(codes), np.float32)
    for index in range(len(codes)):
        disparity_px = np.float32(codes[index]) / per_px
        metres = (a * disparity_px + b) / (c * disparity_px + e)
        depth_m[index] = metres if disparity_px > 0 else np.float32(np.nan)
    return depth_m


def converted(raw: NDArray[Any], key: str, conversion: Conversion) -> NDArray[Any]:
    """Return rows of a dataset after its conversion, in the unit that the dialect states.

    Parameters
    ----------
    raw
        (n, ...) rows as stored.
    key
        Canonical key: of transformations, whether position or orientation is meant.
    """
    if conversion.invalid is not None:
        values = raw.astype(np.float64 if raw.dtype == np.float64 else np.float32)
        raw = np.where(raw == conversion.invalid, values.dtype.type(np.nan), values)
    if conversion.name == "flow16":
        return _flow_px(raw)
    if conversion.name == "chw":
        return np.moveaxis(raw, 1, -1)
    if conversion.name in {"disparity", "disparity16"}:
        per_px = np.float32(_DISPARITY_PER_PX if conversion.name == "disparity16" else 1)
        a, b, c, e = map(np.float32, conversion.depth_from_disparity)
        return np.asarray(_depth_m(raw.ravel(), per_px, a, b, c, e)).reshape(raw.shape)
    if conversion.name == "turned":
        # v_body = R_body_sensor v_sensor, for rows.
        return np.asarray(raw.astype(np.float64) @ np.asarray(conversion.R_body_sensor).T)
    if conversion.name == "matrix4":
        matrices = raw.astype(np.float64).reshape(len(raw), prod(raw.shape[1:]) // 4, 4)
        return _part_of_pose(matrices, key, conversion)
    if conversion.name == "position_quaternion":
        matrices, lengths = transformations(raw.astype(np.float64))
        part = _part_of_pose(matrices, key, conversion)
        # What is not unit is not taken for a rotation.
        return part if key.endswith("position") else part * lengths[:, np.newaxis]
    return raw


def stored_part_of_pose(
    positions: NDArray[np.float64], quaternions: NDArray[np.float64], key: str, conversion: Conversion
) -> NDArray[np.float64]:
    """Return what ``position_quaternion`` made positions (n, 3) or orientations (n, 4) from, but for signs.

    Parameters
    ----------
    positions, quaternions
        (n, 3), (n, 4) of the body, in the unit of the stored values.
    key
        Canonical key: whether stored positions or quaternions are meant.
    """
    matrices, lengths = transformations(np.concatenate([positions, quaternions], axis=1))
    if conversion.T_posed_body:
        matrices = matrices @ np.linalg.inv(np.asarray(conversion.T_posed_body))
    part = _part_of_pose(matrices, key, Conversion("matrix4", conversion.invert))
    return part if key.endswith("position") else part * lengths[:, np.newaxis]


def transformations(poses: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return transformations (n, 4, 4), and the lengths (n) of the quaternions that they were made of.

    Parameters
    ----------
    poses
        (n, 7) positions, and quaternions x, y, z, w of any length; one of length 0 gives NaN.
    """
    x, y, z, w = quaternions = poses[:, 3:].T
    lengths = np.linalg.norm(quaternions, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y, z, w = quaternions / lengths
    matrices = np.tile(np.eye(4), (len(poses), 1, 1))
    # R = I + 2 w [v]x + 2 [v]x^2 for a unit quaternion (v, w)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    matrices[:, :3, :3] = np.moveaxis(np.array(rows), -1, 0)
    matrices[:, :3, 3] = poses[:, :3]
    return matrices, lengths


def intervals(instants: NDArray[Any]) -> NDArray[Any]:
    """Return (n - 1, 2) from each of n instants to the next, in their unit and type."""
    return np.stack([instants[:-1], instants[1:]], axis=1)


def depth_from_disparity(Q: NDArray[np.float64]) -> tuple[float, float, float, float] | None:
    """Return (a, b, c, e) of the matrix Q (4, 4) by which OpenCV reprojects disparity; None where it has no such form.

    ``(X, Y, Z, W) = Q (x, y, d, 1)``, of which Z and W must not depend on the pixel (``cv2.stereoRectify``).
    """
    if Q.shape != (4, 4) or not np.all(np.isfinite(Q)) or np.any(Q[2:, :2] != 0) or not np.any(Q[3, 2:]):
        return None
    (a, b), (c, e) = Q[2:, 2:].tolist()
    return float(a), float(b), float(c), float(e)


def _part_of_pose(matrices: NDArray[np.float64], key: str, conversion: Conversion) -> NDArray[np.float64]:
    """Return positions (n, 3) or orientations (n, 4) x, y, z, w of transformations (n, 4, 4) or (n, 3, 4).

    A matrix that scales gives a quaternion of that length, so that it is not taken for a rotation; one without a
    rotation gives NaN.
    """
    rotations, positions = matrices[:, :3, :3], matrices[:, :3, 3]
    if conversion.invert:
        # (R, p)^-1 = (R^T, -R^T p)
        rotations = np.swapaxes(rotations, 1, 2)
        positions = -np.einsum("nij,nj->ni", rotations, positions)
    if conversion.T_posed_body:
        # T_world_body = T_world_posed T_posed_body
        to_posed = np.asarray(conversion.T_posed_body)
        positions = positions + rotations @ to_posed[:3, 3]
        rotations = rotations @ to_posed[:3, :3]
    if key.endswith("position"):
        return positions
    determinants = np.linalg.det(np.nan_to_num(rotations))
    proper = (determinants > 0) & np.all(np.isfinite(rotations), axis=(1, 2))
    quaternions = np.full((len(rotations), 4), np.nan)
    if np.any(proper):
        from scipy.spatial.transform import Rotation  # noqa: PLC0415 - slow to load, and few layouts need it

        lengths = np.cbrt(determinants[proper])
        quaternions[proper] = Rotation.from_matrix(rotations[proper]).as_quat() * lengths[:, np.newaxis]
    return quaternions
