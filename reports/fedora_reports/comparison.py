"""The report of a comparison: one self-contained HTML file, drawn from what ``fedora-qa compare`` found."""

from dataclasses import dataclass

from fedora_qa.comparison.json_io import comparison_from_json, comparison_to_json
from fedora_qa.comparison.paper_tables import paper_tables
from fedora_qa.comparison.tables import headline, how_it_is_told, pair_tables
from fedora_qa.comparison.text_table import TextTable
from fedora_qa.comparison.types import Comparison
from fedora_reports.comparison_charts import MOST_DRAWN, OverlayChart, overlay_chart
from fedora_reports.html import environment
from fedora_reports.statistics import Table


@dataclass(frozen=True, slots=True)
class PairSection:
    """One subject against the reference."""

    title: str
    summary: str
    tables: tuple[Table, ...]


@dataclass(frozen=True, slots=True)
class ComparisonPage:
    """Everything that the template shows; ``drawn`` names the subjects in the order of their lines."""

    title: str
    tool: str
    headline: str
    told: str
    notes: tuple[str, ...]
    drawn: tuple[str, ...]
    undrawn: tuple[str, ...]
    charts: tuple[OverlayChart, ...]
    pairs: tuple[PairSection, ...]
    paper: tuple[Table, ...]


def render_comparison(comparison: Comparison) -> str:
    """Return a comparison as one HTML document, without scripts, that asks for nothing beyond itself."""
    page = page_of(comparison_from_json(comparison_to_json(comparison)))
    return environment().get_template("comparison.html.j2").render(page=page)


def page_of(comparison: Comparison) -> ComparisonPage:
    """Return the page that shows a comparison."""
    names = tuple(subject.name for subject in comparison.subjects)
    charts = (overlay_chart(source, comparison) for source in comparison.overlays)
    return ComparisonPage(
        title=" · ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else ""),
        tool=f"{comparison.tool.name} {comparison.tool.version}",
        headline=headline(comparison),
        told=how_it_is_told(comparison),
        notes=comparison.notes,
        drawn=names[:MOST_DRAWN],
        undrawn=names[MOST_DRAWN:],
        charts=tuple(chart for chart in charts if chart is not None),
        pairs=tuple(
            PairSection(source.title, source.summary, tuple(map(_table, source.tables)))
            for source in pair_tables(comparison)
        ),
        paper=tuple(map(_table, paper_tables(comparison))),
    )


def _table(source: TextTable) -> Table:
    return Table(source.title, source.note, source.head, source.rows, numeric=source.words <= 2)
