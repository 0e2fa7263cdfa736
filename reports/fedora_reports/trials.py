"""What undoing a fault changes: deviations and their limits, arrays of checks, pictures, each before and after."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from fedora_qa.record.evidence import AFTER_UNDOING, BEFORE_UNDOING, DEVIATIONS, TRIALS, named
from fedora_qa.record.wording import with_unit
from fedora_reports.charts import Chart, series_chart
from fedora_reports.evidence import Array, Evidence
from fedora_reports.maps import ValueMap, value_map
from fedora_reports.panels import Panel
from fedora_reports.scales import Axis
from fedora_reports.strip import SnapshotRow

_LEAST_RATIO: Final = 0.1
"""Left end of the axis of deviations over their limits; smaller ones lie there."""

_LEAST_REACH: Final = 10.0
"""The axis reaches this many limits at least."""

_MOST_ROWS: Final = 6
"""Checks whose largest deviation is drawn."""


@dataclass(frozen=True, slots=True)
class DeviationView:
    """A deviation before and after undoing.

    ``before`` and ``after`` are positions on an axis of deviations over their limits, which all deviations of a trial
    share; None where there is no limit to compare with.
    """

    check: str
    name: str
    before: float | None
    after: float | None
    before_text: str
    after_text: str


@dataclass(frozen=True, slots=True)
class TrialView:
    """Everything that was kept of a trial.

    ``deviations`` are the largest of each check, of ``measured`` in all; ``limit`` is the position of the limit on the
    axis of deviations.
    """

    deviations: tuple[DeviationView, ...]
    measured: int
    limit: float
    by_size: Chart | None
    charts: tuple[Chart, ...]
    maps: tuple[tuple[ValueMap, ValueMap], ...]
    panels: tuple[tuple[Panel, Panel], ...]
    time: str
    is_part: bool


def trial_of(evidence: Evidence, diagnosis: str, pictures: tuple[SnapshotRow, SnapshotRow] | None) -> TrialView | None:
    """Return what was kept of the trial of a diagnosis; None where nothing was."""
    group = named(TRIALS, diagnosis)
    if pictures is None and not any(evidence.under(group)):
        return None
    deviations, limit = _deviations(evidence, group)
    largest: dict[str, DeviationView] = {}
    for deviation in deviations:
        largest.setdefault(deviation.check, deviation)
    course = evidence.numbers(named(group, "size"), None, 2)
    by_size = None if course is None else series_chart(course, evidence.title(named(group, "size")), level=1.0)
    charts: list[Chart] = []
    maps: list[tuple[ValueMap, ValueMap]] = []
    for before, after, title in _changed(evidence, group):
        if after.shape[1] == 2:
            chart = series_chart(after, title, before)
            charts += [] if chart is None else [chart]
        else:
            maps.append((value_map(before, f"Before: {title}", after), value_map(after, f"After: {title}", before)))
    panels: list[tuple[Panel, Panel]] = []
    if pictures is not None:
        by_kind = {panel.kind: panel for panel in pictures[1].panels}
        pairs = ((panel, by_kind[panel.kind]) for panel in pictures[0].panels if panel.kind in by_kind)
        # The frame below the events is the same.
        panels = [(before, after) for before, after in pairs if before.image.uri != after.image.uri]
    box = evidence.numbers(named(group, "box"), 4)
    return TrialView(
        deviations=tuple(largest.values())[:_MOST_ROWS],
        measured=len(deviations),
        limit=limit,
        by_size=by_size,
        charts=tuple(charts),
        maps=tuple(maps),
        panels=tuple(panels),
        time="" if pictures is None else pictures[0].time,
        is_part=box is not None and box.tolist() != [0.0, 0.0, 1.0, 1.0],
    )


def _deviations(evidence: Evidence, group: str) -> tuple[tuple[DeviationView, ...], float]:
    """Return the deviations, largest first, and the position of the limit on their axis."""
    kept = []
    for name in evidence.under(group, DEVIATIONS):
        values = evidence.numbers(name, 2, 2)
        if values is not None:
            (before, limit_before), (after, limit_after) = ([float(value) for value in row] for row in values)
            check, _, measurement = name.removeprefix(f"{group}/{DEVIATIONS}/").partition("/")
            unit = evidence.title(name).rpartition("[")[2].rstrip("]") if "[" in evidence.title(name) else ""
            # What a check no longer states does not deviate.
            ratios = _ratio(before, limit_before), 0.0 if math.isnan(after) else _ratio(after, limit_after)
            # Both limits are much the same: they differ by the noise of what was measured.
            texts = with_unit(before, unit), _text(after, limit_before if math.isnan(after) else limit_after, unit)
            kept.append((ratios, texts, check, measurement))
    kept.sort(key=lambda entry: -(math.inf if entry[0][0] is None else entry[0][0]))
    present = [ratio for pair, *_ in kept for ratio in pair if ratio is not None and math.isfinite(ratio)]
    most = max([_LEAST_REACH, *present])
    axis = Axis(_LEAST_RATIO, most, logarithmic=True)

    def share(ratio: float | None) -> float | None:
        return None if ratio is None else axis.share(min(max(ratio, _LEAST_RATIO), most))

    views = tuple(
        DeviationView(check, measurement, share(before), share(after), *texts)
        for (before, after), texts, check, measurement in kept
    )
    return views, axis.share(1.0)


def _ratio(deviation: float, limit: float) -> float | None:
    """Return the size of a deviation over its limit, infinite beyond what must be exact; None where it is unknown."""
    if limit == 0:
        return math.inf if deviation else 0.0
    ratio = abs(deviation) / limit
    return None if math.isnan(ratio) else ratio


def _text(deviation: float, limit: float, unit: str) -> str:
    size = "no longer stated" if math.isnan(deviation) else with_unit(deviation, unit)
    return f"{size}, limit {with_unit(limit, unit)}" if math.isfinite(limit) else size


def _changed(evidence: Evidence, group: str) -> Iterator[tuple[Array, Array, str]]:
    """Yield series (n, 2) and maps (h, w) of checks before and after undoing, with their title."""
    for name in evidence.under(group, AFTER_UNDOING):
        # Names of pictures have no check before them.
        if "/" not in name.removeprefix(f"{group}/{AFTER_UNDOING}/"):
            continue
        earlier = name.replace(f"/{AFTER_UNDOING}/", f"/{BEFORE_UNDOING}/", 1)
        before, after = (evidence.numbers(each, None, None) for each in (earlier, name))
        if before is not None and after is not None and (before.shape[1] == 2) == (after.shape[1] == 2):
            yield before, after, evidence.title(name)
