"""The scales that all pictures of a file share: a colour means the same value in each of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fedora_reports.evidence import Array, finite
from fedora_reports.scales import Axis
from fedora_reports.snapshots import Snapshot

_DARK_DN = 64.0
"""Frames whose brightest hundredth stays below this are too dark to look at, and are brightened."""

_LEAST_RESIDUAL_DN = 16.0
"""Residuals below this occur in correct files: frames are averaged over blocks, and the view of a texture changes."""

_NO_VALUES = [np.empty(0)]


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
        Flow of this speed or more has its full colour: the 99th percentile, so that one pixel does not fade the rest.
        It is a speed, because the intervals of the fields have different lengths; an unknown interval counts as 1 s.
    full_events
        Events a pixel that are drawn opaque: the 99th percentile over the pixels with events, rounded up.
    full_residual_dn
        Residuals of this size or more have the full colour: the 99th percentile, but at least the residual that noise
        and averaging leave in a correct file.
    """

    gain: int
    depth_m: Axis | None
    full_flow_px_s: float
    full_events: int
    full_residual_dn: float


def scales_for(snapshots: Sequence[Snapshot]) -> PictureScales:
    """Return the scales that suit all of these snapshots."""
    brightest_dn = max((float(np.percentile(snapshot.rgb, 99)) for snapshot in snapshots if snapshot.rgb is not None),
                       default=255.0)  # fmt: skip
    depths_m, speeds_px_s, residuals_dn, events = [], [], [], []
    for snapshot in snapshots:
        if snapshot.depth_m is not None:
            snapshot_depths_m = finite(snapshot.depth_m)
            depths_m.append(snapshot_depths_m[snapshot_depths_m > 0])
        if snapshot.flow_px is not None:
            speeds_px_s.append(flow_lengths_px(snapshot.flow_px) / snapshot.flow_interval_s)
        if snapshot.residual_dn is not None:
            residuals_dn.append(np.abs(finite(snapshot.residual_dn)))
        if snapshot.brighter is not None and snapshot.darker is not None:
            snapshot_events = finite(snapshot.brighter) + finite(snapshot.darker)
            events.append(snapshot_events[snapshot_events > 0])
    depth_m, speed_px_s = np.concatenate(depths_m or _NO_VALUES), np.concatenate(speeds_px_s or _NO_VALUES)
    residual_dn, count = np.concatenate(residuals_dn or _NO_VALUES), np.concatenate(events or _NO_VALUES)
    least_dn = _LEAST_RESIDUAL_DN
    return PictureScales(
        gain=max(int(160.0 / max(brightest_dn, 1.0)), 1) if brightest_dn < _DARK_DN else 1,
        depth_m=Axis(float(depth_m.min()), float(depth_m.max()), logarithmic=True) if depth_m.size else None,
        full_flow_px_s=float(np.percentile(speed_px_s, 99)) if speed_px_s.size else 0.0,
        full_events=math.ceil(np.percentile(count, 99)) if count.size else 1,
        full_residual_dn=max(float(np.percentile(residual_dn, 99)), least_dn) if residual_dn.size else least_dn,
    )


def flow_lengths_px(flow_px: Array) -> Array:
    """Return the finite lengths of flow (h, w, 2) as one row. Infinite lengths, which have no scale, are left out."""
    u, v = (np.asarray(flow_px[..., k], dtype=np.float64) for k in (0, 1))
    with np.errstate(invalid="ignore", over="ignore"):
        return finite(np.hypot(u, v))
