"""The report of a comparison: one self-contained HTML file, drawn from the result of ``fedora-qa compare``.

Distributions are laid over each other in the box of ``charts``: 1000 by 100, stretched; the axis across is logarithmic.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from fedora_qa.comparison.conclusions import conclusions_of
from fedora_qa.comparison.paper_tables import paper_tables
from fedora_qa.comparison.subjects import SharedEvidence
from fedora_qa.comparison.tables import CONCLUSION_WORDS, false_alarm_sentence, headline, pair_tables
from fedora_qa.comparison.types import COMPARISON, Comparison, Overlay
from fedora_qa.record.tables import TextTable
from fedora_qa.record.wording import number, with_error
from fedora_reports.charts import HEIGHT, WIDTH
from fedora_reports.html import rendered
from fedora_reports.scales import Axis, Tick
from fedora_reports.side_by_side import SharedView, shared_view
from fedora_reports.statistics import Table

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
    """Return a comparison as one HTML document, which runs the script of the reports alone and loads no other file.

    Parameters
    ----------
    comparison
        The document.
    shared
        Pictures and paths of files that several subjects have, to be shown beside each other.
    """
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
    """Draw the shares of all subjects per octave, as steps.

    Parameters
    ----------
    overlay
        Shares of one quantity by subject, in bins of which the first begins at 0.
    comparison
        Gives the names of the subjects, and the distances between them.

    Returns
    -------
    OverlayChart or None
        None where no subject has values above the first bin.
    """
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
