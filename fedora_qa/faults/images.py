"""Faults of colour and depth frames."""

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.estimators.images.transfer import to_code, to_linear
from fedora_qa.faults.canary_conditions import CanaryConditions
from fedora_qa.faults.fault import Fault, rows_from, values, values_by_row

_RGB, _DEPTH = "path/rgb", "path/depth"
_LEAST_GAIN: Final = 0.1
"""Least relative change of brightness, 0 to 1. With eight bits it changes every grey value above 5 DN."""
_LEAST_POWER: Final = 0.5
"""Least excess of the exponent above 1. Contrasts are then 1.5 times as large; the transfer curve of a display makes
them more than twice as large."""
_WHITE_DN: Final = 255.0
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
    source = np.arange(count)
    source[last[inside]], source[first[inside]] = first[inside], last[inside]
    description = f"rgb frames are exchanged at the ends of every {_SPARSELY}th interval"
    return Fault(description, {_RGB: rows_from(lambda rows: source[rows], count)})


def darker_colour(conditions: CanaryConditions) -> Fault:
    """Colour frames are darker from the place on."""
    row, percent = conditions.row_at_place("rgb"), conditions.size("largest_jump", at_least=100 * _LEAST_GAIN)
    gain = max(1 - percent / 100, _DARKEST)

    def alter(frames: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
        gains = np.where(rows >= row, gain, 1.0)[:, np.newaxis, np.newaxis, np.newaxis]
        return np.asarray(np.rint(frames * gains), dtype=frames.dtype)

    return Fault(f"rgb is {100 * (1 - gain):.3g}% darker from frame {row} on", {_RGB: values_by_row(alter)})


def exchanged_channels(conditions: CanaryConditions) -> Fault:
    """Two colour channels are exchanged: those of the exchange with the least detection limit."""
    limits = ((m.least_detectable, m.name.removeprefix("towards_")) for m in conditions.measurements)
    orders = [(limit, order) for limit, order in limits if limit and order in _EXCHANGES]
    # The least detection limit belongs to the exchange that is easiest to detect.
    order = min(orders, default=(0.0, "BGR"))[1]
    channels = ["RGB".index(channel) for channel in order]
    return Fault(f"rgb is {', '.join(order)}", {_RGB: values(lambda frames: frames[..., channels])})


def other_transfer(conditions: CanaryConditions) -> Fault:
    """Grey values are altered by a power law that is not declared."""
    power = 1 + conditions.size("exponent", "exponent_at_declared_thresholds", at_least=_LEAST_POWER)
    # Y' = 255 (Y / 255)^power, for all 256 codes; 0 and 255 stay.
    codes = np.rint(_WHITE_DN * (np.arange(_WHITE_DN + 1) / _WHITE_DN) ** power).astype(np.uint8)
    return Fault(f"rgb went through a power of {power:.3g}", {_RGB: values(lambda frames: codes[frames])})


def darker_corners(conditions: CanaryConditions) -> Fault:
    """Colour frames get darker from the principal point to the farthest corner, in linear light."""
    facts = conditions.facts
    loss = min(conditions.size("corner_loss", at_least=_LEAST_LOSS_PERCENT) / 100, _LARGEST_LOSS)
    declared, K = facts.declared, facts.declared.cameras["rgb"].K
    linear_dn = to_linear(np.arange(_WHITE_DN + 1), declared.transfer)

    def alter(frames: NDArray[Any]) -> NDArray[Any]:
        y, x = np.indices(frames.shape[1:3], dtype=np.float64)
        squares = ((x - K[0, 2]) / K[0, 0]) ** 2 + ((y - K[1, 2]) / K[1, 1]) ** 2
        gains = (1 - loss) ** (squares / squares.max())
        darkened_dn = linear_dn[frames] * gains[..., np.newaxis]
        return np.asarray(np.rint(to_code(darkened_dn, declared.transfer)), dtype=frames.dtype)

    return Fault(f"rgb loses {100 * loss:.3g}% of its light in the farthest corner", {_RGB: values(alter)})


def shifted_colour(conditions: CanaryConditions) -> Fault:
    """Colour frames lie too far to the right, by a number of pixels of the event camera."""
    cameras = conditions.facts.declared.cameras
    scale = cameras["rgb"].width / cameras["events"].width
    # The limit is in px of the event camera; one px of it spans width_rgb / width_events colour columns (2.25 in the
    # paper of the dataset).
    return _shifted(_RGB, math.ceil(scale * conditions.size("shift_right", at_least=1.0)))


def shifted_depth(conditions: CanaryConditions) -> Fault:
    """Depth lies too far to the right."""
    return _shifted(_DEPTH, math.ceil(conditions.size("shift_right", at_least=1.0)))


def far_depth(conditions: CanaryConditions) -> Fault:
    """Depth is a thousand times too large: in micrometres instead of millimetres."""
    # 1 mm = 1000 um: the factor equals that from metres to millimetres.
    return Fault("depth is in micrometres", {_DEPTH: values(lambda depth: depth * np.float32(MM_PER_M))})


def uneven_depth(conditions: CanaryConditions) -> Fault:
    """Depths of every second frame are too large by a factor."""
    percent = conditions.size("deviation")

    def alter(frames: NDArray[Any], rows: NDArray[np.int64]) -> NDArray[Any]:
        factors = 1 + np.where(rows % 2, percent / 100, 0.0)[:, np.newaxis, np.newaxis]
        return np.asarray(frames * factors, dtype=frames.dtype)

    return Fault(f"every second depth frame is {percent:.3g}% too far", {_DEPTH: values_by_row(alter)})


def scaled_depth(conditions: CanaryConditions) -> Fault:
    """Depth is too large by a factor."""
    factor = np.float32(1 + conditions.size("scale"))
    return Fault(f"depth is too large by a factor of {factor:.6g}", {_DEPTH: values(lambda depth: depth * factor)})


def ray_depth(conditions: CanaryConditions) -> Fault:
    """Depth is the length of the ray, or z times a higher power of |m| where that length is below the detection limit.

    |m| is the length of the ray of a pixel where z is 1.
    """
    camera, exponent = conditions.facts.declared.cameras["depth"], conditions.size("ray_exponent", at_least=1.0)
    x, y = np.meshgrid(np.arange(camera.width), np.arange(camera.height))
    pixels = np.stack([x, y, np.ones_like(x)], axis=-1)
    # Ray length / z-depth = |m| = |K^-1 (x, y, 1)|, with integer coordinates at pixel centres.
    lengths = np.linalg.norm(pixels @ np.linalg.inv(camera.K).T, axis=-1)
    factors = (lengths**exponent).astype(np.float32)
    return Fault("depth is the length of the ray", {_DEPTH: values(lambda depth: depth * factors)})


def _shifted(key: str, columns: int) -> Fault:
    stream = key.removeprefix("path/")
    # Axes are (time, row, column); columns increase to the right.
    return Fault(
        f"{stream} lies {columns} px too far to the right", {key: values(lambda v: np.roll(v, columns, axis=2))}
    )


def _count(conditions: CanaryConditions, key: str) -> int:
    return conditions.facts.sizes[key]
