"""The scales that pictures shown together share, so that the same colour means the same value."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fedora_reports.evidence import finite
from fedora_reports.instants import Array, Instant
from fedora_reports.scales import Axis

_DARK_DN = 64.0
"""Frames whose brightest hundredth stays below this are shown brightened, or nothing would be seen."""


_LEAST_RESIDUAL_DN = 16.0
"""Below, textures that are averaged over blocks and seen from another place leave as much where all is right."""


@dataclass(frozen=True, slots=True)
class PictureScales:
    """How values become colours.

    Attributes
    ----------
    gain
        Whole factor by which frames are brightened; 1 shows them as stored.
    depth_m
        Logarithmic; None where no depth is known.
    full_flow_px_s
        Flow of this speed or more has its full colour: the 99th percentile, so that one pixel does not fade the rest. A
        speed, because fields over intervals of different lengths are shown side by side; of a field whose interval is
        not known the length counts as that of a second.
    full_events
        Events a pixel that are drawn opaque: the 99th percentile of the pixels that have any, rounded up.
    full_residual_dn
        Residuals of this size or more have the full colour: the 99th percentile, but never less than what noise and
        averaging leave, or a good file would look alarming.
    """

    gain: int
    depth_m: Axis | None
    full_flow_px_s: float
    full_events: int
    full_residual_dn: float


def scales_for(instants: Sequence[Instant]) -> PictureScales:
    """Return the scales that suit all of these instants."""
    return PictureScales(
        _gain(instants), _depth(instants), _full_flow(instants), _full_events(instants), _full_residual(instants)
    )


def flow_lengths_px(flow_px: Array) -> Array:
    """Return the finite lengths of flow (h, w, 2) as one row; inf, which no picture can scale, is left out."""
    u, v = (np.asarray(flow_px[..., k], dtype=np.float64) for k in (0, 1))
    with np.errstate(invalid="ignore", over="ignore"):
        return finite(np.hypot(u, v))


def _gain(instants: Sequence[Instant]) -> int:
    brightest = max(
        (float(np.percentile(instant.rgb, 99)) for instant in instants if instant.rgb is not None), default=255.0
    )
    return max(int(160.0 / max(brightest, 1.0)), 1) if brightest < _DARK_DN else 1


def _depth(instants: Sequence[Instant]) -> Axis | None:
    depths_m = [finite(instant.depth_m) for instant in instants if instant.depth_m is not None]
    depths = np.concatenate([values[values > 0] for values in depths_m]) if depths_m else np.empty(0)
    return Axis(float(depths.min()), float(depths.max()), logarithmic=True) if depths.size else None


def _full_flow(instants: Sequence[Instant]) -> float:
    speeds = [
        flow_lengths_px(instant.flow_px) / instant.flow_interval_s
        for instant in instants
        if instant.flow_px is not None
    ]
    lengths = np.concatenate(speeds) if speeds else np.empty(0)
    return float(np.percentile(lengths, 99)) if lengths.size else 0.0


def _full_residual(instants: Sequence[Instant]) -> float:
    residuals = [np.abs(finite(instant.residual_dn)) for instant in instants if instant.residual_dn is not None]
    sizes = np.concatenate(residuals) if residuals else np.empty(0)
    return max(float(np.percentile(sizes, 99)), _LEAST_RESIDUAL_DN) if sizes.size else _LEAST_RESIDUAL_DN


def _full_events(instants: Sequence[Instant]) -> int:
    totals = [finite(instant.brighter) + finite(instant.darker) for instant in instants
              if instant.brighter is not None and instant.darker is not None]  # fmt: skip
    counts = np.concatenate(totals) if totals else np.empty(0)
    counts = counts[counts > 0]
    return math.ceil(np.percentile(counts, 99)) if counts.size else 1
