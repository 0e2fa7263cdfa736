"""Name the causes of a file's findings: the fewest that explain all of them, tested by undoing them.

Each alarm has hypotheses: causes that would explain it, with their support. A candidate whose fault was undone has the
support that the trial measured: 1 for a finding that it clears, less for one that is left. A cause that explains
several alarms is preferred over several causes (Occam), so causes are taken greedily by the support they add to that of
the causes before them: the classical approximation of a smallest weighted cover (Chvatal, "A greedy heuristic for the
set-covering problem", 1979). Each check counts once, even if it states a disagreement for each rate of flow, as a mean
and at its worst. Diagnosis runs only after an alarm: on clean files it would always name some cause.
"""

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from math import isclose
from types import MappingProxyType
from typing import Final

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.diagnosis.candidates import CONTENDS, FITS, OF_COMPONENTS, UNKNOWN, CauseCandidate, gather_candidates
from fedora_qa.diagnosis.clock_grids import ClockPlace
from fedora_qa.diagnosis.conclusion import (
    CERTAIN,
    Trials,
    UndoTrial,
    clears_by_chance,
    confidence_of,
    has_evidence,
    is_conclusive,
    is_excluded,
    is_refuted,
    is_scale_by_chance,
    is_unit_by_chance,
    status_of,
)
from fedora_qa.diagnosis.direct import CHECKS_OF_CLOCKS, check_of_code, clears_by_construction, is_direct
from fedora_qa.diagnosis.filtered_noise import noise_taken
from fedora_qa.diagnosis.hypothesis import Hypothesis, support
from fedora_qa.diagnosis.image_parts import part_of_images
from fedora_qa.diagnosis.joined_findings import are_of_two_bodies, joined_hypotheses
from fedora_qa.diagnosis.measured_sizes import (
    Results,
    begin_and_end_with_frames,
    has_lines_of_frames,
    is_nearer_to_other_order,
)
from fedora_qa.diagnosis.vetoes import (
    COMPARED_BY_FLOW,
    contradicts,
    disturbs_too_few,
    is_flow_of_a_part,
    no_pose_repeats,
    stand_still,
)
from fedora_qa.faults.fault import ReversibleFault, is_of_part
from fedora_qa.faults.image_part import ImagePart
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Diagnosis, Where

_ENOUGH: Final = 0.05
"""Least support that a further cause must add to be named."""

_OF_LAYOUT: Final = "integrity.layout."
"""Beginning of the codes of findings about how values are stored. Types that lose nothing give no alarm."""

_LABEL: Final = "metadata.units.label"

_OF_CLOCKS: Final = frozenset({"time_offset", "clock_rate"})
"""Causes by which a clock leaves the grid of the others."""

_OF_ROWS: Final = frozenset({"time_offset", "clock_rate", "swapped_frames"})
"""Causes that move or exchange whole images: none holds in a part of the image."""

_OF_TIMESTAMPS: Final = ("clocks.", "index_maps.", "flow_geometry.interval_timestamps.")
"""Beginnings of the codes of findings about timestamps, whatever the images hold."""

_OF_CONSERVATION: Final = "event_response.conservation"
_OF_TIMING: Final = "event_response.timing"

_IN_ONE_DIRECTION: Final = frozenset({"spatial_offset", "intrinsics_centre", "time_offset", "clock_rate"})
"""Causes that move edges in one direction: where the image moves evenly, one undoes what another did."""

_WHOLE_PX: Final = 0.5
"""Largest difference of a fitted shift from the one that was undone for the fitted one to be stated: that in whole
pixels is rounded."""

_MOSTLY: Final = 0.5
"""Share of all findings, where each check counts once, that a guess must exceed to be first beside findings that no
cause explains."""

_VECTORS: Final = OF_COMPONENTS | {"teleport"}
"""Causes whose size is the length of a vector."""


def rank_candidates(
    alarms: Sequence[Alarm],
    hypotheses: Mapping[str, Sequence[Hypothesis]],
    results: Results = MappingProxyType({}),
    places: Mapping[str, ClockPlace] = MappingProxyType({}),
) -> list[CauseCandidate]:
    """Return the candidates that no measurement contradicts, in the order in which to test them: by their support.

    Parameters
    ----------
    alarms
        Of one file.
    hypotheses
        By the id of the finding that they would explain.
    results
        Of the file, by check, judged by the limits alone.
    places
        Of the clocks.
    """
    excluded = COMPARED_BY_FLOW if is_flow_of_a_part(alarms) else frozenset()
    never = {("swapped_frames", "rgb")} if stand_still(alarms) else set()
    if no_pose_repeats(alarms, results):
        never.add(("frozen_frames", "pose"))
    by_finding = {alarm.finding.id: alarm for alarm in alarms}
    taken = noise_taken(alarms, results)
    other_order = support("images.colours_nearer_to_other_order") if is_nearer_to_other_order(results) else 0.0
    large_enough = {
        finding: [
            replace(each, support=max(each.support, other_order)) if each.cause == "channel_order" else each
            for each in proposed
            if not disturbs_too_few(each, by_finding[finding], results)
        ]
        for finding, proposed in hypotheses.items()
    }
    for each in taken:
        large_enough = {finding: each.divided(proposed) for finding, proposed in large_enough.items()}
    of_noise = {(each.cause, each.stream) for each in taken}
    for finding, joined in joined_hypotheses(alarms).items():
        large_enough[finding] = [*large_enough.get(finding, ()), *joined]
    if has_lines_of_frames(results):
        # Too few of all events for a finding of its own: those of a while.
        interpolated = Hypothesis(
            "interpolated_frames", "events", support("event_response.lines_of_frames_for_a_while")
        )
        explained = {_OF_CONSERVATION}
        if begin_and_end_with_frames(results):
            # The events between two frames state no time at which the light of a moving image passed a level.
            explained.add(_OF_TIMING)
        for finding, alarm in by_finding.items():
            if check_of_code(alarm.finding.code) in explained:
                large_enough[finding] = [*large_enough.get(finding, ()), interpolated]
    codes = {finding: alarm.finding.code for finding, alarm in by_finding.items()}
    candidates = [
        candidate
        for candidate in gather_candidates(large_enough, _weights(alarms))
        if stream_family(candidate.stream) not in excluded
        and candidate.key not in never
        and not _is_beside_a_part(candidate, codes, alarms)
        # Neither the grid of the timestamps nor straight lines state what a filter or a smooth curve does to values. A
        # label that is wrong is beside values that are in order.
        and (
            candidate.key in of_noise
            or any(by_finding[finding].finding.code == _LABEL for finding in candidate.evidence)
            or not contradicts(
                candidate.cause,
                candidate.stream,
                candidate.size.magnitude,
                results,
                places,
                of_two_bodies=are_of_two_bodies(alarms),
            )
        )
    ]
    return sorted(candidates, key=lambda candidate: -candidate.total_support)


def _is_beside_a_part(candidate: CauseCandidate, codes: Mapping[str, str], alarms: Sequence[Alarm]) -> bool:
    """Whether a cause moves whole images of flow or depth, which agree but for a part, and no timestamp shows it."""
    if candidate.cause not in _OF_ROWS or part_of_images(alarms, candidate.stream) is None:
        return False
    return not any(codes[finding].startswith(_OF_TIMESTAMPS) for finding in candidate.evidence)


def choose_causes(
    alarms: Sequence[Alarm],
    hypotheses: Mapping[str, Sequence[Hypothesis]],
    trials: Trials = MappingProxyType({}),
    results: Results = MappingProxyType({}),
    places: Mapping[str, ClockPlace] = MappingProxyType({}),
) -> tuple[Diagnosis, ...]:
    """Choose the fewest causes that explain all alarms.

    Alarms without a hypothesis become ``unknown``, one diagnosis for each stream (all rates of flow are one).

    Parameters
    ----------
    alarms
        Of one file.
    hypotheses
        By the id of the finding that they would explain.
    trials
        Of candidates whose fault was undone.
    results, places
        As of ``rank_candidates``.

    Returns
    -------
    tuple
        In the order in which they were chosen, those that are measured before those that are suggested; ``unknown``
        last, or before a guess at the cause of no more than half of the findings.
    """
    where = {alarm.finding.id: alarm.finding.where for alarm in alarms}
    codes = {alarm.finding.id: alarm.finding.code for alarm in alarms}
    weights = _weights(alarms)
    ranked = rank_candidates(alarms, hypotheses, results, places)
    prior = {candidate.key: candidate for candidate in ranked}
    candidates = [
        _tested(candidate, codes, trials.get(candidate.key))
        for candidate in ranked
        if not is_excluded(candidate, codes, trials)
        and not is_scale_by_chance(candidate, trials)
        and not is_unit_by_chance(candidate, codes, trials)
        and not is_refuted(candidate, codes, trials)
    ]
    tested = {c.key: has_evidence(c, codes, trials) for c in candidates}
    # Unexplained support of each finding: the demand of the set cover.
    unexplained = {alarm.finding.id: 1.0 for alarm in alarms}

    def gain(candidate: CauseCandidate) -> float:
        return sum(_new_support(candidate, finding, unexplained) for finding in candidate.evidence)

    of_layout = {alarm.finding.id for alarm in alarms if alarm.finding.code.startswith(_OF_LAYOUT)}

    def merit(candidate: CauseCandidate) -> tuple[bool, float, bool]:
        """Return whether it states how values are stored, the gain by check, and whether a clock is out of place.

        What was lost when values were stored disturbs all that is computed from them, and is read, not estimated.
        """
        by_check = sum(_new_support(candidate, f, unexplained) * weights[f] for f in candidate.evidence)
        is_stored_so = any(_new_support(candidate, f, unexplained) >= CERTAIN for f in of_layout)
        return is_stored_so, round(by_check, 6), is_out_of_place(candidate)

    def is_out_of_place(candidate: CauseCandidate) -> bool:
        clock = places.get(stream_family(candidate.stream))
        return candidate.cause in _OF_CLOCKS and clock is not None and clock.place == "out"

    def is_surpassed(candidate: CauseCandidate, supported: Sequence[CauseCandidate]) -> bool:
        """Whether another cause removes all of several checks, of which undoing this one leaves more."""
        trial = trials.get(candidate.key)
        return trial is not None and any(
            trials[other.key].surpasses(trial) and len(_checks_removed(other, codes, trials[other.key])) > 1
            for other in supported
            if other.key in trials
        )

    def is_less_likely(other: CauseCandidate, candidate: CauseCandidate) -> bool:
        """Whether a cause whose trial fails is ruled out by it, or not certain by its check, and the other one is."""
        return is_conclusive(prior[other.key], codes) or (
            prior[candidate.key].best_support >= CERTAIN > prior[other.key].best_support
        )

    def is_measured_otherwise(candidate: CauseCandidate, supported: Sequence[CauseCandidate]) -> bool:
        """Whether undoing it in the whole file leaves all that it explains, and a check measures another cause of that.

        Such a trial leaves a cause that may hold in a part of the file, and then with less right than the other one.
        """
        trial = trials.get(candidate.key)
        if trial is None or not trial.fails or is_of_part(trial.fault) or tested[candidate.key]:
            return False
        own = {finding for finding, h in candidate.evidence.items() if h.support > 0}
        return any(
            other.key != candidate.key
            and tested[other.key]
            and not (other.key in trials and trials[other.key].fails and is_less_likely(other, candidate))
            and own <= set(other.evidence)
            # Sorted timestamps are in order, whatever has disordered them.
            and not any(clears_by_construction(other.cause, codes[finding]) for finding in other.evidence)
            for other in supported
        )

    diagnoses: list[Diagnosis] = []
    explained: set[str] = set()
    measured: set[tuple[str, str]] = set()
    guesses: set[tuple[str, str]] = set()
    # Greedy step of the weighted cover (Chvatal 1979): the cause that adds most support, counted by check. Among equal
    # ones the first counts, which is ranked higher without trials.
    while supported := [c for c in candidates if gain(c) >= _ENOUGH and (tested[c.key] or c.best_support >= FITS)]:
        in_question = [c for c in supported if not is_surpassed(c, supported)]
        best = max((c for c in in_question if not is_measured_otherwise(c, in_question)), key=merit)
        own = {f: h for f, h in best.evidence.items() if h.support > 0}
        # Where one clock is out of place, the others, which lie on one grid, are no rivals.
        is_odd = is_out_of_place(best)
        rivals = [other for other in ranked if other.key != best.key and not (is_odd and other.cause in _OF_CLOCKS)]
        least = CONTENDS * prior[best.key].support_for(own)
        likely = {rival.key for rival in rivals if rival.support_for(own) >= least}
        status, alike = status_of(best, own, codes, trials, rivals, likely)
        size, trial = best.size, trials.get(best.key)
        magnitude = size.magnitude
        is_by_chance = trial is not None and trial.cleared and trial.cleared.isdisjoint(prior[best.key].evidence)
        if status == "confirmed" or (status == "supported" and not is_by_chance):
            measured.add(best.key)
        elif prior[best.key].best_support < CERTAIN:
            guesses.add(best.key)
        if trial is not None and trial.cleared:
            magnitude = trial.size or _size_by_trial(best.cause, magnitude, trial.fault)
        diagnoses.append(
            Diagnosis(
                id=f"D{len(diagnoses) + 1}",
                cause=best.cause,
                stream=best.stream,
                magnitude=magnitude,
                unit=size.unit or CAUSES[best.cause].unit,
                standard_error=size.standard_error,
                confidence=confidence_of(status, best.cause),
                where=_place(where[best.sized_by], trial),
                remedy=CAUSES[best.cause].remedy,
                explains=tuple(own),
                status=status,
                tried=(trial.description, *(rival.description for rival in alike)) if trial else (),
                cleared=tuple(finding for finding in where if trial and finding in trial.cleared),
                windows=trial.windows if trial else 0,
            )
        )
        for finding, hypothesis in own.items():
            # Rest after the best supported cause so far: supports of several causes of one finding do not add.
            unexplained[finding] = min(unexplained[finding], 1.0 - hypothesis.support)
        explained |= set(own)
        # A cause is named once, and one whose findings are all explained is superfluous.
        candidates = [c for c in candidates if c.key != best.key and not set(c.evidence) <= explained]
    without_cause: dict[str, list[Alarm]] = defaultdict(list)
    for alarm in alarms:
        if alarm.finding.id not in explained:
            without_cause[stream_family(alarm.finding.where.stream or UNKNOWN)].append(alarm)
    for family, of_family in without_cause.items():
        first = of_family[0].finding.where
        streams = {alarm.finding.where.stream for alarm in of_family}
        diagnoses.append(
            Diagnosis(
                id=f"D{len(diagnoses) + 1}",
                cause=UNKNOWN,
                stream=family if len(streams) > 1 else first.stream or UNKNOWN,
                magnitude=None,
                unit="",
                standard_error=None,
                confidence=0.0,
                where=first,
                remedy=CAUSES[UNKNOWN].remedy,
                explains=tuple(alarm.finding.id for alarm in of_family),
                status="unidentified",
            )
        )
    return _guesses_last(_measured_first(diagnoses, measured), guesses, weights)


def _measured_first(diagnoses: Sequence[Diagnosis], measured: Collection[tuple[str, str]]) -> tuple[Diagnosis, ...]:
    """Return diagnoses, confirmed and then measured ones first where the one that explains most is only suggested.

    A suggestion explains whatever its findings share. A measured cause is supported by its own check, or by a trial
    that clears what the cause was proposed for.
    """
    if not diagnoses or diagnoses[0].status != "suggested":
        return tuple(diagnoses)
    ordered = sorted(diagnoses, key=lambda each: (each.status != "confirmed", key_of(each) not in measured))
    return _numbered(ordered)


def _guesses_last(
    diagnoses: Sequence[Diagnosis], guesses: Collection[tuple[str, str]], weights: Mapping[str, float]
) -> tuple[Diagnosis, ...]:
    """Put what has no cause before the first diagnosis where that guesses at no more than half of the findings.

    One fault is likelier than two, and the cause that is guessed leaves findings which nothing explains.

    Parameters
    ----------
    diagnoses
        In order.
    guesses
        Causes, with their streams, that are suggested, and of which no check is certain.
    weights
        Of the findings: each check counts once.
    """
    unknown = [each for each in diagnoses if each.cause == UNKNOWN]
    if not unknown or key_of(diagnoses[0]) not in guesses:
        return tuple(diagnoses)
    share = sum(weights[finding] for finding in diagnoses[0].explains) / sum(weights.values())
    if round(share, 6) > _MOSTLY:
        return tuple(diagnoses)
    ordered = [*unknown, *(each for each in diagnoses if each.cause != UNKNOWN)]
    return _numbered(ordered)


def _numbered(diagnoses: Sequence[Diagnosis]) -> tuple[Diagnosis, ...]:
    return tuple(replace(diagnosis, id=f"D{number}") for number, diagnosis in enumerate(diagnoses, 1))


def key_of(diagnosis: Diagnosis) -> tuple[str, str]:
    """Return cause and stream."""
    return diagnosis.cause, diagnosis.stream


def _place(where: Where, trial: UndoTrial | None) -> Where:
    """Return the place of a cause: the rectangle in which its fault was undone, where it was undone in one."""
    if trial is None or not trial.cleared or not isinstance(trial.fault, ImagePart):
        return where
    return replace(where, frame=None, pixel=None, tile=trial.fault.region)


def _size_by_trial(cause: str, fitted: float | None, fault: ReversibleFault) -> float | None:
    """Return the size of a cause whose fault was undone: that of the fault where the fitted one does not state it.

    An offset from frames is known up to their step, and the trial decides which one it is. A rate that is fitted to the
    whole sequence is not that of the part in which the clock had it. A span leaves several factors of units
    open, of which one was undone.
    """
    of_fault = fault.magnitude
    if cause in (*_VECTORS, "time_unit") or fitted is None or (cause == "clock_rate" and is_of_part(fault)):
        return of_fault
    if cause == "flow_unit" and of_fault is not None and abs(of_fault) > 1.0:
        # Fractions of a pixel: the number of them is exact.
        return of_fault
    if getattr(fault, "v_percent", None) is not None or cause == "unit_mm_m":
        # The fitted size is that of one factor, or of one field.
        return of_fault
    is_of_another_step = cause == "time_offset" and of_fault is not None and not isclose(of_fault, fitted)
    # Shifts beyond the reach of a fit saturate, and one along one axis is no length.
    is_elsewhere = cause == "spatial_offset" and of_fault is not None and abs(of_fault - fitted) > _WHOLE_PX
    return of_fault if is_of_another_step or is_elsewhere else fitted


def _weights(alarms: Sequence[Alarm]) -> dict[str, float]:
    """Return the weight of each finding: each check counts once, by the mean of its findings."""
    checks = {alarm.finding.id: check_of_code(alarm.finding.code) for alarm in alarms}
    findings_of_check = Counter(checks.values())
    return {finding: 1.0 / findings_of_check[check] for finding, check in checks.items()}


def _tested(candidate: CauseCandidate, codes: Mapping[str, str], trial: UndoTrial | None) -> CauseCandidate:
    """Return a candidate with the support that a trial measured."""
    is_chance = trial is not None and clears_by_chance(candidate, codes, trial)
    if trial is None or is_chance or not (trial.cleared or is_conclusive(candidate, codes)):
        # A measurement of the cause itself is worth as much as a trial.
        certain = {
            finding: replace(h, support=1.0)
            for finding, h in candidate.evidence.items()
            if h.support >= CERTAIN and is_direct(candidate.cause, codes[finding], candidate.stream)
        }
        return replace(candidate, evidence={**candidate.evidence, **certain})
    evidence = dict(candidate.evidence)
    # A fault that clears all that the windows show, of several checks, but for the error of its size, clears nothing by
    # chance; nor does one with a field of its own that clears a check beside the one that measured this field.
    concerned = {check_of_code(codes[f]) for f in trial.cleared}
    if candidate.cause not in _IN_ONE_DIRECTION:
        concerned |= {check_of_code(codes[f]) for f, h in candidate.evidence.items() if h.support >= FITS}
    clears_all = trial.clears_but_for_fit and len(concerned) > 1
    for finding in trial.cleared:
        # Deviations that only the trial has brought about count against it.
        cleared = len(trial.cleared) / (len(trial.cleared) + len(trial.caused) + len(trial.crashed))
        prior = evidence.get(finding)
        # A wrong period is one of the clock, whatever the sign of its size; a grid is no effect of an offset or a rate.
        is_own = prior is None and check_of_code(codes[finding]) in CHECKS_OF_CLOCKS
        if clears_by_construction(candidate.cause, codes[finding]) and not is_own:
            continue
        if prior is None:
            # A finding that no check would explain by the cause may clear by chance: a shift undoes a delay where the
            # image moves evenly.
            share = cleared if clears_all else FITS * cleared
            evidence[finding] = Hypothesis(candidate.cause, candidate.stream, share)
        else:
            evidence[finding] = replace(prior, support=cleared)
    for finding, ratio in trial.left.items():
        # Another mechanism, or the same in a part of the file, may still explain what is left.
        if finding in evidence and is_conclusive(candidate, codes):
            # The share of the deviation that is removed.
            share = max(1.0 - abs(ratio), 0.0)
            evidence[finding] = replace(evidence[finding], support=evidence[finding].support * share)
    return replace(candidate, evidence=evidence)


def _checks_removed(candidate: CauseCandidate, codes: Mapping[str, str], trial: UndoTrial) -> frozenset[str]:
    """Return the checks whose findings a trial removes, without those that vanish by construction."""
    return frozenset(
        check_of_code(codes[f]) for f in trial.removed if not clears_by_construction(candidate.cause, codes[f])
    )


def _new_support(candidate: CauseCandidate, finding: str, unexplained: Mapping[str, float]) -> float:
    """Return the support for a finding that no cause chosen before has given."""
    hypothesis = candidate.evidence.get(finding)
    return 0.0 if hypothesis is None else min(hypothesis.support, unexplained[finding])
