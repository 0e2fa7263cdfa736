"""Flow against events: warped by the flow, the events of an edge lie on one line."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.estimators.flow.contrast import GAINS, MARGIN_PX, SensorView, WarpableEvents, best_gain, sharpness_under
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Events, Window
from fedora_qa.views.camera_mapping import why_not_one_centre
from fedora_qa.views.event_view import event_view
from fedora_qa.views.flow_intervals import Interval, owned_intervals, place
from fedora_qa.views.frames import bands, is_large, near

Float64 = NDArray[np.float64]

FIELDS: Final = 1
"""Fields of a rate that are measured in a window, evenly spread. With two the standard error of a gain hardly
changes."""

SHORTEST_NS: Final = 60_000_000
"""Shortest time of the events of a field, ns, around the middle of its interval: at 50 Hz edges cross few pixels in an
interval."""

APART_NS: Final = 40_000_000
"""Least time between the starts of fields, ns: closer fields use the same events. With every second of 40 fields of 50
Hz in 1 s (1440x1080), standard errors of a gain were 0.51% and 0.62%, against 0.57% with all."""

LONGEST_NS: Final = 200_000_000
"""Longest interval of a measured field, ns: paths over longer intervals bend."""

MOST_EVENTS: Final = 25_000
"""Largest number of events of a field that are warped, evenly spread. At 720x540 with 700,000 events, standard errors
of gains are 0.4% with 25,000 events and 0.3% with all; limits, dominated by the size of a pixel, are 16.9% and 16.6% at
10 Hz."""

LARGE_EVENTS: Final = 8_000
LARGE_ROWS: Final = 0.25
"""Number of events of a field that are warped in large frames, and share of the rows that contain them, if these have
enough events.

Bands of rows keep the events of an edge together; a regular selection of events would not. At 1440x1080 over 1 s,
limits are up to 13% larger. With 4,000 events, limits of transforms would be 24% larger, and exchanged axes were not
detected.
"""

FEWEST_EVENTS: Final = 500

TRANSFORMS: Final = MappingProxyType({
    "negated": "negated",
    "transposed_axes": "with its axes exchanged",
    "flipped_v": "with v negated",
    "times_interval": "times the interval (as if it were px/s)",
    "divided_by_interval": "divided by the interval (as if it were px s)",
    "mirrored_columns": "mirrored left to right",
    "mirrored_rows": "mirrored top to bottom",
})  # fmt: skip
"""Transforms of a field that are compared with the stored field, in words; the first five keep the position of its
values."""

_UNIT: Final = np.eye(2)

_SPEED_PIXELS: Final = 5_000
"""Pixels from which the speed of the image is taken."""

_RMS_OF_TIME: Final = 12**-0.5
"""Root mean square distance of an instant from the middle, over the length of the interval."""

FEWEST_FIELDS: Final = 4

ADVANTAGE: Final = 0.2
"""Least logarithm of the ratio of sharpness for another flow. Smaller ratios occur on correct files: v negated where
all motion is horizontal, or a uniform motion that fits a curved path slightly better."""

PIXEL_VARIANCE_PX2: Final = 1 / 12
"""Variance of the position of an edge within its pixel at the time of an event, px^2: uniform."""

BEND: Final = 2.0
"""Bound of the relative bend of a path over the square of its angle (4/3 at 30 degrees)."""

_OF_ONE_SURFACE: Final = 0.95
"""Share of neighbouring pixels that is taken to show one surface. The value is not derived."""

_MOST_GROUPS: Final = 12
_SIGNIFICANT_SIGMAS: Final = 5.0
_SAME_EVENTS: Final = slice(0, 5)
"""Transforms that warp the same events as the field itself."""


@dataclass(frozen=True, slots=True)
class FieldSharpness:
    """Sharpness of the events of one field after they are warped by it.

    Attributes
    ----------
    interval
        Of the field.
    sharpness
        (1 + gains,) of events that are not warped, and of events warped by the field times each of ``GAINS``.
    transformed
        (transforms, 2) of events warped by the field, and by each of ``TRANSFORMS``; events with a flow in both.
    carried
        Number of events that were warped.
    way_px
        Root mean square displacement of the warped events, px of the event camera.
    way_rad
        Root mean square displacement over the time of the events, over the focal length, rad.
    flow_px
        Root mean square of the field, px of the event camera.
    pixel_px
        Root mean square of the widths of the events' pixels in the view of the flow, px of the event camera.
    expansion2
        Mean square of the relative change of scale over the interval, weighted with the squared flow.
    share_in_view
        Share of the event camera's pixels that lie in the view of the flow; None where all do, as of equal lenses.
    """

    interval: Interval
    sharpness: Float64
    transformed: Float64
    carried: int
    way_px: float
    way_rad: float
    flow_px: float
    pixel_px: float
    expansion2: float
    share_in_view: float | None


@dataclass(frozen=True, slots=True)
class SharpestFlow(Feature):
    """The flow under which the events of one rate are sharpest.

    Attributes
    ----------
    rate
        Stream of the rate.
    deviates_by_rate
        Whether events are sharper under another flow, for each rate with informative events.
    interval_s
        Length of a field's interval, s.
    gain
        Ratio of the stored flow to its multiple under which events are sharpest.
    transform
        The transform, of ``TRANSFORMS``, under which events are sharpest.
    """

    rate: str
    deviates_by_rate: Mapping[str, bool]
    interval_s: float
    gain: float
    transform: str


@dataclass(frozen=True, slots=True)
class RateSharpness:
    """All fields of one rate together.

    The advantage is the logarithm of a ratio of sharpness; its error is that of counting. A sum of squares of densities
    H of N events varies by 2 sqrt(<H^2>) / (sqrt(N) <H>), with exponentially distributed densities 2 sqrt(2 / N). Two
    independent sums together give 4 / sqrt(N).

    Attributes
    ----------
    fields
        Measured fields.
    gain, gain_error
        Ratio of the stored flow to the sharpest multiple, with its standard error.
    transform
        Index of the best transform in ``TRANSFORMS``.
    advantage, advantage_error
        Logarithm of the ratio of sharpness under the transform to that of the stored flow, and its standard error.
    sharpening
        Largest relative gain of sharpness over events that are not warped.
    """

    fields: tuple[FieldSharpness, ...]
    gain: float
    gain_error: float
    transform: int
    advantage: float
    advantage_error: float
    sharpening: float

    @property
    def gain_model_error_bound(self) -> float:
        """Bound of the bias of the gain by pixels, bent paths and approach (see ``FlowEventsSharpness``)."""
        way_px2 = float(np.mean(np.square([field.way_px for field in self.fields])))
        way_rad2 = float(np.mean(np.square([field.way_rad for field in self.fields])))
        pixel_px2 = float(np.mean(np.square([field.pixel_px for field in self.fields])))
        expansion2 = float(np.mean([field.expansion2 for field in self.fields]))
        # var(s) / var(u) = p^2 / (12 w^2) by the pixel, 2 a^2 by the bent path, e^2 / 4 by approach (derivations in
        # FlowEventsSharpness).
        return PIXEL_VARIANCE_PX2 * pixel_px2 / max(way_px2, 1e-12) + BEND * way_rad2 + expansion2 / 4

    @property
    def is_informative(self) -> bool:
        """Whether events become significantly sharper, by the field or by a transform of it."""
        return self.sharpening > _SIGNIFICANT_SIGMAS * self.advantage_error

    @property
    def gain_deviates(self) -> bool:
        """Whether the gain deviates significantly from 1, for naming only."""
        return abs(self.gain - 1) > self.gain_model_error_bound + _SIGNIFICANT_SIGMAS * self.gain_error

    @property
    def transform_is_sharper(self) -> bool:
        """Whether events are sharper under a transform, for naming only."""
        return self.advantage > ADVANTAGE + _SIGNIFICANT_SIGMAS * self.advantage_error


class FlowEventsSharpness(WindowCheck[tuple[FieldSharpness, ...]]):
    """Are events sharpest under the stored flow?

    For each rate, the gain of the stored flow in percent (positive: flow too large). Also the logarithm of the ratio of
    sharpness under another flow: negated, with exchanged axes, with v negated, in px/s, in px s, mirrored in either
    direction. All is measured in pixels and time of the event camera.

    Why it matters
    --------------
    Flow with the wrong sign, unit or order of axes still looks like flow, and a network that is trained on it with
    events learns wrong motion. Events are independent of depth, pose and colour.

    How
    ---
    Events of a camera with another lens than the flow's, or turned against it by up to 10 degrees, are seen in the view
    of the flow: each pixel has its position there, between pixels, by the declared lenses, rotation and K. Pixels
    beyond that view are left out, and the share that is left is stated.

    Events around the middle of a field's interval (60 ms, or up to the whole interval where this makes the bound below
    smaller) are warped along the stored flow to the middle, under uniform motion of each point, and along the flow
    times several gains. Sharpness is the mean over events of the density at their positions in the image of warped
    events. A parabola through the sharpest gain and its neighbours gives the peak. Two events of one pixel never belong
    to one point of a moving edge: their contribution is subtracted, because it would bias gains towards 0. Other flows
    are compared on the same events.

    Noise model
    -----------
    The standard error of the gain is a jackknife over segments of time; that of a ratio of sharpness is the error of
    counting. The bound of the gain has three parts. The first is the size of a pixel. An edge that is at u when pixel m
    fires has u = m + s, with s uniform in the pixel. All pixels share s, so that the relative error of the regression
    of m on u, and of the gain, is at most var(s) / var(u) = 1 / (12 w^2), with w the root mean square displacement in
    px. Seen through a lens, a pixel has the width p in the view of the flow, its greatest, and this part is p^2 / (12
    w^2); positions are not rounded. The second is the curvature of a path: if the line of sight rotates by an angle a,
    the third order of tan is up to 4/3 a^2 at 30 degrees off the axis; the bound is 2 a^2. The third is approach: a
    point whose depth shrinks by the share e over the interval moves as 1 / (1 - e tau), and its displacement over the
    interval exceeds the slope in the middle by e^2 / 4. The share is the divergence of the flow between neighbours,
    which on a slanted surface is larger. Another flow must be sharper by a fifth, which uniform motion along a curved
    path never is.

    Cannot detect
    -------------
    A time offset, which moves all events equally. Small local errors (``flow_photometric.residual`` detects them).
    Where no candidate makes events significantly sharper (five standard errors of counting), edges cross too few
    pixels, and nothing is judged.

    Sources
    -------
    G. Gallego, H. Rebecq, D. Scaramuzza, A unifying contrast maximization framework, CVPR (2018), eq. 1 to 4. T.
    Stoffregen, L. Kleeman, Event cameras, contrast maximization and reward functions, CVPR (2019). S. Shiba, Y. Aoki,
    G. Gallego, Event collapse, Sensors 22 (2022): why events go to the middle of the interval.
    """

    name = "flow_events.sharpness"
    needs = ("flow", "events")

    def not_applicable(self, facts: Facts) -> str:
        """Require the event camera at the place of the depth camera, on whose grid flow lies, through any lens."""
        reason = why_not_one_centre(facts, "depth", "events")
        cameras = facts.declared.cameras
        if not reason and not all(np.all(np.diag(cameras[name].K) > 0) for name in ("depth", "events")):
            return "a focal length of the cameras depth and events is not positive (see metadata.cameras)"
        return reason

    def measure(self, window: Window) -> tuple[FieldSharpness, ...]:
        """Measure some fields of each rate."""
        chosen: list[Interval] = []
        for stream in window.facts.flow_streams:
            intervals = [
                interval
                for interval in owned_intervals(window, stream)
                if 0 < interval.length_ns <= LONGEST_NS and interval.row % max(1, APART_NS // interval.length_ns) == 0
            ]
            if intervals:
                indices = np.unique(np.linspace(0, len(intervals) - 1, FIELDS).round().astype(int))
                chosen += [intervals[int(i)] for i in indices]
        if not chosen:
            return ()
        first_ns = min(min(interval.start_ns, _middle_ns(interval) - SHORTEST_NS // 2) for interval in chosen)
        last_ns = max(max(interval.end_ns, _middle_ns(interval) + SHORTEST_NS // 2) for interval in chosen)
        try:
            events = window.events(max(window.span.start_ns - first_ns, 0), max(last_ns - window.span.stop_ns, 0))
        except UnreadableRowsError:
            return ()
        fields = (_measure_field(window, interval, events) for interval in chosen)
        return tuple(field for field in fields if field is not None)

    def conclude(self, state: Sequence[tuple[FieldSharpness, ...]], facts: Facts) -> Observation:
        """State gain and best transform of each rate."""
        fields = [field for window in state for field in window]
        total = sum(facts.sizes.get(f"path/{stream}", 0) for stream in facts.flow_streams)
        coverage = Coverage(len(fields), total, "flow fields")
        by_rate = {stream: [f for f in fields if f.interval.stream == stream] for stream in facts.flow_streams}
        by_rate = {stream: of_rate for stream, of_rate in by_rate.items() if len(of_rate) >= FEWEST_FIELDS}
        if not by_rate:
            return Observation(coverage, unobservable="fewer than four fields of any rate with enough events")
        rates: dict[str, RateSharpness] = {}
        for stream, of_rate in by_rate.items():
            by_gain, by_transform = (
                np.array([getattr(field, name) for field in of_rate]) for name in ("sharpness", "transformed")
            )
            summed, of_transforms = by_gain.sum(axis=0), by_transform.sum(axis=0)
            # Columns: the sharpness of the stored flow and of the transformed one, on the same events.
            transform = int(np.argmax(of_transforms[:, 1] / np.maximum(of_transforms[:, 0], 1e-300)))
            # Jackknife: the gain without each group of consecutive fields. The best multiple of the stored flow is the
            # reciprocal of the flow's gain.
            groups = np.array_split(by_gain, min(len(of_rate), _MOST_GROUPS))
            gains = np.array([1.0 / best_gain((summed - group.sum(axis=0))[1:]) for group in groups])
            # Only transforms that warp the same events are comparable with events that are not warped.
            sharpest = max(float(summed[1:].max()), float(of_transforms[_SAME_EVENTS, 1].max()))
            stored, best = of_transforms[transform]
            rates[stream] = RateSharpness(
                fields=tuple(of_rate),
                gain=1.0 / best_gain(summed[1:]),
                # (n - 1) times the variance of the n leave-one-out gains (delete-one jackknife).
                gain_error=float(np.sqrt((len(groups) - 1) * gains.var())),
                transform=transform,
                advantage=float(np.log(np.maximum(best, 1e-300) / np.maximum(stored, 1e-300))),
                # 4 / sqrt(N), the counting error of both sharpnesses (RateSharpness).
                advantage_error=4.0 / sum(field.carried for field in of_rate) ** 0.5,
                sharpening=sharpest / max(float(summed[0]), 1e-300) - 1.0,
            )
        informative = {stream: rate for stream, rate in rates.items() if rate.is_informative}
        if not informative:
            largest = max(rate.sharpening for rate in rates.values())
            return Observation(
                coverage,
                unobservable=f"events become sharper by at most {100 * largest:.2g}% when they are warped by the flow "
                "or by a transform of it: edges cross too few pixels",
            )
        # A rate with an uncertain gain deviates too if the gain is closer to a deviating one than to 1.
        deviating_gains = [rate.gain for rate in informative.values() if rate.gain_deviates]
        deviates_by_rate = {
            stream: rate.transform_is_sharper
            or rate.gain_deviates
            or any(abs(rate.gain - gain) < abs(rate.gain - 1) for gain in deviating_gains)
            for stream, rate in informative.items()
        }
        statistics = [
            statistic
            for stream, rate in informative.items()
            for statistic in self._statistics(stream, rate, deviates_by_rate, facts)
        ]
        share = fields[0].share_in_view
        inferred = {} if share is None else {"events.share_in_view_of_flow": share}
        return Observation(coverage, tuple(statistics), inferred=inferred)

    def _statistics(
        self, stream: str, sharpness: RateSharpness, deviates_by_rate: Mapping[str, bool], facts: Facts
    ) -> tuple[Statistic, ...]:
        rate = stream.removeprefix("flow/")
        where = place(facts, (sharpness.fields[0].interval, sharpness.fields[-1].interval))
        interval_s = sharpness.fields[0].interval.duration_s
        transform, text = list(TRANSFORMS.items())[sharpness.transform]
        features = (SharpestFlow(stream, deviates_by_rate, interval_s, sharpness.gain, transform),)
        advantage = Statistic(
            name=f"advantage_of_another_{rate}",
            value=sharpness.advantage,
            unit="1",
            standard_error=sharpness.advantage_error,
            model_error_bound=ADVANTAGE,
            side="upper",
            # The best of all transforms was chosen.
            tests=len(TRANSFORMS),
            statement=f"Events warped by the {rate} flow are {np.exp(sharpness.advantage):.3g} times as sharp if it is "
            f"{text}.",
            code="flow_events.sharpness.other",
            where=where,
            features=features,
        )
        # Where another flow is sharper, the gain of the stored one has no meaning.
        if sharpness.transform_is_sharper:
            return (advantage,)
        error_percent = 100 * sharpness.gain_error
        # One percent of the true flow, which is the stored one divided by its gain.
        rms_px = float(np.sqrt(np.mean(np.square([field.flow_px for field in sharpness.fields]))))
        effect_px = 0.01 * rms_px / sharpness.gain
        gain = Statistic(
            name=f"gain_{rate}",
            value=100 * (sharpness.gain - 1),
            unit="%",
            standard_error=error_percent,
            model_error_bound=100 * sharpness.gain_model_error_bound,
            effect_px=effect_px,
            statement=f"Events are sharpest when the {rate} flow is divided by {sharpness.gain:.3g} "
            f"+/- {0.01 * error_percent:.2g}.",
            code="flow_events.sharpness.gain",
            where=where,
            features=features,
        )
        return gain, advantage


def _measure_field(window: Window, interval: Interval, events: Events) -> FieldSharpness | None:
    """Return the sharpness of the events about one field under it and its transforms; None for too few events."""
    try:
        stored_px = window.flow_px(interval.stream, interval.row)
    except UnreadableRowsError:
        return None
    # Events lie in the view of the depth camera, in pixels of the event camera. The axes of both are parallel and their
    # lens is one, so that u_flow = f_flow / f_event (u_event - c_event) + c_flow, along each axis.
    events_view = event_view(window, "depth")
    K_flow, K_event, shape = window.facts.declared.cameras["depth"].K, events_view.K, events_view.shape
    if not min(shape):
        return None
    across, down = (float(K_flow[i, i] / K_event[i, i]) for i in range(2))
    left, top = (float(K_flow[i, 2] - K_event[i, 2] * K_flow[i, i] / K_event[i, i]) for i in range(2))
    view = SensorView(across, left, down, top, 1 / across, 1 / down)
    focal_px = abs(float(window.facts.declared.cameras["events"].K[0, 0]))  # an axis may be declared reversed
    rows, most, speed_pixels = np.ones(shape[0], np.bool_), MOST_EVENTS, _SPEED_PIXELS
    if is_large(stored_px.shape[0] * stored_px.shape[1], window):
        most, speed_pixels = LARGE_EVENTS, round(LARGE_ROWS * _SPEED_PIXELS)
        nearby = _around(events, interval, SHORTEST_NS // 2)
        rows = bands(shape[0], max(LARGE_ROWS, most / max(nearby.stop - nearby.start, most)), interval.row)
    sensor_flow = view.of(stored_px, near(rows, round(MARGIN_PX)), shape[1])

    # Events are taken over the time with the smallest bound, up to the whole interval. With the root mean square
    # displacement w it is 1 / (12 w^2) for the pixels and 2 a^2 = 24 (w / focal)^2 for curved paths, smallest at
    # w^2 = focal / sqrt(288). w is the mean over some pixels: the choice need not be exact.
    stride = max(1, int(np.sqrt(sensor_flow.flow_px[..., 0].size / speed_pixels)))
    sampled_px = sensor_flow.flow_px[::stride, ::stride].astype(np.float64)
    speed_px = np.hypot(sampled_px[..., 0], sampled_px[..., 1])
    finite = speed_px[np.isfinite(speed_px)]
    flow_px = float(np.sqrt(np.mean(np.square(finite)))) if len(finite) else 0.0
    expected_way_px = _RMS_OF_TIME * flow_px
    share_of_interval = np.sqrt(focal_px / np.sqrt(288.0)) / max(expected_way_px, 1e-9)
    longest_ns = max(interval.length_ns, SHORTEST_NS)
    length_ns = int(np.clip(share_of_interval * interval.length_ns, SHORTEST_NS, longest_ns))
    nearby = _around(events, interval, length_ns // 2)
    if nearby.stop - nearby.start < FEWEST_EVENTS:
        return None
    # Step between events, so that about ``most`` of them lie in the rows.
    step = 1 + int(float(np.mean(rows)) * (nearby.stop - nearby.start)) // most
    chosen = events_view.chosen(events, (nearby.start, nearby.stop, step), rows)
    x, y = events.x[chosen].astype(np.uint16), events.y[chosen].astype(np.uint16)
    # Time in units of the interval: an event at tau lies tau times the flow from its place at the start.
    tau = (events.times_ns[chosen] - interval.start_ns) / interval.length_ns
    ordered = WarpableEvents.pixel_by_pixel(x, y, tau)
    columns, rows_px, widths_px = events_view.places(ordered.x, ordered.y)
    ordered = WarpableEvents(columns, rows_px, ordered.tau)

    # The transforms that keep the position of values, as in TRANSFORMS.
    interval_s = interval.duration_s
    transforms = (-_UNIT, _UNIT[::-1], np.diag([1.0, -1.0]), interval_s * _UNIT, _UNIT / interval_s)
    matrices = [0.0 * _UNIT, *(gain * _UNIT for gain in GAINS), *transforms]
    flow = sensor_flow.at(ordered)
    as_stored = sharpness_under(ordered, [(flow, matrices)])
    count = len(as_stored.carried)
    if count < FEWEST_EVENTS:
        return None
    own, by_matrix = as_stored.sharpness[1 + GAINS.index(1.0)], as_stored.sharpness[1 + len(GAINS) :]
    # Mirrored fields have no flow at some events: both are compared on events with a flow in both.
    ordered, flow = ordered.chosen(as_stored.carried), flow.chosen(as_stored.carried)
    mirrored = (view.mirrored(sensor_flow, axis, stored_px.shape).at(ordered) for axis in range(2))
    pairs = [sharpness_under(ordered, [(flow, [_UNIT]), (other, [_UNIT])]).sharpness for other in mirrored]
    transformed = np.array([*((own, sharpness) for sharpness in by_matrix), *pairs])
    # ``way_px`` is the rms over event times, 1/sqrt(12) of the displacement; over the focal length (px) it is an angle.
    way_rad = as_stored.way_px / _RMS_OF_TIME / focal_px
    by_gain = as_stored.sharpness[: 1 + len(GAINS)]
    pixel_px = float(np.sqrt(np.mean(np.square(widths_px[as_stored.carried]))))
    expansion2 = mean_square_expansion(stored_px, max(1, int(np.sqrt(stored_px[..., 0].size / speed_pixels))))
    return FieldSharpness(
        interval,
        by_gain,
        transformed,
        count,
        as_stored.way_px,
        way_rad,
        flow_px,
        pixel_px,
        expansion2,
        events_view.share,
    )


def mean_square_expansion(flow_px: NDArray[Any], stride: int) -> float:
    """Return the mean square of the relative change of scale by a field, weighted with the squared flow.

    Of pixels a stride apart, each with its neighbours to the right and below. Neighbours on two surfaces differ by more
    than one surface expands: the largest twentieth is left out.
    """
    here = flow_px[:-1:stride, :-1:stride].astype(np.float64)
    right, below = flow_px[:-1:stride, 1::stride], flow_px[1::stride, :-1:stride]
    expansion = (right[..., 0] - here[..., 0] + below[..., 1] - here[..., 1]) / 2
    squares_px2 = np.sum(np.square(here), axis=-1)
    finite = np.isfinite(expansion) & np.isfinite(squares_px2)
    expansion2, squares_px2 = np.square(expansion[finite]), squares_px2[finite]
    if not np.any(squares_px2):
        return 0.0
    of_one_surface = expansion2 <= np.quantile(expansion2, _OF_ONE_SURFACE)
    return float(np.average(expansion2[of_one_surface], weights=squares_px2[of_one_surface] + 1e-12))


def _around(events: Events, interval: Interval, half_ns: int) -> slice:
    """Return the events up to a time from the middle of an interval, by index."""
    middle_ns = _middle_ns(interval)
    start, stop = np.searchsorted(events.times_ns, [middle_ns - half_ns, middle_ns + half_ns])
    return slice(int(start), int(stop))


def _middle_ns(interval: Interval) -> int:
    return interval.start_ns + interval.length_ns // 2
