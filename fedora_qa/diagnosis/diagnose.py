"""Name the causes behind a file's findings: the fewest that explain them all.

Each alarm brings suspects, causes that would explain it, weighted by how well. A cause that explains several alarms is
preferred over several causes (Occam), so causes are taken greedily by the weight they explain that no cause before
them has explained: the classical approximation of a smallest weighted cover (Chvatal, "A greedy heuristic for the
set-covering problem", 1979). Checks are the witnesses: one that states a disagreement for each rate of flow, as a mean
and at its worst, says it once. Diagnosis runs only after an alarm: on clean files it would always find something.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, log

from fedora_qa.causes import CAUSES, stream_family
from fedora_qa.checks.protocol import ANY_CAUSE, Suspect
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Diagnosis, Where

_UNKNOWN = "unknown"
"""No cause at all: it explains nothing, and stands where nothing else does."""

_ENOUGH = 0.05
"""Weight that a further cause must newly explain to be named at all."""

_UNFORESEEN = 0.02
"""Weight of a cause with a check that does not know it: none so well studied that it could be ruled out."""

_IN_EARNEST = 0.3
"""Weight from which on a cause, named by some check, may be what spoils its stream for others as well."""

SHARPNESS = 8.0
"""Power to which products of weights are raised before they are shared. Weights are scores, not likelihoods: a cause
that leaves a fifth of a deviation is given 0.8, though of a deviation of a hundred standard errors that fifth rules it
out. One power for all, fitted to how often first diagnoses of planted faults are right, makes the shares true
(temperature scaling: Guo et al., "On calibration of modern neural networks", 2017). Of 146 diagnoses the log-likelihood
is -50.7 without it, -24.5 with 8, and within half of that from 6 to 12 (``python -m tests.benchmarks.confidence``)."""

UNTHOUGHT = 0.02
"""Share of first diagnoses that are wrong although little rivals them (2 of 120): none is surer than the rest."""

_FAIR_FIT = 0.5
"""Share of the best fit from which on a cause's size is taken from where it is most precise: no derivation, but a worse
fit mostly means that another cause takes part."""


@dataclass(frozen=True, slots=True)
class _Candidate:
    cause: str
    stream: str
    evidence: Mapping[str, Suspect]
    """The best suspect for each finding that the cause would explain, by the finding's id."""


def diagnose(alarms: Sequence[Alarm]) -> tuple[Diagnosis, ...]:
    """Return the probable causes of the alarms, that which most checks bear out first.

    Alarms without a suspect become ``unknown``, one for each stream (all rates of flow are one).
    """
    places = {alarm.finding.id: alarm.finding.where for alarm in alarms}
    checks = {alarm.finding.id: alarm.finding.code.rpartition(".")[0] for alarm in alarms}
    candidates = _candidates(alarms)
    unexplained = {alarm.finding.id: 1.0 for alarm in alarms}
    chosen: list[tuple[_Candidate, float]] = []
    while telling := [one for one in candidates if _gain(one, unexplained) >= _ENOUGH]:
        best = max(telling, key=lambda one: (_borne_out(one, unexplained, checks), len(one.evidence)))
        chosen.append((best, _confidence(best, candidates, unexplained, checks)))
        for finding, suspect in best.evidence.items():
            unexplained[finding] = min(unexplained[finding], 1.0 - suspect.weight)
        explained = {finding for candidate, _ in chosen for finding in candidate.evidence}
        candidates = [c for c in candidates if not set(c.evidence) <= explained]
    explained = {finding for candidate, _ in chosen for finding in candidate.evidence}
    rest = [alarm for alarm in alarms if alarm.finding.id not in explained]
    diagnoses = [_as_diagnosis(f"D{i}", candidate, share, places) for i, (candidate, share) in enumerate(chosen, 1)]
    for family in dict.fromkeys(_family(alarm) for alarm in rest):
        of_family = [alarm for alarm in rest if _family(alarm) == family]
        diagnoses.append(_unknown(f"D{len(diagnoses) + 1}", of_family))
    return tuple(diagnoses)


def _family(alarm: Alarm) -> str:
    return stream_family(alarm.finding.where.stream or _UNKNOWN)


def _candidates(alarms: Sequence[Alarm]) -> list[_Candidate]:
    """Gather suspects by cause and stream. A fault of all flow also explains what was seen of one of its rates.

    A size of the other sign contradicts: those that agree are one candidate, the others none. What any fault of a
    stream would explain is explained by those that some check names in earnest.
    """
    evidence: dict[tuple[str, str], dict[str, Suspect]] = defaultdict(dict)
    for alarm in alarms:
        for suspect in alarm.suspects:
            if suspect.cause in (_UNKNOWN, ANY_CAUSE):
                continue
            known = evidence[suspect.cause, suspect.stream]
            if alarm.finding.id not in known or _fit(known[alarm.finding.id]) < _fit(suspect):
                known[alarm.finding.id] = suspect
    for cause, stream in list(evidence):
        if stream == stream_family(stream):
            for (other_cause, other), suspects in list(evidence.items()):
                if other_cause == cause and other != stream and stream_family(other) == stream:
                    for finding, suspect in suspects.items():
                        evidence[cause, stream].setdefault(finding, suspect)
    for alarm in alarms:
        for suspect in alarm.suspects:
            if suspect.cause == ANY_CAUSE:
                _join(evidence, alarm.finding.id, suspect)
    return [_Candidate(cause, stream, _of_one_sign(found)) for (cause, stream), found in evidence.items()]


def _of_one_sign(evidence: Mapping[str, Suspect]) -> dict[str, Suspect]:
    """Leave out the suspects whose size has another sign than those of more weight: one fault is late or early."""
    signs = {finding: (suspect.magnitude or 0.0) > 0 for finding, suspect in evidence.items() if suspect.magnitude}
    weights = {
        sign: sum(evidence[finding].weight for finding in signs if signs[finding] is sign) for sign in (True, False)
    }
    kept = weights[True] >= weights[False]
    return {finding: suspect for finding, suspect in evidence.items() if signs.get(finding, kept) is kept}


def _join(evidence: Mapping[tuple[str, str], dict[str, Suspect]], finding: str, of_any: Suspect) -> None:
    """Let the causes of a stream explain a finding that any of them would explain, with their own size if they have."""
    for (cause, stream), known in evidence.items():
        if stream != of_any.stream or max(one.weight for one in known.values()) < _IN_EARNEST:
            continue
        own = known.get(finding, Suspect(cause, stream, 0.0))
        if own.weight < of_any.weight:
            known[finding] = replace(own, weight=of_any.weight)


def _fit(suspect: Suspect) -> tuple[float, bool]:
    """Order suspects of one finding and cause by weight, to a hundredth, then by whether their size has an error."""
    return round(suspect.weight, 2), suspect.standard_error is not None


def _gain(candidate: _Candidate, unexplained: Mapping[str, float]) -> float:
    """Weight that the candidate explains and nothing chosen before it did."""
    return sum(_new_weight(candidate, finding, unexplained) for finding in candidate.evidence)


def _borne_out(candidate: _Candidate, unexplained: Mapping[str, float], checks: Mapping[str, str]) -> float:
    """Weight that the candidate newly explains of each check's findings in the mean, summed over the checks."""
    counts = Counter(checks.values())
    return sum(_new_weight(candidate, finding, unexplained) / counts[checks[finding]] for finding in candidate.evidence)


def _new_weight(candidate: _Candidate, finding: str, unexplained: Mapping[str, float]) -> float:
    suspect = candidate.evidence.get(finding)
    return 0.0 if suspect is None else min(suspect.weight, unexplained[finding])


def _confidence(
    best: _Candidate, candidates: Sequence[_Candidate], unexplained: Mapping[str, float], checks: Mapping[str, str]
) -> float:
    """Return the candidate's share of probability among all rivals that would explain any of the same findings."""
    rivals = [candidate for candidate in candidates if set(candidate.evidence) & set(best.evidence)]
    return share_of_first(_plausibilities([best, *(one for one in rivals if one is not best)], unexplained, checks))


def share_of_first(plausibilities: Sequence[float], sharpness: float = SHARPNESS) -> float:
    """Return the probability that the first of several rivals is the cause, from the logarithms of their weights.

    It is below 1 where there is no rival at all: by ``UNTHOUGHT``.
    """
    most = max(plausibilities)
    shares = [exp(sharpness * (one - most)) for one in plausibilities]
    return (1.0 - UNTHOUGHT) * shares[0] / sum(shares)


def _plausibilities(
    rivals: Sequence[_Candidate], unexplained: Mapping[str, float], checks: Mapping[str, str]
) -> list[float]:
    """Return the logarithms of the rivals' weights with what the first would explain.

    Checks are taken as independent witnesses of what is still unexplained: the weights that a cause has with each are
    multiplied (Bayes, with equal priors). Findings of one check are one witness, and count by their mean.
    """
    of_check: dict[str, list[str]] = defaultdict(list)
    for finding in rivals[0].evidence:
        if unexplained[finding] > 0:
            of_check[checks[finding]].append(finding)

    def weight(rival: _Candidate, findings: Sequence[str]) -> float:
        mean = sum(_new_weight(rival, finding, unexplained) for finding in findings) / len(findings)
        return max(mean, _UNFORESEEN)

    return [sum(log(weight(rival, findings)) for findings in of_check.values()) for rival in rivals]


def _as_diagnosis(name: str, candidate: _Candidate, share: float, places: Mapping[str, Where]) -> Diagnosis:
    fair = _FAIR_FIT * max(suspect.weight for suspect in candidate.evidence.values())
    finding, suspect = min(candidate.evidence.items(), key=lambda item: _precision(item[1], fair))
    return Diagnosis(
        id=name,
        cause=candidate.cause,
        stream=candidate.stream,
        magnitude=suspect.magnitude,
        unit=suspect.unit or CAUSES[candidate.cause].unit,
        standard_error=suspect.standard_error,
        confidence=share,
        where=places[finding],
        remedy=CAUSES[candidate.cause].remedy,
        explains=tuple(candidate.evidence),
    )


def _precision(suspect: Suspect, fair: float) -> tuple[bool, bool, bool, float, float]:
    """Order suspects by how much they tell of the size: a magnitude, an error, a fair fit, the smaller error."""
    error = suspect.standard_error
    return (suspect.magnitude is None, error is None, suspect.weight < fair, error or 0.0, -suspect.weight)


def _unknown(name: str, alarms: Sequence[Alarm]) -> Diagnosis:
    where = alarms[0].finding.where
    streams = {alarm.finding.where.stream for alarm in alarms}
    return Diagnosis(
        id=name,
        cause=_UNKNOWN,
        stream=_family(alarms[0]) if len(streams) > 1 else where.stream or _UNKNOWN,
        magnitude=None,
        unit="",
        standard_error=None,
        confidence=0.0,
        where=where,
        remedy=CAUSES[_UNKNOWN].remedy,
        explains=tuple(alarm.finding.id for alarm in alarms),
    )
