"""Flow against events: carried along the flow, the events of an edge meet in a line."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.estimators.flow.contrast import best_gain
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_mapping import why_not_one_view
from fedora_qa.views.carried_events import TRANSFORMS, FieldSharpness, measure_fields
from fedora_qa.views.flow_intervals import place

Float64 = NDArray[np.float64]

FEWEST_FIELDS: Final = 4

ADVANTAGE: Final = 0.2
"""A transformed flow under which events are less than a fifth sharper (in the logarithm) is not another flow: v upwards
where all move sideways, or an even motion that fits a bent path a little better."""

PIXEL_VARIANCE_PX2: Final = 1 / 12
"""Where in its pixel an edge was when an event fired is not known: uniform, of this variance."""

BEND: Final = 2.0
"""Bound of the share by which a path bends, over the square of the angle that it turns by (4/3 at 30 degrees)."""

_MOST_GROUPS: Final = 12
_SIGNIFICANT_SIGMAS: Final = 5.0
_SAME_EVENTS: Final = slice(0, 5)
"""Transforms that carry the same events as the field itself."""

_WORDS: Final = (
    "turned round",
    "with its axes exchanged",
    "with v upwards",
    "times the interval (as if it were px/s)",
    "divided by the interval (as if it were px s)",
    "mirrored left to right",
    "mirrored top to bottom",
)
"""The transforms in words, in the order of ``TRANSFORMS``."""


@dataclass(frozen=True, slots=True)
class SharpestFlow(Feature):
    """The flow under which the events of one rate are sharpest.

    Attributes
    ----------
    deviates_by_rate
        Whether events of each rate that can be judged are sharper under another flow.
    interval_s
        Length of a field's interval.
    gain
        Of the stored flow on the one among its multiples under which events are sharpest.
    transform
        The one of ``TRANSFORMS`` under which events are sharpest.
    """

    rate: str
    deviates_by_rate: Mapping[str, bool]
    interval_s: float
    gain: float
    transform: str


@dataclass(frozen=True, slots=True)
class RateSharpness:
    """All fields of one rate together, with standard errors: gain, and how much sharper its best transform is.

    The advantage is the logarithm of the ratio. Its error is that of counting: a sum of squares of densities H of N
    events varies by 2 sqrt(<H^2>) / (sqrt(N) <H>), with densities that vary as an exponential 2 sqrt(2 / N); both
    together, as if they were independent, 4 / sqrt(N). ``transform`` is an index into ``TRANSFORMS``, ``sharpening``
    the largest relative gain of sharpness over events that are not carried.
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
        """Bound of what pixels and bent paths do to the gain (see ``Sharpness``)."""
        way_px2 = float(np.mean(np.square([field.way_px for field in self.fields])))
        way_rad2 = float(np.mean(np.square([field.way_rad for field in self.fields])))
        # var(s) / var(u) = 1 / (12 w^2) by the pixel, 2 a^2 by the bent path (derivation in FlowEventsSharpness).
        return PIXEL_VARIANCE_PX2 / max(way_px2, 1e-12) + BEND * way_rad2

    @property
    def is_informative(self) -> bool:
        """Whether events become surely sharper, by the field or by what it might be."""
        return self.sharpening > _SIGNIFICANT_SIGMAS * self.advantage_error

    @property
    def gain_deviates(self) -> bool:
        """Whether the gain lies outside what a correct field gives, for naming only."""
        return abs(self.gain - 1) > self.gain_model_error_bound + _SIGNIFICANT_SIGMAS * self.gain_error

    @property
    def transform_is_sharper(self) -> bool:
        """Whether events are sharper under a transform, for naming only."""
        return self.advantage > ADVANTAGE + _SIGNIFICANT_SIGMAS * self.advantage_error


class FlowEventsSharpness(WindowCheck[tuple[FieldSharpness, ...]]):
    """Does the stored flow carry the events of an edge onto one line?

    The gain of each rate of flow in percent, that is by how much the stored flow is too large, and by how much sharper
    the events would be under another flow, as a logarithm: turned round, with its axes exchanged, with v upwards, in
    px/s, in px s, mirrored either way. All is measured in pixels and time of the event camera.

    Why it matters
    --------------
    Flow that has the wrong sign, unit or order of axes still looks like flow; a network that is trained on it with
    events learns nonsense. Events are a witness that neither depth nor pose nor colour can spoil.

    How
    ---
    Events around the middle of a field's interval (60 ms, or up to the whole interval where that makes the allowance
    below less) are carried along the stored flow to that middle, as if points moved evenly, and so along the flow times
    several gains. Sharpness is the mean, over events, of the
    density that they meet in the image of warped events; a parabola through the sharpest gain and its neighbours tells
    the peak. Two events of one pixel are never of one place on a moving edge; what they contribute is taken off, or it
    would draw gains towards 0. Rivals are compared on the same events.

    Noise model
    -----------
    The gain's standard error leaves out stretches of time in turn; a rival's advantage has that of counting events.
    The allowance has two parts. An edge that is at u when pixel m fires was m + s, with s uniform in the pixel: of the
    ways u the positions m know all but s, which all pixels share alike, so that the regression of m on u, and with it
    the gain, errs by at most var(s) / var(u) = 1 / (12 w^2), w the root mean square way in px. And a path that turns
    the line of sight by an angle a is bent by tan's third order, up to 4/3 a^2 at 30 degrees off the axis; 2 a^2 is
    allowed. A rival must be a fifth sharper, which even motion along a bent path never is.

    Cannot see
    ----------
    A shift in time, which moves all events alike. Small local faults: ``flow_photometric.residual`` sees them. Where
    events become no surely sharper under any candidate (five standard errors of counting), edges cross too few pixels
    and nothing is judged.

    Sources
    -------
    G. Gallego, H. Rebecq, D. Scaramuzza, A unifying contrast maximization framework, CVPR (2018), eq. 1 to 4.
    T. Stoffregen, L. Kleeman, Event cameras, contrast maximization and reward functions, CVPR (2019).
    S. Shiba, Y. Aoki, G. Gallego, Event collapse, Sensors 22 (2022): why events go to the middle of the interval.
    """

    name = "flow_events.sharpness"
    needs = ("flow", "events")
    _MATTERS_PERCENT: Final = 30.0

    def not_applicable(self, facts: Facts) -> str:
        """Require the event camera at the place of the depth camera, on whose grid flow lies."""
        return why_not_one_view(facts, "depth", "events")

    def measure(self, window: Window) -> tuple[FieldSharpness, ...]:
        """Measure some fields of each rate."""
        return measure_fields(window)

    def conclude(self, state: Sequence[tuple[FieldSharpness, ...]], facts: Facts) -> Observation:
        """State gain and best transform of each rate."""
        fields = [field for window in state for field in window]
        total = sum(facts.sizes.get(f"path/{stream}", 0) for stream in facts.flow_streams)
        coverage = Coverage(len(fields), total, "flow fields")
        by_rate = {stream: [f for f in fields if f.interval.stream == stream] for stream in facts.flow_streams}
        by_rate = {stream: of_rate for stream, of_rate in by_rate.items() if len(of_rate) >= FEWEST_FIELDS}
        if not by_rate:
            return Observation(coverage, unobservable="fewer than four fields of any rate with enough events")
        rates = {stream: _estimate(of_rate) for stream, of_rate in by_rate.items()}
        informative = {stream: rate for stream, rate in rates.items() if rate.is_informative}
        if not informative:
            best = max(rate.sharpening for rate in rates.values())
            return Observation(
                coverage,
                unobservable=f"events become sharper by {100 * best:.2g}% at most when they are carried by the flow "
                "or by what it might be: edges cross too few pixels",
            )
        # A rate deviates, too, where its gain is too uncertain for that and nearer to one that deviates than to 1.
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
        return Observation(coverage, tuple(statistics))

    def _statistics(
        self, stream: str, sharpness: RateSharpness, deviates_by_rate: Mapping[str, bool], facts: Facts
    ) -> tuple[Statistic, ...]:
        rate = stream.removeprefix("flow/")
        where = place(facts, (sharpness.fields[0].interval, sharpness.fields[-1].interval))
        interval_s = sharpness.fields[0].interval.duration_s
        transform = TRANSFORMS[sharpness.transform]
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
            statement=f"Events are {np.exp(sharpness.advantage):.3g} times as sharp when the {rate} flow that carries "
            f"them is taken {_WORDS[sharpness.transform]}.",
            code="flow_events.sharpness.other",
            where=where,
            features=features,
        )
        # Where another flow is sharper, the gain of the stored one means nothing.
        if sharpness.transform_is_sharper:
            return (advantage,)
        error_percent = 100 * sharpness.gain_error
        gain = Statistic(
            name=f"gain_{rate}",
            value=100 * (sharpness.gain - 1),
            unit="%",
            standard_error=error_percent,
            model_error_bound=100 * sharpness.gain_model_error_bound,
            material=self._MATTERS_PERCENT,
            statement=f"Events are sharpest when the {rate} flow is divided by {sharpness.gain:.3g} "
            f"+/- {0.01 * error_percent:.2g}.",
            code="flow_events.sharpness.gain",
            where=where,
            features=features,
        )
        return gain, advantage


def _estimate(fields: Sequence[FieldSharpness]) -> RateSharpness:
    by_gain, by_transform = (
        np.array([getattr(field, name) for field in fields]) for name in ("sharpness", "transformed")
    )
    total, of_transforms = by_gain.sum(axis=0), by_transform.sum(axis=0)
    # Columns: the sharpness of the stored flow and of the transformed one, on the same events.
    transform = int(np.argmax(of_transforms[:, 1] / np.maximum(of_transforms[:, 0], 1e-300)))
    # Jackknife: the gain without each group of consecutive fields.
    groups = np.array_split(by_gain, min(len(fields), _MOST_GROUPS))
    # The best multiple of the stored flow is the reciprocal of the flow's gain.
    gains = np.array([1.0 / best_gain((total - group.sum(axis=0))[1:]) for group in groups])
    # Only transforms that carry the same events are comparable with those of events that are not carried.
    sharpest = max(float(total[1:].max()), float(of_transforms[_SAME_EVENTS, 1].max()))
    stored, best = of_transforms[transform]
    return RateSharpness(
        fields=tuple(fields),
        gain=1.0 / best_gain(total[1:]),
        # (n - 1) times the variance of the n leave-one-out gains (delete-one jackknife).
        gain_error=float(np.sqrt((len(groups) - 1) * gains.var())),
        transform=transform,
        advantage=float(np.log(np.maximum(best, 1e-300) / np.maximum(stored, 1e-300))),
        # 4 / sqrt(N), the counting error of both sharpnesses (RateSharpness).
        advantage_error=4.0 / sum(field.carried for field in fields) ** 0.5,
        sharpening=sharpest / max(float(total[0]), 1e-300) - 1.0,
    )
