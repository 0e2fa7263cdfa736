"""The report of a comparison: one self-contained HTML file, with files side by side.

Distributions are laid over each other in the box of ``charts``: 1000 by 100, stretched; the axis across is logarithmic.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from markupsafe import Markup

from fedora_qa.comparison.paper_tables import paper_tables
from fedora_qa.comparison.subjects import SharedEvidence
from fedora_qa.comparison.tables import CONCLUSION_WORDS, conclusions_of, false_alarm_sentence, headline, pair_tables
from fedora_qa.comparison.types import COMPARISON, Comparison, Overlay
from fedora_qa.record.tables import TextTable
from fedora_qa.record.wording import number, with_error
from fedora_reports.charts import HEIGHT, WIDTH
from fedora_reports.evidence import Evidence
from fedora_reports.flight import poses_of
from fedora_reports.html import rendered
from fedora_reports.panels import Kind, Legend, Panel, legends_for, panels_of, scales_for, seconds
from fedora_reports.scales import Axis, Tick
from fedora_reports.snapshots import Snapshot, snapshots_of
from fedora_reports.statistics import Table
from fedora_reports.trajectory_path import MOST_POINTS, flown_path
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


MOST_DRAWN: Final = 6
"""Most lines in one drawing: a reader cannot distinguish the colours of more."""

_TAIL: Final = 1e-3
"""Share of the values that may lie beyond either end of the axis, so that a few far values do not flatten the rest."""


@dataclass(frozen=True, slots=True)
class OverlayLine:
    """The distribution of one subject. ``place`` is the index of the subject, which gives the line its colour."""

    place: int
    path: str


@dataclass(frozen=True, slots=True)
class OverlayChart:
    """One quantity in every subject. ``distances`` states how far each subject lies from the first."""

    title: str
    lines: tuple[OverlayLine, ...]
    ticks: tuple[Tick, ...]
    aside: str
    distances: tuple[str, ...]
    alt: str


@dataclass(frozen=True, slots=True)
class PairSection:
    """One subject against the reference."""

    title: str
    summary: str
    tables: tuple[Table, ...]


@dataclass(frozen=True, slots=True)
class ComparisonPage:
    """Every value of the template. ``drawn`` names the subjects in the order of their lines."""

    title: str
    tool: str
    headline: str
    conclusions: tuple[str, ...]
    false_alarm_rate: str
    notes: tuple[str, ...]
    drawn: tuple[str, ...]
    undrawn: tuple[str, ...]
    charts: tuple[OverlayChart, ...]
    shared: tuple[SharedView, ...]
    shared_note: str
    pairs: tuple[PairSection, ...]
    paper: tuple[Table, ...]


def render_comparison(comparison: Comparison, shared: Sequence[SharedEvidence] = ()) -> str:
    """Return a comparison as one HTML document, which runs the script of the reports alone and loads no other file."""
    page = page_of(COMPARISON.from_json(COMPARISON.to_json(comparison)), shared)
    return rendered("comparison.html.j2", page)


def page_of(comparison: Comparison, shared: Sequence[SharedEvidence] = ()) -> ComparisonPage:
    """Return the page of a comparison."""
    names = tuple(subject.name for subject in comparison.subjects)
    charts = (overlay_chart(source, comparison) for source in comparison.overlays)
    matched = max((pair.versions.matched for pair in comparison.pairs if pair.versions), default=0)
    shared_note = ""
    if not shared:
        shared_note = (
            "Pictures and paths are shown of files that several have, from records of fedora-qa check --json with the "
            "arrays beside them; none was given."
        )
    elif matched > len(shared):
        shared_note = f"Of {len(shared)} of {matched} files that are in both."
    return ComparisonPage(
        title=" · ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else ""),
        tool=f"{comparison.tool.name} {comparison.tool.version}",
        headline=headline(comparison),
        conclusions=conclusions_of(comparison),
        false_alarm_rate=false_alarm_sentence(comparison),
        notes=comparison.notes,
        drawn=names[:MOST_DRAWN],
        undrawn=names[MOST_DRAWN:],
        charts=tuple(chart for chart in charts if chart is not None),
        shared=tuple(shared_view(evidence, names[:MOST_DRAWN]) for evidence in shared),
        shared_note=shared_note,
        pairs=tuple(
            PairSection(source.title, source.summary, tuple(map(_table, source.tables)))
            for source in pair_tables(comparison)
        ),
        paper=tuple(map(_table, paper_tables(comparison))),
    )


def overlay_chart(overlay: Overlay, comparison: Comparison) -> OverlayChart | None:
    """Draw the shares of all subjects per octave, as steps; None where no subject has values above the first bin."""
    edges = np.array(overlay.edges)
    above = edges[:-1] > 0
    shares_by_place = {
        place: np.array(shares) for place, shares in enumerate(overlay.shares[:MOST_DRAWN]) if shares is not None
    }
    # The axis holds all but the tails of every distribution.
    lows, highs = [], []
    for shares in shares_by_place.values():
        below = np.cumsum(shares * above)
        if below[-1] > 0:
            lows.append(float(edges[np.searchsorted(below, _TAIL * below[-1], "right")]))
            highs.append(float(edges[np.searchsorted(below, (1 - _TAIL) * below[-1]) + 1]))
    if not lows:
        return None
    axis = Axis(min(lows), max(highs), logarithmic=True)
    octaves = np.log2(edges[1:][above] / edges[:-1][above])
    heights = {place: shares[above] / octaves for place, shares in shares_by_place.items()}
    tallest = max(float(height.max()) for height in heights.values())
    lefts = axis.shares(edges[np.append(above, True)]) * WIDTH
    lines = []
    for place, height in heights.items():
        # An outline without its base. Steps beyond the axis have no width and are left out.
        steps: list[str] = []
        for left, right, level in zip(lefts[:-1], lefts[1:], height / tallest * HEIGHT, strict=True):
            if right > left:
                steps.append(f"{'L' if steps else 'M'}{left:.1f} {HEIGHT - level:.1f}H{right:.1f}")
        lines.append(OverlayLine(place, "".join(steps)))
    names = [subject.name for subject in comparison.subjects]
    zeros = [
        f"{names[place]} {shares[~above].sum():.1%}"
        for place, shares in shares_by_place.items()
        if shares[~above].any()
    ]
    distances = []
    for pair in comparison.pairs:
        differences = [difference for difference in pair.differences if difference.quantity == overlay.quantity]
        name = comparison.subjects[pair.after].name
        if len(differences) == 1:
            apart = with_error(differences[0].distance, differences[0].distance_standard_error, differences[0].unit)
            distances.append(f"{name}: distance {apart}, {CONCLUSION_WORDS[differences[0].told]}")
        elif differences:
            differing = sum(difference.told == "differs" for difference in differences)
            distances.append(f"{name}: {differing} of {len(differences)} files differ")
    return OverlayChart(
        title=overlay.meaning,
        lines=tuple(lines),
        ticks=axis.ticks(),
        aside=f"At 0, left of the axis: {', '.join(zeros)}." if zeros else "",
        distances=tuple(distances),
        alt=f"{overlay.meaning}, of {', '.join(names[place] for place in shares_by_place)}: "
        f"from {number(axis.low)} to {number(axis.high)} {overlay.unit}",
    )


def _table(source: TextTable) -> Table:
    return Table(source.title, source.note, source.head, source.rows, numeric=source.words <= 2)
