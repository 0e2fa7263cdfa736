"""One deviation, one finding: the same rule broken in several rates or parts of a stream, for the same cause."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite
from typing import Final

from fedora_qa.causes import stream_family
from fedora_qa.checks.protocol import Statistic
from fedora_qa.judgement.judge import Alarm, Judged
from fedora_qa.record.types import Diagnosis
from fedora_qa.record.wording import place

_PLACES_IN_MESSAGE: Final = 3
"""Further places that a message names; the record holds all."""


def join_places(
    judged: Sequence[Judged], diagnoses: Sequence[Diagnosis]
) -> tuple[tuple[Judged, ...], tuple[Diagnosis, ...]]:
    """Join the findings of one rule in one stream that the same diagnoses explain into one with several places.

    All rates of flow are one stream. The finding of the largest deviation, in multiples of its scatter, stays, with the
    places of the others. The findings are numbered anew.

    Parameters
    ----------
    judged
        Of all checks of a file, in the order of the record.
    diagnoses
        Of the same file.

    Returns
    -------
    tuple
        Results and alarms with the joined findings, and the diagnoses that refer to them.
    """
    explained_by: dict[str, set[str]] = {}
    for diagnosis in diagnoses:
        for explained in diagnosis.explains:
            explained_by.setdefault(explained, set()).add(diagnosis.id)
    # The finding that each belongs to, by identifiers; and the alarm of each that stays.
    head_of: dict[str, str] = {}
    heads: dict[str, Alarm] = {}
    for result in judged:
        groups: dict[tuple[str, str, str, frozenset[str]], list[Alarm]] = {}
        for alarm in result.alarms:
            finding = alarm.finding
            causes = frozenset(explained_by.get(finding.id, ()))
            kind = finding.code, finding.severity, stream_family(finding.where.stream or ""), causes
            groups.setdefault(kind, []).append(alarm)
        for group in groups.values():
            head = max(group, key=lambda alarm: _excess(alarm.statistic))
            head_of |= {alarm.finding.id: head.finding.id for alarm in group}
            heads[head.finding.id] = _with_places(head, [alarm for alarm in group if alarm is not head])
    numbers: dict[str, str] = {}
    results = []
    for result in judged:
        findings, alarms = [], []
        for finding in result.result.findings:
            # Findings that are no alarms belong to themselves.
            if head_of.get(finding.id, finding.id) != finding.id:
                continue
            numbers[finding.id] = f"F{len(numbers) + 1}"
            joined = heads[finding.id].finding if finding.id in heads else finding
            findings.append(replace(joined, id=numbers[finding.id]))
            if finding.id in heads:
                alarms.append(replace(heads[finding.id], finding=findings[-1]))
        results.append(Judged(replace(result.result, findings=tuple(findings)), tuple(alarms)))
    referring = []
    for diagnosis in diagnoses:
        # A joined finding is cleared where it is cleared at all its places.
        not_cleared = {head for each, head in head_of.items() if each not in diagnosis.cleared}
        referring.append(
            replace(
                diagnosis,
                explains=_numbered([head_of[each] for each in diagnosis.explains], numbers),
                cleared=_numbered(
                    [h for each in diagnosis.cleared if (h := head_of[each]) not in not_cleared], numbers
                ),
            )
        )
    return tuple(results), tuple(referring)


def _numbered(identifiers: Iterable[str], numbers: Mapping[str, str]) -> tuple[str, ...]:
    """Return the new identifiers of findings, each once, in the order of the record."""
    wanted = set(identifiers)
    return tuple(number for identifier, number in numbers.items() if identifier in wanted)


def _excess(statistic: Statistic) -> float:
    """Return a deviation in multiples of its scatter and the bound of its model error; infinite without either."""
    scale = statistic.standard_error + statistic.model_error_bound
    deviation = abs(statistic.value - statistic.expected)
    return deviation / scale if scale > 0 and isfinite(deviation) else inf


def _with_places(head: Alarm, others: Sequence[Alarm]) -> Alarm:
    """Return an alarm whose finding has the places of others of its kind."""
    if not others:
        return head
    finding = head.finding
    places = tuple(dict.fromkeys(alarm.finding.where for alarm in others if alarm.finding.where != finding.where))
    streams = dict.fromkeys(where.stream or "" for where in places if where.stream != finding.where.stream)
    # Where the places are other rates, these say it all.
    named = list(streams) if len(streams) == len(places) else [place(where) for where in places]
    more = "" if len(named) <= _PLACES_IN_MESSAGE else ", ..."
    count = f"{len(places)} more place{'' if len(places) == 1 else 's'}"
    message = f"{finding.message} Likewise at {count}: {', '.join(named[:_PLACES_IN_MESSAGE])}{more}."
    return replace(head, finding=replace(finding, message=message if places else finding.message, places=places))
