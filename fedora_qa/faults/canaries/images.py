"""Faults of colour and depth frames."""

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.faults.canary_conditions import CanaryConditions
from fedora_qa.faults.fault import Fault, rows_from, values_by_row
from fedora_qa.faults.images import ChannelOrder, ExposureGain, PowerCurve, RayLength, Vignetting
from fedora_qa.faults.pixels import PixelShift
from fedora_qa.faults.row_order import SwappedFrames
from fedora_qa.faults.units import LengthUnit

_RGB, _DEPTH = "path/rgb", "path/depth"
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


def shifted_colour(conditions: CanaryConditions) -> Fault:
    """Colour frames lie too far to the right, by a number of pixels of the event camera."""
    cameras = conditions.facts.declared.cameras
    scale = cameras["rgb"].width / cameras["events"].width
    # The limit is in px of the event camera; one px of it spans width_rgb / width_events colour columns (2.25 in the
    # paper of the dataset).
    columns = math.ceil(scale * conditions.size("shift_right", at_least=1.0))
    return conditions.planted(PixelShift("rgb", columns))


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
