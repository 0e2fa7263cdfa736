"""The path is drawn by the trajectory's module, and nothing that it does spoils the report."""

import numpy as np
import pytest

from fedora_reports import trajectory
from fedora_reports.html import render_html
from tests.reports.page_reader import complaints_about, read_page
from tests.support.records import record

PATH = {
    "trajectory/times_us": np.arange(3.0),
    "trajectory/positions_world_m": np.zeros((3, 3)),
    "trajectory/speeds_m_s": np.zeros(3),
    "trajectory/forward_world": np.ones((3, 3)),
}


def picture(png: bytes = b"", svg: str = "", note: str = "") -> trajectory.TrajectoryPicture:
    """A picture as the module gives it."""
    return trajectory.TrajectoryPicture(png=png, svg=svg, caption="Path, axes in metres.", note=note)


def test_render_is_carried_by_the_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """A render is embedded with its caption as words."""
    monkeypatch.setattr(trajectory, "render_trajectory", lambda *_: picture(png=b"PNG"))
    page = read_page(render_html(record(), PATH))
    assert complaints_about(page) == []
    (figure,) = page.all("figure", kind="flight")
    (image,) = [one for one in figure.inside if one.tag == "img"]
    assert image.attributes["src"] == "data:image/png;base64,UE5H"
    assert image.attributes["alt"] == "Path, axes in metres."


def test_drawing_follows_the_page_and_tells_why(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is no render, the drawing stands in the page itself, with the reason below."""
    shown = picture(svg="<svg id='flat'><path d='M0 0'/></svg>", note="OpenGL could not be used.")
    monkeypatch.setattr(trajectory, "render_trajectory", lambda *_: shown)
    page = read_page(render_html(record(), PATH))
    assert complaints_about(page) == []
    assert any(one.attributes.get("id") == "flat" for one in page.all("svg"))
    assert "OpenGL could not be used." in page.text


def test_failure_is_told_and_the_rest_stands(monkeypatch: pytest.MonkeyPatch) -> None:
    """An error of graphics is a sentence on the page."""

    def fail(*_: object) -> trajectory.TrajectoryPicture:
        raise RuntimeError("no display <here>")

    monkeypatch.setattr(trajectory, "render_trajectory", fail)
    page = read_page(render_html(record(), PATH))
    assert "The path could not be drawn: RuntimeError: no display <here>" in page.text
    assert "Events are 2.06 ± 0.03 ms late." in page.text


@pytest.mark.parametrize("name", sorted(PATH))
def test_without_all_of_a_path_none_is_drawn(name: str) -> None:
    """A path lacks nothing or is left out."""
    arrays = {other: array for other, array in PATH.items() if other != name}
    assert not read_page(render_html(record(), arrays)).all("figure", kind="flight")
