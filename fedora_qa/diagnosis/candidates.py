"""Candidates: for each cause and stream its best hypothesis for every finding that it would explain."""

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from fedora_qa.causes import stream_family
from fedora_qa.diagnosis.hypothesis import ANY_CAUSE, Hypothesis
from fedora_qa.diagnosis.length_units import is_length_unit

UNKNOWN: Final = "unknown"
"""Name of the cause of a finding without a hypothesis."""

CONTENDS: Final = 0.25
"""Share of the support of a cause, before trials, from which another cause is its rival: without a trial of a rival
that could be tested the cause is not confirmed. The value is not derived."""

FITS: Final = 0.4
"""Least support by one check of a cause that is named without a trial: what any fault of the stream would explain has
less."""

OF_COMPONENTS: Final = frozenset({"gyro_bias", "accel_bias", "lever_arm"})
"""Causes whose size is a vector that is fitted to the whole sequence: each finding states a component, of either
sign."""

_IN_EARNEST: Final = 0.3
"""Least support of a cause by one check for it to explain findings of other checks about its stream."""


@dataclass(frozen=True, slots=True)
class CauseCandidate:
    """A cause in a stream, and its best hypothesis for each finding that it would explain, by the finding's id.

    ``weights`` are those of all findings, by which each check counts once.
    """

    cause: str
    stream: str
    evidence: Mapping[str, Hypothesis]
    weights: Mapping[str, float]

    @property
    def total_support(self) -> float:
        """Support for all findings, where each check counts once."""
        return self.support_for(self.evidence)

    def support_for(self, findings: Collection[str]) -> float:
        """Return the support for some findings, where each check counts once."""
        return sum(h.support * self.weights[f] for f, h in self.evidence.items() if f in findings)

    @property
    def key(self) -> tuple[str, str]:
        """Cause and stream."""
        return self.cause, self.stream

    @property
    def best_support(self) -> float:
        """Support by the check that supports it most."""
        return max((hypothesis.support for hypothesis in self.evidence.values()), default=0.0)

    @property
    def best_findings(self) -> tuple[str, ...]:
        """The findings that support it most."""
        return tuple(f for f, hypothesis in self.evidence.items() if hypothesis.support >= self.best_support)

    @property
    def sized_by(self) -> str:
        """The finding that gives the size: with a magnitude, with an error, fair, of small error, well supported."""
        fair = _FAIR_FIT * max(hypothesis.support for hypothesis in self.evidence.values())

        def order(finding: str) -> tuple[bool, bool, bool, float, float]:
            h = self.evidence[finding]
            return h.magnitude is None, h.standard_error is None, h.support < fair, h.standard_error or 0.0, -h.support

        return min(self.evidence, key=order)

    @property
    def size(self) -> Hypothesis:
        """The hypothesis of that finding."""
        return self.evidence[self.sized_by]


_FAIR_FIT: Final = 0.5
"""Least ratio of a hypothesis's support to the best support of its cause for its size to be used. The value is not
derived: with less support, another cause mostly contributes to the size."""


def gather_candidates(
    hypotheses: Mapping[str, Sequence[Hypothesis]], weights: Mapping[str, float]
) -> list[CauseCandidate]:
    """Gather hypotheses by cause and stream.

    Parameters
    ----------
    hypotheses
        By the id of the finding that they would explain.
    weights
        Of the findings.
    """
    evidence: dict[tuple[str, str], dict[str, Hypothesis]] = defaultdict(dict)
    # Best hypotheses whose size has a sign, by that sign.
    by_sign: dict[tuple[str, str, str, bool], Hypothesis] = {}
    for finding, of_finding in hypotheses.items():
        for hypothesis in of_finding:
            # Lengths of no sign and of no size have no unit.
            if hypothesis.cause == "unit_mm_m" and hypothesis.magnitude is not None and not hypothesis.magnitude > 0:
                continue
            if hypothesis.cause not in (UNKNOWN, ANY_CAUSE):
                best = evidence[hypothesis.cause, hypothesis.stream]
                if finding not in best or _fit(best[finding]) < _fit(hypothesis):
                    best[finding] = hypothesis
                if hypothesis.magnitude:
                    key = hypothesis.cause, hypothesis.stream, finding, hypothesis.magnitude > 0
                    if key not in by_sign or _fit(by_sign[key]) < _fit(hypothesis):
                        by_sign[key] = hypothesis
    _keep_units(evidence)
    # A fault of all rates of flow also explains the findings of one rate.
    for cause, stream in list(evidence):
        if stream == stream_family(stream):
            for (other_cause, other), of_other in list(evidence.items()):
                if other_cause == cause and other != stream and stream_family(other) == stream:
                    for finding, hypothesis in of_other.items():
                        evidence[cause, stream].setdefault(finding, hypothesis)
    _add_findings_of_any_cause(evidence, hypotheses)
    candidates = []
    for (cause, stream), of_cause in evidence.items():
        # One fault shifts or scales in one direction: sizes of the sign with less support are left out, or replaced by
        # the best of the other sign for the same finding. Each check counts once, however many of its findings have a
        # size. Components of one vector have signs of their own.
        sized = () if cause in OF_COMPONENTS else of_cause.items()
        signs = {finding: bool(h.magnitude > 0) for finding, h in sized if h.magnitude}
        support = {s: sum(of_cause[f].support * weights[f] for f in signs if signs[f] is s) for s in (True, False)}
        sign = support[True] >= support[False]
        of_one_sign = {
            finding: chosen
            for finding, h in of_cause.items()
            if (chosen := h if signs.get(finding, sign) is sign else by_sign.get((cause, stream, finding, sign)))
        }
        if of_one_sign:
            candidates.append(CauseCandidate(cause, stream, of_one_sign, weights))
    return candidates


def _keep_units(evidence: dict[tuple[str, str], dict[str, Hypothesis]]) -> None:
    """Remove factors of lengths that are no ratio of units where a check states one: others fit what is left of it."""
    for (cause, _), of_cause in evidence.items():
        factors = {finding: h.magnitude for finding, h in of_cause.items() if cause == "unit_mm_m" and h.magnitude}
        if any(map(is_length_unit, factors.values())):
            for finding in (f for f, factor in factors.items() if not is_length_unit(factor)):
                del of_cause[finding]


def _add_findings_of_any_cause(
    evidence: dict[tuple[str, str], dict[str, Hypothesis]], hypotheses: Mapping[str, Sequence[Hypothesis]]
) -> None:
    """Let causes that one check supports well explain the findings that any fault of their stream would explain."""
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


def _fit(hypothesis: Hypothesis) -> tuple[float, bool]:
    """Order hypotheses of one finding and cause by support, to a hundredth, then by whether their size has an error."""
    return round(hypothesis.support, 2), hypothesis.standard_error is not None
