"""The panels of a snapshot, the scales that a file shares, and the legends of pictures."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np

from fedora_qa.record.wording import number
from fedora_reports import colour_maps
from fedora_reports.colour_maps import Image, drawing, photograph
from fedora_reports.evidence import Array, finite
from fedora_reports.scales import Axis, Tick
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


_WHEEL_PX = 88
_BAR_STEPS = 160


@dataclass(frozen=True, slots=True)
class ColourBar:
    """A strip of colours, low values on the left, with ticks at round values."""

    image: Image
    ticks: tuple[Tick, ...]


@dataclass(frozen=True, slots=True)
class Legend:
    """The meaning of the colours of one kind of picture."""

    kind: Kind
    name: str
    text: str
    bar: ColourBar | None = None
    wheel: Image | None = None


def legends_for(panels: tuple[Panel, ...], scales: PictureScales) -> tuple[Legend, ...]:
    """Return a legend for each kind of panel, in the order of the panels.

    Parameters
    ----------
    scales
        The scales that their pictures share.
    """
    legends = []
    for kind in dict.fromkeys(panel.kind for panel in panels):
        bar, wheel = None, None
        if kind == "frame":
            brightness = f"shown {scales.gain} times as bright" if scales.gain > 1 else "shown as stored"
            text = f"8-bit values (DN), {brightness}"
        elif kind == "events":
            full = f"opaque from {scales.full_events} a pixel" if scales.full_events > 1 else "opaque where one fell"
            text = f"over the frame in grey, {full}"
        elif kind == "depth":
            text = "metres; grey: none"
            if scales.depth_m is not None:
                near, far = number(scales.depth_m.low), number(scales.depth_m.high)
                alt = f"Colours of depth from {near} m (yellow) to {far} m (violet)"
                text = "metres, logarithmic; grey: none"
                bar = colour_bar(scales.depth_m, colour_maps.SEQUENTIAL, alt, reverse=True)
        elif kind == "flow":
            text = f"hue: direction; saturation: length, full from {scales.full_flow_px_s:.3g} px/s; grey: none"
            alt = "Colours of flow: right red, down green, left cyan, up violet"
            wheel = drawing(colour_maps.flow_wheel(_WHEEL_PX), alt)
        else:
            full = number(scales.full_residual_dn)
            alt = f"Colours of residuals from -{full} DN (blue) to {full} DN (red)"
            text = "DN: the next frame, carried back by the flow, minus this one; grey: none"
            bar = colour_bar(Axis(-scales.full_residual_dn, scales.full_residual_dn), colour_maps.DIVERGING, alt)
        legends.append(Legend(kind, NAMES[kind], text, bar, wheel))
    return tuple(legends)


def colour_bar(axis: Axis, table: colour_maps.Picture, alt: str, *, reverse: bool = False) -> ColourBar:
    """Return the colours of a table along an axis.

    Parameters
    ----------
    table
        (256, 3), the colours from the low end of the axis to the high one.
    alt
        What the bar shows, in words.
    reverse
        Give the low end the last colour of the table.
    """
    ramp = np.linspace(1.0, 0.0, _BAR_STEPS) if reverse else np.linspace(0.0, 1.0, _BAR_STEPS)
    picture = np.repeat(colour_maps.by_table(ramp[None, :], table), 8, axis=0)
    return ColourBar(drawing(picture, alt), axis.ticks(4))
