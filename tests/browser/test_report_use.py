"""What a reader does with a report: click in time, browse frames, search, filter, sort, turn the path, print."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from fedora_reports.html import render_html
from tests.browser.devtools import Browser
from tests.browser.sample_page import FINDINGS, HOSTILE, HOSTILE_NAME, write_sample
from tests.browser.tab import Tab
from tests.reports.evidence_samples import all_kinds
from tests.support.records import failed, file_record, late_events, record

SHOWN_TIME = "document.querySelector('.stage .time').textContent.split(' · ')[0]"
SAID = "document.querySelector('.stage .said')?.textContent ?? ''"
FINDING_LIST = ".findings .listing"
VISIBLE = "[...document.querySelectorAll('.findings .item')].filter(e => e.checkVisibility())"


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with forty findings."""
    return write_sample(tmp_path_factory.mktemp("use") / "report.html")


@pytest.fixture(scope="module")
def browser(chromium: Path) -> Iterator[Browser]:
    """A browser for all tests."""
    with Browser(chromium) as running:
        yield running


@pytest.fixture
def tab(browser: Browser, page: Path) -> Iterator[Tab]:
    """The report, open. Whatever was done with it, it has complained about nothing and asked for nothing."""
    with Tab(browser, page) as opened:
        yield opened
        assert opened.complaints == []
        assert opened.requests == [page.resolve().as_uri()]


def test_opens_at_the_worst_place(tab: Tab) -> None:
    """The place of the gravest finding is shown first, with what it says, and the playhead stands at its time."""
    assert tab.evaluate(SHOWN_TIME) == "0.500 s"
    assert "Events are 2.06" in tab.evaluate(SAID)
    assert tab.evaluate("document.querySelector('.playhead').getAttribute('x1')") == "25%"
    assert tab.evaluate("document.querySelectorAll('.stage img').length") == 5


def test_click_in_time_shows_the_nearest_pictures(tab: Tab) -> None:
    """A click near the beginning, the end of the moments, and again the beginning of the timeline."""
    for across, time in ((0.02, "0.000 s"), (0.52, "1.000 s"), (0.1, "0.000 s")):
        tab.click(".timeline .track", across, 0.3)
        assert tab.evaluate(SHOWN_TIME) == time
        assert tab.evaluate("location.hash") == ""


def test_click_on_a_finding_shows_its_place(tab: Tab) -> None:
    """A mark of the timeline shows the pictures nearest to it and says the finding, which a link leads to."""
    marks = tab.evaluate("[...document.querySelectorAll('.timeline a.mark')].map(a => a.getAttribute('href'))")
    anchor = next(mark for mark in marks if mark != "#file-0-finding-0")
    tab.click(f".timeline a.mark[href='{anchor}'] text")
    message = tab.evaluate(f"document.querySelector('{anchor} .message').textContent")
    assert message in tab.evaluate(SAID)
    tab.click(".stage .said a")
    assert tab.evaluate("location.hash") == anchor
    assert tab.evaluate(f"document.querySelector('{anchor}').checkVisibility()")


def test_marks_of_the_path_show_the_place_too(tab: Tab) -> None:
    """A diamond on the path does what a mark of the timeline does."""
    tab.click(".flight a.mark path")
    assert tab.evaluate(SAID).startswith("F")
    assert tab.evaluate("location.hash") == ""


def test_frames_are_browsed_by_button_slider_and_key(tab: Tab) -> None:
    """Later and earlier, to both ends and not beyond; the slider moves along, and moves the frames."""
    places = int(tab.evaluate("document.querySelector('[data-slider]').max"))
    assert places == 3 + 3 - 1
    for _ in range(places + 2):
        tab.click("[data-step='1']")
    assert tab.evaluate("document.querySelector('[data-slider]').value") == str(places)
    assert tab.evaluate(SHOWN_TIME) == "1.000 s"
    tab.evaluate("document.querySelector('[data-slider]').focus()")
    tab.press("Home", 36)
    assert tab.evaluate(SHOWN_TIME) == "0.000 s"
    tab.click("[data-step='-1']")
    assert tab.evaluate("document.querySelector('[data-slider]').getAttribute('aria-valuetext')") == "0.000 s"


def test_one_layer_is_shown_large(tab: Tab) -> None:
    """Each stream alone, larger than beside the others; all again."""
    kinds = "[...document.querySelectorAll('.stage .panel')].filter(e => e.checkVisibility()).map(e => e.dataset.kind)"
    width = "document.querySelector('.stage .panel[data-kind=depth]').getBoundingClientRect().width"
    beside = tab.evaluate(width)
    tab.choose("[data-layer]", "depth")
    assert tab.evaluate(kinds) == ["depth"]
    assert tab.evaluate(width) > 1.5 * beside
    tab.choose("[data-layer]", "")
    assert tab.evaluate(kinds) == ["frame", "events", "depth", "flow", "residual"]


def test_pictures_are_aligned(tab: Tab) -> None:
    """Panels of one instant have one size, and the cross marks the same share of each."""
    boxes = "[...document.querySelectorAll('.stage .frame')].map(e => e.getBoundingClientRect()).map(b => {0})"
    sizes = {tuple(size) for size in tab.evaluate(boxes.format("[Math.round(b.width), Math.round(b.height)]"))}
    assert len(sizes) == 1
    tab.point_at(".stage .frame", 0.25, 0.75)
    assert tab.evaluate("document.querySelector('.stage').className").endswith("crossed")
    across, down = tab.evaluate("['--x', '--y'].map(n => document.querySelector('.stage').style.getPropertyValue(n))")
    assert float(across.removesuffix("%")) == pytest.approx(25, abs=1)
    assert float(down.removesuffix("%")) == pytest.approx(75, abs=1)


def test_findings_are_searched(tab: Tab) -> None:
    """Only what holds the words stays, wherever it was folded, and how many that are is said."""
    tab.type_into(f"{FINDING_LIST} [data-search]", "number 37")
    assert tab.evaluate(f"{VISIBLE}.map(e => e.querySelector('.tag').textContent)") == ["F37"]
    assert tab.evaluate(f"document.querySelector('{FINDING_LIST} [data-count]').textContent") == f"1 of {FINDINGS - 1}"


def test_findings_are_filtered(tab: Tab) -> None:
    """By stream and by severity, both together; a stream may be called anything."""
    tab.choose(f"{FINDING_LIST} [data-filter=severity]", "critical")
    assert tab.evaluate(f"{VISIBLE}.map(e => e.querySelector('.tag').textContent)") == ["F30"]
    tab.choose(f"{FINDING_LIST} [data-filter=severity]", "")
    tab.choose(f"{FINDING_LIST} [data-filter=stream]", HOSTILE)
    streams = set(tab.evaluate(f"{VISIBLE}.map(e => e.dataset.stream)"))
    assert streams == {HOSTILE}


def test_findings_are_sorted_and_put_back(tab: Tab) -> None:
    """In the order of time, the gravest first, and as in the record again."""
    ids = f"{VISIBLE}.map(e => e.querySelector('.tag').textContent)"
    before = tab.evaluate("[...document.querySelectorAll('.findings .item .tag')].map(e => e.textContent)")
    tab.choose(f"{FINDING_LIST} [data-order]", "us")
    times = tab.evaluate(f"{VISIBLE}.map(e => Number(e.dataset.us))")
    assert times == sorted(times)
    assert len(times) == FINDINGS - 1
    tab.choose(f"{FINDING_LIST} [data-order]", "rank")
    assert tab.evaluate(ids)[:2] == ["F30", "F1"]
    tab.choose(f"{FINDING_LIST} [data-order]", "")
    assert tab.evaluate("[...document.querySelectorAll('.findings .item .tag')].map(e => e.textContent)") == before


def test_checks_are_filtered_and_sorted(tab: Tab) -> None:
    """By outcome, with the headings of what is left; the nearest to its limit first."""
    names = "[...document.querySelectorAll('.check')].filter(e => e.checkVisibility()).map(e => e.dataset.name)"
    tab.choose(".checks [data-filter=outcome]", "passed")
    assert tab.evaluate(names) == ["clocks.order", "clocks.rate"]
    headings = "[...document.querySelectorAll('.subject')].filter(e => e.checkVisibility()).map(e => e.innerText)"
    assert tab.evaluate(headings) == ["Clocks"]
    tab.choose(".checks [data-order]", "-near")
    assert tab.evaluate(names) == ["clocks.rate", "clocks.order"]


def test_a_link_reaches_what_is_filtered_out_or_folded(tab: Tab) -> None:
    """A link to a finding that a filter hides takes the filter away; one to a folded finding unfolds it."""
    tab.choose(f"{FINDING_LIST} [data-filter=severity]", "critical")
    tab.evaluate("location.hash = '#file-0-finding-38'")
    tab.evaluate("new Promise(done => setTimeout(done, 50))")
    assert tab.evaluate("document.querySelector('#file-0-finding-38').checkVisibility()")
    assert tab.evaluate(f"{VISIBLE}.length") == FINDINGS - 1


def test_path_is_turned_when_asked_for(browser: Browser, tmp_path: Path) -> None:
    """Without points of the world nothing is drawn until it is unfolded; then the mouse and the keys turn it."""
    bare = write_sample(tmp_path / "path.html", with_world=False)
    with Tab(browser, bare) as tab:
        drawn = "document.querySelector('.space canvas').toDataURL()"
        blank = tab.evaluate(drawn)
        tab.click(".space > summary")
        tab.evaluate("new Promise(done => setTimeout(done, 100))")
        pictures = [blank, tab.evaluate(drawn)]
        tab.drag(".space canvas", (80, 20))
        pictures.append(tab.evaluate(drawn))
        tab.evaluate("document.querySelector('.space canvas').focus()")
        tab.press("ArrowUp", 38)
        pictures.append(tab.evaluate(drawn))
        assert len(set(pictures)) == 4
        assert tab.complaints == []


def test_world_is_in_sight_and_turned(tab: Tab) -> None:
    """Points of the world, in their colours, and the path are in one picture, unfolded, which the mouse turns."""
    canvas = "document.querySelector('.world canvas')"
    assert tab.evaluate(f"{canvas}.checkVisibility()")
    assert tab.evaluate("document.querySelectorAll('.space canvas').length") == 0
    pictures = [tab.evaluate(f"{canvas}.toDataURL()")]
    brown = (
        f"(c => [...Array(c.width * c.height).keys()].filter(k => (p => p[4 * k] > 180 && p[4 * k + 2] < 90)"
        f"(c.pixels)).length)(Object.assign({canvas}, {{pixels: {canvas}.getContext('2d')"
        f".getImageData(0, 0, {canvas}.width, {canvas}.height).data}}))"
    )
    assert tab.evaluate(brown) >= 50
    tab.drag(".world canvas", (60, 15))
    pictures.append(tab.evaluate(f"{canvas}.toDataURL()"))
    assert len(set(pictures)) == 2


def test_two_fingers_come_closer(tab: Tab) -> None:
    """Fingers that part do what plus does, and back together they restore the picture; one finger then turns it."""
    canvas = "document.querySelector('.clouds canvas')"
    drawn = f"{canvas}.toDataURL()"
    pictures = [tab.evaluate(drawn)]
    tab.pinch(".clouds canvas", 20, 60)
    pictures.append(tab.evaluate(drawn))
    tab.pinch(".clouds canvas", 60, 20)
    assert tab.evaluate(drawn) == pictures[0]
    tab.swipe(".clouds canvas", (60, 0))
    pictures.append(tab.evaluate(drawn))
    assert len(set(pictures)) == 3
    assert tab.complaints == []


def test_event_cloud_is_turned(tab: Tab) -> None:
    """It is drawn at once and does not move by itself; the mouse, a finger and keys turn it, and plus comes closer."""
    canvas = "document.querySelector('.clouds canvas')"
    drawn = f"{canvas}.toDataURL()"
    pictures = [tab.evaluate(drawn)]
    assert tab.evaluate(f"new Promise(done => setTimeout(() => done({drawn}), 300))") == pictures[0]
    tab.drag(".clouds canvas", (60, 15))
    pictures.append(tab.evaluate(drawn))
    tab.swipe(".clouds canvas", (60, 0))
    pictures.append(tab.evaluate(drawn))
    tab.evaluate(f"{canvas}.focus()")
    tab.press("ArrowLeft", 37)
    pictures.append(tab.evaluate(drawn))
    tab.press("+", 187)
    pictures.append(tab.evaluate(drawn))
    assert len(set(pictures)) == 5
    assert tab.complaints == []


def test_still_clouds_are_for_paper(tab: Tab) -> None:
    """On the screen the picture that can be turned takes the place of the still one; on paper it is the other way."""
    visible = "['.still', '.clouds canvas'].map(name => document.querySelector(name).checkVisibility())"
    assert tab.evaluate(visible) == [False, True]
    tab.show_as("light", "print")
    assert tab.evaluate(visible) == [True, False]


@pytest.mark.parametrize(
    ("number", "said", "lines"),
    [
        (1, "CSV copied", ["sequence,T (s),", f"{HOSTILE_NAME}.h5,2,"]),
        (2, "LaTeX copied", ["% needs", r"\begin{table}"]),
    ],
)
def test_paper_tables_are_copied(browser: Browser, tab: Tab, number: int, said: str, lines: list[str]) -> None:
    """A button puts the table into the clipboard as text, without a network, and the page says so."""
    browser.call("Browser.grantPermissions", permissions=["clipboardReadWrite"])
    tab.click(f".statistics .copy button:nth-of-type({number})")
    assert tab.evaluate("document.querySelector('.statistics .copy output').textContent") == said
    copied = tab.evaluate("navigator.clipboard.readText()").splitlines()
    assert [line[: len(start)] for line, start in zip(copied, lines, strict=False)] == lines
    name = f"document.querySelector('.statistics .copy button:nth-of-type({number})').textContent"
    assert tab.evaluate(name) == f"{said.split(maxsplit=1)[0]}: Sequence"


def test_hostile_names_are_text(tab: Tab) -> None:
    """What a file calls its streams or itself is shown letter by letter, wherever scripts copy it to."""
    assert tab.evaluate("document.querySelector('h1').textContent") == f"{HOSTILE_NAME}.h5"
    tab.evaluate("document.querySelector('#file-0-finding-7 .see').click()")
    assert HOSTILE in tab.evaluate(SAID)
    foreign = "document.querySelectorAll('img:not([src^=\"data:\"]), body script, [onerror]').length"
    assert tab.evaluate(foreign) == 0


def test_print_shows_all_moments_and_no_controls(tab: Tab) -> None:
    """On paper every moment stands in its row, no button is left, and ink is dark on white whatever the scheme."""
    tab.show_as("dark", "print")
    assert tab.evaluate("[...document.querySelectorAll('.instants .instant')].every(e => e.checkVisibility())")
    controls = (
        "[...document.querySelectorAll('button, input, select, canvas, .stage')].filter(e => e.checkVisibility())"
    )
    assert tab.evaluate(f"{controls}.length") == 0
    assert tab.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    assert tab.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    assert tab.pdf().startswith(b"%PDF")


def test_print_leaves_out_what_is_folded_but_findings_and_checks(tab: Tab) -> None:
    """Of what is folded, paper states findings and passed checks; the columns of checks stand side by side."""
    tab.show_as("light", "print")
    folded = "[...document.querySelectorAll('details.more:not([open])')].filter(e => e.checkVisibility())"
    assert set(tab.evaluate(f"{folded}.map(e => e.closest('.findings, .remarks, .checks') !== null)")) == {True}
    cells = "[...document.querySelector('.check summary').children].map(e => e.getBoundingClientRect())"
    assert tab.evaluate(f"(cells => cells.every((c, k) => k === 0 || c.left >= cells[k - 1].right))({cells})")


@pytest.mark.parametrize("width", [375, 800, 1200])
def test_every_part_is_linked_in_sight(browser: Browser, page: Path, width: int) -> None:
    """However many parts a report has, no link to one is cut off, and what a link leads to is not below the links."""
    with Tab(browser, page, width=width) as tab:
        links = tab.evaluate("[...document.querySelectorAll('.parts a')].map(a => a.getBoundingClientRect().right)")
        within = tab.evaluate("document.querySelector('.parts').getBoundingClientRect().right")
        assert len(links) >= 9
        assert max(links) <= within
        tab.evaluate("document.documentElement.style.scrollBehavior = 'auto'")
        tab.evaluate("[...document.querySelectorAll('.parts a')].at(-4).click()")
        tab.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        target = "document.querySelector(location.hash).getBoundingClientRect().top"
        assert tab.evaluate(f"{target} >= document.querySelector('.parts').getBoundingClientRect().bottom")


def test_each_of_several_files_has_frames_of_its_own(browser: Browser, tmp_path: Path) -> None:
    """Two files in one report: what is shown of one does not move the other."""
    files = [file_record(failed(), path=f"{name}.h5", diagnoses=(late_events(),)) for name in ("one", "two")]
    arrays = {f"{k}/{name}": array for k in (0, 1) for name, array in all_kinds().items()}
    both = tmp_path / "both.html"
    both.write_text(render_html(record(*files), arrays), encoding="utf-8")
    times = "[...document.querySelectorAll('.stage .time')].map(e => e.textContent.split(' · ')[0])"
    with Tab(browser, both) as tab:
        assert tab.evaluate(times) == ["0.500 s", "0.500 s"]
        tab.click("#file-1 .timeline .track", 0.02, 0.3)
        assert tab.evaluate(times) == ["0.500 s", "0.000 s"]
        assert tab.complaints == []


def test_instants_without_a_time_come_last(browser: Browser, tmp_path: Path) -> None:
    """Where stamps say nothing, or lie outside the timeline, frames are shown all the same, and no playhead."""
    arrays = all_kinds() | {"moments/times_us": np.array([np.nan, 9e12, 0.0])}
    strange = tmp_path / "strange.html"
    strange.write_text(render_html(record(), arrays), encoding="utf-8")
    hidden = "document.querySelector('.playhead').getAttribute('visibility')"
    with Tab(browser, strange) as tab:
        assert tab.evaluate(hidden) == "visible"
        tab.evaluate("document.querySelector('[data-slider]').focus()")
        tab.press("End", 35)
        assert tab.evaluate(hidden) == "hidden"
        tab.click("[data-step='-1']")
        assert (tab.evaluate(SHOWN_TIME), tab.evaluate(hidden)) == ("9000000.000 s", "hidden")
        tab.click(".timeline .track", 0.02, 0.3)
        assert (tab.evaluate(SHOWN_TIME), tab.evaluate(hidden)) == ("0.000 s", "visible")
        assert tab.complaints == []


def test_a_file_without_pictures_has_no_viewer(browser: Browser, tmp_path: Path) -> None:
    """Scripts find nothing to do in a bare report, and say nothing about it."""
    bare = tmp_path / "bare.html"
    bare.write_text(render_html(record(), {}), encoding="utf-8")
    with Tab(browser, bare) as tab:
        assert tab.evaluate("document.documentElement.className") == "js"
        assert tab.evaluate("document.querySelectorAll('.viewer, canvas').length") == 0
        assert tab.complaints == []
