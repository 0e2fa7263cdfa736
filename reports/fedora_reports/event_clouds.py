"""Event clouds: single events in x, y and t around the busiest instants."""

import json
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from markupsafe import Markup

from fedora_qa.record.evidence import EVENT_CLOUDS, named
from fedora_qa.record.wording import number
from fedora_reports.clouds import CloudAxis, CloudView, box_scene, draw_cloud, packed_points
from fedora_reports.evidence import Array, Evidence
from fedora_reports.panels import seconds
from fedora_reports.scales import Axis

_VIEW: Final = CloudView(yaw_rad=0.85, pitch_rad=0.42)
_TIME_SHARE: Final = 1.25
"""Length of the axis of time as a share of the longer side of the sensor."""

_PAINTS: Final = ('class="darker"', 'class="brighter"')
_LARGEST: Final = 1e12
"""No sensor and no interval has as many px or us."""

_VARIABLES: Final = ("--darker", "--brighter")
"""By polarity, of the picture and of the scene."""


@dataclass(frozen=True, slots=True)
class EventCloud:
    """A cloud of events: its instant, its picture in SVG, the same as JSON to be turned, and how many it shows."""

    time: str
    view: Markup
    space: str
    caption: str


def event_clouds_of(evidence: Evidence) -> tuple[EventCloud, ...]:
    """Return the event clouds of a file in the order of time; none where their arrays are missing or do not fit."""

    def array(name: str, *shape: int | None) -> Array | None:
        return evidence.numbers(named(EVENT_CLOUDS, name), *shape)

    times_us, instant = array("times_us", None), array("instant", None)
    if times_us is None or instant is None:
        return ()
    c, m = len(times_us), len(instant)
    intervals_us, counts, shapes_px = array("intervals_us", c, 2), array("counts", c), array("shapes_px", c, 2)
    offsets_us, x, y, polarities = (array(name, m) for name in ("offsets_us", "x", "y", "polarities"))
    clouds = []
    for k in range(c):
        if intervals_us is None or counts is None or shapes_px is None:
            break
        if offsets_us is None or x is None or y is None or polarities is None:
            break
        cloud = _cloud(
            float(times_us[k]),
            intervals_us[k].astype(np.float64),
            float(counts[k]),
            shapes_px[k].astype(np.float64),
            np.stack([events[instant == k].astype(np.float64) for events in (offsets_us, x, y)], axis=-1),
            polarities[instant == k],
        )
        clouds += [cloud] if cloud else []
    return tuple(clouds)


def _cloud(
    time_us: float, interval_us: Array, count: float, shape_px: Array, offsets_us_x_y: Array, polarities: Array
) -> EventCloud | None:
    """Draw a cloud; None where its numbers describe no box, or no event lies in it."""
    with np.errstate(invalid="ignore", over="ignore"):
        low_us, high_us = interval_us - time_us
        length_us = high_us - low_us
    height, width = shape_px
    if not (0 < length_us < _LARGEST and 0 < height < _LARGEST and 0 < width < _LARGEST and 0 <= count < _LARGEST):
        return None  # also for NaN
    # Shares of the box: time along X, columns along Y, rows down Z.
    with np.errstate(invalid="ignore", over="ignore"):
        shares = (offsets_us_x_y - (low_us, 0.0, 0.0)) / (length_us, width, height)
    within = ((shares >= 0) & (shares <= 1)).all(axis=1)  # False for NaN
    if not within.any():
        return None
    shares = np.where((False, False, True), 1.0 - shares, shares)[within]
    longer = max(height, width)
    sides = np.array([_TIME_SHARE, width / longer, height / longer]) / max(_TIME_SHARE, 1.0)
    down = tuple(replace(tick, share=1.0 - tick.share) for tick in Axis(0.0, height).ticks(3))
    axes = (
        CloudAxis("t, ms", Axis(low_us / 1e3, high_us / 1e3).ticks(4)),
        CloudAxis("x, px", Axis(0.0, width).ticks(3)),
        CloudAxis("y, px", down),
    )
    time, drawn = seconds(time_us), int(within.sum())
    thinned = f"{drawn} of {count:.0f} events" if drawn < count else f"{drawn} events"
    caption = f"{thinned} within {number(length_us / 1e3)} ms; t is counted from {time}"
    paint = (polarities[within] > 0).astype(np.intp)
    view = draw_cloud((shares - 0.5) * sides, paint, _PAINTS, sides, axes, _VIEW, f"Events at {time}: {caption}")
    scene = box_scene(sides, _VIEW, axes) | {
        "paints": _VARIABLES,
        "cloud": packed_points((shares - 0.5) * sides, paint),
    }
    return EventCloud(time, Markup(view), json.dumps(scene, allow_nan=False, separators=(",", ":")), caption)
