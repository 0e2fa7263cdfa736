"""The path is drawn by the trajectory's module, and nothing that it does spoils the report."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.record.types import Finding, Where
from fedora_reports import trajectory
from fedora_reports.evidence import Evidence
from fedora_reports.flight import flight_of
from fedora_reports.html import render_html
from fedora_reports.timeline import AnchoredFinding
from fedora_reports.trajectory_path import Frusta
from tests.reports.evidence_samples import frusta
from tests.reports.page_reader import complaints_about, read_page
from tests.support.records import record

PATH = {
    "trajectory/times_us": np.arange(3.0),
    "trajectory/positions_world_m": np.zeros((3, 3)),
    "trajectory/speeds_m_s": np.zeros(3),
    "trajectory/forward_world": np.ones((3, 3)),
}


def picture(png: bytes = b"", note: str = "") -> trajectory.TrajectoryPicture:
    """A picture as the module gives it."""
    return trajectory.TrajectoryPicture(png=png, caption="Path, axes in metres.", note=note)


def test_render_is_carried_by_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """A render is embedded with its caption as words."""
    monkeypatch.setattr(trajectory, "render_trajectory", lambda *_: picture(png=b"PNG"))
    page = read_page(render_html(record(), PATH))
    assert complaints_about(page) == []
    _, figure = page.all("figure", kind="flight")
    (image,) = [one for one in figure.inside if one.tag == "img"]
    assert image.attributes["src"] == "data:image/png;base64,UE5H"
    assert image.attributes["alt"] == "Path, axes in metres."


def test_two_views_are_always_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether a render can be made or not, the path is drawn from above and from the side, with the reason below."""
    shown = picture(note="OpenGL could not be used.")
    monkeypatch.setattr(trajectory, "render_trajectory", lambda *_: shown)
    page = read_page(render_html(record(), PATH))
    assert complaints_about(page) == []
    (figure,) = page.all("figure", kind="flight")
    assert "from above" in figure.text
    assert "from the side" in figure.text
    assert "OpenGL could not be used." in page.text


def findings(*starts_us: float | None) -> list[AnchoredFinding]:
    """Errors that begin at these times."""
    return [
        AnchoredFinding(Finding(f"F{k}", "x.y", "error", "Wrong.", Where("rgb", start, start)), f"a{k}")
        for k, start in enumerate(starts_us)
    ]


def test_findings_are_marked_where_the_body_was(monkeypatch: pytest.MonkeyPatch) -> None:
    """A finding half way lies in the middle of both views and of the path in space; without a time it has no place."""
    monkeypatch.setattr(trajectory, "render_trajectory", lambda *_: picture())
    flown = PATH | {"trajectory/positions_world_m": np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])}
    found = flight_of(Evidence(flown, {}), findings(1.0, None, 5.0))
    assert found is not None
    assert found.views.count("<a ") == 2
    assert found.views.count('href="#a0"') == 2
    assert "Diamonds mark findings" in found.views_caption
    (mark,) = json.loads(found.space)["marks"]
    assert mark == [0.0, 0.0, 0.0, "F0"]


def test_words_of_findings_are_text_on_the_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """An identifier that looks like markup is escaped in the drawing."""
    monkeypatch.setattr(trajectory, "render_trajectory", lambda *_: picture())
    (one,) = findings(1.0)
    hostile = replace(one, finding=replace(one.finding, id="<script>\x00"))
    found = flight_of(Evidence(PATH, {}), [hostile])
    assert found is not None
    assert "<script>" not in found.views
    assert "&lt;script&gt;\N{REPLACEMENT CHARACTER}" in found.views


def test_many_findings_are_thinned(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thousand findings do not make a drawing of thousands of links."""
    monkeypatch.setattr(trajectory, "render_trajectory", lambda *_: picture())
    found = flight_of(Evidence(PATH, {}), findings(*np.linspace(0.0, 2.0, 1000)))
    assert found is not None
    assert 80 <= found.views.count("<a ") <= 160


def test_failure_is_told_and_the_rest_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error of graphics is a sentence on the page."""

    def fail(*_: object) -> trajectory.TrajectoryPicture:
        raise RuntimeError("no display <here>")

    monkeypatch.setattr(trajectory, "render_trajectory", fail)
    page = read_page(render_html(record(), PATH))
    assert "No picture in space: RuntimeError: no display <here>" in page.text
    assert "Events are 2.06 ± 0.03 ms late." in page.text


@pytest.mark.parametrize("name", sorted(PATH))
def test_without_all_of_a_path_none_is_drawn(name: str) -> None:
    """A path lacks nothing or is left out."""
    arrays = {other: array for other, array in PATH.items() if other != name}
    assert not read_page(render_html(record(), arrays)).all("figure", kind="flight")


def test_frusta_are_in_the_scene(monkeypatch: pytest.MonkeyPatch) -> None:
    """About the middle of the box, with the order of the line that draws them; the render gets them as well."""
    passed: list[tuple[object, ...]] = []

    def render(*arguments: object) -> trajectory.TrajectoryPicture:
        passed.append(arguments)
        return picture()

    monkeypatch.setattr(trajectory, "render_trajectory", render)
    flight = flight_of(Evidence(PATH | frusta(np.zeros(3)), {}), [])
    assert flight is not None
    scene = json.loads(flight.space)
    assert np.array(scene["frusta"]).shape == (2, 6, 3)
    assert set(scene["outline"]) == set(range(6))
    assert isinstance(passed[0][-1], Frusta)
    without = flight_of(Evidence(PATH, {}), [])
    assert without is not None
    assert (json.loads(without.space)["frusta"], passed[1][-1]) == ([], None)
