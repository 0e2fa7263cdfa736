"""Name the causes of a file's findings: the fewest that explain all of them.

Each alarm has hypotheses: causes that would explain it, with their support. A cause that explains several alarms is
preferred over several causes (Occam), so causes are taken greedily by the support they add to that of the causes before
them: the classical approximation of a smallest weighted cover (Chvatal, "A greedy heuristic for the set-covering
problem", 1979). Each check counts once, even if it states a disagreement for each rate of flow, as a mean and at its
worst. Diagnosis runs only after an alarm: on clean files it would always name some cause.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, log

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Diagnosis

_UNKNOWN = "unknown"
"""Name of the cause of a finding without a hypothesis."""

_ENOUGH = 0.05
"""Least support that a further cause must add to be named."""

_UNFORESEEN = 0.02
"""Support of a cause by a check that has no hypothesis of it: the check does not rule the cause out."""

_IN_EARNEST = 0.3
"""Least support of a cause by one check for it to explain findings of other checks about its stream."""

SHARPNESS = 8.0
"""Power to which products of support are raised before they are normalised. Support is a score and not a likelihood: a
cause that leaves a fifth of a deviation has a support of 0.8, though with a deviation of 100 standard errors this fifth
rules it out. One power for all products turns them into probabilities; it is fitted to the frequency of correct first
diagnoses of planted faults (temperature scaling: Guo et al., "On calibration of modern neural networks", 2017). The
log-likelihood of 146 diagnoses is -50.7 without the power, -24.5 with 8, and within half of that from 6 to 12 (``python
-m tests.benchmarks.confidence``)."""

UNTHOUGHT = 0.02
"""Share of first diagnoses that are wrong although their rivals have little support (2 of 120). It reduces every
confidence."""

_FAIR_FIT = 0.5
"""Least ratio of a hypothesis's support to the best support of its cause for its size to be used. The value is not
derived: with less support, another cause mostly contributes to the size."""


@dataclass(frozen=True, slots=True)
class _CauseCandidate:
    """A cause in a stream, and its best hypothesis for each finding that it would explain, by the finding's id."""

    cause: str
    stream: str
    evidence: Mapping[str, Hypothesis]


def choose_causes(alarms: Sequence[Alarm], hypotheses: Mapping[str, Sequence[Hypothesis]]) -> tuple[Diagnosis, ...]:
    """Choose the fewest causes that explain all alarms.

    Alarms without a hypothesis become ``unknown``, one diagnosis for each stream (all rates of flow are one).

    Parameters
    ----------
    alarms
        Of one file.
    hypotheses
        By the id of the finding that they would explain.

    Returns
    -------
    tuple
        In the order in which they were chosen, ``unknown`` last.
    """
    places = {alarm.finding.id: alarm.finding.where for alarm in alarms}
    checks = {alarm.finding.id: alarm.finding.code.rpartition(".")[0] for alarm in alarms}
    findings_of_check = Counter(checks.values())
    candidates = _candidates(hypotheses)
    # Unexplained support of each finding: the demand of the set cover.
    unexplained = {alarm.finding.id: 1.0 for alarm in alarms}

    def gain(candidate: _CauseCandidate) -> float:
        return sum(_new_support(candidate, finding, unexplained) for finding in candidate.evidence)

    def gain_per_check(candidate: _CauseCandidate) -> float:
        """Average over the findings of each check, sum over the checks: each check counts once."""
        evidence = candidate.evidence
        return sum(_new_support(candidate, f, unexplained) / findings_of_check[checks[f]] for f in evidence)

    diagnoses: list[Diagnosis] = []
    explained: set[str] = set()
    # Greedy step of the weighted cover (Chvatal 1979): the cause that adds most support, counted by check; among equal
    # ones that of more findings.
    while supported := [candidate for candidate in candidates if gain(candidate) >= _ENOUGH]:
        best = max(supported, key=lambda candidate: (gain_per_check(candidate), len(candidate.evidence)))
        # Only causes of common findings compete; others belong to a diagnosis of their own.
        rivals = [rival for rival in candidates if rival is not best and set(rival.evidence) & set(best.evidence)]
        confidence = share_of_first(_plausibilities([best, *rivals], unexplained, checks))
        # The size comes from the best hypothesis: with a magnitude, with an error, with enough support, with a smaller
        # error, with more support, in this order.
        fair = _FAIR_FIT * max(hypothesis.support for hypothesis in best.evidence.values())
        sized_by, of_size = min(
            best.evidence.items(),
            key=lambda item: (
                item[1].magnitude is None,
                item[1].standard_error is None,
                item[1].support < fair,
                item[1].standard_error or 0.0,
                -item[1].support,
            ),
        )
        diagnoses.append(
            Diagnosis(
                id=f"D{len(diagnoses) + 1}",
                cause=best.cause,
                stream=best.stream,
                magnitude=of_size.magnitude,
                unit=of_size.unit or CAUSES[best.cause].unit,
                standard_error=of_size.standard_error,
                confidence=confidence,
                where=places[sized_by],
                remedy=CAUSES[best.cause].remedy,
                explains=tuple(best.evidence),
            )
        )
        for finding, hypothesis in best.evidence.items():
            # Rest after the best supported cause so far: supports of several causes of one finding do not add.
            unexplained[finding] = min(unexplained[finding], 1.0 - hypothesis.support)
        explained |= set(best.evidence)
        # A cause whose findings are all explained is superfluous.
        candidates = [candidate for candidate in candidates if not set(candidate.evidence) <= explained]
    without_cause: dict[str, list[Alarm]] = defaultdict(list)
    for alarm in alarms:
        if alarm.finding.id not in explained:
            without_cause[stream_family(alarm.finding.where.stream or _UNKNOWN)].append(alarm)
    for family, of_family in without_cause.items():
        where = of_family[0].finding.where
        streams = {alarm.finding.where.stream for alarm in of_family}
        diagnoses.append(
            Diagnosis(
                id=f"D{len(diagnoses) + 1}",
                cause=_UNKNOWN,
                stream=family if len(streams) > 1 else where.stream or _UNKNOWN,
                magnitude=None,
                unit="",
                standard_error=None,
                confidence=0.0,
                where=where,
                remedy=CAUSES[_UNKNOWN].remedy,
                explains=tuple(alarm.finding.id for alarm in of_family),
            )
        )
    return tuple(diagnoses)


def _candidates(hypotheses: Mapping[str, Sequence[Hypothesis]]) -> list[_CauseCandidate]:
    """Gather hypotheses by cause and stream."""
    evidence: dict[tuple[str, str], dict[str, Hypothesis]] = defaultdict(dict)
    for finding, of_finding in hypotheses.items():
        for hypothesis in of_finding:
            if hypothesis.cause not in (_UNKNOWN, ANY_CAUSE):
                best = evidence[hypothesis.cause, hypothesis.stream]
                if finding not in best or _fit(best[finding]) < _fit(hypothesis):
                    best[finding] = hypothesis
    # A fault of all rates of flow also explains the findings of one rate.
    for cause, stream in list(evidence):
        if stream == stream_family(stream):
            for (other_cause, other), of_other in list(evidence.items()):
                if other_cause == cause and other != stream and stream_family(other) == stream:
                    for finding, hypothesis in of_other.items():
                        evidence[cause, stream].setdefault(finding, hypothesis)
    # A finding that any fault of a stream would explain is explained by each cause of this stream that one check
    # supports well.
    for finding, of_finding in hypotheses.items():
        for any_cause in of_finding:
            if any_cause.cause != ANY_CAUSE:
                continue
            for (cause, stream), of_cause in evidence.items():
                if stream != any_cause.stream or max(h.support for h in of_cause.values()) < _IN_EARNEST:
                    continue
                own = of_cause.get(finding, Hypothesis(cause, stream, 0.0))
                if own.support < any_cause.support:
                    of_cause[finding] = replace(own, support=any_cause.support)
    candidates = []
    for (cause, stream), of_cause in evidence.items():
        # One fault shifts or scales in one direction: sizes of the sign with less support are left out.
        signs = {finding: (h.magnitude or 0.0) > 0 for finding, h in of_cause.items() if h.magnitude}
        support = {sign: sum(of_cause[f].support for f in signs if signs[f] is sign) for sign in (True, False)}
        sign = support[True] >= support[False]
        of_one_sign = {finding: h for finding, h in of_cause.items() if signs.get(finding, sign) is sign}
        candidates.append(_CauseCandidate(cause, stream, of_one_sign))
    return candidates


def _fit(hypothesis: Hypothesis) -> tuple[float, bool]:
    """Order hypotheses of one finding and cause by support, to a hundredth, then by whether their size has an error."""
    return round(hypothesis.support, 2), hypothesis.standard_error is not None


def _new_support(candidate: _CauseCandidate, finding: str, unexplained: Mapping[str, float]) -> float:
    """Return the support for a finding that no cause chosen before has given."""
    hypothesis = candidate.evidence.get(finding)
    return 0.0 if hypothesis is None else min(hypothesis.support, unexplained[finding])


def share_of_first(plausibilities: Sequence[float], sharpness: float = SHARPNESS) -> float:
    """Return the probability that the first of several rivals is the cause.

    It is at most 1 - ``UNTHOUGHT``, also without a rival.

    Parameters
    ----------
    plausibilities
        Logarithms of the support of the rivals, one or more; the first is the candidate.
    sharpness
        Power to which the supports are raised.

    Returns
    -------
    float
        0 to 1.
    """
    most = max(plausibilities)
    # Softmax at the temperature 1 / sharpness (Guo et al. 2017); less the maximum, so that exp cannot overflow.
    shares = [exp(sharpness * (plausibility - most)) for plausibility in plausibilities]
    return (1.0 - UNTHOUGHT) * shares[0] / sum(shares)


def _plausibilities(
    rivals: Sequence[_CauseCandidate], unexplained: Mapping[str, float], checks: Mapping[str, str]
) -> list[float]:
    """Return the logarithms of the rivals' support for the findings that the first would explain.

    The checks are taken as independent observations of the unexplained deviations: supports of a cause by several
    checks are multiplied (Bayes, with equal priors). Findings of one check count once, by their mean.
    """
    of_check: dict[str, list[str]] = defaultdict(list)
    for finding in rivals[0].evidence:
        if unexplained[finding] > 0:
            of_check[checks[finding]].append(finding)

    def support_of(rival: _CauseCandidate, findings: Sequence[str]) -> float:
        mean = sum(_new_support(rival, finding, unexplained) for finding in findings) / len(findings)
        # Without the floor one check that has no hypothesis of a cause would rule it out with log(0).
        return max(mean, _UNFORESEEN)

    # ln of the product over checks: Bayes with equal priors and independent checks.
    return [sum(log(support_of(rival, findings)) for findings in of_check.values()) for rival in rivals]
