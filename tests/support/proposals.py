"""Hypotheses for an alarm of any check, made of the features of its statistic."""

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.protocol import Statistic
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.record.types import Finding, Where
from fedora_qa.sequence.facts import Facts
from tests.support.facts import exact_facts


def proposed(
    code: str,
    *features: Feature,
    stream: str = "rgb",
    value: float = 1.0,
    expected: float = 0.0,
    name: str = "value",
    standard_error: float = 0.01,
    facts: Facts | None = None,
    where: Where | None = None,
) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for a statistic that broke the rule ``code``, in a file that is exact otherwise."""
    where = where or Where(stream=stream)
    statistic = Statistic(name, value, "1", standard_error, "off", code, where, expected=expected, features=features)
    return hypotheses_of(Alarm(Finding("F1", code, "error", "off", where), statistic), facts or exact_facts())


def named(hypotheses: tuple[Hypothesis, ...]) -> list[tuple[str, str]]:
    """Return causes and streams, in their order."""
    return [(hypothesis.cause, hypothesis.stream) for hypothesis in hypotheses]
