"""The rates of flow against each other: short fields compose to long ones."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Final

from fedora_qa.checks.flow_rates.inverse_trials import try_inverse_transforms
from fedora_qa.checks.protocol import Observation, Statistic, WindowCheck
from fedora_qa.features import Feature
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.flow_chains import segments
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_rate_agreement import MOST_LOST, MedianEndpointError, RateAgreement, compare_rates

RatePair = tuple[str, str]
"""Two rates, the slower one first."""

_MOST_FOLLOW_UPS: Final = 4

_MATERIAL_PX: Final = 0.1
"""An endpoint error that no use of the flow would notice."""


@dataclass(frozen=True, slots=True)
class WindowComposition:
    """The common intervals that begin in a window, those that could not be compared, and the trials of a follow-up."""

    window: int
    segments: tuple[RateAgreement, ...] = ()
    not_compared: int = 0
    trials: tuple[ConventionTrial, ...] = ()


@dataclass(frozen=True, slots=True)
class RatePairsOff(Feature):
    """The pair of rates that was compared, and the share of common intervals that are off, for every pair."""

    pair: RatePair
    shares_off: Mapping[RatePair, float]


class FlowRatesComposition(WindowCheck[WindowComposition]):
    """Do the fields of a faster rate compose to those of a slower one?

    Each pixel is followed along the fields of either rate, from the start of an interval that both cover to its end:
    five fields of 50 Hz lead where one of 10 Hz leads, two where one of 25 Hz does, five of 25 Hz where two of 10 Hz
    do. The distance of the two endpoints is the error in px: its median over the worst interval, its median over the
    worst of 48 tiles, and the share of pixels that only one of the rates carries out of the image.

    Why it matters
    --------------
    It needs neither depth nor pose nor frames, and it tells which of three rates is wrong: the two others agree. A
    rate stored under another's name, or one field out of place, shows at once.

    How
    ---
    Flow is read bilinearly between pixels of a lattice whose density the effort states. Paths within 4 px of breaks of
    the flow are left out, and those that get midway to a place where another surface leads, too, and hides them or is
    hidden: every fourth pixel of a field (from 880,000 pixels on every eighth) tells which flows lead where, and flows
    that differ by more than 0.5 px, and than the flow's slope makes of their distance, are of two surfaces. After an
    alarm the rate that disagrees with the others is named, and faults are undone on it (sign, axes, mirrors, unit,
    gain, neighbouring intervals, fields of another rate, repeated fields), on the pixels that are off where these are
    few.

    Noise model
    -----------
    Bounds, not spreads: each path has, of each field around the place where it is read, a quarter of the second
    differences (twice the bilinear error of a smooth surface) and half of the third (the step where two surfaces meet),
    and single-precision rounding of each field, all grown by the flow's slope from field to field. Medians must not
    exceed the bounds' medians.

    Cannot see
    ----------
    A fault that all rates share and that composes, such as a turned camera; which of only two rates is wrong; pixels
    that are hidden midway; faults of stamps, which change which fields are compared and nothing else.

    Sources
    -------
    First principles: Lagrange's remainder for the reading, `geometry/rigid_flow.py` for the rounding; the derivation
    stands in `estimators/flow/path_kernels.py`.
    """

    name = "flow_rates.composition"
    needs = ("flow",)

    def not_applicable(self, facts: Facts) -> str:
        """State that there is nothing to compare with."""
        return "" if len(facts.flow_streams) > 1 else "there is one rate of flow only"

    def measure(self, window: Window) -> WindowComposition | None:
        """Compare every pair of rates over the intervals that begin in the window."""
        agreements, not_compared = [], 0
        # Streams are in the order of their rates: the slower one of each pair comes first.
        for slow, fast in combinations(window.facts.flow_streams, 2):
            for segment in segments(window, slow, fast):
                # Strides count from the first row of the file, so that the sample does not depend on the windows.
                if segment.slow.rows[0] % window.sampling.field_stride:
                    continue
                agreement = compare_rates(window, segment)
                agreements += [agreement] if agreement else []
                not_compared += agreement is None
        return WindowComposition(window.span.index, tuple(agreements), not_compared)

    def follow_up_windows(self, state: list[WindowComposition], facts: Facts) -> tuple[int, ...]:
        """Return the windows of the worst intervals that exceed their bounds."""
        worst = sorted(
            (-max((agreement.suspicion for agreement in summary.segments), default=0.0), summary.window)
            for summary in state
        )
        return tuple(window for suspicion, window in worst[:_MOST_FOLLOW_UPS] if suspicion < -1)

    def follow_up(self, state: list[WindowComposition], window: Window) -> None:
        """Try inverse transforms on the window's worst interval of each pair of rates."""
        of_window = [
            agreement for summary in state if summary.window == window.span.index for agreement in summary.segments
        ]
        trials: list[ConventionTrial] = []
        for group in _by_pair(of_window).values():
            worst = max(group, key=lambda agreement: agreement.suspicion)
            if worst.suspicion > 1:
                trials += try_inverse_transforms(window, worst.segment)
        state.append(WindowComposition(window.span.index, trials=tuple(trials)))

    def conclude(self, state: Sequence[WindowComposition], facts: Facts) -> Observation:
        """State the endpoint error of each pair of rates."""
        pairs = _by_pair([agreement for summary in state for agreement in summary.segments])
        count = sum(len(group) for group in pairs.values())
        not_compared = sum(summary.not_compared for summary in state)
        coverage = Coverage(count, count + not_compared, "common intervals")
        if not pairs:
            return Observation(coverage, unobservable="no two rates cover a common interval by whole fields")
        trials = [trial for summary in state for trial in summary.trials]
        shares_off = {
            pair: sum(agreement.suspicion > 1 for agreement in group) / len(group) for pair, group in pairs.items()
        }
        statistics: list[Statistic] = []
        for pair, group in pairs.items():
            features = (RatePairsOff(pair, shares_off), *trials)
            statistics += [replace(statistic, features=features) for statistic in _statistics(pair, group, facts)]
        return Observation(coverage, tuple(statistics))


def _by_pair(agreements: Sequence[RateAgreement]) -> Mapping[RatePair, list[RateAgreement]]:
    pairs: dict[RatePair, list[RateAgreement]] = {}
    for agreement in sorted(agreements, key=lambda agreement: agreement.segment.start_ns):
        pairs.setdefault((agreement.segment.slow.stream, agreement.segment.fast.stream), []).append(agreement)
    return pairs


def _statistics(pair: RatePair, group: Sequence[RateAgreement], facts: Facts) -> list[Statistic]:
    name = f"{pair[0]} by {pair[1].removeprefix('flow/')}"
    most_lost = max(group, key=lambda agreement: agreement.lost)
    statistics = [
        Statistic(
            name=f"{name} leaving",
            value=most_lost.lost,
            unit="share",
            standard_error=0.0,
            model_error_bound=MOST_LOST,
            side="upper",
            statement=f"{most_lost.lost:.0%} of the pixels leave the image by {pair[0]} or by {pair[1]}, "
            "but not by both.",
            code="flow_rates.composition.leaving",
            where=_where([agreement for agreement in group if agreement.lost > MOST_LOST] or [most_lost], facts),
        )
    ]
    compared = [
        (agreement, agreement.whole, agreement.worst_tile)
        for agreement in group
        if agreement.whole and agreement.worst_tile
    ]
    if compared:
        whole = max(compared, key=lambda errors: errors[1].suspicion)
        tile = max(compared, key=lambda errors: errors[2].suspicion)
        off = [agreement for agreement, error, _ in compared if error.suspicion > 1]
        off_tile = [agreement for agreement, _, error in compared if error.suspicion > 1]
        extent = f"{len(off)} of {len(compared)} intervals are off"
        statistics += [
            _error(f"{name} error", pair, whole[1], extent, "error", _where(off or [whole[0]], facts)),
            _error(f"{name} worst_tile", pair, tile[2], "in the worst tile", "tile",
                   replace(_where(off_tile or [tile[0]], facts), tile=tile[0].tile)),
        ]  # fmt: skip
    return statistics


def _error(name: str, pair: RatePair, error: MedianEndpointError, extent: str, rule: str, where: Where) -> Statistic:
    return Statistic(
        name=name,
        value=error.typical_px,
        unit="px",
        standard_error=0.0,
        model_error_bound=error.bound_px,
        side="upper",
        material=_MATERIAL_PX,
        statement=f"{pair[0]} leads {error.typical_px:.3g} px away from where fields of {pair[1]} lead together, "
        f"and interpolation explains {error.bound_px:.1g} px; {extent}.",
        code=f"flow_rates.composition.{rule}",
        where=where,
    )


def _where(group: Sequence[RateAgreement], facts: Facts) -> Where:
    first, last = group[0].segment, group[-1].segment
    return Where(
        stream=first.slow.stream,
        start_us=facts.to_file_us(first.start_ns),
        stop_us=facts.to_file_us(last.end_ns),
        index_start=first.slow.rows[0],
        index_stop=last.slow.rows[-1] + 1,
    )
