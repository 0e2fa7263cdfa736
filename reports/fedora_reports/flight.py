"""The path that was flown, drawn by whatever the machine has: nothing that graphics do can spoil a report."""

from dataclasses import dataclass

from markupsafe import Markup

from fedora_qa.record.evidence import TRAJECTORY, named
from fedora_reports.evidence import Evidence
from fedora_reports.pictures import png_uri


@dataclass(frozen=True, slots=True)
class Flight:
    """A picture of the path: encoded, or drawn in SVG (one of them is empty); ``note`` says what could not be done."""

    uri: str
    svg: Markup
    caption: str
    note: str


def flight_of(evidence: Evidence) -> Flight | None:
    """Return the picture of the path; None where no path was kept."""
    times_us = evidence.numbers(named(TRAJECTORY, "times_us"), None)
    count = 0 if times_us is None else len(times_us)
    positions = evidence.numbers(named(TRAJECTORY, "positions_world_m"), count, 3)
    speeds = evidence.numbers(named(TRAJECTORY, "speeds_m_s"), count)
    forward = evidence.numbers(named(TRAJECTORY, "forward_world"), count, 3)
    if times_us is None or positions is None or speeds is None or forward is None:
        return None
    try:
        from fedora_reports.trajectory import render_trajectory  # noqa: PLC0415 - brings graphics, wanted only here

        picture = render_trajectory(times_us, positions, speeds, forward)
    except Exception as problem:  # noqa: BLE001 - whatever a graphics library does, the rest of the report stands
        return Flight("", Markup(), "", f"The path could not be drawn: {type(problem).__name__}: {problem}")
    # The drawing holds numbers of the path only, no text of the file: it is markup of our own.
    svg = Markup(picture.svg)
    return Flight(png_uri(picture.png) if picture.png else "", svg, picture.caption, picture.note)
