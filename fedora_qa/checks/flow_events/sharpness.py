"""Flow against events: carried along the flow, the events of an edge meet in a line."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.protocol import Observation, Statistic, Suspect, WindowCheck
from fedora_qa.estimators.flow.contrast import best_gain
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.camera_mapping import why_not_one_view
from fedora_qa.views.carried_events import RIVALS, FieldSharpness, measure_fields
from fedora_qa.views.flow_intervals import place
from fedora_qa.views.flow_suspects import gain_suspect, spreads_over

Float64 = NDArray[np.float64]

FEWEST_FIELDS: Final = 4

ADVANTAGE: Final = 0.2
"""A rival that is less than a fifth sharper (in the logarithm) is not another flow: v upwards where all move sideways,
or an even motion that fits a bent path a little better."""

PIXEL_VARIANCE_PX2: Final = 1 / 12
"""Where in its pixel an edge was when an event fired is not known: uniform, of this variance."""

BEND: Final = 2.0
"""Bound of the share by which a path bends, over the square of the angle that it turns by (4/3 at 30 degrees)."""

_MOST_GROUPS: Final = 12
_SURE: Final = 5.0
_SAME_GAIN: Final = 0.1
_TURNED: Final = slice(0, 5)
"""Rivals that carry the same events as the field itself."""


@dataclass(frozen=True, slots=True)
class RateSharpness:
    """What all fields of one rate tell, with standard errors: its gain, and how much sharper its best rival is.

    The advantage is the logarithm of the ratio. Its error is that of counting: a sum of squares of densities H of N
    events varies by 2 sqrt(<H^2>) / (sqrt(N) <H>), with densities that vary as an exponential 2 sqrt(2 / N); both
    together, as if they were independent, 4 / sqrt(N).
    """

    fields: tuple[FieldSharpness, ...]
    gain: float
    gain_error: float
    rival: int
    advantage: float
    advantage_error: float
    sharpening: float

    @property
    def gain_model_error_bound(self) -> float:
        """Bound of what pixels and bent paths do to the gain (see ``Sharpness``)."""
        way_px2, way_rad2 = (float(np.mean(np.square(ways))) for ways in zip(*self._ways(), strict=True))
        return PIXEL_VARIANCE_PX2 / max(way_px2, 1e-12) + BEND * way_rad2

    @property
    def tells(self) -> bool:
        """Whether events become surely sharper, by the field or by what it might be."""
        return self.sharpening > _SURE * self.advantage_error

    @property
    def gain_is_off(self) -> bool:
        """Whether the gain lies outside what an honest field gives, for naming only."""
        return abs(self.gain - 1) > self.gain_model_error_bound + _SURE * self.gain_error

    @property
    def rival_wins(self) -> bool:
        """Whether a rival is sharper, for naming only."""
        return self.advantage > ADVANTAGE + _SURE * self.advantage_error

    def _ways(self) -> Iterable[tuple[float, float]]:
        return ((one.way_px, one.way_rad) for one in self.fields)


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
        """Need the event camera at the place of the depth camera, on whose grid flow lies."""
        return why_not_one_view(facts, "depth", "events")

    def measure(self, window: Window) -> tuple[FieldSharpness, ...]:
        """Measure some fields of each rate."""
        return measure_fields(window)

    def conclude(self, state: Sequence[tuple[FieldSharpness, ...]], facts: Facts) -> Observation:
        """State gain and best rival of each rate."""
        fields = [one for window in state for one in window]
        total = sum(facts.sizes.get(f"path/{stream}", 0) for stream in facts.flow_streams)
        coverage = Coverage(len(fields), total, "flow fields")
        rates = {stream: [f for f in fields if f.interval.stream == stream] for stream in facts.flow_streams}
        rates = {stream: of_rate for stream, of_rate in rates.items() if len(of_rate) >= FEWEST_FIELDS}
        if not rates:
            return Observation(coverage, unobservable="fewer than four fields of any rate with enough events")
        found = {stream: _estimate(of_rate) for stream, of_rate in rates.items()}
        telling = {stream: one for stream, one in found.items() if one.tells}
        if not telling:
            best = max(one.sharpening for one in found.values())
            return Observation(
                coverage,
                unobservable=f"events become sharper by {100 * best:.2g}% at most when they are carried by the flow "
                "or by what it might be: edges cross too few pixels",
            )
        off = {stream: _is_off(one, telling.values()) for stream, one in telling.items()}
        measured = (self._state(stream, one, spreads_over(stream, off), facts) for stream, one in telling.items())
        return Observation(coverage, tuple(one for of_rate in measured for one in of_rate))

    def _state(self, stream: str, found: RateSharpness, flow: str, facts: Facts) -> tuple[Statistic, ...]:
        rate = stream.removeprefix("flow/")
        where = place(facts, (found.fields[0].interval, found.fields[-1].interval))
        cause = RIVALS[found.rival]
        seconds = found.fields[0].interval.duration_s
        size = {3: 1 / seconds, 4: seconds}.get(found.rival)
        rival = Statistic(
            name=f"advantage_of_another_{rate}",
            value=found.advantage,
            unit="1",
            standard_error=found.advantage_error,
            model_error_bound=ADVANTAGE,
            side="upper",
            tests=len(RIVALS),
            statement=f"Events are {np.exp(found.advantage):.3g} times as sharp when the {rate} flow that carries them "
            f"is taken {_WORDS[found.rival]}.",
            code="flow_events.sharpness.other",
            where=where,
            suspects=(Suspect(cause, flow, 0.9, size, "1" if size else ""),),
        )
        if found.rival_wins:
            return (rival,)
        error, model_error_bound = 100 * found.gain_error, 100 * found.gain_model_error_bound
        gain = Statistic(
            name=f"gain_{rate}",
            value=100 * (found.gain - 1),
            unit="%",
            standard_error=error,
            model_error_bound=model_error_bound,
            material=self._MATTERS_PERCENT,
            statement=f"Events are sharpest when the {rate} flow is divided by {found.gain:.3g} "
            f"+/- {0.01 * error:.2g}.",
            code="flow_events.sharpness.gain",
            where=where,
            suspects=(
                gain_suspect(flow, found.gain - 1, 0.01 * (error + model_error_bound), 0.8, seconds, _SAME_GAIN),
                Suspect("intrinsics_focal", flow, 0.5),
                Suspect("flow_rate_mixed", flow, 0.4),
            ),
        )
        return gain, rival


_WORDS: Final = (
    "turned round",
    "with its axes exchanged",
    "with v upwards",
    "times the interval (as if it were px/s)",
    "divided by the interval (as if it were px s)",
    "mirrored left to right",
    "mirrored top to bottom",
)
"""The rivals in words, in the order of ``RIVALS``."""


def _is_off(one: RateSharpness, all_rates: Iterable[RateSharpness]) -> bool:
    """Whether a rate is off, or too uncertain for that and nearer to one that is off than to what is due."""
    nearer = (abs(one.gain - other.gain) < abs(one.gain - 1) for other in all_rates if other.gain_is_off)
    return one.rival_wins or one.gain_is_off or any(nearer)


def _estimate(fields: Sequence[FieldSharpness]) -> RateSharpness:
    curves, rivals = (np.array([getattr(one, name) for one in fields]) for name in ("sharpness", "rivals"))
    total, of_rivals = curves.sum(axis=0), rivals.sum(axis=0)
    rival = int(np.argmax(of_rivals[:, 1] / np.maximum(of_rivals[:, 0], 1e-300)))
    groups = np.array_split(curves, min(len(fields), _MOST_GROUPS))
    gains = np.array([1.0 / best_gain((total - group.sum(axis=0))[1:]) for group in groups])
    sharpest = max(float(total[1:].max()), float(of_rivals[_TURNED, 1].max()))
    return RateSharpness(
        fields=tuple(fields),
        gain=1.0 / best_gain(total[1:]),
        gain_error=float(np.sqrt((len(groups) - 1) * gains.var())),
        rival=rival,
        advantage=float(np.log(np.maximum(of_rivals[rival, 1], 1e-300) / np.maximum(of_rivals[rival, 0], 1e-300))),
        advantage_error=4.0 / sum(one.carried for one in fields) ** 0.5,
        sharpening=sharpest / max(float(total[0]), 1e-300) - 1.0,
    )
