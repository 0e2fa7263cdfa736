"""The report of a study of detection: one self-contained HTML file, drawn from what ``fedora-qa power`` measured."""

from dataclasses import dataclass

from fedora_qa.record.power_json import power_from_json, power_to_json
from fedora_qa.record.power_tables import PowerTable, share_words, tables_of
from fedora_qa.record.power_types import WHOLE_FILE, Power
from fedora_reports.html import environment
from fedora_reports.power_charts import LimitsChart, PowerChart, detection_chart, limits_chart
from fedora_reports.statistics import Table


@dataclass(frozen=True, slots=True)
class PowerPage:
    """Everything that the template shows."""

    title: str
    tool: str
    effort: str
    started: str
    facts: tuple[tuple[str, str], ...]
    tables: tuple[Table, ...]
    charts: tuple[PowerChart, ...]
    limits: LimitsChart | None
    not_comparable: Table


def render_power(power: Power) -> str:
    """Return the report of a study as one HTML document, without scripts, that asks for nothing beyond itself."""
    return environment().get_template("power.html.j2").render(page=page_of(power_from_json(power_to_json(power))))


def page_of(power: Power) -> PowerPage:
    """Return the page that shows a study."""
    charts = (detection_chart(row) for row in power.detections if row.check == WHOLE_FILE)
    return PowerPage(
        title=power.corpus,
        tool=f"{power.tool.name} {power.tool.version}",
        effort=power.effort,
        started=power.started,
        facts=_facts(power),
        tables=tuple(_table(row) for row in tables_of(power)),
        charts=tuple(chart for chart in charts if chart is not None),
        limits=limits_chart(power.stated),
        not_comparable=_not_comparable(power),
    )


def _facts(power: Power) -> tuple[tuple[str, str], ...]:
    named = [(f"{naming.kind} faults named first", share_words(naming.named_first)) for naming in power.naming]
    facts = [
        ("Files", f"{power.files}, {power.clean} of them clean"),
        ("Clean files that failed", share_words(power.false_alarms.files)),
        *((f"{naming.kind} faults found".capitalize(), share_words(naming.found)) for naming in power.naming),
        *((name.capitalize(), share) for name, share in named),
        ("Rules", power.ruleset_version),
        ("Code that was measured", f"sha256 {power.estimators_digest[:16]}"),
    ]
    if power.crashed:
        facts.append(("A check crashed in", ", ".join(power.crashed)))
    return tuple(facts)


def _table(source: PowerTable) -> Table:
    return Table(source.title, source.note, source.head, source.rows, numeric=source.words == 1)


def _not_comparable(power: Power) -> Table:
    rows = tuple((pair.cause, pair.check, pair.reason) for pair in power.not_comparable)
    note = "These checks find the cause, but state no limit that could be held against its size."
    return Table("Not compared", note, ("cause", "check", "why"), rows, numeric=False)
