"""Events carried along fields of flow: the sharpness of each field, and of each of its transforms."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.flow.contrast import GAINS, MARGIN_PX, SensorView, WarpableEvents, sharpness_under
from fedora_qa.estimators.flow.contrast_kernels import on_rows
from fedora_qa.sequence.window import Events, Window
from fedora_qa.views.event_camera import sensor_shape
from fedora_qa.views.flow_intervals import Interval, owned_intervals
from fedora_qa.views.large_frames import bands, is_large, near

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

FIELDS: Final = 1
"""Fields of a rate that a window looks at, evenly spread. With two the standard error of a gain hardly changes."""

SHORTEST_NS: Final = 60_000_000
"""Events are taken over at least so long, around the middle of the interval: at 50 Hz edges cross few pixels."""

APART_NS: Final = 40_000_000
"""Fields begin at least so far apart: nearer ones are judged by the same events. Of 40 fields of 50 Hz in 1 s
(1440x1080) every second field gave a gain the same standard error, 0.51% and 0.62% for 0.57%."""

LONGEST_NS: Final = 200_000_000
"""Fields over longer intervals are left out: paths bend."""

MOST_EVENTS: Final = 25_000
"""Of more events of a field, evenly spread ones are carried: at 720x540, 700 000 events, standard errors of gains are
0.4% with 25 000 and 0.3% with all of them, and limits, which the pixels' size decides, 16.9% and 16.6% at 10 Hz."""

LARGE_EVENTS: Final = 8_000
LARGE_ROWS: Final = 0.25
"""Of large frames so many events of a field are carried, of such a share of the rows where that has enough of them.

Bands of rows keep the events of an edge together, which every third event would not. At 1440x1080, 1 s, limits are up
to 13% larger; with 4,000 those of transforms would be 24%, and exchanged axes were no longer detected.
"""

FEWEST_EVENTS: Final = 500

TRANSFORMS: Final = (
    "negated",
    "transposed_axes",
    "flipped_v",
    "times_interval",
    "divided_by_interval",
    "mirrored_columns",
    "mirrored_rows",
)
"""What is done to a field to compare it with the one that is stored; the first five keep the place of its values."""

_UNIT: Final = np.eye(2)


@dataclass(frozen=True, slots=True)
class FieldSharpness:
    """How sharp the events of one field are when they are carried by it.

    Attributes
    ----------
    sharpness
        (1 + gains,): not carried at all, and by the field times each of ``GAINS``.
    transformed
        (transforms, 2): by the field, and by each of ``TRANSFORMS``, of events that have a flow in both.
    carried
        Events that were carried.
    way_px
        Root mean square of the way that events are carried, in pixels of the event camera.
    way_rad
        Root mean square of the displacement over the time that events are taken from, over the focal length.
    """

    interval: Interval
    sharpness: Float64
    transformed: Float64
    carried: int
    way_px: float
    way_rad: float


def measure_fields(window: Window) -> tuple[FieldSharpness, ...]:
    """Measure some fields of every rate that the window owns."""
    chosen = list(_chosen(window))
    if not chosen:
        return ()
    first_ns = min(min(interval.start_ns, _middle_ns(interval) - SHORTEST_NS // 2) for interval in chosen)
    last_ns = max(max(interval.end_ns, _middle_ns(interval) + SHORTEST_NS // 2) for interval in chosen)
    try:
        events = window.events(max(window.span.start_ns - first_ns, 0), max(last_ns - window.span.stop_ns, 0))
    except UnreadableRowsError:
        return ()
    fields = (_measure(window, interval, events) for interval in chosen)
    return tuple(field for field in fields if field is not None)


def _chosen(window: Window) -> Iterator[Interval]:
    for stream in window.facts.flow_streams:
        intervals = [
            interval
            for interval in owned_intervals(window, stream)
            if 0 < interval.length_ns <= LONGEST_NS and interval.row % max(1, APART_NS // interval.length_ns) == 0
        ]
        if intervals:
            indices = np.unique(np.linspace(0, len(intervals) - 1, FIELDS).round().astype(int))
            yield from (intervals[int(i)] for i in indices)


def _middle_ns(interval: Interval) -> int:
    return interval.start_ns + interval.length_ns // 2


def _measure(window: Window, interval: Interval, events: Events) -> FieldSharpness | None:
    try:
        stored_px = window.flow_px(interval.stream, interval.row)
    except UnreadableRowsError:
        return None
    # How the event camera, which has the centre of the depth camera, maps onto the flow's grid.
    K_flow, K_event = (window.facts.declared.cameras[name].K for name in ("depth", "events"))
    across, down = (float(K_flow[i, i] / K_event[i, i]) for i in range(2))
    left, top = (float(K_flow[i, 2] - K_event[i, 2] * K_flow[i, i] / K_event[i, i]) for i in range(2))
    # Both cameras look in one direction: u_flow = f_flow / f_event (u_event - c_event) + c_flow, along each axis.
    view_of_flow = SensorView(across, left, down, top, 1 / across, 1 / down)
    shape, view = sensor_shape(window.facts.declared), view_of_flow
    focal_px = float(window.facts.declared.cameras["events"].K[0, 0])
    rows, most, speed_pixels = np.ones(shape[0], np.bool_), MOST_EVENTS, _SPEED_PIXELS
    if is_large(stored_px.shape[0] * stored_px.shape[1], window):
        most, speed_pixels = LARGE_EVENTS, round(LARGE_ROWS * _SPEED_PIXELS)
        nearby = _around(events, interval, SHORTEST_NS // 2)
        rows = bands(shape[0], max(LARGE_ROWS, most / max(nearby.stop - nearby.start, most)), interval.row)
    sensor_flow = view.of(stored_px, near(rows, round(MARGIN_PX)), shape[1])
    length_ns = _length_ns(interval, sensor_flow.flow_px, focal_px, speed_pixels)
    nearby = _around(events, interval, length_ns // 2)
    if nearby.stop - nearby.start < FEWEST_EVENTS:
        return None
    # Every so many-th event, so that about as many as there may be lie in the rows.
    step = 1 + int(float(np.mean(rows)) * (nearby.stop - nearby.start)) // most
    chosen = on_rows(events.x, events.y, (nearby.start, nearby.stop, step), shape[1], rows)
    x, y = events.x[chosen].astype(np.uint16), events.y[chosen].astype(np.uint16)
    # Time in units of the interval: an event at tau lies tau times the flow from its place at the start.
    tau = (events.times_ns[chosen] - interval.start_ns) / interval.length_ns
    ordered = WarpableEvents.pixel_by_pixel(x, y, tau)
    matrices = [0.0 * _UNIT, *(gain * _UNIT for gain in GAINS), *_transform_matrices(interval.duration_s)]
    flow = sensor_flow.at(ordered)
    as_stored = sharpness_under(ordered, [(flow, matrices)])
    count = len(as_stored.carried)
    if count < FEWEST_EVENTS:
        return None
    own, by_matrix = as_stored.sharpness[1 + GAINS.index(1.0)], as_stored.sharpness[1 + len(GAINS) :]
    # Mirrored fields have no flow at some events: both are compared on those that have one in either.
    ordered, flow = ordered.chosen(as_stored.carried), flow.chosen(as_stored.carried)
    mirrored = (view.mirrored(sensor_flow, axis, stored_px.shape).at(ordered) for axis in range(2))
    pairs = [sharpness_under(ordered, [(flow, [_UNIT]), (other, [_UNIT])]).sharpness for other in mirrored]
    transformed = np.array([*((own, sharpness) for sharpness in by_matrix), *pairs])
    # The way is the rms over event times, 1/sqrt(12) of the displacement; over the focal length (px) it is an angle.
    way_rad = as_stored.way_px / _RMS_OF_TIME / focal_px
    by_gain = as_stored.sharpness[: 1 + len(GAINS)]
    return FieldSharpness(interval, by_gain, transformed, count, as_stored.way_px, way_rad)


def _around(events: Events, interval: Interval, half_ns: int) -> slice:
    """Return the events up to a time from the middle of an interval, by index."""
    middle_ns = _middle_ns(interval)
    start, stop = np.searchsorted(events.times_ns, [middle_ns - half_ns, middle_ns + half_ns])
    return slice(int(start), int(stop))


def _length_ns(interval: Interval, flow_px: Float32, focal_px: float, pixels: int) -> int:
    """Return the time that events are taken from: of up to the whole interval that which makes the allowance least.

    With the root mean square way w it is 1 / (12 w^2) for the pixels and 2 a^2 = 24 (w / focal)^2 for bent paths, least
    at w^2 = focal / sqrt(288). w is the mean over some ``pixels``: the choice need not be exact.
    """
    step = max(1, int(np.sqrt(flow_px[..., 0].size / pixels)))
    sampled_px = flow_px[::step, ::step].astype(np.float64)
    speed_px = np.hypot(sampled_px[..., 0], sampled_px[..., 1])
    finite = speed_px[np.isfinite(speed_px)]
    way_px = _RMS_OF_TIME * float(np.sqrt(np.mean(np.square(finite)))) if len(finite) else 0.0
    # w^2 = focal / sqrt(288), derived above, over the way of one whole interval.
    intervals = np.sqrt(focal_px / np.sqrt(288.0)) / max(way_px, 1e-9)
    return int(np.clip(intervals * interval.length_ns, SHORTEST_NS, max(interval.length_ns, SHORTEST_NS)))


_SPEED_PIXELS: Final = 5_000
"""Pixels from which the speed of the image is taken."""


def _transform_matrices(interval_s: float) -> tuple[Float64, ...]:
    """Return the matrices of the transforms that keep the place of values, as in ``TRANSFORMS``."""
    return -_UNIT, _UNIT[::-1], np.diag([1.0, -1.0]), interval_s * _UNIT, _UNIT / interval_s


_RMS_OF_TIME: Final = 12**-0.5
"""Root mean square distance of an instant from the middle, over the length of the interval."""
