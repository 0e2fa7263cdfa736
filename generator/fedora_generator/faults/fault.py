"""What to plant: a cause, its place and its magnitude."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from fedora_generator.errors import GeneratorError
from fedora_qa.causes import CAUSES, stream_family

_DIMENSIONS: Final = (
    {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0},
    {"mm": 1e-3, "cm": 1e-2, "m": 1.0},
    {"deg": np.pi / 180, "rad": 1.0},
    {"deg/s": np.pi / 180, "rad/s": 1.0},
    {"ppm": 1e-6, "percent": 1e-2, "1": 1.0},
)
"""Units that can stand for each other, with their size."""

_TIMES: Final = _DIMENSIONS[0]

Region = tuple[int, int, int, int]
"""First column and row, and the column and row behind the last: pixels of the stream's own image."""


class FaultError(GeneratorError, ValueError):
    """The fault cannot be planted as requested; the file stays as it was."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One fault.

    Attributes
    ----------
    cause, stream
        As in ``fedora_qa.causes``; ``flow`` means every rate of the file.
    magnitude, unit
        Positive: timestamps too late, values too large. A fault without a size ignores them.
    seed
        For what is placed or drawn at random.
    start_s, stop_s
        Half-open interval after the file's first timestamp that the fault is confined to. A fault of some samples
        begins at ``start_s``, or in the middle of the stream; one of a declaration or of storage cannot be confined.
    region
        Rectangle of the image that the fault is confined to: outside, the file does not change.
    direction_deg
        Direction of a shift of images or flow, clockwise from the right; it need not be by whole pixels. None: to the
        right, by whole pixels.
    donor
        The file that a stream of another sequence comes from.
    """

    cause: str
    stream: str
    magnitude: float
    unit: str
    seed: int = 0
    start_s: float | None = None
    stop_s: float | None = None
    region: Region | None = None
    direction_deg: float | None = None
    donor: Path | None = None

    @property
    def is_duration(self) -> bool:
        """Whether the magnitude is a time."""
        return self.unit in _TIMES

    def magnitude_in(self, unit: str) -> float:
        """Return the magnitude in another unit of the same dimension.

        Raises
        ------
        FaultError
            The units measure different things.
        """
        if self.unit == unit:
            return self.magnitude
        for sizes in _DIMENSIONS:
            if self.unit in sizes and unit in sizes:
                return self.magnitude * (sizes[self.unit] / sizes[unit])
        raise FaultError(
            f"Expected the magnitude of {self.cause} in {unit or 'no unit'}, got {self.unit!r}; use --unit"
        )

    def count(self) -> int:
        """Return the magnitude as a number of samples, events, pixels or intervals: a whole number but 0."""
        if self.magnitude != round(self.magnitude) or self.magnitude == 0:
            raise FaultError(f"Expected a whole {self.cause} magnitude other than 0, got {self.magnitude:g}")
        return round(self.magnitude)

    def positive_count(self) -> int:
        """Return the magnitude as a number of at least 1."""
        count = self.count()
        if count < 1:
            raise FaultError(f"Expected a {self.cause} magnitude of at least 1, got {count}")
        return count

    def rng(self) -> np.random.Generator:
        """Return the random stream of this fault."""
        return np.random.default_rng(np.random.SeedSequence(self.seed))


def default_unit(cause: str, stream: str) -> str:
    """Return the unit of a magnitude that is given without a unit.

    It is the cause's own, except that dropped or duplicated events are a packet, which has a duration.
    """
    if cause in ("dropped_samples", "duplicated_samples") and stream_family(stream) == "events":
        return "ms"
    return CAUSES[cause].unit
