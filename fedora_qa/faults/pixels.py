"""Faults of where pixels lie, of events and of images, and of polarity; and canaries of events.

Axes are exchanged, images mirrored or shifted. Coordinates of events outside of the sensor stay as they are.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.flow.mask import EDGE, flow_breaks, inverse_depth, mark_edges
from fedora_qa.faults.canary_conditions import CanaryConditions, UnplantableError
from fedora_qa.faults.fault import (
    Alteration,
    Fault,
    InapplicableError,
    Read,
    rows_from,
    signed_length,
    streams_in,
    value_keys,
    values,
    values_by_row,
)
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

_X, _Y, _T, _P = "path/events/x", "path/events/y", "path/events/t", "path/events/p"

_COLUMN_AXIS: Final = 2
_ROW_AXIS: Final = 1
"""Axes of images are (time, row, column, ...)."""

_WITH_COMPONENTS: Final = 3
"""Axes of a field of flow: row, column, component."""

_FEWEST_IN_PACKETS: Final = 16.0
"""Least mean number of events of a tick. If all events are doubled, nearly every tick then holds four pairs."""


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
    columns_px
        Positive: too far to the right.
    rows_px
        Positive: too far down.
    """

    stream: str
    columns_px: float
    rows_px: float = 0
    cause: ClassVar[str] = "spatial_offset"

    @property
    def magnitude(self) -> float:
        """Length of the shift, px; negative if its larger part is to the left or up."""
        return signed_length((self.columns_px, self.rows_px))

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Shift to the right and down."""
        description = f"{self.stream} lies {self.columns_px:g} px too far to the right"
        description += f", {self.rows_px:g} px down" * bool(self.rows_px)
        return self._moved(facts, self.columns_px, self.rows_px, description)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Shift to the left and up."""
        description = f"{self.stream} {self.columns_px:g} px to the left and {self.rows_px:g} px up"
        return self._moved(facts, -self.columns_px, -self.rows_px, description)

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


def outside_of_the_sensor(conditions: CanaryConditions) -> Fault:
    """Columns are counted from the width of the sensor on, so that all events lie outside of it."""
    return Fault(
        "columns of events begin at the width", {_X: values(lambda x: x + x.dtype.type(_sensor(conditions).width))}
    )


def repeated(conditions: CanaryConditions) -> Fault:
    """Every second event repeats the event before it, so that packets hold only pairs."""
    events = conditions.facts.events
    count, events_per_tick = 0, 0.0
    if events is not None:
        count = events.count
        if events.last_ns > events.first_ns:
            events_per_tick = events.count * events.grid_ns / (events.last_ns - events.first_ns)
    if not any(m.name == "repeats" for m in conditions.measurements) and events_per_tick < _FEWEST_IN_PACKETS:
        raise UnplantableError("too few events share a timestamp to show a packet that was written twice")
    # Row 2k + 1 takes x, y, t and p of row 2k: the same event twice.
    earlier = rows_from(lambda rows: rows - rows % 2, count)
    return Fault("every second event repeats the one before", dict.fromkeys((_X, _Y, _T, _P), earlier))


def hot_pixel(conditions: CanaryConditions) -> Fault:
    """Every k-th event is moved to the pixel (0, 0)."""
    events = conditions.facts.events
    if events is None or events.last_ns <= events.first_ns:
        raise UnplantableError("the events have no duration")
    all_hz = events.count * NS_PER_S / (events.last_ns - events.first_ns)
    rate_hz = conditions.size("loudest_pixel_excess")
    # Rounded down, so that the rate all_hz / every is at least ``rate_hz``.
    every = max(1, int(all_hz / rate_hz))

    def alter(column: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
        # By row number: x and y are read separately, and the same events must be altered.
        return np.where(rows % every == 0, column.dtype.type(0), column)

    return Fault(f"a pixel gives {all_hz / every:.3g} Hz too much", {key: values_by_row(alter) for key in (_X, _Y)})


def inverted_polarity(conditions: CanaryConditions) -> Fault:
    """Brighter and darker events are exchanged. Invalid polarities stay."""
    return conditions.planted(PolarityInversion())


def mirrored(conditions: CanaryConditions) -> Fault:
    """Columns are counted from right to left."""
    return conditions.planted(Mirroring("events"))


def interpolated(conditions: CanaryConditions) -> Fault:
    """Between two frames, pixels give three events at equal spacings each. No row is added or removed."""
    index_map = conditions.facts.index_maps.get("rgb_to_event")
    if index_map is None:
        raise UnplantableError("no index map tells which events lie between two frames")
    width, pixels = _sensor(conditions).width, _sensor(conditions).width * _sensor(conditions).height
    advancing = np.flatnonzero(conditions.facts.clocks["rgb"].advancing)
    frames_ns = conditions.facts.clocks["rgb"].times_ns[advancing]
    first_rows = index_map.expected_left[advancing]

    def places(rows: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.int64]]:
        """Return which rows lie in groups of three a pixel between two frames, their pixels, and all timestamps, ns."""
        frame = np.clip(np.searchsorted(first_rows, rows, side="right") - 1, 0, len(first_rows) - 2)
        row, count = rows - first_rows[frame], first_rows[frame + 1] - first_rows[frame]
        # Pixel q of m has events at the shares (q + 1/2) / m + 0, 1 and 2 of a third of the interval.
        columns = np.maximum(np.minimum(count // 3, pixels), 1)
        grouped = (row >= 0) & (row < 3 * columns) & (count >= 3)
        number, column = np.divmod(np.clip(row, 0, None), columns)
        third_ns = (frames_ns[frame + 1] - frames_ns[frame]) // 3
        # One spacing for all: whole steps of the phase, so that the three are equal to the nanosecond.
        times_ns = frames_ns[frame] + third_ns * number + third_ns * (2 * column + 1) // (2 * columns)
        return grouped, column * (pixels // columns), times_ns

    def alter(name: str) -> Alteration:
        def altered(values: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
            grouped, pixel, times_ns = places(rows)
            planted = {_X: pixel % width, _Y: pixel // width, _T: times_ns, _P: np.ones_like(pixel)}[name]
            return np.where(grouped, planted, values).astype(values.dtype)

        return values_by_row(altered)

    return Fault("events are interpolated between the colour frames", {key: alter(key) for key in (_X, _Y, _T, _P)})


def shifted(conditions: CanaryConditions) -> Fault:
    """Events lie too far to the right. Events that would leave the sensor enter it on the left."""
    # Whole columns, rounded up: a smaller shift can lie below the detection limit.
    return conditions.planted(PixelShift("events", math.ceil(conditions.size("shift_right", at_least=1.0))))


def _sensor(conditions: CanaryConditions) -> Camera:
    return conditions.facts.declared.cameras["events"]
