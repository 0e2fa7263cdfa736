"""Rows of panels that share their scales: the snapshots along the sequence, and the worst places of findings."""

from collections.abc import Iterable
from dataclasses import dataclass

from fedora_qa.record.evidence import MOMENTS
from fedora_reports.anchors import Anchors
from fedora_reports.evidence import Evidence
from fedora_reports.panels import Legend, Panel, PictureScales, legends_for, panels_of, scales_for, seconds
from fedora_reports.snapshots import Snapshot, snapshots_of, trial_snapshots_of, worst_location_of


@dataclass(frozen=True, slots=True)
class SnapshotRow:
    """The panels of one snapshot. ``anchor`` is empty where no link leads to it; ``worst``: it is a finding's place."""

    anchor: str
    time: str
    time_us: float | None
    panels: tuple[Panel, ...]
    worst: bool = False


@dataclass(frozen=True, slots=True)
class Strip:
    """Snapshots along the sequence, the legends of all pictures of the file, and notes on how these were made."""

    rows: tuple[SnapshotRow, ...]
    legends: tuple[Legend, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class WorstLocation:
    """The worst place of a finding, and the frames beside it that were kept."""

    row: SnapshotRow
    beside: tuple[SnapshotRow, ...]


@dataclass(frozen=True, slots=True)
class Pictures:
    """All pictures of a file, in the same colours.

    Snapshots; worst locations by the finding's identifier; by the diagnosis's identifier the snapshots before and after
    its fault was undone.
    """

    strip: Strip | None
    worst_locations: dict[str, WorstLocation]
    trials: dict[str, tuple[SnapshotRow, SnapshotRow]]


def pictures_of(
    evidence: Evidence, findings: Iterable[str], anchors: Anchors, diagnoses: Iterable[str] = ()
) -> Pictures:
    """Draw every snapshot of a file."""
    snapshots = snapshots_of(evidence)
    of_trials = {item: pair for item in diagnoses if (pair := trial_snapshots_of(evidence, item))}
    by_finding = {item: located for item in dict.fromkeys(findings) if (located := worst_location_of(evidence, item))}
    grouped = (*by_finding.values(), *of_trials.values())
    scales = scales_for([*snapshots, *(snapshot for group in grouped for snapshot in group)])
    rows = tuple(_row(snapshot, scales, anchors.snapshot(k)) for k, snapshot in enumerate(snapshots))
    panels = [panel for row in rows for panel in row.panels]
    worst_locations = {}
    for finding, located in by_finding.items():
        in_time = [_row(snapshot, scales) for snapshot in located]
        worst = next(row for row in in_time if row.worst)
        beside = tuple(row for row in in_time if row is not worst)
        worst_locations[finding] = WorstLocation(worst, beside)
        panels += [panel for row in (worst, *beside) for panel in row.panels]
    trials = {item: (_row(before, scales), _row(after, scales)) for item, (before, after) in of_trials.items()}
    if not panels:
        return Pictures(None, worst_locations, trials)
    titles = (evidence.title(name) for name in evidence.under(MOMENTS) if not name.endswith("_us"))
    strip = Strip(rows, legends_for(tuple(panels), scales), tuple(dict.fromkeys(titles)))
    return Pictures(strip, worst_locations, trials)


def _row(snapshot: Snapshot, scales: PictureScales, anchor: str = "") -> SnapshotRow:
    time = "" if snapshot.time_us is None else seconds(snapshot.time_us)
    return SnapshotRow(anchor, time, snapshot.time_us, tuple(panels_of(snapshot, scales)), snapshot.worst)
