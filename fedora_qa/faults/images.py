"""Faults of the values of images: channels, brightness, lengths of rays, invalid codes; and canaries of frames."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Final, Literal

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M, NS_PER_MS
from fedora_qa.estimators.images.luma import WHITE_DN, to_code, to_linear
from fedora_qa.faults.canary_conditions import CanaryConditions
from fedora_qa.faults.clocks import ClockShift
from fedora_qa.faults.fault import (
    Fault,
    InapplicableError,
    RowRange,
    in_rows,
    rows_from,
    streams_in,
    value_keys,
    values,
    values_by_row,
)
from fedora_qa.faults.pixels import PixelShift
from fedora_qa.faults.row_order import SwappedFrames
from fedora_qa.faults.units import LengthUnit
from fedora_qa.geometry.lens import rays_of_pixels, undistorted
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

_RGB, _DEPTH = "path/rgb", "path/depth"

Transfer = Literal["linear", "srgb", "gamma2.2"]

_CODES: Final = np.arange(WHITE_DN + 1)
"""The 256 codes of eight bits."""

_USEFUL_PX, _USEFUL_MS, _LATEST_MS = 2.0, 20.0, 25.0
"""Detection limits of shifts and delays of events against depth up to which they are of use, and the longest delay that
is planted: below the 30 ms that are searched."""

_LEAST_GAIN: Final = 0.1
"""Least relative change of brightness, 0 to 1. With eight bits it changes every grey value above 5 DN."""
_LEAST_POWER: Final = 0.5
"""Least excess of the exponent above 1. Contrasts are then 1.5 times as large; the transfer curve of a display makes
them more than twice as large."""
_LEAST_LOSS_PERCENT: Final = 2.0
"""Least loss of light in the corner: with eight bits it changes the grey values there from 25 DN on."""
_LARGEST_LOSS: Final = 0.9
"""Largest loss (0 to 1) of light in the corner, so that corners keep contrast."""
_EXCHANGES: Final = ("RBG", "GRB", "BGR")
_SPARSELY: Final = 8
"""Frames are exchanged in every 8th interval. Three of eight intervals are then out of order, so that the median of all
intervals does not change."""
_DARKEST: Final = 0.3
"""Least share (0 to 1) of the brightness after a jump of exposure, so that images keep contrast."""


@dataclass(frozen=True, slots=True)
class ChannelOrder:
    """Channels are in another order than R, G, B.

    Attributes
    ----------
    order
        Which correct channel is stored at each place: ``BGR``.
    """

    order: str = "BGR"
    cause: ClassVar[str] = "channel_order"
    stream: ClassVar[str] = "rgb"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Store the channels in this order."""
        channels = ["RGB".index(channel) for channel in self.order]
        return _of_colour(facts, f"rgb is {', '.join(self.order)}", lambda frames: frames[..., channels])

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Return to the order R, G, B."""
        channels = [self.order.index(channel) for channel in "RGB"]
        return _of_colour(facts, f"rgb back from {', '.join(self.order)}", lambda frames: frames[..., channels])


@dataclass(frozen=True, slots=True)
class ExposureGain:
    """Codes are multiplied by a factor, rounded, and clipped at white, which is lost.

    Attributes
    ----------
    percent
        Excess of the factor over 1; negative: too dark.
    rows
        The frames; None: all.
    """

    percent: float
    rows: RowRange | None = None
    cause: ClassVar[str] = "exposure_or_gamma"
    stream: ClassVar[str] = "rgb"

    @property
    def magnitude(self) -> float:
        """Excess of the factor, percent."""
        return self.percent

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Multiply by the factor."""
        gain, start = 1 + self.percent / 100, 0 if self.rows is None else self.rows[0]
        change = f"{abs(self.percent):.3g}% {'darker' if self.percent < 0 else 'brighter'} from frame {start} on"
        return _of_colour(facts, f"rgb is {change}", lambda frames: _recoded(frames, _CODES * gain), self.rows)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide by the factor; the error is half a code over the factor, and half a code."""
        gain = 1 + self.percent / 100
        if gain <= 0:
            raise InapplicableError(f"Expected frames that are not black, got a factor of {gain:g}")
        description = f"rgb divided by {gain:.4g}"
        return _of_colour(facts, description, lambda frames: _recoded(frames, _CODES / gain), self.rows)


@dataclass(frozen=True, slots=True)
class PowerCurve:
    """Codes are changed by an undeclared power law, ``Y' = 255 (Y / 255)^exponent``.

    Attributes
    ----------
    exponent
        Above 0; 1 / 2.2 is the curve of a display.
    """

    exponent: float
    cause: ClassVar[str] = "exposure_or_gamma"
    stream: ClassVar[str] = "rgb"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Raise to the exponent."""
        description = f"rgb went through a power of {self.exponent:.3g}"
        return _of_colour(facts, description, lambda frames: _recoded(frames, _powers(self.exponent)))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Raise to 1 / exponent: codes that the curve has merged become one code."""
        description = f"rgb back from a power of {self.exponent:.3g}"
        return _of_colour(facts, description, lambda frames: _recoded(frames, _powers(1 / self.exponent)))


@dataclass(frozen=True, slots=True)
class TransferMisdeclared:
    """Frames have another transfer curve than the declared one.

    Attributes
    ----------
    actual, declared
        Transfer curve of the frames, and the declared one.
    """

    actual: Transfer
    declared: Transfer
    cause: ClassVar[str] = "exposure_or_gamma"
    stream: ClassVar[str] = "rgb"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the other curve."""
        description = f"rgb is declared {self.declared}"
        return Fault(description, declared=replace(facts.declared, transfer=self.declared))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the curve that frames have."""
        return Fault(f"rgb is declared {self.actual}", declared=replace(facts.declared, transfer=self.actual))


@dataclass(frozen=True, slots=True)
class DecodedTwice:
    """The transfer curve of a display is taken from codes that do not have it, or once too often: they get darker.

    Attributes
    ----------
    transfer
        Curve of the display.
    """

    transfer: Transfer
    cause: ClassVar[str] = "exposure_or_gamma"
    stream: ClassVar[str] = "rgb"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Decode."""
        description = f"rgb is decoded from {self.transfer} once too often"
        return _of_colour(facts, description, lambda frames: _recoded(frames, to_linear(_CODES, self.transfer)))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Encode: codes that decoding has merged become one code."""
        description = f"rgb encoded as {self.transfer}"
        return _of_colour(facts, description, lambda frames: _recoded(frames, to_code(_CODES, self.transfer)))


@dataclass(frozen=True, slots=True)
class Vignetting:
    """Frames get darker from the principal point to the farthest corner, in linear light.

    The gain is ``(1 - loss)^(r^2 / r_corner^2)``, r being the distance from the optical axis where z is 1. The
    logarithm of the brightness falls as r^2, which is how it is measured.

    Attributes
    ----------
    corner_loss_percent
        Loss in the farthest corner; negative: corners too bright.
    """

    corner_loss_percent: float
    cause: ClassVar[str] = "vignetting"
    stream: ClassVar[str] = "rgb"

    @property
    def magnitude(self) -> float:
        """Loss in the farthest corner, percent."""
        return self.corner_loss_percent

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Multiply linear values by the gains."""
        description = f"rgb loses {self.corner_loss_percent:.3g}% of its light in the farthest corner"
        return self._shaded(facts, description, power=1)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide linear values by the gains; the error is half a code over the gain, and half a code."""
        return self._shaded(facts, f"rgb divided by a fall-off of {self.corner_loss_percent:.3g}%", power=-1)

    def _shaded(self, facts: Facts, description: str, power: int) -> Fault:
        camera, transfer = _camera(facts, "rgb"), facts.declared.transfer
        corner_gain = 1 - self.corner_loss_percent / 100
        if corner_gain <= 0:
            raise InapplicableError(f"Expected a loss below 100%, got {self.corner_loss_percent:g}%")
        linear_dn = to_linear(_CODES, transfer)

        def alter(frames: NDArray[Any]) -> NDArray[Any]:
            rows, columns = (np.asarray(places) for places in np.indices(frames.shape[1:3], dtype=np.float64))
            x, y = rays_of_pixels(camera.K, camera.lens, columns, rows)
            squares = x**2 + y**2
            gains = corner_gain ** (power * squares / squares.max())
            shaded_dn = linear_dn[np.clip(frames, 0, int(WHITE_DN))] * gains[..., np.newaxis]
            return np.rint(to_code(shaded_dn, transfer))

        return _of_colour(facts, description, alter)


@dataclass(frozen=True, slots=True)
class RayLength:
    """Depth is the length of the ray instead of z: z |m|, with ``m = K^-1 (x, y, 1)``.

    Attributes
    ----------
    exponent
        Of |m|: 1 for the length of the ray, -1 where z was taken for that length and divided by |m|.
    rows
        The frames; None: all.
    """

    exponent: float = 1.0
    rows: RowRange | None = None
    cause: ClassVar[str] = "depth_ray_not_z"
    stream: ClassVar[str] = "depth"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Multiply by |m|."""
        power = "" if self.exponent == 1 else f" with |m| to the power of {self.exponent:.3g}"
        return self._scaled(facts, f"depth is the length of the ray{power}", self.exponent)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Divide by |m|."""
        divided = f"depth divided by |m| to the power of {self.exponent:.3g}"
        return self._scaled(facts, "lengths of rays become z" if self.exponent == 1 else divided, -self.exponent)

    def _scaled(self, facts: Facts, description: str, exponent: float) -> Fault:
        streams_in(facts, self.stream)
        camera = _camera(facts, "depth")
        columns, rows = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
        rays = np.stack([columns, rows, np.ones_like(columns)], axis=-1) @ np.linalg.inv(camera.K).T
        rays[..., 0], rays[..., 1] = undistorted(camera.lens, rays[..., 0], rays[..., 1])
        # Ray length / z-depth = |m| with the ray m, of z = 1, and integer coordinates at pixel centres.
        factors = np.linalg.norm(rays, axis=-1) ** exponent
        return Fault(description, {_DEPTH: in_rows(lambda depth: depth * factors, self.rows)})


@dataclass(frozen=True, slots=True)
class InvalidCode:
    """Invalid pixels hold a code instead of NaN.

    Attributes
    ----------
    stream
        ``depth`` or flow.
    code
        In the unit of the stream: 0, or infinite. Undone, valid pixels of exactly this value become NaN too: of flow,
        those of which both components have it.
    """

    stream: str
    code: float = 0.0
    cause: ClassVar[str] = "invalid_encoding"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Replace NaN by the code."""

        def alter(images: NDArray[Any]) -> NDArray[Any]:
            return np.where(np.isnan(images), images.dtype.type(self.code), images)

        description = f"invalid pixels of {self.stream} are {self.code:g}"
        return Fault(description, dict.fromkeys(value_keys(facts, self.stream), values(alter)))

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Replace the code by NaN."""

        def alter(images: NDArray[Any]) -> NDArray[Any]:
            is_code = images == images.dtype.type(self.code)
            if images.ndim > 3:
                # A component may be 0 where a point moves along the other axis.
                is_code = np.all(is_code, axis=-1, keepdims=True)
            return np.where(is_code, images.dtype.type(np.nan), images)

        description = f"{self.code:g} of {self.stream} becomes NaN"
        return Fault(description, dict.fromkeys(value_keys(facts, self.stream), values(alter)))


def _powers(exponent: float) -> NDArray[np.float64]:
    """Return ``255 (Y / 255)^exponent`` of the 256 codes Y; 0 and 255 stay."""
    powers: NDArray[np.float64] = WHITE_DN * (_CODES / WHITE_DN) ** exponent
    return powers


def _recoded(frames: NDArray[Any], curve_dn: NDArray[np.float64]) -> NDArray[Any]:
    """Replace codes by those of a curve (256,), rounded and clipped; codes that eight bits cannot hold stay."""
    codes = np.rint(np.clip(curve_dn, 0, WHITE_DN)).astype(frames.dtype)
    if frames.dtype == np.uint8:
        return np.asarray(codes[frames])
    is_code = (frames >= 0) & (frames <= WHITE_DN)
    return np.where(is_code, codes[np.where(is_code, frames, 0)], frames)


def _of_colour(
    facts: Facts, description: str, alter: Callable[[NDArray[Any]], NDArray[Any]], rows: RowRange | None = None
) -> Fault:
    streams_in(facts, "rgb")
    return Fault(description, {_RGB: in_rows(lambda frames: np.ascontiguousarray(alter(frames)), rows)})


def _camera(facts: Facts, name: str) -> Camera:
    if name not in facts.declared.cameras:
        raise InapplicableError(f"Expected a declared {name} camera, got none: its intrinsics are needed")
    return facts.declared.cameras[name]


def frozen_colour(conditions: CanaryConditions) -> Fault:
    """Three successive colour frames repeat the frame before them."""
    row = conditions.row_at_place("rgb")
    held = rows_from(lambda rows: np.where((rows >= row) & (rows < row + 3), row - 1, rows), _count(conditions, _RGB))
    return Fault(f"rgb frames {row} to {row + 2} repeat frame {row - 1}", {_RGB: held})


def exchanged_colour(conditions: CanaryConditions) -> Fault:
    """The colour frames at the two ends of every 8th interval are exchanged.

    Intervals are those of the fastest flow; without flow they last from one frame to the next.
    """
    facts, count = conditions.facts, _count(conditions, _RGB)
    # The frames at the start and at the end of each interval.
    flow_clock = facts.clocks[facts.flow_streams[-1]] if facts.flow_streams else None
    if flow_clock is None or flow_clock.ends_ns is None:
        first, last = np.arange(count - 1), np.arange(1, count)
    else:
        times_ns = facts.clocks["rgb"].times_ns
        first, last = np.searchsorted(times_ns, flow_clock.times_ns), np.searchsorted(times_ns, flow_clock.ends_ns)
    # One of the exchanged intervals lies at the place, where motion makes the exchange detectable.
    chosen = np.arange(conditions.row_at_place("rgb") % _SPARSELY, len(first), _SPARSELY)
    inside = chosen[(last[chosen] < count) & (first[chosen] < last[chosen])]
    pairs = tuple(zip(first[inside].tolist(), last[inside].tolist(), strict=True))
    exchange = conditions.planted(SwappedFrames("rgb", pairs))
    return replace(exchange, description=f"rgb frames are exchanged at the ends of every {_SPARSELY}th interval")


def darker_colour(conditions: CanaryConditions) -> Fault:
    """Colour frames are darker from the place on."""
    percent = conditions.size("largest_jump", at_least=100 * _LEAST_GAIN)
    gain = max(1 - percent / 100, _DARKEST)
    return conditions.planted(ExposureGain(100 * (gain - 1), rows=(conditions.row_at_place("rgb"), None)))


def exchanged_channels(conditions: CanaryConditions) -> Fault:
    """Two colour channels are exchanged: those of the exchange with the least detection limit."""
    limits = ((m.least_detectable, m.name.removeprefix("towards_")) for m in conditions.measurements)
    orders = [(limit, order) for limit, order in limits if limit and order in _EXCHANGES]
    # The least detection limit belongs to the exchange that is easiest to detect.
    return conditions.planted(ChannelOrder(min(orders, default=(0.0, "BGR"))[1]))


def other_transfer(conditions: CanaryConditions) -> Fault:
    """Grey values are altered by a power law that is not declared."""
    size = conditions.size("exponent", "exponent_at_declared_thresholds", at_least=_LEAST_POWER)
    return conditions.planted(PowerCurve(1 + size))


def darker_corners(conditions: CanaryConditions) -> Fault:
    """Colour frames get darker from the principal point to the farthest corner, in linear light."""
    loss = min(conditions.size("corner_loss", at_least=_LEAST_LOSS_PERCENT) / 100, _LARGEST_LOSS)
    return conditions.planted(Vignetting(100 * loss))


def displaced_events(conditions: CanaryConditions) -> Fault:
    """What locates the events, colour or depth, lies too far to the right; or events are late, if that is measured."""
    cameras, limits = conditions.facts.declared.cameras, {m.name: m.least_detectable for m in conditions.measurements}
    # Where depth locates them, edges are searched up to 8 px away, and delays up to 30 ms: a canary that is three times
    # as large as a useful limit must lie within.
    is_located = 0 < (limits.get("shift_right") or 0) <= _USEFUL_PX
    if not is_located and 0 < (limits.get("time_offset") or 0) <= _USEFUL_MS:
        return conditions.planted(ClockShift("events", NS_PER_MS * min(conditions.size("time_offset"), _LATEST_MS)))
    # Depth locates them where the check has measured along all directions from the principal point.
    stream = "depth" if "shift_outwards" in limits else "rgb"
    scale = cameras[stream].width / cameras["events"].width
    # The limit is in px of the event camera; one px of it spans width_rgb / width_events colour columns (2.25 in the
    # paper of the dataset).
    columns = math.ceil(scale * conditions.size("shift_right", at_least=1.0))
    return conditions.planted(PixelShift(stream, columns))


def shifted_depth(conditions: CanaryConditions) -> Fault:
    """Depth lies too far to the right."""
    return conditions.planted(PixelShift("depth", math.ceil(conditions.size("shift_right", at_least=1.0))))


def far_depth(conditions: CanaryConditions) -> Fault:
    """Depth is a thousand times too large: in micrometres instead of millimetres."""
    # 1 mm = 1000 um: the factor equals that from metres to millimetres.
    return conditions.planted(LengthUnit("depth", MM_PER_M))


def uneven_depth(conditions: CanaryConditions) -> Fault:
    """Depths of every second frame are too large by a factor."""
    percent = conditions.size("deviation")

    def alter(frames: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
        factors = 1 + np.where(rows % 2, percent / 100, 0.0)[:, np.newaxis, np.newaxis]
        return np.asarray(frames * factors, dtype=frames.dtype)

    return Fault(f"every second depth frame is {percent:.3g}% too far", {_DEPTH: values_by_row(alter)})


def scaled_depth(conditions: CanaryConditions) -> Fault:
    """Depth is too large by a factor."""
    return conditions.planted(LengthUnit("depth", 1 + conditions.size("scale")))


def ray_depth(conditions: CanaryConditions) -> Fault:
    """Depth is the length of the ray, or z times a higher power of |m| where that length is below the detection limit.

    |m| is the length of the ray of a pixel where z is 1.
    """
    return conditions.planted(RayLength(conditions.size("ray_exponent", at_least=1.0)))


def _count(conditions: CanaryConditions, key: str) -> int:
    return conditions.facts.sizes[key]
