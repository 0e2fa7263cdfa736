"""What a dataset may be by its shape, type and first values: depth, flow, transformations (``guesses``)."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.inventory import Fields, StoredObject

_DEPTH_WORDS: Final = ("depth", "disp")
_INVERSE_DEPTH_WORDS: Final = ("inverse_depth", "inversedepth", "inv_depth", "invdepth", "idepth")
_COLOUR_WORDS: Final = ("rgb", "color", "colour", "grey", "gray")
"""Words in the paths of images by which they are depth, or what a camera sees."""

_FAR: Final = (0.01, 2.0)
"""Share of the pixels with the largest depth, and ratio to the next depth, from which on it marks invalid pixels."""

_MATRIX_NUMBERS: Final = 16
"""Of a 4 x 4 matrix."""

_ROUNDED_UNIT: Final = 1e-3
"""How far products of rows of a stored rotation may be from 0 and 1."""


def is_named_as_depth(item: StoredObject) -> bool:
    """Whether the path has a word for depth or disparity."""
    return any(word in item.path.lower() for word in _DEPTH_WORDS)


def is_named_as_inverse_depth(item: StoredObject) -> bool:
    """Whether the path has a word for 1 / depth, whose values would pass for depth in metres."""
    return any(word in item.path.lower() for word in _INVERSE_DEPTH_WORDS)


def is_picture_of_depth(item: StoredObject) -> bool:
    """Whether images of 8 bits show depth to people, by the last word for it in their path: they have no unit."""
    path = item.path.lower()
    depth, colour = (max(path.rfind(word) for word in words) for words in (_DEPTH_WORDS, _COLOUR_WORDS))
    return item.dtype == np.uint8 and depth > colour


def mark_of_invalid(depth: NDArray[Any]) -> tuple[Fields, str]:
    """Return the value that marks invalid depth, and in words why: infinity, 0, or a depth far beyond all others.

    NaN needs no mark.
    """
    if np.any(np.isposinf(depth)):
        return {"invalid": float("inf")}, "; infinity is taken for invalid"
    if np.any(depth == 0):
        return {"invalid": 0.0}, "; 0 is taken for invalid"
    values = depth[np.isfinite(depth) & (depth > 0)]
    farthest = float(values.max()) if values.size else 0.0
    others = values[values < farthest]
    if others.size and np.mean(values == farthest) > _FAR[0] and farthest > _FAR[1] * others.max():
        words = f"; many pixels of {farthest:g}, far beyond all others, are taken for invalid"
        return {"invalid": farthest}, words
    return {}, ""


def has_equal_channels(item: StoredObject) -> bool:
    """Whether an image has three channels or more of which the first three are equal."""
    if len(item.shape) != 4 or item.shape[3] < 3:
        return False
    return all(np.array_equal(item.head[..., 0], item.head[..., channel], equal_nan=True) for channel in (1, 2))


def is_flow(item: StoredObject) -> bool:
    """Whether a dataset has the shape and type of flow in px."""
    return len(item.shape) == 4 and item.shape[3] == 2 and item.dtype.kind == "f"


def transformations_of(item: StoredObject) -> str:
    """Return in words how the rows of a dataset hold transformations, a time before them or not; empty: not at all."""
    if item.dtype.kind != "f" or len(item.shape) not in {2, 3}:
        return ""
    if len(item.shape) == 3:
        is_matrix = item.shape[1:] == (4, 4) and np.allclose(item.head[:, 3], [0, 0, 0, 1])
        return "4 x 4 transformations" if is_matrix else ""
    rows = item.head[:, item.shape[1] % 4 :]
    rises = bool(np.all(np.diff(item.head[:, 0]) > 0))
    if item.shape[1] not in {12, 16} and not (item.shape[1] in {13, 17} and rises):
        return ""
    if rows.shape[1] == _MATRIX_NUMBERS and not np.allclose(rows[:, 12:], [0, 0, 0, 1]):
        return ""
    rotations = rows[:, :12].reshape(-1, 3, 4)[..., :3]
    # R R^T = I; three decimals are the fewest that are written.
    are_rotations = np.allclose(rotations @ np.swapaxes(rotations, 1, 2), np.eye(3), atol=_ROUNDED_UNIT)
    return f"{rows.shape[1]} columns that are rotations beside positions, row by row" if are_rotations else ""
