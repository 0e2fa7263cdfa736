"""Faults of where pixels lie, of events and of images: exchanged axes, mirrored and shifted images; and of polarity.

Coordinates of events outside of the sensor stay as they are.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.mask import EDGE, flow_breaks, inverse_depth, mark_edges
from fedora_qa.faults.fault import Alteration, Fault, Read, values
from fedora_qa.faults.reversible import InapplicableError, signed_length, streams_in, value_keys
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

_X, _Y, _P = "path/events/x", "path/events/y", "path/events/p"

_COLUMN_AXIS: Final = 2
_ROW_AXIS: Final = 1
"""Axes of images are (time, row, column, ...)."""

_WITH_COMPONENTS: Final = 3
"""Axes of a field of flow: row, column, component."""


@dataclass(frozen=True, slots=True)
class PolarityInversion:
    """Brighter and darker events are exchanged. Codes above 1 are invalid, and stay."""

    cause: ClassVar[str] = "polarity_inverted"
    stream: ClassVar[str] = "events"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Exchange the codes 0 and 1."""
        streams_in(facts, self.stream)
        return Fault("polarity is inverted", {_P: values(lambda p: np.where(p <= 1, 1 - p, p).astype(p.dtype))})

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Exchange them again: the exchange is its own inverse."""
        return self.plant(facts, sequence)


@dataclass(frozen=True, slots=True)
class SwappedPixelAxes:
    """Columns and rows of events are exchanged, or u and v of flow.

    Attributes
    ----------
    stream
        ``events`` or flow.
    """

    stream: str
    cause: ClassVar[str] = "axes_swapped"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Exchange them."""
        description = f"the axes of {self.stream} are exchanged"
        if self.stream != "events":
            keys = value_keys(facts, self.stream)
            return Fault(description, dict.fromkeys(keys, values(lambda flow: np.ascontiguousarray(flow[..., ::-1]))))
        streams_in(facts, self.stream)

        def from_key(key: str) -> Alteration:
            return lambda read, start, stop: sequence.rows(key, start, stop)

        return Fault(description, {_X: from_key(_Y), _Y: from_key(_X)})

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Exchange them again: the exchange is its own inverse."""
        return self.plant(facts, sequence)


@dataclass(frozen=True, slots=True)
class Mirroring:
    """The image is mirrored. Values stay, also the sign of flow.

    Attributes
    ----------
    stream
        ``events``, or of images.
    direction
        ``horizontal``: columns are counted from right to left; ``vertical``: rows from bottom to top; ``both``: the
        image is turned by 180 degrees, as that of a camera that hangs upside down.
    """

    stream: str
    direction: Literal["horizontal", "vertical", "both"] = "horizontal"
    cause: ClassVar[str] = "mirrored"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Mirror the image."""
        description = f"{self.stream} mirrored" if self.stream != "events" else "events are mirrored"
        axes = {"horizontal": (_COLUMN_AXIS,), "vertical": (_ROW_AXIS,), "both": (_ROW_AXIS, _COLUMN_AXIS)}[
            self.direction
        ]
        if self.stream != "events":
            alter = values(lambda images: np.ascontiguousarray(np.flip(images, axes)))
            return Fault(description, dict.fromkeys(value_keys(facts, self.stream), alter))
        width, height = _sensor_size(facts)
        coordinates = {_COLUMN_AXIS: (_X, width - 1), _ROW_AXIS: (_Y, height - 1)}
        return Fault(description, {key: _mirrored(last) for key, last in map(coordinates.__getitem__, axes)})

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Mirror it again: mirroring is its own inverse."""
        return self.plant(facts, sequence)


def _mirrored(last: int) -> Alteration:
    """Return the alteration that counts coordinates 0 to ``last`` from the other end."""
    return values(lambda at: np.where((at >= 0) & (at <= last), last - at, at).astype(at.dtype))


@dataclass(frozen=True, slots=True)
class PixelShift:
    """The image is shifted.

    Of images, what leaves the image is lost: the freed pixels are NaN, or where values cannot be NaN they repeat the
    outermost pixel. Between pixels values follow a straight line along either axis. Depth and flow are NaN where one of
    the pixels of the line is, or where it leads from one surface to another: such a value belongs to neither. Events
    are shifted by whole pixels. They enter again on the opposite side, so that no row is lost: undone, as many columns
    and rows at the edge hold events of the opposite edge where the file held events that belong outside.

    Attributes
    ----------
    stream
        ``events``, or of images.
    columns
        px, positive: too far to the right.
    rows
        px, positive: too far down.
    """

    stream: str
    columns: float
    rows: float = 0
    cause: ClassVar[str] = "spatial_offset"

    @property
    def magnitude(self) -> float:
        """Length of the shift, px; negative if its larger part is to the left or up."""
        return signed_length((self.columns, self.rows))

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Shift to the right and down."""
        description = f"{self.stream} lies {self.columns:g} px too far to the right"
        description += f", {self.rows:g} px down" * bool(self.rows)
        return self._moved(facts, self.columns, self.rows, description)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Shift to the left and up."""
        description = f"{self.stream} {self.columns:g} px to the left and {self.rows:g} px up"
        return self._moved(facts, -self.columns, -self.rows, description)

    def _moved(self, facts: Facts, columns: float, rows: float, description: str) -> Fault:
        if self.stream != "events":
            alter = values(lambda images: _moved_images(images, columns, rows))
            return Fault(description, dict.fromkeys(value_keys(facts, self.stream), alter))
        width, height = _sensor_size(facts)
        moves = ((_X, round(columns), width), (_Y, round(rows), height))
        return Fault(description, {key: _on_ring(shift, size) for key, shift, size in moves if shift})


def _moved_images(images: NDArray[Any], columns: float, rows: float) -> NDArray[Any]:
    whole_columns, whole_rows = math.floor(columns), math.floor(rows)
    part_columns, part_rows = columns - whole_columns, rows - whole_rows
    if not part_columns and not part_rows:
        return _moved_by_whole_pixels(images, whole_columns, whole_rows)
    is_float = images.dtype.kind == "f"
    if is_float:
        images = np.where(_beside_edges(images).reshape(images.shape[:3] + (1,) * (images.ndim - 3)), np.nan, images)
    moved = np.zeros(images.shape)
    # Shares of the pixels at the whole shifts to both sides.
    for right, of_column in ((0, 1.0 - part_columns), (1, part_columns)):
        for down, of_row in ((0, 1.0 - part_rows), (1, part_rows)):
            if of_column * of_row:
                pixels = _moved_by_whole_pixels(images, whole_columns + right, whole_rows + down)
                moved += of_column * of_row * pixels
    return (moved if is_float else np.rint(moved)).astype(images.dtype)


def _beside_edges(images: NDArray[Any]) -> NDArray[np.bool_]:
    """Return where (n, H, W) a pixel of depth (n, H, W) or flow (n, H, W, 2) is or touches one with an edge."""
    marks = np.zeros(images.shape[:3], np.uint8)
    for image, marked in zip(images.astype(np.float32), marks, strict=True):
        if image.ndim == _WITH_COMPONENTS:
            marked[...] = flow_breaks(image)
        else:
            marked[...] = mark_edges(inverse_depth(image), np.float32(EDGE), np.float32(np.inf))
        # The border has no neighbours on one side, by which an edge would show.
        for side in (marked[0], marked[-1], marked[:, 0], marked[:, -1]):
            side[...] = 0
        # Half way between two surfaces the second difference vanishes; that of its neighbours does not.
        marked[...] = cv2.dilate(marked, np.ones((3, 3), np.uint8))
    return marks.astype(np.bool_)


def _moved_by_whole_pixels(images: NDArray[Any], columns: int, rows: int) -> NDArray[Any]:
    height, width = images.shape[1:3]
    from_rows, from_columns = np.arange(height) - rows, np.arange(width) - columns
    moved = images[:, np.clip(from_rows, 0, height - 1)][:, :, np.clip(from_columns, 0, width - 1)]
    if moved.dtype.kind == "f":
        moved[:, (from_rows < 0) | (from_rows >= height)] = np.nan
        moved[:, :, (from_columns < 0) | (from_columns >= width)] = np.nan
    return np.ascontiguousarray(moved)


def _on_ring(shift: int, size: int) -> Alteration:
    """Return the alteration that shifts coordinates on a ring of ``size`` pixels; those outside stay."""

    def alter(read: Read, start: int, stop: int) -> NDArray[Any]:
        at = read(start, stop)
        # In int64: uint16 would overflow before the remainder is taken.
        return np.where((at >= 0) & (at < size), (at.astype(np.int64) + shift) % size, at).astype(at.dtype)

    return alter


def _sensor_size(facts: Facts) -> tuple[int, int]:
    streams_in(facts, "events")
    camera = facts.declared.cameras.get("events")
    if camera is None:
        raise InapplicableError("Expected a declared event camera, got none: the size of the sensor is needed")
    return camera.width, camera.height
