"""The report in a real browser: it complains about nothing, asks for nothing, and shows everything at any width."""

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import pytest

from fedora_generator.faults import plant_fault
from fedora_qa.cli.main import run
from tests.browser.devtools import Browser
from tests.browser.tab import Tab
from tests.browser.visit import Visit, visit
from tests.support.graphics import without_opengl
from tests.support.shared_files import SharedFiles

WIDTHS_PX = (390, 820, 1000, 1200, 1440)

MOST_PAGES = 8

LEAST_LINE_PX = 150
"""In less, a question is a column of single words."""


@dataclass(frozen=True, slots=True)
class Report:
    """A report and the word of its verdict."""

    page: Path
    exit_code: int
    verdict: str


@pytest.fixture(scope="module")
def browser(chromium: Path) -> Iterator[Browser]:
    """A browser for all pages."""
    with Browser(chromium) as running:
        yield running


@pytest.fixture(scope="module")
def visited(browser: Browser) -> Callable[..., Visit]:
    """What a page shows, measured once for each width and scheme: several tests look at the same."""
    return cache(partial(visit, browser))


@pytest.fixture(scope="module", params=["clean", "failing"])
def report(request: pytest.FixtureRequest, small_park_day: Path, shared_files: SharedFiles) -> Report:
    """The report of a small clean file, and of one whose events are late, each made once a run."""
    kind, verdict = request.param, {"clean": "clean", "failing": "findings"}[request.param]

    def write(page: Path) -> None:
        sequence = small_park_day
        if kind == "failing":
            sequence = page.with_name("late-events.h5")
            plant_fault(small_park_day, sequence, "time_offset", "events", 5.0, "ms")
        code = run(["check", str(sequence), "--html", str(page)])
        page.with_name(f"{kind}-exit-code").write_text(str(code))

    page = shared_files.file(f"{kind}-report.html", write)
    return Report(page, int(page.with_name(f"{kind}-exit-code").read_text()), verdict)


@pytest.mark.parametrize(("width", "scheme"), [*((width, "light") for width in WIDTHS_PX), (820, "dark")])
def test_report(visited: Callable[..., Visit], report: Report, width: int, scheme: str) -> None:
    """No complaint, no request but the page, everything visible, nothing wider than the window.

    Dark or light, boxes are as wide: one width stands for all.
    """
    shown = visited(report.page, width=width, scheme=scheme)
    assert shown.complaints == []
    assert shown.requests == [report.page.resolve().as_uri()]
    seen = shown.seen
    assert report.verdict in seen["text"].lower()
    assert seen["sticking_out"] == []
    assert seen["overflow"] <= 0
    assert len(seen["pictures"]) >= 4
    for picture in seen["pictures"]:
        assert picture["natural"] > 0, picture["name"]
        assert picture["name"], "a picture says in words what it shows"
    boxes = [picture["box"] for picture in seen["pictures"]] + seen["drawings"] + seen["tables"]
    assert len(seen["tables"]) >= 3
    assert all(across > 0 and down > 0 for across, down in boxes)
    assert all(seen["captions"])
    assert min(seen["questions"]) >= LEAST_LINE_PX


@pytest.mark.parametrize("width", [390, 1200])
def test_report_without_scripts(browser: Browser, report: Report, width: int) -> None:
    """Where no script runs, all moments stand in rows, nothing is shown that would need one, and all is visible."""
    shown = visit(browser, report.page, width=width, scheme="light", scripts=False)
    assert (shown.complaints, shown.seen["sticking_out"], shown.seen["overflow"]) == ([], [], 0)
    assert len(shown.seen["pictures"]) >= 12 * 4
    boxes = [picture["box"] for picture in shown.seen["pictures"]] + shown.seen["drawings"] + shown.seen["tables"]
    assert all(across > 0 and down > 0 for across, down in boxes)
    assert "search" not in shown.seen["text"]


def test_report_where_opengl_is_missing(
    browser: Browser, small_park_day: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The path is drawn another way, the page says why and what to install, and all else is as it was."""
    for name, value in without_opengl(tmp_path).items():
        monkeypatch.setenv(name, value)
    page = tmp_path / "report.html"
    assert run(["check", str(small_park_day), "--select", "clocks", "--html", str(page)]) in {0, 3}
    monkeypatch.undo()
    shown = visit(browser, page, width=390, scheme="light")
    assert shown.complaints == []
    assert "libegl1 and libgl1-mesa-dri" in shown.seen["text"]
    assert "from above" in shown.seen["text"].lower()
    assert shown.seen["sticking_out"] == []


def test_report_follows_the_colour_scheme(visited: Callable[..., Visit], report: Report) -> None:
    """Light is dark on light, dark is light on dark."""
    light, dark = (visited(report.page, width=820, scheme=scheme).seen for scheme in ("light", "dark"))
    assert brightness(light["background"]) > 200
    assert brightness(light["colour"]) < 100
    assert brightness(dark["background"]) < 60
    assert brightness(dark["colour"]) > 180


def test_a_clean_file_prints_on_few_pages(browser: Browser, report: Report) -> None:
    """At most eight pages of A4 for a clean file; ten instants are printed, whatever the verdict."""
    with Tab(browser, report.page) as tab:
        tab.show_as("light", "print")
        instants = "[...document.querySelectorAll('.instants .instant')].filter(e => e.checkVisibility()).length"
        assert tab.evaluate(instants) == 10
        pages = len(re.findall(rb"/Type\s*/Page\b", tab.pdf()))
    assert pages <= (MOST_PAGES if report.verdict == "clean" else 2 * MOST_PAGES)


def test_findings_are_named(visited: Callable[..., Visit], report: Report) -> None:
    """A failing report names the probable cause with its unit; a clean one names none."""
    text = visited(report.page, width=820, scheme="light").seen["text"]
    assert report.exit_code == (0 if report.verdict == "clean" else 1)
    causes = text[: text.index("Timeline\n\ndepth")]
    assert ("events:time_offset" in causes) == (report.verdict == "findings")
    assert "What a pass is worth" in text


def test_the_browser_test_can_fail(browser: Browser, tmp_path: Path) -> None:
    """A page with a broken picture, a request, an error and a box that is too wide is seen to have them."""
    (tmp_path / "beside.css").write_text("")
    (tmp_path / "bad.html").write_text(
        '<link rel="stylesheet" href="beside.css"><img alt="" src="data:image/png;base64,AAAA">'
        '<div style="width: 3000px">wide</div><script>console.error("said"); throw new Error("thrown")</script>'
    )
    shown = visit(browser, tmp_path / "bad.html", width=390, scheme="light")
    assert any("said" in line for line in shown.complaints)
    assert any("Uncaught" in line for line in shown.complaints)
    assert [Path(url).name for url in shown.requests] == ["bad.html", "beside.css"]
    assert shown.seen["pictures"][0]["natural"] == 0
    assert shown.seen["overflow"] > 0
    assert shown.seen["sticking_out"]


def brightness(colour: str) -> float:
    """Return the mean of red, green and blue, 0 to 255, of a computed ``rgb(...)``."""
    parts = colour[colour.index("(") + 1 : -1].replace("/", ",").replace(" ", ",").split(",")
    return sum(float(part) for part in [part for part in parts if part][:3]) / 3
