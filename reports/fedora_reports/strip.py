"""Rows of panels that share their scales: the moments along the sequence, and the worst places of findings."""

from collections.abc import Iterable
from dataclasses import dataclass

from fedora_reports.anchors import Anchors
from fedora_reports.evidence import Evidence
from fedora_reports.instants import Instant, moments_of, places_of
from fedora_reports.legends import Legend, legends_for
from fedora_reports.panels import Panel, panels_of, seconds
from fedora_reports.picture_scales import PictureScales, scales_for

Box = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Row:
    """The panels of one instant. ``anchor`` is empty where nothing leads to it; ``worst`` marks a finding's place."""

    anchor: str
    time: str
    time_us: float | None
    panels: tuple[Panel, ...]
    worst: bool = False


@dataclass(frozen=True, slots=True)
class Strip:
    """Moments, the legends that hold for all pictures of the file, and how the pictures were made."""

    rows: tuple[Row, ...]
    legends: tuple[Legend, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Place:
    """The worst place of a finding, and the frames beside it that were kept."""

    row: Row
    beside: tuple[Row, ...]

    @property
    def rows(self) -> tuple[Row, ...]:
        """All of them."""
        return (self.row, *self.beside)


@dataclass(frozen=True, slots=True)
class Pictures:
    """All pictures of a file, in the same colours: moments, and places by the finding's identifier."""

    strip: Strip | None
    places: dict[str, Place]


def pictures_of(evidence: Evidence, findings: Iterable[str], anchors: Anchors) -> Pictures:
    """Draw all that was kept of a file; ``findings`` are the identifiers of its findings."""
    moments = moments_of(evidence)
    at_places = {item: instants for item in dict.fromkeys(findings) if (instants := places_of(evidence, item))}
    scales = scales_for([*moments, *(instant for instants in at_places.values() for instant in instants)])
    rows = tuple(_row(item, scales, anchors.moment(k)) for k, item in enumerate(moments))
    places = {finding: _place(instants, scales) for finding, instants in at_places.items()}
    panels = [panel for row in rows for panel in row.panels]
    panels += [panel for place in places.values() for row in place.rows for panel in row.panels]
    if not panels:
        return Pictures(None, places)
    titles = (evidence.title(name) for name in evidence.under("moments") if not name.endswith("_us"))
    return Pictures(Strip(rows, legends_for(tuple(panels), scales), tuple(dict.fromkeys(titles))), places)


def _place(instants: tuple[Instant, ...], scales: PictureScales) -> Place:
    rows = [_row(instant, scales) for instant in instants]
    worst = next(row for row in rows if row.worst)
    return Place(worst, tuple(row for row in rows if row is not worst))


def _row(instant: Instant, scales: PictureScales, anchor: str = "") -> Row:
    time = "" if instant.time_us is None else seconds(instant.time_us)
    return Row(anchor, time, instant.time_us, tuple(panels_of(instant, scales)), instant.worst)
