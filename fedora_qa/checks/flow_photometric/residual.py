"""Flow against the frames: warp the next frame back, and see how far it still lies from the one before."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from numpy.typing import NDArray

from fedora_qa.checks.flow_photometric.candidates import residual_maps, weigh_candidates
from fedora_qa.checks.flow_photometric.photometric_measures import inferred_unit, is_off, place_measurements, suspicion
from fedora_qa.checks.flow_photometric.photometric_rates import estimate_rate, rate_measurements
from fedora_qa.checks.flow_photometric.photometric_suspects import photometric_suspects
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_intervals import owned_intervals
from fedora_qa.views.flow_residuals import FEWEST_TILES, FieldResidual, measure_field
from fedora_qa.views.warped_frames import frame_pair, optics_of

_CLOSER_LOOKS: Final = 8


@dataclass(frozen=True, slots=True)
class WindowResiduals:
    """The fields that a window owns, those without frames, and what a closer look showed."""

    window: int
    fields: tuple[FieldResidual, ...] = ()
    without_frames: int = 0
    weighed: tuple[ConventionTrial, ...] = ()
    maps: Mapping[str, tuple[NDArray[Any], str]] = field(default_factory=dict)


class FlowPhotometricResidual(WindowCheck[WindowResiduals]):
    """Does the stored flow carry each frame onto the next?

    The frame at the end of a field's interval is warped back by the stored flow. How far it still lies from the frame
    at its start is measured in tiles of 32 px, as a flow in px with its covariance. All tiles of a rate then give its
    mean (u, v), its gain, and what it would take of focal length, principal point, mounting, time and roll to explain
    it; the worst field, the worst tile, and the share of tiles that do not match at all are stated besides.

    Why it matters
    --------------
    A network learns flow from frames or events. Flow that is a hundredth too large, half a pixel to the side, in
    another unit or an interval late trains it to be wrong, and neither depth nor pose need show it.

    How
    ---
    Tiles and fields are sampled by shares that the effort states. In each tile least squares fit the flow's error,
    with gain and bias of brightness left free; beyond 0.5 px once more about the corrected flow. Pixels count where
    depth and pose (never the flow under test) say that both frames show the same point, 4 px away from edges of the
    depth; without depth or pose, away from breaks of the flow. After an alarm, faults are undone one by one (sign,
    axes, mirrors, units, gains, neighbouring intervals, other rates, frames out of order) on the tiles that do not
    match, and the share of the mismatch that this removes weighs them.

    Noise model
    -----------
    Formal errors follow from what each tile's fit leaves. They are multiplied by how far the tiles of a rate really
    scatter (Birge's ratio, its median over fields); where fields scatter more than one honest rate in a hundred,
    their own spread is taken, widened after Student. Consecutive fields share a frame, whose rounding enters with
    opposite signs: z of a mean spreads less than 1. Allowance: aliases and interpolation err by at most 0.005 px
    times sin(2 pi flow), of which only the mean over the tiles counts (0.02 px for a field, 0.2 px for a tile at
    grazing angles).

    Cannot see
    ----------
    Errors along the edges of a scene with texture in one direction only; much of a gain in slow fields. Tiles in
    which rounding or noise hides 0.1 px, or whose ground is grazed, do not count: walls and nights may be not
    observable. Where poses are noisy, time is not fitted.

    Sources
    -------
    B. D. Lucas, T. Kanade, IJCAI (1981) 674; S. Birchfield (1997) for the symmetric gradient; M. Unser, IEEE Signal
    Process. Mag. 16 (1999) 22 for the spline; J. Westerweel, Meas. Sci. Technol. 8 (1997) 1379 for peak locking; R.
    T. Birge, Phys. Rev. 40 (1932) 207. Derivations: `estimators/flow/residual.py`, `flow_field_fit.py`.
    """

    name = "flow_photometric.residual"
    needs = ("flow", "rgb")

    def not_applicable(self, facts: Facts) -> str:
        """Say why frames cannot be mapped onto the flow's grid."""
        optics = optics_of(facts)
        return optics if isinstance(optics, str) else ""

    def measure(self, window: Window) -> WindowResiduals | None:
        """Measure every field that the window owns and the plan wants."""
        optics = optics_of(window.facts)
        if isinstance(optics, str):
            return None
        fields: list[FieldResidual] = []
        without_frames = 0
        for stream in window.facts.flow_streams:
            for interval in owned_intervals(window, stream):
                if interval.row % window.sampling.field_stride:
                    continue
                frames = frame_pair(window, optics, interval)
                measured = measure_field(frames, interval, window.sampling.tile_share) if frames else None
                without_frames += frames is None
                fields += [measured] if measured else []
        return WindowResiduals(window.span.index, tuple(fields), without_frames)

    def follow_up_windows(self, state: list[WindowResiduals], facts: Facts) -> tuple[int, ...]:
        """Ask for the windows of the worst fields, the worst first."""
        worst = sorted((-max((suspicion(one) for one in w.fields), default=0.0), w.window) for w in state)
        return tuple(window for suspicion, window in worst[:_CLOSER_LOOKS] if suspicion < -1)

    def follow_up(self, state: list[WindowResiduals], window: Window) -> None:
        """Try inverse transforms on the window's worst field of each rate, and draw the worst of all."""
        optics = optics_of(window.facts)
        fields = [one for w in state if w.window == window.span.index for one in w.fields]
        off = sorted((one for one in fields if suspicion(one) > 1), key=suspicion, reverse=True)
        if isinstance(optics, str) or not off:
            return
        weighed: list[ConventionTrial] = []
        for stream in window.facts.flow_streams:
            of_stream = [one for one in off if one.interval.stream == stream]
            if of_stream:
                weighed += weigh_candidates(window, optics, of_stream[0].interval)
        maps = residual_maps(window, optics, off[0].interval)
        state.append(WindowResiduals(window.span.index, weighed=tuple(weighed), maps=maps))

    def conclude(self, state: Sequence[WindowResiduals], facts: Facts) -> Observation:
        """State the residual flow of each rate."""
        fields = [one for w in state for one in w.fields]
        fields.sort(key=lambda one: (one.interval.stream, one.interval.row))
        total = sum(facts.sizes.get(f"path/{stream}", 0) for stream in facts.flow_streams)
        coverage = Coverage(len(fields), total, "flow fields")
        can_tell = [one for one in fields if one.textured >= FEWEST_TILES]
        telling = {stream: [f for f in can_tell if f.interval.stream == stream] for stream in facts.flow_streams}
        telling = {stream: group for stream, group in telling.items() if group}
        if not telling:
            return Observation(coverage, unobservable=_why_none(state, fields))
        weighed = [one for w in state for one in w.weighed]
        rates = {stream: estimate_rate(group) for stream, group in telling.items()}
        off = {stream: is_off(rates[stream], group) for stream, group in telling.items()}
        measurements: list[Statistic] = []
        for stream, group in telling.items():
            fields_off = [one for one in group if suspicion(one) > 1]
            suspects = photometric_suspects(stream, group, weighed, off, fields_off, facts.declared.pose)
            measurements += rate_measurements(stream, group, rates[stream], facts, suspects)
            measurements += place_measurements(stream, group, facts, suspects)
        maps = next((w.maps for w in state if w.maps), {})
        return Observation(
            coverage,
            tuple(measurements),
            evidence={name: values for name, (values, _) in maps.items()},
            titles={name: title for name, (_, title) in maps.items()},
            inferred={"flow_unit": inferred_unit(rates, telling, weighed)},
        )


def _why_none(state: Sequence[WindowResiduals], fields: Sequence[FieldResidual]) -> str:
    without = sum(w.without_frames for w in state)
    if fields:
        tiles = sum(one.tiles for one in fields)
        return (
            f"too few of {tiles} tiles in {len(fields)} fields have texture enough to tell its flow to 0.1 px "
            "where depth and pose let both frames show the same"
        )
    if without:
        return f"of {without} fields none starts and ends on the stamp of a colour frame"
    return "there is no field of flow whose image holds a tile of 32 px"
