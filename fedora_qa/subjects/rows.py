"""The rows of those subjects that are asked for: of no other subject is anything imported."""

from importlib import import_module

from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.faults.canary_conditions import PlantCanary
from fedora_qa.judgement.judge import Alarm
from fedora_qa.sequence.facts import Facts
from fedora_qa.subjects import SUBJECTS, subject_of
from fedora_qa.subjects.row import CatalogueRow


def rows_of(subject: str) -> tuple[CatalogueRow, ...]:
    """Return the rows of a subject, in the order of its checks; none where there is no such subject."""
    if subject not in SUBJECTS:
        return ()
    rows: tuple[CatalogueRow, ...] = import_module(f"fedora_qa.subjects.{subject}").ROWS
    return rows


def canary_of(check: str) -> PlantCanary | None:
    """Return the canary of a check, by its name; None where there is none."""
    return next((row.canary for row in rows_of(subject_of(check)) if row.check.name == check), None)


def hypotheses_of(alarm: Alarm, facts: Facts) -> tuple[Hypothesis, ...]:
    """Return the hypotheses for an alarm, best supported first.

    Parameters
    ----------
    alarm
        Of a check of the catalogue.
    facts
        Of the same file.

    Returns
    -------
    tuple
        One at least for most checks.

    Raises
    ------
    KeyError
        The check has no row.
    """
    # The code of a finding is ``<subject>.<property>.<rule>``: without the rule it is the name of the check.
    name = alarm.finding.code.rpartition(".")[0]
    propose = {row.check.name: row.propose for row in rows_of(subject_of(name))}[name]
    return propose(alarm, facts)
