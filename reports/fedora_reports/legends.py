"""The legends of pictures: the meaning of their colours, in words and on a scale."""

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
    panels
        All panels of the file.
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
    axis
        The scale of the values.
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
