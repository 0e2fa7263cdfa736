"""Scenes that OpenGL draws: their description, what is refused, and a sequence from end to end."""

import ctypes.util
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator.errors import GraphicsMissingError, SceneError
from fedora_generator.generate import Request, generate_sequence, require_free_flight
from fedora_generator.mesh.context import open_context
from fedora_generator.mesh.model import MeshDetail
from fedora_generator.scene import Place, Scene, load_scene
from fedora_generator.surroundings import MESH_DETAIL, mesh_detail, render_surroundings, surroundings_of
from tests.generator.mesh_cases import AMBIENT, LOOKING_EAST, camera, grey, model, wall


def written(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text)
    return path


@pytest.fixture
def yard(tmp_path: Path) -> Scene:
    """A floor and a crate, 72 x 54, drawn by OpenGL."""
    world = """
name = "yard"
[textures.waves]
dark_rgb = [0.1, 0.1, 0.1]
light_rgb = [0.9, 0.8, 0.7]
waves = [{ longest_m = 3.0, shortest_m = 0.3, count = 5 }]
[[rectangles]]
name = "floor"
center_m = [0.0, 0.0, 0.0]
size_m = [60.0, 60.0]
texture = "waves"
[[boxes]]
name = "crate"
center_m = [4.0, 0.0, 1.0]
size_m = [1.0, 1.0, 2.0]
texture = "waves"
"""
    (tmp_path / "yard.toml").write_text(world)
    text = 'base = "park-day"\nname = "yard"\nworld = "yard.toml"\n'
    return load_scene(written(tmp_path, text)).with_size(72, 54)


def test_who_draws_is_part_of_the_digest(yard: Scene) -> None:
    """Renderer, detail and place each change it."""
    drawn = replace(yard, renderer="mesh")
    place = replace(drawn, world=None, place=Place(name="park"))
    scenes = (
        yard,
        drawn,
        replace(drawn, mesh=MeshDetail(event_factor=3)),
        place,
        replace(place, place=Place(name="park", seed=1)),
    )
    assert len({scene.digest for scene in scenes}) == len(scenes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ('renderer = "magic"\n', r"Expected 'exact' or 'mesh'"),
        ('place = {name = "park"}\n', r"Expected a world with the exact renderer, got a place; set renderer = 'mesh'"),
        ("mesh = {event_factor = 2}\n", r"Expected no table mesh with the exact renderer"),
        ('renderer = "mesh"\nmesh = {event_factor = 0}\n', r"Expected event_factor from 1 to 16, got 0"),
        ('renderer = "mesh"\nmesh = {precision = "half"}\n', r"Expected 'float' or '8bit'"),
        (
            'renderer = "mesh"\nworld = "park"\nplace = {name = "park"}\n',
            r"Expected either a world or a place, got both",
        ),
        ('renderer = "mesh"\nplace = {name = "park", sed = 3}\n', r"Expected only known keys, got place.sed"),
    ],
)
def test_a_wrong_description_is_one_sentence(tmp_path: Path, changes: str, message: str) -> None:
    """What is wrong, and where."""
    with pytest.raises(SceneError, match=message):
        load_scene(written(tmp_path, f'base = "park-day"\nname = "mine"\n{changes}'))


def test_a_place_takes_the_place_of_the_base_s_world(tmp_path: Path) -> None:
    """A scene need not say that it has no world any more."""
    text = 'base = "park-day"\nname = "mine"\nrenderer = "mesh"\nplace = { name = "park", seed = 2 }\n'
    scene = load_scene(written(tmp_path, text))
    assert scene.world is None
    assert scene.place == Place(name="park", seed=2)


def test_an_unknown_place_is_one_sentence(yard: Scene) -> None:
    """The places that there are, and the one asked for."""
    nowhere = replace(yard, renderer="mesh", world=None, place=Place(name="moon"))
    with pytest.raises(SceneError, match=r"Expected one of the places .*park.*, got 'moon'"):
        surroundings_of(nowhere)


def test_a_flight_into_a_solid_of_a_place_is_refused(monkeypatch: pytest.MonkeyPatch, yard: Scene) -> None:
    """The collision test looks at the solids of a model as it does at the boxes of a world."""
    assert yard.world is not None
    pillar = replace(yard.world.boxes[0], name="pillar", center_m=(1.0, 0.0, 1.0))
    built = model(wall(grey()), solids=(pillar,))
    monkeypatch.setattr("fedora_generator.mesh.places.build_place", lambda name, seed: built)
    drawn = replace(yard, renderer="mesh", world=None, place=Place(name="park"))
    with pytest.raises(SceneError, match=r"got inside 'pillar' at 0\.\d+ s"):
        require_free_flight(drawn, 1_000_000)


def test_finer_quality_draws_finer() -> None:
    """No quality is drawn more coarsely than the one before."""
    details = [MESH_DETAIL[quality] for quality in ("draft", "standard", "reference")]
    assert [detail.event_factor for detail in details] == sorted(detail.event_factor for detail in details)
    assert all(detail.precision == "float" for detail in details)


def test_lamps_are_drawn_finer_than_the_sun() -> None:
    """By night even a draft averages the edges of lit windows."""
    lamps, sun = replace(AMBIENT, sun_strength=0.0), replace(AMBIENT, sun_strength=0.5)
    assert mesh_detail(lamps, "draft").event_factor > mesh_detail(sun, "draft").event_factor
    assert mesh_detail(lamps, "reference") == mesh_detail(sun, "reference")


def test_without_opengl_a_mesh_scene_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    """One sentence with the packages, whichever part is missing."""
    monkeypatch.delenv("PYOPENGL_PLATFORM", raising=False)
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None)
    with pytest.raises(GraphicsMissingError, match=r"libEGL or libOSMesa, got neither; install .*libegl1"):
        open_context.__wrapped__()
    monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")
    monkeypatch.setitem(sys.modules, "pyrender", None)
    with pytest.raises(GraphicsMissingError, match=r"Expected pyrender for a mesh world.*fedora-qa\[generator\]"):
        open_context.__wrapped__()


def test_the_exact_world_needs_no_graphics(yard: Scene) -> None:
    """Neither pyrender nor OpenGL is imported by the command, or by rendering an exact scene."""
    code = (
        "import sys, numpy; from fedora_generator.scene import load_scene; import fedora_generator.cli;"
        "from fedora_generator.surroundings import render_surroundings as render, surroundings_of as of;"
        "scene = load_scene('park-day'); render(scene, of(scene), 'draft', numpy.zeros((1, 3)));"
        "sys.exit(any(name.split('.')[0] in ('pyrender', 'OpenGL', 'trimesh') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.usefixtures("opengl")
def test_a_sequence_of_a_mesh_scene(tmp_path: Path, yard: Scene) -> None:
    """Every stream; depth, flow and intensity as the exact world has them; the same again with the same seed."""
    request = Request(duration_s=0.1, quality="draft")
    exact, mesh, again = (tmp_path / name for name in ("exact.h5", "mesh.h5", "again.h5"))
    drawn = replace(yard, renderer="mesh")
    generate_sequence(yard, exact, request)
    generate_sequence(drawn, mesh, request)
    generate_sequence(drawn, again, request)
    with h5py.File(exact) as one, h5py.File(mesh) as other, h5py.File(again) as third:
        assert other.attrs["world"] == "yard"
        assert other.attrs["scene_digest"] == drawn.digest != one.attrs["scene_digest"]
        depths = [file["path/depth"][...] for file in (one, other)]
        same = np.isfinite(depths[0]) & np.isfinite(depths[1])
        assert same.mean() > 0.4
        relative = np.abs(depths[1] / depths[0] - 1)[same]
        assert np.quantile(relative, 0.99) < 1e-6
        rgb = [file["path/rgb"][...].astype(float) for file in (one, other)]
        assert np.sqrt(((rgb[0] - rgb[1]) ** 2).mean()) < 3.0
        events = [len(file["path/events/t"]) for file in (one, other)]
        assert events[1] == pytest.approx(events[0], rel=0.1)
        for key in ("path/rgb", "path/depth", "path/events/t", "path/events/x", "path/flow/50hz"):
            np.testing.assert_array_equal(third[key][...], other[key][...])


@pytest.mark.usefixtures("opengl")
def test_the_scene_may_set_its_detail(yard: Scene) -> None:
    """``[mesh]`` goes before the quality."""
    drawn = replace(yard, renderer="mesh", light=AMBIENT, mesh=MeshDetail(precision="8bit", colour_factor=1))
    world = render_surroundings(drawn, surroundings_of(drawn), "draft", np.zeros((1, 3)))
    T_world_camera = LOOKING_EAST.copy()
    T_world_camera[2, 3] = 1.5
    image = world.rgb_dn(camera(), T_world_camera)
    codes = 255 * (image / 255) ** (1 / 2.2)
    np.testing.assert_allclose(codes, np.rint(codes), atol=1e-3)
