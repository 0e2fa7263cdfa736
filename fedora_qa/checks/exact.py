"""Measurements without noise: counts and declared numbers, which are right or wrong."""

from fedora_qa.checks.protocol import Statistic
from fedora_qa.features import Feature
from fedora_qa.record.types import Severity, Where


def count_of_faults(
    name: str,
    value: int,
    unit: str,
    *,
    statement: str,
    code: str,
    where: Where | None = None,
    severity: Severity = "error",
    features: tuple[Feature, ...] = (),
) -> Statistic:
    """State a count that must be zero, and that was counted exactly."""
    return Statistic(
        name=name,
        value=float(value),
        unit=unit,
        standard_error=0.0,
        resolution=1.0,
        statement=statement,
        code=code,
        where=where or Where(),
        severity=severity,
        features=features,
    )


def no_faults(name: str, unit: str, code: str) -> Statistic:
    """State that the count of faults is zero."""
    return count_of_faults(name, 0, unit, statement="", code=code)
