"""Rows of panels that share their scales: the strip of moments, and the worst place of a finding."""

from dataclasses import dataclass

from fedora_reports.evidence import Evidence
from fedora_reports.instants import Instant, moments_of, place_of
from fedora_reports.legends import Legend, legends_for
from fedora_reports.panels import Panel, panels_of, seconds
from fedora_reports.picture_scales import scales_for


@dataclass(frozen=True, slots=True)
class Row:
    """The panels of one instant."""

    time: str
    panels: tuple[Panel, ...]


@dataclass(frozen=True, slots=True)
class Strip:
    """Rows of panels, the legends that hold for all of them, and how the pictures were made.

    A single row needs no legends: its captions tell its own scales.
    """

    rows: tuple[Row, ...]
    legends: tuple[Legend, ...]
    notes: tuple[str, ...] = ()


def strip_of(evidence: Evidence) -> Strip | None:
    """Return the moments of a sequence; None where none were kept."""
    strip = _strip(moments_of(evidence))
    if strip is None:
        return None
    titles = (evidence.title(name) for name in evidence.under("moments") if not name.endswith("_us"))
    return Strip(strip.rows, strip.legends, tuple(dict.fromkeys(titles)))


def place_strip(evidence: Evidence, finding: str) -> Strip | None:
    """Return the worst place of a finding as a strip of one row; None where no picture of it was kept."""
    place = place_of(evidence, finding)
    strip = None if place is None else _strip((place,))
    return None if strip is None else Strip(strip.rows, ())


def _strip(instants: tuple[Instant, ...]) -> Strip | None:
    scales = scales_for(instants)
    rows = tuple(Row(_time(one), tuple(panels_of(one, scales))) for one in instants)
    panels = tuple(panel for row in rows for panel in row.panels)
    return Strip(rows, legends_for(panels, scales)) if panels else None


def _time(instant: Instant) -> str:
    return "" if instant.time_us is None else seconds(instant.time_us)
