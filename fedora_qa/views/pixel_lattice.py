"""The compared pixels of a field: its static part, a lattice, its deviating part, and a thinned sample."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.flow.motion_fit import FlowSample
from fedora_qa.sequence.declared import Lens
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_intervals import Interval

Float64 = NDArray[np.float64]
Region = tuple[int, int, int, int]
"""Left, top, right, bottom of a part of the image, in pixels; half-open."""

FIT_PIXELS: Final = 800
"""Pixels that a motion is fitted to: enough for six parameters, since the residuals are rounding."""

_DEFAULT_SIGMA_PX: Final = 0.01
"""Standard deviation of residuals, px, where no rounding bound is computed: small against the effect of any
transform."""

FEWEST_PIXELS: Final = 20
"""Pixels below which a field is not compared."""

_FILLED: Final = 0.5
"""Least share of a region's pixels that must deviate: a fault of a part of the image leaves few pixels unchanged."""

_UNAFFECTED: Final = 0.1
"""Largest ratio of the error around a region to that within it at which the pixels around it count as not affected."""

_PART: Final = 0.9
"""Share of the image's pixels above which a region counts as the whole image."""


def why_no_static_depth(facts: Facts) -> str:
    """Return why moving objects cannot be left out; empty where they can, or where no object moves by itself."""
    if facts.declared.flow_model != "scene" or masked_flows(facts):
        return ""
    return "objects move (flow model 'scene'), and no mask marks their pixels"


def masked_flows(facts: Facts) -> tuple[str, ...]:
    """Return the flow streams that have masks of objects that move by themselves, the fastest first."""
    masked = (stream for stream in facts.flow_streams if f"path/{stream}_moving" in facts.sizes)
    return tuple(masked)[::-1]


def has_static_depth(window: Window, frame: int) -> bool:
    """Whether ``static_depth_m`` is not None, without decoding an image; a mask may still be missing.

    Parameters
    ----------
    frame
        Row of the depth stream.
    """
    if window.facts.declared.flow_model != "scene":
        return True
    clocks, time_ns = window.facts.clocks, int(window.facts.clocks["depth"].times_ns[frame])
    return any(bool(np.any(clocks[stream].times_ns == time_ns)) for stream in masked_flows(window.facts))


def static_depth_m(window: Window, frame: int) -> NDArray[np.float32] | None:
    """Return a depth frame with NaN where an object moves by itself.

    The masks of flow mark these pixels at the start of each field.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the image.
    frame
        Row of the depth stream.

    Returns
    -------
    ndarray of float32 or None
        (H, W) m; None where objects may move by themselves and no masked field starts with the frame.
    """
    if window.facts.declared.flow_model != "scene":
        return window.depth_m(frame)
    return window.derived(_standing_depth_m, frame)


def _standing_depth_m(window: Window, frame: int) -> NDArray[np.float32] | None:
    time_ns = int(window.facts.clocks["depth"].times_ns[frame])
    for stream in masked_flows(window.facts):
        fields = np.flatnonzero(window.facts.clocks[stream].times_ns == time_ns)
        moving = window.moving(stream, int(fields[0])) if len(fields) else None
        if moving is not None:
            return np.where(moving, np.float32(np.nan), window.depth_m(frame))
    return None


def sample_field(window: Window, interval: Interval, frame: int, region: Region | None = None) -> FlowSample | None:
    """Return evenly thinned pixels of a field that are also valid in the depth frame; None where there are too few.

    Parameters
    ----------
    interval
        Of the field.
    frame
        Row of the depth frame at its start.
    region
        Left, top, right, bottom, px, half-open, of the part that is sampled; the whole image if None.

    Returns
    -------
    FlowSample or None
        About ``FIT_PIXELS`` pixels; None for fewer than ``FEWEST_PIXELS``.
    """
    lattice = lattice_of(window, interval, frame)
    return None if lattice is None else thinned(lattice if region is None else lattice.within(region))


@dataclass(frozen=True, slots=True)
class FlowLattice:
    """Pixels of a field at regular steps, with their depths.

    Attributes
    ----------
    columns, rows
        (1, w) and (h, 1), px.
    depths_m
        (h, w) along the optical axis; NaN where a value is missing.
    flow_px
        (h, w, 2) px: u to the right, v down.
    lens
        Of the camera; None for a pinhole.
    """

    columns: Float64
    rows: Float64
    depths_m: Float64
    flow_px: Float64
    lens: Lens | None = None

    def within(self, region: Region) -> "FlowLattice":
        """Return the lattice with the depths outside of a region set to NaN."""
        return replace(self, depths_m=np.where(self._inside(region), self.depths_m, np.nan))

    def beside(self, region: Region) -> "FlowLattice":
        """Return the lattice with the depths within a region set to NaN."""
        return replace(self, depths_m=np.where(self._inside(region), np.nan, self.depths_m))

    def _inside(self, region: Region) -> NDArray[np.bool_]:
        left, top, right, bottom = region
        inside: NDArray[np.bool_] = (
            (self.columns >= left) & (self.columns < right) & (self.rows >= top) & (self.rows < bottom)
        )
        return inside


def region_of(lattice: FlowLattice, excess: Float64) -> Region | None:
    """Return the rectangle about the deviating pixels, where only these deviate and they are a part of the image.

    A pixel deviates where its error exceeds its bound. A small fault of the whole image exceeds its bound in a part
    only, but its error elsewhere is little below the bound.

    Parameters
    ----------
    lattice
        The compared pixels.
    excess
        (h, w) error over its bound, NaN where not compared.

    Returns
    -------
    Region or None
        Left, top, right, bottom, px, half-open; None where no such part exists.
    """
    compared = np.isfinite(excess)
    rows, columns = np.nonzero(compared & (excess > 1))
    if len(rows) < FEWEST_PIXELS:
        return None
    part = (slice(rows.min(), rows.max() + 1), slice(columns.min(), columns.max() + 1))
    inside = np.zeros_like(compared)
    inside[part] = compared[part]
    count = np.count_nonzero(inside)
    if len(rows) < _FILLED * count or count > _PART * np.count_nonzero(compared):
        return None
    if np.median(excess[compared & ~inside]) > _UNAFFECTED * np.median(excess[inside]):
        return None
    left, right = (int(lattice.columns[0, column]) for column in (columns.min(), columns.max()))
    top, bottom = (int(lattice.rows[row, 0]) for row in (rows.min(), rows.max()))
    return left, top, right + 1, bottom + 1


def union_of(regions: Sequence[Region]) -> Region | None:
    """Return the smallest rectangle that holds some rectangles; None without any."""
    if not regions:
        return None
    lefts, tops, rights, bottoms = zip(*regions, strict=True)
    return min(lefts), min(tops), max(rights), max(bottoms)


def lattice_of(window: Window, interval: Interval, frame: int) -> FlowLattice | None:
    """Return the lattice that the effort asks for; its origin moves from field to field over all pixels of a step.

    Parameters
    ----------
    interval
        Of the field.
    frame
        Row of the depth frame at its start.

    Returns
    -------
    FlowLattice or None
        None where static depth is not known, or depth and flow have different sizes.
    """
    depth_m, flow_px = static_depth_m(window, frame), window.flow_px(interval.stream, interval.row)
    camera = window.facts.declared.cameras.get("depth")
    if depth_m is None or depth_m.shape != flow_px.shape[:2]:
        return None
    stride = max(1, round(1 / window.sampling.tile_share))
    # Successive fields take each of the stride^2 phases in turn, so that no pixel is left out for good.
    first_row, first_column = divmod(interval.row % stride**2, stride)
    pixels = (slice(first_row, None, stride), slice(first_column, None, stride))
    depths_m, flow = depth_m[pixels].astype(np.float64), flow_px[pixels].astype(np.float64)
    valid = (depths_m > 0) & np.isfinite(depths_m) & np.isfinite(flow[..., 0]) & np.isfinite(flow[..., 1])
    return FlowLattice(
        np.arange(first_column, depth_m.shape[1], stride, dtype=np.float64)[None, :],
        np.arange(first_row, depth_m.shape[0], stride, dtype=np.float64)[:, None],
        np.where(valid, depths_m, np.nan),
        flow,
        None if camera is None else camera.lens,
    )


def thinned(lattice: FlowLattice) -> FlowSample | None:
    """Return some ``FIT_PIXELS`` valid pixels of a lattice, evenly spread; None where too few are valid."""
    valid = np.flatnonzero(np.isfinite(lattice.depths_m))
    if len(valid) < FEWEST_PIXELS:
        return None
    row, column = np.unravel_index(valid[:: max(1, len(valid) // FIT_PIXELS)], lattice.depths_m.shape)
    depths_m, flow_px = lattice.depths_m[row, column], lattice.flow_px[row, column]
    return FlowSample(
        lattice.columns[0, column], lattice.rows[row, 0], depths_m, flow_px, _DEFAULT_SIGMA_PX, lattice.lens
    )
