"""Faults of the unit, scale or sign of values."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS, NS_PER_S
from fedora_qa.faults.fault import Fault, InapplicableError, RowRange, in_rows, streams_in, value_keys, values_by_row
from fedora_qa.sequence.facts import Clock, Facts
from fedora_qa.sequence.sequence import SequenceRows

_LENGTHS: Final = {"depth": "path/depth", "pose": "path/pose/position"}
_ANGULAR_VELOCITY: Final = "path/imu/angular_velocity"


@dataclass(frozen=True, slots=True)
class LengthUnit:
    """Depths or positions are too large by a factor.

    Attributes
    ----------
    stream
        ``depth`` or ``pose``.
    factor
        Stored over correct value: 0.001 for metres that are read as millimetres.
    rows
        The rows in the other unit; None: all.
    """

    stream: Literal["depth", "pose"]
    factor: float
    rows: RowRange | None = None
    cause: ClassVar[str] = "unit_mm_m"

    @property
    def magnitude(self) -> float:
        """Stored over correct value."""
        return self.factor

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Multiply by the factor."""
        description = f"{self.stream} is too large by a factor of {self.factor:.6g}"
        return self._scaled(facts, description, lambda lengths: lengths * np.float64(self.factor))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide by the factor."""
        description = f"{self.stream} divided by {self.factor:.6g}"
        return self._scaled(facts, description, lambda lengths: lengths / np.float64(self.factor))

    def _scaled(self, facts: Facts, description: str, scale: Callable[[NDArray[Any]], NDArray[Any]]) -> Fault:
        streams_in(facts, self.stream)
        return Fault(description, {_LENGTHS[self.stream]: in_rows(scale, self.rows)})


@dataclass(frozen=True, slots=True)
class AngleUnit:
    """Angular velocities are too large by a factor.

    Attributes
    ----------
    factor
        Stored over correct value: 180 / pi for deg/s.
    rows
        The rows in the other unit; None: all.
    """

    factor: float
    rows: RowRange | None = None
    cause: ClassVar[str] = "unit_deg_rad"
    stream: ClassVar[str] = "imu"

    @property
    def magnitude(self) -> float:
        """Stored over correct value."""
        return self.factor

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Multiply by the factor."""
        streams_in(facts, self.stream)
        description = f"angular velocities are too large by a factor of {self.factor:.6g}"
        return Fault(description, {_ANGULAR_VELOCITY: in_rows(lambda rates: rates * self.factor, self.rows)})

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide by the factor."""
        streams_in(facts, self.stream)
        description = f"angular velocities divided by {self.factor:.6g}"
        return Fault(description, {_ANGULAR_VELOCITY: in_rows(lambda rates: rates / self.factor, self.rows)})


@dataclass(frozen=True, slots=True)
class FlowGain:
    """Flow is too large by a factor.

    Attributes
    ----------
    stream
        ``flow``, or a rate.
    percent
        Excess of the factor over 1.
    rows
        The fields; None: all.
    v_percent
        That of the component along rows of pixels, v; None: the same as of u.
    """

    stream: str
    percent: float
    rows: RowRange | None = None
    v_percent: float | None = None
    cause: ClassVar[str] = "flow_gain"

    @property
    def magnitude(self) -> float:
        """Excess of the factor, percent; the larger one of both components."""
        return max(self.percent, self.percent if self.v_percent is None else self.v_percent, key=abs)

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Multiply by the factor."""
        gains, keys = self._gains, value_keys(facts, self.stream)
        alter = in_rows(lambda flow: flow * gains, self.rows)
        return Fault(f"{self.stream} is {self.magnitude:.3g}% too large", dict.fromkeys(keys, alter))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide by the factor."""
        gains, keys = self._gains, value_keys(facts, self.stream)
        alter = in_rows(lambda flow: flow / gains, self.rows)
        of_v = "" if gains[0] == gains[1] else f" along columns, by {gains[1]:.6g} along rows"
        return Fault(f"{self.stream} divided by {gains[0]:.6g}{of_v}", dict.fromkeys(keys, alter))

    @property
    def _gains(self) -> NDArray[np.float64]:
        v_percent = self.percent if self.v_percent is None else self.v_percent
        return 1 + np.array([self.percent, v_percent]) / 100


@dataclass(frozen=True, slots=True)
class FlowSign:
    """Flow points backwards.

    Attributes
    ----------
    stream
        ``flow``, or a rate.
    """

    stream: str = "flow"
    cause: ClassVar[str] = "flow_sign"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Change the sign."""
        keys = value_keys(facts, self.stream)
        return Fault("flow points backwards", dict.fromkeys(keys, in_rows(np.negative, None)))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Change it again: the change is its own inverse."""
        return self.plant(facts, sequence)


FlowUnitName = Literal[
    "px/s", "px/ms", "px s", "images", "half images", "clip space", "focal lengths", "px per frame", "fractions"
]

_IMAGES: Final[dict[FlowUnitName, tuple[float, float]]] = {
    "images": (1.0, 1.0),
    "half images": (0.5, 0.5),
    "clip space": (0.5, -0.5),
}
"""Units of length that depend on the size of the image, in widths and heights of it; negative where v is upwards."""

_OF_TIME: Final[dict[FlowUnitName, float]] = {"px/s": 1.0, "px/ms": NS_PER_MS / NS_PER_S, "px per frame": 0.0}
"""Units of time, s, of flow that was divided by its interval; 0: that of the file's frames."""

LENGTHS: Final[tuple[FlowUnitName, ...]] = (*_IMAGES, "focal lengths")
"""Units in which flow is not in pixels but in lengths of its camera."""


def length_of_flow_px(facts: Facts, unit: FlowUnitName) -> tuple[float, float] | None:
    """Return the length of a unit of ``LENGTHS`` along columns and rows, px; None without a declared depth camera.

    That along rows is negative where v is upwards.
    """
    camera = facts.declared.cameras.get("depth")
    if camera is None:
        return None
    if unit == "focal lengths":
        return abs(float(camera.K[0, 0])), abs(float(camera.K[1, 1]))
    along_columns, along_rows = _IMAGES[unit]
    return along_columns * camera.width, along_rows * camera.height


def frame_period_s(facts: Facts) -> float:
    """Return the median period of the colour frames, s; 0 without two of them."""
    clock = facts.clocks.get("rgb")
    steps_ns = np.diff(clock.times_ns[clock.advancing]) if clock is not None else np.zeros(0)
    return float(np.median(steps_ns)) / NS_PER_S if len(steps_ns) else 0.0


@dataclass(frozen=True, slots=True)
class FlowUnit:
    """Flow is divided by its interval, multiplied by it, or relative to the image size.

    Attributes
    ----------
    stream
        ``flow``, or a rate.
    unit
        ``px/s``; ``px/ms``; ``px s``: the equation of the paper applied to a displacement; ``images`` or ``half
        images``: u in widths and v in heights of the image, or in halves of them, as samplers of networks count from -1
        to 1; ``clip space``: halves, with v upwards, as buffers of renderers have it; ``focal lengths``: on the plane
        at z = 1, as undistorted points without a K are; ``px per frame``: the motion during one period of the colour
        frames, whatever the interval; ``fractions``: whole numbers of a fraction of a pixel, that nothing has divided.
    per_px
        Number of fractions in a pixel.
    """

    stream: str
    unit: FlowUnitName = "px/s"
    per_px: float = 1.0
    cause: ClassVar[str] = "flow_unit"

    @property
    def magnitude(self) -> float:
        """1 for px/s and the number of fractions, which are too large; -1 for all others, which are too small.

        Values in px/ms are too small of rates below 1000 Hz.
        """
        if self.unit == "fractions":
            return self.per_px
        return 1.0 if self.unit == "px/s" else -1.0

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Convert from px."""
        if self.unit in LENGTHS:
            return self._in_lengths(facts, f"{self.stream} is in {self.unit}", -1)
        if self.unit == "fractions":
            return self._in_fractions(facts, f"{self.stream} is in 1/{self.per_px:g} px", self.per_px)
        divided = self.unit in _OF_TIME
        return self._scaled(facts, f"{self.stream} is in {self.unit}", divided=divided)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Convert to px."""
        if self.unit in LENGTHS:
            return self._in_lengths(facts, f"{self.stream} from {self.unit} to px", 1)
        if self.unit == "fractions":
            return self._in_fractions(facts, f"{self.stream} from 1/{self.per_px:g} px to px", 1 / self.per_px)
        divided = self.unit not in _OF_TIME
        return self._scaled(facts, f"{self.stream} from {self.unit} to px", divided=divided)

    def _in_fractions(self, facts: Facts, description: str, gain: float) -> Fault:
        factor, keys = np.float64(gain), value_keys(facts, self.stream)
        return Fault(description, dict.fromkeys(keys, in_rows(lambda flow: flow * factor, None)))

    def _in_lengths(self, facts: Facts, description: str, power: Literal[1, -1]) -> Fault:
        of_camera_px = length_of_flow_px(facts, self.unit)
        if self.unit == "focal lengths" and of_camera_px is None:
            raise InapplicableError("Expected a declared depth camera, got none: its focal length is the unit")

        def scaled(flow: NDArray[Any]) -> NDArray[Any]:
            height, width = flow.shape[-3:-1]
            along_columns, along_rows = _IMAGES.get(self.unit, (0.0, 0.0))
            length_px = of_camera_px if self.unit == "focal lengths" else (along_columns * width, along_rows * height)
            return flow * np.array(length_px, np.float64) ** power

        keys = value_keys(facts, self.stream)
        return Fault(description, dict.fromkeys(keys, in_rows(scaled, None)))

    def _scaled(self, facts: Facts, description: str, *, divided: bool) -> Fault:
        rows = {}
        # Of motion per frame one period of the frames is the unit of time.
        unit_s = frame_period_s(facts) if self.unit == "px per frame" else _OF_TIME.get(self.unit, 1.0)
        if not unit_s:
            raise InapplicableError("Expected colour frames, got none: their period is the unit of time")
        for name in streams_in(facts, self.stream):
            clock: Clock = facts.clocks[name]

            def alter(flow: NDArray[Any], numbers: NDArray[np.int64], clock: Clock = clock) -> NDArray[Any]:
                assert clock.ends_ns is not None  # flow has intervals
                intervals_s = (clock.ends_ns[numbers] - clock.times_ns[numbers]) / NS_PER_S
                intervals_s = intervals_s.reshape(-1, 1, 1, 1) / unit_s
                with np.errstate(divide="ignore", invalid="ignore"):
                    scaled = flow / intervals_s if divided else flow * intervals_s
                # An interval of length 0 has no velocity: its field stays.
                return np.where(intervals_s == 0, flow, scaled).astype(flow.dtype)

            rows[f"path/{name}"] = values_by_row(alter)
        return Fault(description, rows)
