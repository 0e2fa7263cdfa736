"""A file in several subjects of a comparison: the same instants beside each other, and all paths in one picture."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from markupsafe import Markup

from fedora_qa.comparison.subjects import SharedEvidence
from fedora_reports.evidence import Evidence
from fedora_reports.flight import MOST_POINTS, poses_of
from fedora_reports.legends import Legend, legends_for
from fedora_reports.panels import Kind, Panel, panels_of, seconds
from fedora_reports.picture_scales import scales_for
from fedora_reports.snapshots import Snapshot, snapshots_of
from fedora_reports.trajectory_path import flown_path
from fedora_reports.trajectory_views import draw_paths

_INSTANTS: Final = 3
"""Instants of a file, evenly spread."""

_KINDS: Final[tuple[Kind, ...]] = ("frame", "events", "depth", "flow")
"""What stands beside each other: what the files hold, and no residual."""


@dataclass(frozen=True, slots=True)
class SubjectPanel:
    """A panel of one subject: its name and the time."""

    subject: str
    time: str
    panel: Panel


@dataclass(frozen=True, slots=True)
class SharedView:
    """One file.

    Attributes
    ----------
    name
        Of the file.
    paths
        All paths from above, in SVG; empty where there is none. ``flown`` are the places and names of their subjects.
    instants
        Of each instant the panels of every stream, and of each stream those of the subjects, on scales that all share.
    legends
        Of these scales.
    missing
        A sentence on the subjects that kept neither pictures nor a path of the file; empty where all did.
    """

    name: str
    paths: Markup
    flown: tuple[tuple[int, str], ...]
    instants: tuple[tuple[tuple[SubjectPanel, ...], ...], ...]
    legends: tuple[Legend, ...]
    missing: str


def shared_view(shared: SharedEvidence, names: Sequence[str]) -> SharedView:
    """Return what is shown of a file.

    Parameters
    ----------
    shared
        The evidence of the file in each subject.
    names
        The first subjects, in their order; others are left out.
    """
    path_by_place, snapshots_by_place, without = {}, dict[int, tuple[Snapshot, ...]](), []
    for place, (name, arrays) in enumerate(zip(names, shared.arrays, strict=False)):
        if arrays is None:
            continue
        evidence = Evidence(arrays, {})
        poses, snapshots = poses_of(evidence), snapshots_of(evidence)
        path = None if poses is None else flown_path(*poses, most=MOST_POINTS)
        if path is not None and path.runs:
            path_by_place[place] = path
        if snapshots:
            snapshots_by_place[place] = snapshots
        elif place not in path_by_place:
            without.append(name)
    missing = ""
    if without:
        missing = (
            f"No pictures and no path of this file were kept in {' and '.join(without)}: they come from records of "
            "fedora-qa check --json, with the arrays beside them."
        )

    chosen = _simultaneous(snapshots_by_place) if len(snapshots_by_place) > 1 else []
    scales = scales_for([snapshot for row in chosen for snapshot in row.values()])
    instants, panels = [], list[Panel]()
    for row in chosen:
        by_kind: dict[Kind, list[SubjectPanel]] = {kind: [] for kind in _KINDS}
        for place, snapshot in row.items():
            time = "" if snapshot.time_us is None else seconds(snapshot.time_us)
            for panel in panels_of(snapshot, scales):
                if panel.kind in by_kind:
                    by_kind[panel.kind].append(SubjectPanel(names[place], time, panel))
                    panels.append(panel)
        instants.append(tuple(tuple(of_kind) for of_kind in by_kind.values() if of_kind))
    return SharedView(
        name=shared.name,
        paths=Markup(draw_paths(path_by_place)) if path_by_place else Markup(),  # numbers alone
        flown=tuple((place, names[place]) for place in path_by_place),
        instants=tuple(instants),
        legends=legends_for(tuple(panels), scales),
        missing=missing,
    )


def _simultaneous(snapshots_by_place: Mapping[int, Sequence[Snapshot]]) -> list[dict[int, Snapshot]]:
    """Return a few instants of the first subject, each with the nearest of the others, by the places of subjects."""
    first = next(iter(snapshots_by_place.values()))
    ranks = dict.fromkeys(int((k + 0.5) / _INSTANTS * len(first)) for k in range(_INSTANTS))
    return [
        {
            place: _nearest(snapshots, first[rank].time_us, rank / len(first))
            for place, snapshots in snapshots_by_place.items()
        }
        for rank in ranks
    ]


def _nearest(snapshots: Sequence[Snapshot], time_us: float | None, share: float) -> Snapshot:
    """Return the snapshot nearest in time; on another clock, or where times are unknown, that at a share of them."""
    by_time_us = {snapshot.time_us: snapshot for snapshot in snapshots if snapshot.time_us is not None}
    if time_us is None or not by_time_us or not min(by_time_us) <= time_us <= max(by_time_us):
        return snapshots[int(share * len(snapshots))]
    return by_time_us[min(by_time_us, key=lambda other_us: abs(other_us - time_us))]
