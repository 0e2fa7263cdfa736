"""Faults of where pixels lie, of events and of images: exchanged axes, mirrored and shifted images; and of polarity.

Coordinates of events outside of the sensor stay as they are.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.fault import Alteration, Fault, Read, values
from fedora_qa.faults.reversible import InapplicableError, signed_length, streams_in, value_keys
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

_X, _Y, _P = "path/events/x", "path/events/y", "path/events/p"

_COLUMN_AXIS: Final = 2
_ROW_AXIS: Final = 1
"""Axes of images are (time, row, column, ...)."""


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
    """The image is shifted by whole pixels.

    Of images, what leaves the image is lost: the freed pixels are NaN, or where values cannot be NaN they repeat the
    outermost pixel. Events enter again on the opposite side, so that no row is lost: undone, as many columns and rows
    at the edge hold events of the opposite edge where the file held events that belong outside.

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
    columns: int
    rows: int = 0
    cause: ClassVar[str] = "spatial_offset"

    @property
    def magnitude(self) -> float:
        """Length of the shift, px; negative if its larger part is to the left or up."""
        return signed_length((self.columns, self.rows))

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Shift to the right and down."""
        description = f"{self.stream} lies {self.columns} px too far to the right"
        return self._moved(facts, self.columns, self.rows, description + (f", {self.rows} px down" * bool(self.rows)))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Shift to the left and up."""
        description = f"{self.stream} {self.columns} px to the left and {self.rows} px up"
        return self._moved(facts, -self.columns, -self.rows, description)

    def _moved(self, facts: Facts, columns: int, rows: int, description: str) -> Fault:
        if self.stream != "events":
            alter = values(lambda images: _moved_images(images, columns, rows))
            return Fault(description, dict.fromkeys(value_keys(facts, self.stream), alter))
        width, height = _sensor_size(facts)
        moves = ((_X, columns, width), (_Y, rows, height))
        return Fault(description, {key: _on_ring(shift, size) for key, shift, size in moves if shift})


def _moved_images(images: NDArray[Any], columns: int, rows: int) -> NDArray[Any]:
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
