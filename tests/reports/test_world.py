"""The world in the report: points where they were kept, in their colours, with the path, and small."""

import base64
import json
import re
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.evidence.options import EvidenceOptions
from fedora_reports.evidence import Evidence
from fedora_reports.trajectory_path import FlownPath, flown_path
from fedora_reports.world import draw_world, world_of, world_scene
from tests.reports.drawn_dots import dots_of
from tests.reports.evidence_samples import frusta, point_cloud

MOST_BYTES = 60_000
WALL = 2 * 13 * 9


def path() -> FlownPath:
    """Level, 8 m to the east, 6 m before the wall of the samples."""
    east_m = 5e6 + np.linspace(-4.0, 4.0, 20)
    positions_m = np.stack([east_m, np.full(20, 6.0), np.full(20, 2.0)], axis=1)
    return flown_path(np.arange(20.0), positions_m, np.ones(20), np.tile([1.0, 0.0, 0.0], (20, 1)), most=600)


def evidence(**changed: NDArray[Any]) -> Evidence:
    """The samples, some arrays of which are others."""
    return Evidence(point_cloud() | {f"point_cloud/{name}": array for name, array in changed.items()}, {})


def test_points_are_about_the_box_of_path_and_world() -> None:
    """The wall is in the box, metre by metre; the point 900 m away is outside and counted."""
    world = world_of(evidence(), path())
    assert world is not None
    assert (len(world.points), world.beyond, world.frames) == (WALL, 1, 2)
    points_m = world.points * world.box.span_m + world.box.centre_m
    expected_m = point_cloud()["point_cloud/offsets_m"][:WALL] + np.array([5e6, 0.0, 0.0])
    np.testing.assert_allclose(points_m, expected_m, atol=1e-6, rtol=0)
    assert (world.box.low_m <= path().positions_world_m).all()
    assert (world.box.high_m >= path().positions_world_m).all()


def test_dark_points_are_brightened_by_one_factor() -> None:
    """Points keep their hue, and the caption states the factor; grey ones, which have no colour, stay."""
    world = world_of(evidence(), path())
    assert world is not None
    assert world.gain == pytest.approx(230 / 120)
    assert np.unique(world.rgb, axis=0).tolist() == [[230, 115, 58]]
    assert "in their colours, 1.9 times as bright" in draw_world(world, path())[1]
    grey = world_of(evidence(rgb=np.full((WALL + 1, 3), 128, np.uint8)), path())
    assert grey is not None
    assert (grey.rgb == 128).all()
    assert "in grey" in draw_world(grey, path())[1]


def test_still_picture_holds_points_path_and_axes() -> None:
    """Dots of the nearest colour of six levels, each place once; the path as a line; axes in metres."""
    world = world_of(evidence(), path())
    assert world is not None
    svg, caption = draw_world(world, path())
    assert set(re.findall(r'stroke="(#\w+)"', svg)) == {"#f63"}
    assert len(dots_of(svg, 'stroke="#f63"')) == WALL / 2
    assert svg.count('class="way"') == 1
    assert {"X east, m", "Y north, m", "Z up, m"} <= set(re.findall(r"<text[^>]*>([^<]*)</text>", svg))
    assert caption.startswith(f"{WALL} points of 2 depth frames")


def test_frusta_stand_along_the_path() -> None:
    """Each a line below the path, and a sentence of the caption; without any there is neither."""
    world = world_of(Evidence(point_cloud() | frusta(), {}), path())
    assert world is not None
    svg, caption = draw_world(world, path())
    assert svg.count('class="frustum"') == 2
    assert svg.rindex('class="frustum"') < svg.index('class="way"')
    assert "Frusta show the view of the camera of rgb" in caption
    without = world_of(evidence(), path())
    assert without is not None
    svg, caption = draw_world(without, path())
    assert ("frustum" in svg, "Frusta" in caption) == (False, False)


def test_scene_holds_every_point_with_its_colour() -> None:
    """To a 32767th of the longest side, and five bits a colour."""
    world = world_of(evidence(), path())
    assert world is not None
    scene = json.loads(json.dumps(world_scene(world)))
    numbers = np.frombuffer(base64.b64decode(scene["cloud"]), "<i2").reshape(-1, 4)
    np.testing.assert_allclose(numbers[:, :3] / 32767, world.points, atol=2e-5)
    red, green, blue = ((numbers[:, 3] >> shift) & 31 for shift in (10, 5, 0))
    np.testing.assert_array_equal(np.stack([red, green, blue], axis=1), world.rgb >> 3)
    assert "paints" not in scene


def test_as_many_points_as_are_ever_kept_stay_small() -> None:
    """Noise, of all colours."""
    rng, count = np.random.default_rng(1), EvidenceOptions().cloud_points
    world = world_of(
        evidence(
            offsets_m=rng.uniform(-50.0, 50.0, (count, 3)).astype(np.float32),
            rgb=rng.integers(0, 256, (count, 3)).astype(np.uint8),
        ),
        path(),
    )
    assert world is not None
    assert len(draw_world(world, path())[0].encode()) < MOST_BYTES


@pytest.mark.parametrize(
    "changed",
    [
        {"rgb": np.zeros((3, 3), np.uint8)},
        {"rgb": np.zeros((WALL + 1, 3), np.float32)},
        {"origin_world_m": np.zeros(2)},
        {"origin_world_m": np.full(3, np.nan)},
        {"offsets_m": np.full((WALL + 1, 3), np.inf, np.float32)},
        {"offsets_m": np.full((WALL + 1, 3), 3e38, np.float32)},
        {"times_us": np.empty(0)},
    ],
)
def test_arrays_that_do_not_fit_draw_no_world(changed: dict[str, NDArray[Any]]) -> None:
    """Of other lengths or kinds, and without a finite point."""
    assert world_of(evidence(**changed), path()) is None


def test_no_world_without_a_path() -> None:
    """Points alone are not drawn: the picture is of the path among them."""
    nowhere = flown_path(np.zeros(1), np.full((1, 3), np.nan), np.zeros(1), np.zeros((1, 3)), most=600)
    assert world_of(evidence(), nowhere) is None
