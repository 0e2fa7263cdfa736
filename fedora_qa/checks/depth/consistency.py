"""Each depth frame against the next: the same surfaces, seen from where the pose says."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from fedora_qa.checks.depth.suspects import ANY_MISFIT
from fedora_qa.checks.protocol import ANY_CAUSE, Notice, Observation, Statistic, Suspect, WindowCheck
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.depth_agreement import Deviation, PairAgreement, compare
from fedora_qa.views.depth_conventions import DEPTH, PART, weigh_hypotheses
from fedora_qa.views.depth_pairs import owned_pairs, place, why_no_geometry
from fedora_qa.views.flow_comparison import is_noisy
from fedora_qa.views.flow_conventions import ConventionTrial
from fedora_qa.views.flow_suspects import gross_suspects, most_probable

_CLOSER_LOOKS: Final = 4

_PERCENT: Final = 100.0
_MATTERS_PERCENT: Final = 1.0
"""A deviation that moves no use of the depth by more than a hundredth of it."""

_AS_WELL: Final = 0.9
"""What another pose explains, whatever is wrong with the poses explains a little less surely."""

_LITTLE: Final = 0.3
"""Where no cause removes more of the deviation than this, depth or pose may be another sequence's."""

_OTHER: Final = 1.6
"""What any motion of each pair explains of most pairs, half counted for single poses, those of another sequence do;
a cause of one number that removes as much is meant first."""


@dataclass(frozen=True, slots=True)
class WindowAgreement:
    """The pairs that a window owns, those that could not be compared, and what a closer look showed."""

    window: int
    pairs: tuple[PairAgreement, ...] = ()
    without_pose: int = 0
    too_few_pixels: int = 0
    weighed: tuple[ConventionTrial, ...] = ()


class DepthConsistency(WindowCheck[WindowAgreement]):
    """Does each depth frame, carried by the camera's motion, agree with the next?

    The median deviation of the worst pair of frames, and of the worst of 48 tiles of any pair, in percent of the
    depth; and how large a correction of the motion each pair asks for.

    Why it matters
    --------------
    Flow, scene flow and every reprojection are made of depth and pose together. Where one of them belongs to another
    instant, another unit or another camera, they contradict each other here first, without any image.

    How
    ---
    Pixels of a frame are moved by the pose's relative motion into the next frame, whose inverse depth is read there
    bilinearly (exact on planes). Compared are pixels clear of edges and of the border in both frames, by 4 px and by
    as much as the nearest surface may have moved against them: what is hidden is left out without a look at the
    residual. After an alarm, and only then, gross faults are undone one by one on pairs that are off: units, rays,
    mirrors, shifts, exchanged and frozen frames, late stamps, conventions of the pose; the share of the residual that
    undoing a fault removes is its weight.

    Noise model
    -----------
    Each pixel has a bound: rounding to float32, half a step where depths are quantised, a quarter of the second
    differences of the inverse depth around it in both frames (twice Lagrange's bilinear error of a smooth surface; of
    white noise about twice its spread), and the pose's interpolation where stamps fall between its samples. Medians
    must not exceed the bounds' medians. Where the file declares pose noise, each pair may correct its motion; the
    correction must then be as large as the declared noise makes it: chi-square, made normal by the cube root.

    Cannot see
    ----------
    A fault that moves depth and pose alike, such as one unit wrong in both; one of a few pixels; anything on pixels
    beside edges, on moving objects, and in a camera that stands still.

    Sources
    -------
    Y. Chen, G. Medioni, Image and Vision Computing 10 (1992) 145 (point to plane); E. B. Wilson, M. M. Hilferty, PNAS
    17 (1931) 684 (cube root of chi-square); first principles, ``fedora_qa/estimators/depth/inverse_depth.py`` and
    ``depth_warp.py``.
    """

    name = "depth.consistency"
    needs = ("depth", "pose")

    def not_applicable(self, facts: Facts) -> str:
        """Say what of the model does not hold."""
        return why_no_geometry(facts)

    def measure(self, window: Window) -> WindowAgreement | None:
        """Compare every pair that the window owns."""
        found, without_pose, too_few = [], 0, 0
        for pair in owned_pairs(window):
            agreement = None if pair is None else compare(pair)
            without_pose += pair is None
            too_few += pair is not None and agreement is None
            found += [agreement] if agreement else []
        return WindowAgreement(window.span.index, tuple(found), without_pose, too_few)

    def follow_up_windows(self, state: list[WindowAgreement], facts: Facts) -> tuple[int, ...]:
        """Ask for the windows of the worst pairs; of those that could not be compared where there are no others."""
        worst = sorted((-_suspicion(one.pairs), one.window) for one in state)
        chosen = [window for suspicion, window in worst if suspicion < -1]
        return tuple(chosen[:_CLOSER_LOOKS])

    def follow_up(self, state: list[WindowAgreement], window: Window) -> None:
        """Undo faults on the middle one of the window's pairs that are off: in the worst a fault may begin or end."""
        of_window = [pair for one in state if one.window == window.span.index for pair in one.pairs]
        off = sorted((pair for pair in of_window if pair.suspicion > 1), key=lambda pair: pair.suspicion)
        chosen = off[(len(off) - 1) // 2]
        for pair in owned_pairs(window):
            if pair is not None and pair.first == chosen.first:
                local = chosen.whole.suspicion <= 1 and chosen.noise_square <= 0
                residual, tile = (chosen.worst_tile.typical, chosen.tile) if local else (chosen.whole.typical, None)
                weighed = weigh_hypotheses(pair.whole(), residual, tile)
                state.append(WindowAgreement(window.span.index, weighed=tuple(weighed)))

    def conclude(self, state: Sequence[WindowAgreement], facts: Facts) -> Observation:
        """State the worst deviations, and how large the corrections were."""
        pairs = sorted((pair for one in state for pair in one.pairs), key=lambda pair: pair.first)
        total = max(int(np.count_nonzero(facts.clocks["depth"].advancing)) - 1, 0)
        coverage = Coverage(len(pairs), total, "pairs of depth frames")
        if not pairs:
            return Observation(coverage, unobservable=_why_none(state))
        suspects = _suspects(pairs, [one for each in state for one in each.weighed], facts)
        measured = [_whole(pairs, facts, suspects), _tile(pairs, facts, suspects)]
        if facts.declared.pose is not None and is_noisy(facts.declared.pose):
            measured += _corrections(pairs, facts, suspects)
        notices = () if facts.declared.pose else (_noise_not_declared(),)
        return Observation(coverage, tuple(measured), notices)


def _whole(pairs: Sequence[PairAgreement], facts: Facts, suspects: tuple[Suspect, ...]) -> Statistic:
    worst = max(pairs, key=lambda pair: pair.whole.suspicion)
    off = [pair for pair in pairs if pair.whole.suspicion > 1]
    return Statistic(
        name="deviation",
        value=_PERCENT * worst.whole.typical,
        unit="percent",
        standard_error=0.0,
        model_error_bound=_PERCENT * worst.whole.bound,
        side="upper",
        material=_MATTERS_PERCENT,
        statement=f"Depth frame {worst.first} differs from frame {worst.second} by {_said(worst.whole)}; "
        f"{len(off)} of {len(pairs)} pairs are off.",
        code="depth.consistency.frame",
        where=_where(off or [worst], facts),
        suspects=suspects,
    )


def _tile(pairs: Sequence[PairAgreement], facts: Facts, suspects: tuple[Suspect, ...]) -> Statistic:
    worst = max(pairs, key=lambda pair: pair.worst_tile.suspicion)
    off = [pair for pair in pairs if pair.worst_tile.suspicion > 1]
    return Statistic(
        name="worst_tile",
        value=_PERCENT * worst.worst_tile.typical,
        unit="percent",
        standard_error=0.0,
        model_error_bound=_PERCENT * worst.worst_tile.bound,
        side="upper",
        material=_MATTERS_PERCENT,
        statement=f"A tile of depth frame {worst.first} differs from frame {worst.second} by "
        f"{_said(worst.worst_tile)}; so it is in {len(off)} of {len(pairs)} pairs.",
        code="depth.consistency.tile",
        where=replace(_where(off or [worst], facts), tile=worst.tile),
        suspects=suspects,
    )


def _corrections(pairs: Sequence[PairAgreement], facts: Facts, suspects: tuple[Suspect, ...]) -> list[Statistic]:
    """Hold the corrections to the declared noise: all together over every second pair (no pose in common), and each.

    With Q chi-square of n degrees of freedom, (Q/n)^(1/3) is normal about 1 - 2/(9n) with variance 2/(9n) (Wilson and
    Hilferty, PNAS 17 (1931) 684; at n = 6 its five-sigma tails are right within a factor of three).
    """
    held = [pair for pair in pairs if pair.noise_dof >= 1]
    if not held:
        return []
    alone = held[::2]
    dof = sum(pair.noise_dof for pair in alone)
    ratio = sum(pair.noise_square for pair in alone) / dof
    misdeclared = Suspect("noise_misdeclared", "pose", 0.8, 100 * (1 / ratio**0.5 - 1) if ratio else None, "percent")
    any_pose = Suspect(ANY_CAUSE, "pose", _AS_WELL * misdeclared.weight)
    worst = max(held, key=lambda pair: pair.noise_square / pair.noise_dof)
    return [
        _correction("pose_correction", ratio, dof, "The corrections that depth asks of the pose are",
                    place(facts, alone[0].first, alone[-1].second), (misdeclared, any_pose, *suspects),
                    tests=1, side="both"),
        _correction("worst_pose_correction", worst.noise_square / worst.noise_dof, worst.noise_dof,
                    f"The correction that depth frames {worst.first} and {worst.second} ask of the pose is",
                    place(facts, worst.first, worst.second), (*suspects, any_pose, replace(misdeclared, weight=0.4)),
                    tests=len(held), side="upper"),
    ]  # fmt: skip


def _correction(
    name: str, ratio: float, dof: float, what: str, where: Where, suspects: tuple[Suspect, ...],
    *, tests: int, side: Literal["both", "upper"],
) -> Statistic:  # fmt: skip
    spread = 2 / (9 * dof)
    return Statistic(
        name=name,
        value=float(np.cbrt(ratio)),
        unit="1",
        standard_error=float(np.sqrt(spread)),
        expected=1 - spread,
        side=side,
        tests=tests,
        statement=f"{what} {np.sqrt(ratio):.3g} times as large as the declared pose noise makes them.",
        code=f"depth.consistency.{name}",
        where=where,
        suspects=suspects,
    )


def _suspects(pairs: Sequence[PairAgreement], weighed: Sequence[ConventionTrial], facts: Facts) -> tuple[Suspect, ...]:
    """Return what a closer look found, most probable first, and what other checks may know better."""
    off = [pair for pair in pairs if pair.suspicion > 1]
    if not off:
        return ()
    local = 2 * len(off) <= len(pairs)
    gross = gross_suspects(DEPTH, weighed, "flow", share_off=len(off) / len(pairs))
    # What begins between the frames of the worst pair spoils that pair alone, whatever part of the file it has.
    gross = _best_of_each((*gross, *gross_suspects(PART, weighed, "flow", share_off=1.0)))
    repeated = sum(pair.repeats for pair in off)
    if repeated:
        gross.append(Suspect("frozen_frames", "depth", 1.0, float(repeated), "samples", 0.0))
    by_pose = max((one.weight for one in gross if (one.cause, one.stream) == ("teleport", "pose")), default=0.0)
    if not local:
        gross += [Suspect("other_sequence", stream, max(_LITTLE, _OTHER * by_pose)) for stream in ("depth", "pose")]
    named = most_probable(gross)
    return (
        *named,
        Suspect(ANY_CAUSE, "pose", _AS_WELL * by_pose),
        *(suspect for suspect in ANY_MISFIT if not _is_among(suspect, named)),
    )


def _best_of_each(suspects: Sequence[Suspect]) -> list[Suspect]:
    best: dict[tuple[str, str], Suspect] = {}
    for suspect in sorted(suspects, key=lambda one: one.weight):
        best[suspect.cause, suspect.stream] = suspect
    return list(best.values())


def _is_among(suspect: Suspect, named: Sequence[Suspect]) -> bool:
    return any((one.cause, one.stream) == (suspect.cause, suspect.stream) for one in named)


def _where(pairs: Sequence[PairAgreement], facts: Facts) -> Where:
    return place(facts, pairs[0].first, pairs[-1].second)


def _said(deviation: Deviation) -> str:
    typical, bound = (_PERCENT * share for share in (deviation.typical, deviation.bound))
    return f"{typical:.3g}% at the median pixel, where rounding explains {bound:.1g}%"


def _suspicion(pairs: Sequence[PairAgreement]) -> float:
    return max((pair.suspicion for pair in pairs), default=0.0)


def _why_none(state: Sequence[WindowAgreement]) -> str:
    reasons = {
        "are not covered by poses": sum(one.without_pose for one in state),
        "share too few pixels clear of edges": sum(one.too_few_pixels for one in state),
    }
    found = [f"{count} {reason}" for reason, count in reasons.items() if count]
    if found:
        return "of the pairs of depth frames " + ", ".join(found)
    return "there are no two depth frames, or it is not known what stands in them"


def _noise_not_declared() -> Notice:
    return Notice(
        "depth.consistency.undeclared",
        "The pose's noise is not declared, so that each pair of depth frames was allowed any correction of its motion.",
    )
