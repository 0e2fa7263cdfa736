"""The pictures of a path: flat views, and a render where OpenGL works."""

import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import cv2
import numpy as np
import pytest

from fedora_reports import trajectory
from fedora_reports.trajectory import TrajectoryPicture, flat_views, render_trajectory
from fedora_reports.trajectory_path import Frusta, flown_path, speed_colours
from fedora_reports.trajectory_views import draw_views
from tests.reports.evidence_samples import frusta
from tests.reports.trajectory_shapes import SHAPES, loop
from tests.support.graphics import without_opengl

SVG = "{http://www.w3.org/2000/svg}"


def decoded(picture: TrajectoryPicture) -> np.ndarray:
    """Return the pixels (h, w, 3) of a render, RGB."""
    return cv2.imdecode(np.frombuffer(picture.png, np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


@pytest.fixture(scope="module")
def rendered(opengl: str) -> TrajectoryPicture:
    """The picture of a loop."""
    return render_trajectory(**loop())


def test_render_shows_the_path_in_its_colours(rendered: TrajectoryPicture) -> None:
    """The picture is large, has no note, and holds the colours of slow and of fast."""
    assert rendered.note == ""
    pixels = decoded(rendered)
    assert pixels.shape == (640, 960, 3)
    for colour in (speed_colours(2)[0], speed_colours(2)[-1]):
        hue = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)], dtype=float)
        path = pixels[:, :840].reshape(-1, 3).astype(float)
        # Shading darkens a colour; its direction stays.
        cosine = path @ hue / (np.linalg.norm(path, axis=1) * np.linalg.norm(hue) + 1e-9)
        assert ((cosine > 0.995) & (np.linalg.norm(path, axis=1) > 90)).sum() > 100


def test_render_is_repeatable(rendered: TrajectoryPicture) -> None:
    """The same path gives the same picture."""
    np.testing.assert_array_equal(decoded(rendered), decoded(render_trajectory(**loop())))


def test_frusta_take_the_place_of_cones(rendered: TrajectoryPicture) -> None:
    """With the views of a camera the picture shows these, and the caption says which camera and which side is up."""
    arrays = loop()
    views = frusta()
    rays, at = views["frusta/rgb/rays_world"], arrays["positions_world_m"][[10, 100]]
    picture = render_trajectory(**arrays, frusta=Frusta("rgb", at, rays))
    assert picture.note == ""
    assert "cones" in rendered.caption
    assert "cones" not in picture.caption
    assert "the camera of rgb; a peak marks the upper edge" in picture.caption
    assert (decoded(picture) != decoded(rendered)).any(axis=-1).sum() > 1000


@pytest.mark.parametrize("name", ["gaps", "still", "two poses", "one pose", "vertical"])
def test_render_of_any_shape(name: str, opengl: str) -> None:
    """Missing values, few poses and degenerate shapes are rendered."""
    picture = render_trajectory(**SHAPES[name])
    assert picture.note == ""
    assert decoded(picture).std() > 5


def test_caption_states_units_and_gaps() -> None:
    """The caption gives the time, the range of speeds with unit, and how often positions are missing."""
    path = flown_path(**SHAPES["gaps"], most=1000)
    caption = trajectory._caption(path, "ball", "cube", "")
    low, high = path.speed_range_m_s or (0.0, 0.0)
    assert f"{low:.4g} to {high:.4g} m/s" in caption
    assert "over 10 s" in caption
    assert "missing in 2 places" in caption


def test_without_opengl_the_reason(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Where the libraries cannot be loaded VTK dies, and a drawing says so and names the packages."""
    for name, value in without_opengl(tmp_path).items():
        monkeypatch.setenv(name, value)
    picture = render_trajectory(**loop())
    assert picture.png == b""
    assert "OpenGL could not be used" in picture.note
    assert "libegl1 and libgl1-mesa-dri" in picture.note


def test_vtk_without_opengl_takes_its_process_along(tmp_path: Path) -> None:
    """What the process apart is for: without the libraries the render ends by a signal, not by an exception."""
    np.savez(tmp_path / "path.npz", **SHAPES["two poses"])
    command = [sys.executable, "-m", "fedora_reports.trajectory_render", tmp_path / "path.npz", tmp_path / "path.png"]
    done = subprocess.run(command, env=without_opengl(tmp_path), capture_output=True, check=False)
    assert done.returncode < 0


def test_without_pyvista_the_note_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    """A missing library is not a missing OpenGL."""
    monkeypatch.setattr(trajectory, "find_spec", lambda _: None)
    picture = render_trajectory(**loop())
    assert "pip install 'fedora-qa[reports]'" in picture.note


def test_a_render_that_does_not_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """A driver that hangs costs the time limit, and the note says so."""
    picture = render_trajectory(**loop(), time_limit_s=0.01)
    assert "more than 0.01 s" in picture.note
    assert picture.png == b""


def test_no_pose_at_all() -> None:
    """Without a finite position there is no path, and the caption says that."""
    nothing = render_trajectory(np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))
    unknown = render_trajectory(np.zeros(2), np.full((2, 3), np.nan), np.zeros(2), np.zeros((2, 3)))
    assert nothing == unknown
    assert "no path" in nothing.caption
    assert nothing.png == b""
    svg, caption = flat_views(flown_path(np.zeros(0), np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), most=9), ())
    assert "no path" in caption
    ET.fromstring(svg)


@pytest.mark.parametrize("name", SHAPES)
def test_views_stay_inside_and_at_one_scale(name: str) -> None:
    """Both views are drawn within the picture, with finite numbers, at one scale in all directions."""
    path = flown_path(**SHAPES[name], most=300)
    svg = draw_views(path)
    assert "nan" not in svg
    root = ET.fromstring(svg)
    _, _, width, height = (float(value) for value in root.attrib["viewBox"].split())
    rings = [ring.attrib for ring in root.iter(f"{SVG}circle")]
    assert len(rings) == 2
    for ring in rings:
        assert 0 < float(ring["cx"]) < width
        assert 0 < float(ring["cy"]) < height
    if len(path.times_us) > 1:
        squares = [square.attrib for square in root.iter(f"{SVG}rect") if "stroke-width" in square.attrib]
        step_m = path.positions_world_m[-1] - path.positions_world_m[0]
        across = [float(s["x"]) + 5 - float(r["cx"]) for r, s in zip(rings, squares, strict=True)]
        up = [float(r["cy"]) - float(s["y"]) - 5 for r, s in zip(rings, squares, strict=True)]
        # East, north and up in px, from the first view and the second one's height.
        assert_parallel(np.array([across[0], up[0], up[1]]), step_m)


def assert_parallel(moved_px: np.ndarray, moved_m: np.ndarray) -> None:
    """Assert that a step in px is a positive multiple of one in metres, to the rounding of the drawing."""
    scale = np.linalg.norm(moved_px) / max(np.linalg.norm(moved_m), 1e-12)
    np.testing.assert_allclose(moved_px, scale * moved_m, atol=0.5)
