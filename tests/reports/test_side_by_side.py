"""Files that several subjects have stand beside each other: the same instants, and paths in one picture."""

import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.comparison.subjects import SharedEvidence
from fedora_reports.comparison import page_of, shared_view
from tests.comparison.test_compare import versions
from tests.reports.evidence_samples import moments
from tests.reports.trajectory_shapes import flown

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
