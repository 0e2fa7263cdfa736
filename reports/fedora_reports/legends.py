"""The keys to pictures: what their colours mean, in words and on a scale."""

from dataclasses import dataclass

import numpy as np

from fedora_qa.record.wording import number
from fedora_reports import colour_maps
from fedora_reports.panels import NAMES, Kind, Panel
from fedora_reports.picture_scales import PictureScales
from fedora_reports.pictures import Image, drawing
from fedora_reports.scales import Axis, Tick

_WHEEL_PX = 88
_BAR_STEPS = 160


@dataclass(frozen=True, slots=True)
class ColourBar:
    """A strip of colours, low values on the left, and where round values lie on it."""

    image: Image
    ticks: tuple[Tick, ...]


@dataclass(frozen=True, slots=True)
class Legend:
    """What the colours of one kind of picture mean."""

    kind: Kind
    name: str
    text: str
    bar: ColourBar | None = None
    wheel: Image | None = None


def legends_for(panels: tuple[Panel, ...], scales: PictureScales) -> tuple[Legend, ...]:
    """Return a legend for each kind of panel, in the order of the panels."""
    return tuple(_legend(kind, scales) for kind in dict.fromkeys(panel.kind for panel in panels))


def colour_bar(axis: Axis, table: colour_maps.Picture, alt: str, *, reverse: bool = False, ticks: int = 4) -> ColourBar:
    """Return the colours of a table along an axis; ``reverse`` gives the low end the table's last colour."""
    ramp = np.linspace(1.0, 0.0, _BAR_STEPS) if reverse else np.linspace(0.0, 1.0, _BAR_STEPS)
    picture = np.repeat(colour_maps.by_table(ramp[None, :], table), 8, axis=0)
    return ColourBar(drawing(picture, alt), axis.ticks(ticks))


def _legend(kind: Kind, scales: PictureScales) -> Legend:
    of_kind = {"frame": _frame, "events": _events, "depth": _depth, "flow": _flow, "residual": _residual}
    return of_kind[kind](scales)


def _frame(scales: PictureScales) -> Legend:
    brightness = f"shown {scales.gain} times as bright" if scales.gain > 1 else "shown as stored"
    return Legend("frame", NAMES["frame"], f"8-bit values (DN), {brightness}")


def _events(scales: PictureScales) -> Legend:
    full = f"opaque from {scales.full_events} a pixel" if scales.full_events > 1 else "opaque where one fell"
    return Legend("events", NAMES["events"], f"over the frame in grey, {full}")


def _depth(scales: PictureScales) -> Legend:
    if scales.depth_m is None:
        return Legend("depth", NAMES["depth"], "metres; grey: none")
    alt = f"Colours of depth from {number(scales.depth_m.low)} m (yellow) to {number(scales.depth_m.high)} m (violet)"
    bar = colour_bar(scales.depth_m, colour_maps.SEQUENTIAL, alt, reverse=True)
    return Legend("depth", NAMES["depth"], "metres, logarithmic; grey: none", bar)


def _flow(scales: PictureScales) -> Legend:
    full = f"full from {scales.full_flow_px_s:.3g} px/s"
    wheel = drawing(colour_maps.flow_wheel(_WHEEL_PX), "Colours of flow: right red, down green, left cyan, up violet")
    return Legend("flow", NAMES["flow"], f"hue: direction; saturation: length, {full}; grey: none", wheel=wheel)


def _residual(scales: PictureScales) -> Legend:
    full = number(scales.full_residual_dn)
    axis = Axis(-scales.full_residual_dn, scales.full_residual_dn)
    bar = colour_bar(axis, colour_maps.DIVERGING, f"Colours of residuals from -{full} DN (blue) to {full} DN (red)")
    text = "DN: the next frame, carried back by the flow, minus this one; grey: none"
    return Legend("residual", NAMES["residual"], text, bar)
