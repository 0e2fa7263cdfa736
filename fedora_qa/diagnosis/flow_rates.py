"""Hypotheses for fields of a faster rate that do not compose to those of a slower one."""

from typing import Final

from fedora_qa.checks.flow_rates.composition import COPIES, RatePairsOff
from fedora_qa.diagnosis.convention_trials import most_probable, weakened
from fedora_qa.diagnosis.flow import convention_hypotheses
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.flow_conventions import ConventionTrial

_CAUSES: Final = (
    "flow_gain", "flow_unit", "flow_sign", "flow_interval_shifted", "flow_rate_mixed", "axes_swapped",
    "frame_convention", "mirrored", "spatial_offset", "swapped_frames", "frozen_frames", "other_sequence",
    "time_offset", "intrinsics_focal", "intrinsics_centre", "extrinsic_rotation", "nan_in_stream", "clock_rate",
    "time_unit", "unsorted", "duplicated_samples",
)  # fmt: skip
"""Causes of a deviation between rates, also those whose inverse transform was not tried."""


def propose_composition(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for one pair of rates, best supported first."""
    rates_off = next((feature for feature in alarm.statistic.features if isinstance(feature, RatePairsOff)), None)
    if rates_off is None or not rates_off.shares_off[rates_off.pair]:
        return ()
    pair, shares_off = rates_off.pair, rates_off.shares_off
    trials = [feature for feature in alarm.statistic.features if isinstance(feature, ConventionTrial)]
    # A copy is equal bit for bit in every trial, so its removed share is exactly 1: no tolerance.
    shares: dict[tuple[str, str], list[float]] = {}
    for trial in trials:
        if trial.transform in COPIES:
            shares.setdefault((trial.stream, trial.transform), []).append(trial.removed_share)
    copied = {stream for (stream, _), of_transform in shares.items() if min(of_transform) == 1.0}
    # Transforms with nearly the effect of a copy are then not named.
    trials = [trial for trial in trials if trial.stream not in copied or trial.transform in COPIES]
    hypotheses: list[Hypothesis] = []
    # A deviation between two rates does not determine which one is wrong; a rate that agrees with a third is rarely
    # wrong.
    agrees = {rate: any(rate in another and not share for another, share in shares_off.items()) for rate in pair}
    for rate, other in (pair, pair[::-1]):
        if agrees[rate]:
            factor = support("flow_rates.agrees_with_third")
        else:
            factor = 1.0 if agrees[other] else support("flow_rates.either_of_two")
        hypotheses += weakened(convention_hypotheses(rate, trials, rate, share_off=shares_off[pair]), factor)
    all_off = all(shares_off.values())
    if all_off:
        hypotheses += convention_hypotheses("flow", trials, "flow", share_off=shares_off[pair])
        mixed = {
            trial.stream for trial in trials if trial.transform == "field_of_another_rate" and trial.removed_share > 0
        }
        if len(mixed) > 2:  # of two rates that are exchanged only one holds fields of the other's
            hypotheses.append(Hypothesis("flow_rate_mixed", "flow", support("flow_rates.every_rate_mixed")))
    named = most_probable(hypotheses)
    already_named = {(hypothesis.cause, hypothesis.stream) for hypothesis in named}
    weak = support("flow_rates.any_disagreement")
    return named + tuple(
        Hypothesis(cause, stream, weak)
        for stream in (("flow", *pair) if all_off else pair)
        for cause in _CAUSES
        if (cause, stream) not in already_named
    )
