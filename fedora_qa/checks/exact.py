"""Measurements without noise: counts and declared numbers."""

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
    """Return the statistic of an exact count that must be zero.

    Parameters
    ----------
    name
        Name of the statistic.
    value
        The count.
    unit
        Unit of the count.
    statement
        Sentence for the reader of the finding.
    code
        ``<subject>.<property>.<rule>``.
    where
        Location of the faults; the whole file if None.
    severity
        Of the finding.
    features
        Of the faults.
    """
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
    """Return the statistic of a count of zero.

    Parameters
    ----------
    name
        Name of the statistic.
    unit
        Unit of the count.
    code
        ``<subject>.<property>.<rule>``.
    """
    return count_of_faults(name, 0, unit, statement="", code=code)
