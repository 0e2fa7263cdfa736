"""A fault of pixels that holds in a rectangle of the image, and leaves the rest as it is."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.faults.fault import Alteration, Fault, InapplicableError, Read, ReversibleFault
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

_X, _Y = "path/events/x", "path/events/y"

PixelRegion = tuple[int, int, int, int]
"""Left, top, right, bottom of a part of the image, px; half-open."""

_FEWEST_AXES: Final = 3
"""Axes of images: time, row and column."""


@dataclass(frozen=True, slots=True)
class ImagePart:
    """A fault whose values hold within a rectangle of the image alone.

    Of images, values that the fault moved out of the rectangle are lost: undone, the pixels that they would return to
    are NaN, or where values cannot be NaN they are what lies beside the rectangle. Events of the rectangle stay as they
    are where undoing the fault would move them out of it.

    Attributes
    ----------
    fault
        As it holds within the rectangle.
    region
        The rectangle, in pixels of the stream.
    """

    fault: ReversibleFault
    region: PixelRegion

    @property
    def cause(self) -> str:
        """The cause of the fault."""
        return self.fault.cause

    @property
    def stream(self) -> str:
        """The stream of the fault."""
        return self.fault.stream

    @property
    def magnitude(self) -> float | None:
        """The size of the fault within the rectangle."""
        return self.fault.magnitude

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Plant the fault within the rectangle."""
        return self._within(self.fault.plant(facts, sequence), sequence)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Undo the fault within the rectangle."""
        return self._within(self.fault.undo(facts, sequence), sequence)

    def _within(self, whole: Fault, sequence: SequenceRows) -> Fault:
        if whole.declared is not None or whole.layout is not None or whole.moves_time:
            raise InapplicableError("Expected a fault of pixels, got one of declarations or timestamps")
        left, top, right, bottom = self.region
        description = f"{whole.description}, in columns {left} to {right - 1}, rows {top} to {bottom - 1}"
        if self.stream == "events":
            return Fault(description, _of_events(whole.rows, self.region, sequence))
        return Fault(description, {key: _of_images(alter, self.region) for key, alter in whole.rows.items()})


def _of_images(alter: Alteration, region: PixelRegion) -> Alteration:
    """Return the alteration of the values within a region, which sees no values beside it where they can be NaN."""
    left, top, right, bottom = region
    part = (slice(None), slice(top, bottom), slice(left, right))

    def altered(read: Read, start: int, stop: int) -> NDArray[Any]:
        def read_part(first: int, last: int) -> NDArray[Any]:
            images = read(first, last)
            if images.ndim < _FEWEST_AXES or images.dtype.kind != "f":
                return images
            alone = np.full_like(images, np.nan)
            alone[part] = images[part]
            return alone

        images = read(start, stop).copy()
        if images.ndim >= _FEWEST_AXES:
            images[part] = alter(read_part, start, stop)[part]
        return images

    return altered


def _of_events(
    whole: Mapping[str, Alteration], region: PixelRegion, sequence: SequenceRows
) -> Mapping[str, Alteration]:
    """Return the alterations of events that lie within a region before and after them."""
    left, top, right, bottom = region

    def of(key: str) -> Callable[[int, int], NDArray[Any]]:
        return lambda start, stop: sequence.rows(key, start, stop)

    def moved(key: str, start: int, stop: int) -> NDArray[Any]:
        return whole[key](of(key), start, stop) if key in whole else sequence.rows(key, start, stop)

    def inside(x: NDArray[Any], y: NDArray[Any]) -> NDArray[np.bool_]:
        within: NDArray[np.bool_] = (x >= left) & (x < right) & (y >= top) & (y < bottom)
        return within

    def within(key: str) -> Alteration:
        def altered(read: Read, start: int, stop: int) -> NDArray[Any]:
            was = inside(sequence.rows(_X, start, stop), sequence.rows(_Y, start, stop))
            stays = inside(moved(_X, start, stop), moved(_Y, start, stop))
            values = read(start, stop)
            return np.where(was & stays, whole[key](read, start, stop), values).astype(values.dtype)

        return altered

    return {key: within(key) for key in whole}
