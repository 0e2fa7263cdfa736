"""The page of a score: one self-contained HTML file, drawn from the result of ``fedora-qa score``."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import PurePath

import numpy as np

from fedora_qa.record.tables import TextTable
from fedora_qa.scoring.tables import depth_table, flow_tables, headline, headlines, pose_tables
from fedora_qa.scoring.types import SCORE, ErrorAtTime, Score
from fedora_reports.charts import Chart, series_chart
from fedora_reports.html import environment
from fedora_reports.statistics import Table


@dataclass(frozen=True, slots=True)
class StreamSection:
    """What was predicted of one kind: the error over time, and tables."""

    anchor: str
    title: str
    charts: tuple[Chart, ...]
    tables: tuple[Table, ...]


@dataclass(frozen=True, slots=True)
class ScorePage:
    """Every value of the template."""

    title: str
    tool: str
    sequence: str
    headline: str
    headlines: tuple[str, ...]
    notes: tuple[str, ...]
    sections: tuple[StreamSection, ...]


def render_score(score: Score) -> str:
    """Return a score as one HTML document, which runs no script and loads no other file."""
    page = score_page(SCORE.from_json(SCORE.to_json(score)))
    return environment().get_template("score.html.j2").render(page=page)


def score_page(score: Score) -> ScorePage:
    """Return the page of a score."""
    # All streams share one axis of time, which begins with the first that is scored.
    timed = [*(flow.over_time for flow in score.flow), *(part.over_time for part in (score.depth, score.pose) if part)]
    first_us = min((point.start_us for points in timed for point in points), default=0)
    sections = []
    if score.flow:
        charts = (
            _error_chart(flow.over_time, first_us, f"Endpoint error at {flow.rate_hz:g} Hz", "AEE [px]")
            for flow in score.flow
        )
        sections.append(_section("flow", "Flow", charts, flow_tables(score.flow)))
    if score.depth:
        chart = _error_chart(score.depth.over_time, first_us, "Normalised error of disparity", "NADE")
        sections.append(_section("depth", "Depth and disparity", [chart], [depth_table(score.depth)]))
    if score.pose:
        chart = _error_chart(score.pose.over_time, first_us, "Distance of positions, as predicted", "error [m]")
        sections.append(_section("pose", "Pose", [chart], pose_tables(score.pose)))
    return ScorePage(
        title=PurePath(score.predictions).name or score.predictions,
        tool=f"{score.tool.name} {score.tool.version}",
        sequence=score.sequence,
        headline="Score" if headlines(score) else headline(score),
        headlines=headlines(score),
        notes=score.notes,
        sections=tuple(sections),
    )


def _section(anchor: str, title: str, charts: Iterable[Chart | None], tables: Iterable[TextTable]) -> StreamSection:
    return StreamSection(
        anchor,
        title,
        tuple(chart for chart in charts if chart is not None),
        tuple(Table(source.title, source.note, source.head, source.rows, numeric=True) for source in tables),
    )


def _error_chart(points: Sequence[ErrorAtTime], first_us: int, title: str, label: str) -> Chart | None:
    """Draw errors at the middle of the time of each, in s; None without any."""
    middles_s = [((point.start_us - first_us) + (point.stop_us - first_us)) / 2e6 for point in points]
    series = np.array([middles_s, [point.error for point in points]], np.float64).T
    return series_chart(series, f"{title}; time [s]; {label}", from_zero=True)
