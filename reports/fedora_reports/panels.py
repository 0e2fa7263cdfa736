"""One instant, aligned: colour frame, events over it, depth, flow, and what the flow leaves, beside each other."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from fedora_qa.record.wording import number
from fedora_reports import colour_maps
from fedora_reports.evidence import finite
from fedora_reports.instants import Array, Instant
from fedora_reports.picture_scales import PictureScales, flow_lengths_px
from fedora_reports.pictures import Image, drawing, photograph
from fedora_reports.scales import Axis

Kind = Literal["frame", "events", "depth", "flow", "residual"]

NAMES: dict[Kind, str] = {
    "frame": "Colour frame",
    "events": "Events",
    "depth": "Depth",
    "flow": "Flow",
    "residual": "Residual of flow",
}

_ARROWS_ACROSS = 9
"""Arrows over a picture of flow, so that its direction is not told by colour alone."""


@dataclass(frozen=True, slots=True)
class Panel:
    """A picture of one stream with its caption; ``arrows`` is an SVG path in pixels of the picture."""

    kind: Kind
    name: str
    image: Image
    caption: str
    arrows: str = ""
    box: tuple[float, float, float, float] | None = None


def panels_of(instant: Instant, scales: PictureScales) -> Iterator[Panel]:
    """Yield the panels of an instant, in the order of the paper; streams that are not there are left out."""
    if instant.rgb is not None:
        yield _frame(instant, instant.rgb, scales.gain)
    if instant.brighter is not None and instant.darker is not None:
        yield _events(instant, instant.brighter, instant.darker, scales)
    if instant.depth_m is not None:
        yield _depth(instant, instant.depth_m, scales.depth_m)
    if instant.flow_px is not None:
        yield _flow(instant, instant.flow_px, scales.full_flow_px_s * instant.flow_interval_s)
    if instant.residual_dn is not None:
        yield _residual(instant, instant.residual_dn, scales.full_residual_dn)


def _frame(instant: Instant, rgb: Array, gain: int) -> Panel:
    if not instant.rgb_known:
        return _nothing("frame", instant, rgb)
    displayed = _brightened(rgb, gain)
    brightened = f", shown {gain} times as bright" if gain > 1 else ""
    caption = f"DN {rgb.min()} to {rgb.max()} of 255{brightened}"
    return Panel(
        "frame", NAMES["frame"], photograph(displayed, _alt("frame", instant, caption)), caption, box=instant.box
    )


def _events(instant: Instant, brighter: Array, darker: Array, scales: PictureScales) -> Panel:
    if not instant.events_known:
        return _nothing("events", instant, brighter)
    on, off = (int(finite(counts).sum()) for counts in (brighter, darker))
    caption = f"{_count(on)} brighter (red), {_count(off)} darker (blue){_within(instant.events_interval_us)}"
    ground, full = _ground(instant, scales.gain), scales.full_events
    if ground is not None:
        height, width = ground.shape[:2]
        brighter, darker = (_stretched(counts, height, width) for counts in (brighter, darker))
    image = drawing(colour_maps.event_colours(brighter, darker, full, ground), _alt("events", instant, caption))
    return Panel("events", NAMES["events"], image, caption, box=instant.box)


def _ground(instant: Instant, gain: int) -> colour_maps.Picture | None:
    """Return the frame that events are drawn over: the cameras of a file look through one field of view."""
    return colour_maps.faded(_brightened(instant.rgb, gain)) if instant.rgb is not None and instant.rgb_known else None


def _brightened(rgb: Array, gain: int) -> colour_maps.Picture:
    return np.asarray(np.minimum(rgb.astype(np.uint16) * gain, 255), dtype=np.uint8)


def _stretched(counts: Array, height: int, width: int) -> Array:
    """Return counts of events in pixels of another picture, each as large as it is there."""
    plain = np.nan_to_num(np.asarray(counts, dtype=np.float64), posinf=0.0, neginf=0.0)
    return np.asarray(cv2.resize(plain, (width, height), interpolation=cv2.INTER_NEAREST_EXACT))


def _depth(instant: Instant, depth_m: Array, axis: Axis | None) -> Panel:
    depths_m = finite(depth_m)
    depths_m = depths_m[depths_m > 0]
    caption = _span(float(depths_m.min()), float(depths_m.max()), axis) if depths_m.size else "none here"
    # Nearer is brighter: the scale runs from far to near.
    metres = np.where(np.isfinite(depth_m) & (np.nan_to_num(depth_m) > 0), depth_m, np.nan)
    shares = 1.0 - axis.shares(metres) if axis else np.full(depth_m.shape, np.nan)
    picture = colour_maps.by_table(shares, colour_maps.SEQUENTIAL)
    return Panel("depth", NAMES["depth"], drawing(picture, _alt("depth", instant, caption)), caption, box=instant.box)


def _span(near_m: float, far_m: float, axis: Axis | None) -> str:
    """Return from where to where; with its colours where the scale is this picture's own."""
    if axis and (near_m, far_m) == (axis.low, axis.high):
        return f"{near_m:.3g} m (yellow) to {far_m:.3g} m (violet)"
    return f"{near_m:.3g} to {far_m:.3g} m"


def _flow(instant: Instant, flow_px: Array, full_px: float) -> Panel:
    lengths = flow_lengths_px(flow_px)
    caption = (
        f"up to {lengths.max():.3g} px{_within(instant.flow_interval_us)}, along the arrows"
        if lengths.size
        else "none here"
    )
    image = drawing(colour_maps.flow_colours(flow_px, full_px), _alt("flow", instant, caption))
    return Panel("flow", NAMES["flow"], image, caption, arrows_over(flow_px, full_px), instant.box)


def _residual(instant: Instant, residual_dn: Array, full_dn: float) -> Panel:
    sizes = np.abs(finite(residual_dn))
    with np.errstate(over="ignore"):
        caption = f"{np.sqrt(np.mean(sizes**2)):.2g} DN rms, up to {sizes.max():.3g} DN" if sizes.size else "none here"
    shares = Axis(-full_dn, full_dn).shares(np.where(np.isfinite(residual_dn), residual_dn, np.nan))
    picture = colour_maps.by_table(shares, colour_maps.DIVERGING)
    image = drawing(picture, _alt("residual", instant, caption))
    return Panel("residual", NAMES["residual"], image, caption, box=instant.box)


def _nothing(kind: Kind, instant: Instant, picture: Array) -> Panel:
    """Return a grey panel in the place of a picture that this instant lacks."""
    grey = colour_maps.by_table(np.full(picture.shape[:2], np.nan), colour_maps.SEQUENTIAL)
    return Panel(kind, NAMES[kind], drawing(grey, _alt(kind, instant, "none here")), "none here")


def arrows_over(flow_px: Array, full_px: float) -> str:
    """Return arrows over flow (h, w, 2) as an SVG path in pixels of the picture; the longest span one grid step."""
    height, width = flow_px.shape[:2]
    step = max(width / _ARROWS_ACROSS, 1.0)
    if full_px <= 0:
        return ""
    marks = []
    for y in np.arange(step / 2, height, step):
        for x in np.arange(step / 2, width, step):
            u, v = (float(value) for value in flow_px[int(y), int(x)])
            length = float(np.hypot(u, v))
            if np.isfinite(length) and length > 0:
                reach = 0.8 * step * min(length / full_px, 1.0) / length
                marks.append(_arrow(x, y, u * reach, v * reach))
    return "".join(marks)


def _arrow(x: float, y: float, dx: float, dy: float) -> str:
    """Return an arrow from (x, y): a shaft, and a head of a third of its length, 25 degrees open to either side."""
    barbs = [(-(c * dx - s * dy) / 3, -(s * dx + c * dy) / 3) for c, s in ((0.906, 0.423), (0.906, -0.423))]
    (ax, ay), (bx, by) = barbs
    return f"M{x:.1f} {y:.1f}l{dx:.1f} {dy:.1f}l{ax:.1f} {ay:.1f}m{-ax:.1f} {-ay:.1f}l{bx:.1f} {by:.1f}"


def _alt(kind: Kind, instant: Instant, caption: str) -> str:
    moment = "" if instant.time_us is None else f" at {seconds(instant.time_us)}"
    boxed = "; the box marks the worst place" if instant.box and instant.worst else ""
    return f"{NAMES[kind]}{moment}: {caption}{boxed}"


def _within(interval_us: Array | None) -> str:
    return (
        "" if interval_us is None else f" in {number(float(interval_us[1] - interval_us[0]) / 1e3)}\N{NO-BREAK SPACE}ms"
    )


def _count(events: int) -> str:
    return f"{events:,}".replace(",", "\N{NARROW NO-BREAK SPACE}")


def seconds(time_us: float) -> str:
    """Return microseconds of the file's clock as seconds, to the millisecond."""
    return f"{time_us / 1e6:.3f} s"
