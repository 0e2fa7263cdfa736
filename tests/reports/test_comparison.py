"""Distributions are drawn where they lie, in lines that can be told apart."""

import re
from importlib.resources import files
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.comparison.subjects import SharedEvidence
from fedora_qa.comparison.types import COMPARISON_VERSION, Comparison, Overlay, Subject
from fedora_qa.record.types import Tool
from fedora_reports.charts import HEIGHT, WIDTH
from fedora_reports.comparison import MOST_DRAWN, overlay_chart, page_of, shared_view
from tests.comparison.test_compare import versions
from tests.reports.evidence_samples import moments
from tests.reports.test_style import colours, contrast
from tests.reports.trajectory_shapes import flown

CSS = (files("fedora_reports") / "templates" / "comparison.css").read_text(encoding="utf-8")


def comparison(*overlays: Overlay, subjects: int = 2) -> Comparison:
    """A comparison of so many subjects without files."""
    named = tuple(Subject(f"s{k}", ()) for k in range(subjects))
    return Comparison(COMPARISON_VERSION, Tool("fedora-qa", "0"), 0.01, 1, 0.01, named, overlays, (), (), ())


def depths(*shares: tuple[float, ...] | None, edges: tuple[float, ...] = (1.0, 2.0, 4.0, 16.0)) -> Overlay:
    return Overlay("depth_m", "Pixels by depth, m", "m", edges, shares)


def test_heights_are_shares_per_octave() -> None:
    """A bin of two octaves with half of the values is as high as one of one octave with a fourth of them."""
    one = depths((0.25, 0.25, 0.5), (0.0, 1.0, 0.0))
    chart = overlay_chart(one, comparison(one))
    assert chart is not None
    first, second = (re.findall(r"[ML]([\d.]+) ([\d.]+)H([\d.]+)", line.path) for line in chart.lines)
    assert [float(y) for _, y, _ in first] == [0.75 * HEIGHT] * 3
    assert [float(y) for _, y, _ in second] == [HEIGHT, 0.0, HEIGHT]
    assert [float(x) for x, _, _ in first] == pytest.approx([0, WIDTH / 4, WIDTH / 2])
    assert float(first[-1][2]) == WIDTH


def test_what_is_zero_lies_left_of_the_axis() -> None:
    """A logarithmic axis has no place for 0: its share is told in words."""
    one = depths((0.1, 0.4, 0.5), edges=(0.0, 1.0, 2.0, 4.0))
    chart = overlay_chart(one, comparison(one, subjects=1))
    assert chart is not None
    assert chart.aside == "At 0, left of the axis: s0 10.0%."
    assert (chart.ticks[0].label, chart.ticks[0].share) == ("1", 0.0)


def test_what_is_not_known_is_not_drawn() -> None:
    """A subject without the quantity has no line, a quantity that nobody has, or only 0, no chart."""
    one = depths(None, (0.5, 0.5, 0.0))
    chart = overlay_chart(one, comparison(one))
    assert chart is not None
    assert [line.place for line in chart.lines] == [1]
    for nothing in (depths(None, None), depths((1.0,), None, edges=(0.0, 1.0))):
        assert overlay_chart(nothing, comparison(nothing)) is None


def test_more_than_can_be_told_apart_are_named() -> None:
    """The seventh subject has no line, and the page says so."""
    many = depths(*((0.2, 0.3, 0.5) for _ in range(7)))
    page = page_of(comparison(many, subjects=7))
    assert len(page.charts[0].lines) == MOST_DRAWN
    assert page.undrawn == ("s6",)


def test_far_tails_do_not_flatten_the_rest() -> None:
    """A value in ten thousand beyond all others is beyond the axis too."""
    edges = tuple(2.0**k for k in range(13))
    shares = np.zeros(12)
    shares[[2, 3, 11]] = 0.5, 0.4999, 0.0001
    one = depths(tuple(float(share) for share in shares), edges=edges)
    chart = overlay_chart(one, comparison(one))
    assert chart is not None
    assert "from 4 to 16 m" in chart.alt


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_lines_stand_out(scheme: str) -> None:
    """Every line reaches 3 against the paper, as WCAG asks of graphics."""
    light, dark = (dict(re.findall(r"--(s\d): (#[0-9a-f]{6})", line)) for line in CSS.splitlines() if "--s0:" in line)
    lines = light if scheme == "light" else dark
    assert len(lines) == MOST_DRAWN
    assert all(contrast(colour, colours(scheme)["paper"]) >= 3 for colour in lines.values())


NAMES = ("old", "new")
SQUARE_M = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]])


def kept(**changed: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Three instants and a path around a square; ``changed`` are other arrays of the instants."""
    path = {f"trajectory/{name}": array for name, array in flown(SQUARE_M).items()}
    return moments() | path | {f"moments/{name}": array for name, array in changed.items()}


def times(view: Any) -> list[list[str]]:
    """The times of the frames of each instant, by subject."""
    return [[each.time for each in instant[0]] for instant in view.instants]


def test_streams_stand_beside_each_other() -> None:
    """Each stream of each instant, of both; the residual of flow is left out."""
    view = shared_view(SharedEvidence("a.h5", (kept(), kept())), NAMES)
    assert view.missing == ""
    kinds = [[[each.panel.kind for each in stream] for stream in instant] for instant in view.instants]
    assert kinds == [[[kind] * 2 for kind in ("frame", "events", "depth", "flow")]] * 3
    assert [each.subject for each in view.instants[0][0]] == ["old", "new"]
    assert times(view) == [["0.000 s"] * 2, ["0.500 s"] * 2, ["1.000 s"] * 2]


@pytest.mark.parametrize(
    ("times_us", "expected"),
    [
        pytest.param([1e6, 5e5, 0.0], ["0.000 s", "0.500 s", "1.000 s"], id="nearest in time, in any order"),
        pytest.param([9e9, 9.1e9, 9.2e9], ["9000.000 s", "9100.000 s", "9200.000 s"], id="another clock: same share"),
        pytest.param([np.nan] * 3, [""] * 3, id="unknown times: same share"),
    ],
)
def test_instants_are_the_same(times_us: list[float], expected: list[str]) -> None:
    """The nearest in time stand beside each other; without a common clock those at the same share."""
    view = shared_view(SharedEvidence("a.h5", (kept(), kept(times_us=np.array(times_us)))), NAMES)
    assert [row[1] for row in times(view)] == expected


def test_colours_are_shared() -> None:
    """Depths that are doubled look different, since one scale holds both."""
    doubled = kept(depth_m=2 * moments()["moments/depth_m"])
    view = shared_view(SharedEvidence("a.h5", (kept(), doubled)), NAMES)
    depth = view.instants[0][2]
    assert depth[0].panel.image.uri != depth[1].panel.image.uri
    alone = shared_view(SharedEvidence("a.h5", (doubled, doubled)), NAMES).instants[0][2]
    assert depth[1].panel.image.uri != alone[1].panel.image.uri


def test_paths_have_one_scale() -> None:
    """A square is as wide as it is high, in the picture of both paths, and one that was moved lies beside it."""
    moved = kept() | {"trajectory/positions_world_m": SQUARE_M + np.array([8.0, 0, 0])}
    view = shared_view(SharedEvidence("a.h5", (kept(), moved)), NAMES)
    assert view.flown == ((0, "old"), (1, "new"))
    lines = re.findall(r'<path class="overlay s(\d)" d="M([^"]+)"', view.paths)
    assert [place for place, _ in lines] == ["0", "1"]
    corners = [np.array([point.split() for point in line.split("L")], dtype=float) for _, line in lines]
    across, down = np.ptp(corners[0], axis=0)
    assert across == pytest.approx(down, abs=0.2)
    np.testing.assert_allclose(corners[1] - corners[0], [[2 * across, 0]] * 4, atol=0.3)


def test_what_was_not_kept_is_said() -> None:
    """A record without evidence is named in a sentence, and a subject without the file is not."""
    view = shared_view(SharedEvidence("a.h5", (kept(), {})), NAMES)
    assert view.missing.startswith("No pictures and no path of this file were kept in new: ")
    assert view.instants == ()
    assert view.flown == ((0, "old"),)
    assert shared_view(SharedEvidence("a.h5", (kept(), None)), NAMES).missing == ""
    bare = page_of(versions())
    assert "none was given" in bare.shared_note
    assert bare.shared == ()
    assert page_of(versions(), [SharedEvidence("a.h5", (kept(), kept()))]).shared_note.startswith("Of 1 of 2 files")
