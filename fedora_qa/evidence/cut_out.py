"""A part of the pictures of a snapshot: small displacements are visible only where no pixels are averaged."""

from dataclasses import replace
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.evidence.snapshot import Picture, Snapshot

Box = tuple[float, float, float, float]
"""Left, top, right and bottom as shares of a picture, 0 to 1."""

WHOLE: Final[Box] = (0.0, 0.0, 1.0, 1.0)


def busiest_box(snapshot: Snapshot, width_px: int) -> Box:
    """Return the box in which the widest picture has a width, where most events lie; in the middle without events.

    Parameters
    ----------
    snapshot
        With pictures that were not averaged.
    width_px
        Of the box in the widest picture, px.
    """
    widest = max((_size(picture)[1] for picture in snapshot.pictures.values()), default=0)
    if widest <= width_px:
        return WHOLE
    share = width_px / widest
    middle = (0.5, 0.5)
    if (events := snapshot.pictures.get("events")) is not None and np.any(events.image):
        height, width = _size(events)
        counts = events.image.sum(axis=0, dtype=np.float32)
        side = (max(round(share * width), 1), max(round(share * height), 1))
        sums = cv2.boxFilter(counts, cv2.CV_32F, side, normalize=False, borderType=cv2.BORDER_CONSTANT)
        row, column = np.unravel_index(int(np.argmax(sums)), sums.shape)
        middle = ((int(column) + 0.5) / width, (int(row) + 0.5) / height)
    left, top = (min(max(centre - share / 2, 0.0), 1.0 - share) for centre in middle)
    return (left, top, left + share, top + share)


def cut_out(snapshot: Snapshot, box: Box) -> Snapshot:
    """Return the same box of all pictures: the cameras of a file have one field of view."""
    pictures = {
        family: replace(picture, image=np.ascontiguousarray(_part(picture, box)))
        for family, picture in snapshot.pictures.items()
    }
    return replace(snapshot, pictures=pictures)


def _size(picture: Picture) -> tuple[int, int]:
    """Return rows and columns."""
    shape = picture.image.shape
    return shape[-2:] if picture.stream == "events" else shape[:2]


def _part(picture: Picture, box: Box) -> NDArray[Any]:
    height, width = _size(picture)
    left, top, right, bottom = box
    rows, columns = _pixels(top, bottom, height), _pixels(left, right, width)
    return picture.image[..., rows, columns] if picture.stream == "events" else picture.image[rows, columns]


def _pixels(start: float, stop: float, size: int) -> slice:
    """Return the pixels of a range of shares, 1 at least; their number does not depend on where the range lies."""
    first = round(start * size)
    return slice(first, first + max(round((stop - start) * size), 1))
