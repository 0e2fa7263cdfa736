"""The panels of a snapshot, beside each other: colour frame, events over it, depth, flow, and the flow's residual."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from fedora_qa.record.wording import number
from fedora_reports import colour_maps
from fedora_reports.evidence import Array, finite
from fedora_reports.picture_scales import PictureScales, flow_lengths_px
from fedora_reports.pictures import Image, drawing, photograph
from fedora_reports.scales import Axis
from fedora_reports.snapshots import Snapshot

Kind = Literal["frame", "events", "depth", "flow", "residual"]

NAMES: dict[Kind, str] = {
    "frame": "Colour frame",
    "events": "Events",
    "depth": "Depth",
    "flow": "Flow",
    "residual": "Residual of flow",
}

_ARROWS_ACROSS = 9
"""Arrows in a row over a picture of flow, whose direction must not depend on colour alone."""


@dataclass(frozen=True, slots=True)
class Panel:
    """A picture of one stream with its caption; ``arrows`` is an SVG path in pixels of the picture."""

    kind: Kind
    name: str
    image: Image
    caption: str
    arrows: str = ""
    box: tuple[float, float, float, float] | None = None


def panels_of(snapshot: Snapshot, scales: PictureScales) -> Iterator[Panel]:
    """Yield the panels of a snapshot in the order of the paper, without those of missing streams.

    Parameters
    ----------
    snapshot
        The pictures.
    scales
        The scales that all pictures of the file share.
    """
    # Events are drawn over the frame, because the cameras of a file share one field of view.
    ground = None
    if snapshot.rgb is not None and not snapshot.rgb_known:
        yield _empty("frame", snapshot, snapshot.rgb)
    elif snapshot.rgb is not None:
        rgb, gain = snapshot.rgb, scales.gain
        picture = np.asarray(np.minimum(rgb.astype(np.uint16) * gain, 255), dtype=np.uint8)
        brightened = f", shown {gain} times as bright" if gain > 1 else ""
        caption = f"DN {rgb.min()} to {rgb.max()} of 255{brightened}"
        image = photograph(picture, _alt("frame", snapshot, caption))
        yield Panel("frame", NAMES["frame"], image, caption, box=snapshot.box)
        ground = colour_maps.faded(picture)

    if snapshot.brighter is not None and snapshot.darker is not None and not snapshot.events_known:
        yield _empty("events", snapshot, snapshot.brighter)
    elif snapshot.brighter is not None and snapshot.darker is not None:
        counts = [snapshot.brighter, snapshot.darker]
        on, off = (f"{int(finite(count).sum()):,}".replace(",", "\N{NARROW NO-BREAK SPACE}") for count in counts)
        caption = f"{on} brighter (red), {off} darker (blue){_within(snapshot.events_interval_us)}"
        if ground is not None:
            # Each pixel of the event camera covers several of the frame, each with the full count.
            height, width = ground.shape[:2]
            counts = [np.nan_to_num(np.asarray(count, np.float64), posinf=0.0, neginf=0.0) for count in counts]
            counts = [cv2.resize(count, (width, height), interpolation=cv2.INTER_NEAREST_EXACT) for count in counts]
        picture = colour_maps.event_colours(counts[0], counts[1], scales.full_events, ground)
        image = drawing(picture, _alt("events", snapshot, caption))
        yield Panel("events", NAMES["events"], image, caption, box=snapshot.box)

    if snapshot.depth_m is not None:
        axis = scales.depth_m
        depths_m = finite(snapshot.depth_m)
        depths_m = depths_m[depths_m > 0]
        caption = "none here"
        if depths_m.size:
            near_m, far_m = float(depths_m.min()), float(depths_m.max())
            caption = f"{near_m:.3g} to {far_m:.3g} m"
            # Only the ends of the scale have the colours that the caption names.
            if axis and (near_m, far_m) == (axis.low, axis.high):
                caption = f"{near_m:.3g} m (yellow) to {far_m:.3g} m (violet)"
        # Nearer is brighter: the scale runs from far to near.
        positive = np.isfinite(snapshot.depth_m) & (np.nan_to_num(snapshot.depth_m) > 0)
        metres = np.where(positive, snapshot.depth_m, np.nan)
        shares = 1.0 - axis.shares(metres) if axis else np.full(snapshot.depth_m.shape, np.nan)
        picture = colour_maps.by_table(shares, colour_maps.SEQUENTIAL)
        image = drawing(picture, _alt("depth", snapshot, caption))
        yield Panel("depth", NAMES["depth"], image, caption, box=snapshot.box)

    if snapshot.flow_px is not None:
        full_px = scales.full_flow_px_s * snapshot.flow_interval_s
        lengths_px = flow_lengths_px(snapshot.flow_px)
        caption = "none here"
        if lengths_px.size:
            caption = f"up to {lengths_px.max():.3g} px{_within(snapshot.flow_interval_us)}, along the arrows"
        image = drawing(colour_maps.flow_colours(snapshot.flow_px, full_px), _alt("flow", snapshot, caption))
        yield Panel("flow", NAMES["flow"], image, caption, arrows_over(snapshot.flow_px, full_px), snapshot.box)

    if snapshot.residual_dn is not None:
        full_dn = scales.full_residual_dn
        sizes_dn = np.abs(finite(snapshot.residual_dn))
        caption = "none here"
        if sizes_dn.size:
            with np.errstate(over="ignore"):
                caption = f"{np.sqrt(np.mean(sizes_dn**2)):.2g} DN rms, up to {sizes_dn.max():.3g} DN"
        residual_dn = np.where(np.isfinite(snapshot.residual_dn), snapshot.residual_dn, np.nan)
        picture = colour_maps.by_table(Axis(-full_dn, full_dn).shares(residual_dn), colour_maps.DIVERGING)
        image = drawing(picture, _alt("residual", snapshot, caption))
        yield Panel("residual", NAMES["residual"], image, caption, box=snapshot.box)


def _empty(kind: Kind, snapshot: Snapshot, picture: Array) -> Panel:
    """Return a grey panel of the size of a picture, for a stream without a sample at this time."""
    grey = colour_maps.by_table(np.full(picture.shape[:2], np.nan), colour_maps.SEQUENTIAL)
    return Panel(kind, NAMES[kind], drawing(grey, _alt(kind, snapshot, "none here")), "none here")


def arrows_over(flow_px: Array, full_px: float) -> str:
    """Return arrows over a field of flow as an SVG path in pixels of the picture.

    Parameters
    ----------
    flow_px
        (h, w, 2), u right and v down. Flow that is NaN or zero has no arrow.
    full_px
        Length of flow whose arrow spans 0.8 of a step of the grid of arrows. Longer flow has the same arrow.
    """
    height, width = flow_px.shape[:2]
    step = max(width / _ARROWS_ACROSS, 1.0)
    if full_px <= 0:
        return ""
    arrows = []
    for y in np.arange(step / 2, height, step):
        for x in np.arange(step / 2, width, step):
            u, v = (float(value) for value in flow_px[int(y), int(x)])
            length = float(np.hypot(u, v))
            if np.isfinite(length) and length > 0:
                reach = 0.8 * step * min(length / full_px, 1.0) / length
                dx, dy = u * reach, v * reach
                # A shaft, and two barbs of a third of its length, 25 degrees open to either side.
                ax, ay = -(0.906 * dx - 0.423 * dy) / 3, -(0.423 * dx + 0.906 * dy) / 3
                bx, by = -(0.906 * dx + 0.423 * dy) / 3, -(0.906 * dy - 0.423 * dx) / 3
                barbs = f"l{ax:.1f} {ay:.1f}m{-ax:.1f} {-ay:.1f}l{bx:.1f} {by:.1f}"
                arrows.append(f"M{x:.1f} {y:.1f}l{dx:.1f} {dy:.1f}{barbs}")
    return "".join(arrows)


def seconds(time_us: float) -> str:
    """Return microseconds of the file's clock as seconds, to the millisecond."""
    return f"{time_us / 1e6:.3f} s"


def _alt(kind: Kind, snapshot: Snapshot, caption: str) -> str:
    time = "" if snapshot.time_us is None else f" at {seconds(snapshot.time_us)}"
    boxed = "; the box marks the worst place" if snapshot.box and snapshot.worst else ""
    return f"{NAMES[kind]}{time}: {caption}{boxed}"


def _within(interval_us: Array | None) -> str:
    if interval_us is None:
        return ""
    return f" in {number(float(interval_us[1] - interval_us[0]) / 1e3)}\N{NO-BREAK SPACE}ms"
