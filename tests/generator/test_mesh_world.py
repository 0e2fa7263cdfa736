"""Pixels of the mesh world against closed form."""

import hashlib
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from fedora_generator.mesh.model import MeshDetail
from fedora_generator.mesh.world import MeshWorld
from fedora_generator.surfaces.light import WHITE_DN
from fedora_generator.surfaces.world import Lamp
from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from tests.generator.mesh_cases import AMBIENT, LOOKING_EAST, camera, grey, model, wall

pytestmark = pytest.mark.usefixtures("opengl")

HALF_FLOAT = 2.0**-11
"""Relative rounding of a texel."""


def test_a_wall_has_its_depth_at_every_pixel() -> None:
    """1/z is right to float32, wherever in the image, from 6 cm to 5 km."""
    for x_m in (0.06, 0.1, 30.0, 5000.0):
        world = MeshWorld.of(model(wall(grey(), x_m=x_m, half_m=x_m)), AMBIENT)
        np.testing.assert_allclose(world.inverse_depth_per_m(camera(), LOOKING_EAST), 1 / x_m, rtol=1e-6)


def test_the_sky_has_no_depth_and_goes_with_the_sine_of_the_elevation() -> None:
    """Row by row as the light says, averaged over the pixel; 1/z is 0."""
    lens = camera()
    world = MeshWorld.of(model(wall(grey(), x_m=-4.0)), AMBIENT)
    rows = np.arange(lens.height) + np.linspace(-0.5, 0.5, 1001)[:, None]
    columns = lens.width // 2
    right, down = (columns - lens.K[0, 2]) / lens.K[0, 0], (rows - lens.K[1, 2]) / lens.K[1, 1]
    sine = np.maximum(-down / np.sqrt(1 + right**2 + down**2), 0).mean(axis=0)[:, None]
    horizon, zenith = np.array(AMBIENT.sky_horizon_rgb), np.array(AMBIENT.sky_zenith_rgb)
    expected_dn = WHITE_DN * (horizon + sine * (zenith - horizon))
    np.testing.assert_allclose(world.rgb_dn(lens, LOOKING_EAST)[:, columns], expected_dn, atol=0.05)
    assert not world.inverse_depth_per_m(lens, LOOKING_EAST).any()


def test_a_surface_shines_by_lambert() -> None:
    """Ambient, sun by the cosine, and a lamp by the softened inverse square, times the reflectance."""
    light = replace(
        AMBIENT, ambient=0.2, sun_strength=0.5, sun_azimuth_deg=180.0, sun_elevation_deg=60.0, lamp_scale=2.0
    )
    lamp = Lamp(position_m=(1.0, 0.0, 0.0), strength=1.5)
    world = MeshWorld.of(model(wall(grey(0.4), x_m=4.0), lamps=(lamp,)), light)
    lens = camera(361, 361)  # pixels so small that their mean is the value at their centre
    away_m = 4.0 * np.arange(0, 180, 30) / lens.K[0, 0]
    lamp_light = 2.0 * 1.5 * 3.0 / (away_m**2 + 3.0**2 + light.lamp_radius_m**2) ** 1.5
    expected_dn = WHITE_DN * 0.4 * (0.2 + 0.5 * 0.5 + lamp_light)
    np.testing.assert_allclose(world.luma_dn(lens, LOOKING_EAST)[180, 180:360:30], expected_dn, rtol=HALF_FLOAT)


def test_a_lamp_behind_a_wall_gives_it_nothing() -> None:
    """Only the side that faces the lamp is lit."""
    night = replace(AMBIENT, ambient=0.01, lamp_scale=1.0)
    lamp = Lamp(position_m=(6.0, 0.0, 0.0), strength=50.0)
    world = MeshWorld.of(model(wall(grey(1.0)), lamps=(lamp,)), night)
    np.testing.assert_allclose(world.luma_dn(camera(), LOOKING_EAST), 0.01 * WHITE_DN, rtol=1e-5)


def test_emission_is_added_everywhere() -> None:
    """A window that shines by itself needs no light."""
    world = MeshWorld.of(model(wall(grey(0.5), emission_rgb=(0.1, 0.2, 0.3))), AMBIENT)
    np.testing.assert_allclose(
        world.rgb_dn(camera(), LOOKING_EAST),
        np.broadcast_to(WHITE_DN * np.array([0.6, 0.7, 0.8]), (27, 36, 3)),
        rtol=1e-5,
    )


def test_only_two_sided_meshes_are_seen_from_behind() -> None:
    """From behind, the normal is turned: the sun behind the camera lights what it sees."""
    light = replace(AMBIENT, ambient=0.2, sun_strength=0.5, sun_azimuth_deg=0.0, sun_elevation_deg=0.0)
    from_behind = np.diag([-1.0, -1.0, 1.0, 1.0]) @ LOOKING_EAST
    from_behind[0, 3] = 8.0
    for two_sided, expected in ((True, 1 / 4.0), (False, 0.0)):
        world = MeshWorld.of(model(wall(grey(1.0), two_sided=two_sided)), light)
        assert world.inverse_depth_per_m(camera(), from_behind)[13, 18] == pytest.approx(expected)
        if two_sided:
            assert world.luma_dn(camera(), from_behind)[13, 18] == pytest.approx(0.7 * WHITE_DN, rel=1e-5)


def test_radiance_does_not_depend_on_the_direction_of_view() -> None:
    """Brightness constancy: what flow and events rest on."""
    world = MeshWorld.of(model(wall(grey(0.7))), replace(AMBIENT, sun_strength=0.5, sun_azimuth_deg=200.0))
    turned = LOOKING_EAST.copy()
    turned[:3, :3] = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]) @ turned[:3, :3]
    assert world.luma_dn(camera(), turned)[13, 18] == pytest.approx(
        world.luma_dn(camera(), LOOKING_EAST)[13, 18], rel=1e-6
    )


@pytest.mark.parametrize("share", [0.1, 0.25, 0.5, 0.85])
def test_an_edge_shares_its_pixel_by_area(share: float) -> None:
    """An integer is a pixel's centre; a pixel that a wall covers to a share shows that share of both radiances."""
    lens = camera()
    column = 20
    edge_px = column + 0.5 - share
    world = MeshWorld.of(
        model(
            wall(grey(0.2), x_m=8.0, half_m=40.0),
            wall(grey(0.8), right_of_y_m=-4.0 * (edge_px - lens.K[0, 2]) / lens.K[0, 0]),
        ),
        AMBIENT,
        MeshDetail(colour_factor=8),
    )
    row_dn = world.rgb_dn(lens, LOOKING_EAST)[13, :, 0] / WHITE_DN
    np.testing.assert_allclose(row_dn[:column], 0.2, rtol=HALF_FLOAT)
    np.testing.assert_allclose(row_dn[column + 1 :], 0.8, rtol=HALF_FLOAT)
    assert row_dn[column] == pytest.approx(0.2 + 0.6 * share, abs=0.6 / 32)  # 8 fragments of 4 samples
    depth = world.inverse_depth_per_m(lens, LOOKING_EAST)[13]
    assert depth[column] == pytest.approx(1 / 4.0 if share >= 0.5 else 1 / 8.0)  # never a mixture


def test_texture_rows_go_along_v_and_repeat_or_go_on() -> None:
    """(0, 0) is the outer corner of the first texel; beyond 1 the texture begins again, or its last texel goes on."""
    checks = np.zeros((2, 2, 3), dtype=np.float32)
    checks[0, 0], checks[0, 1], checks[1, 0], checks[1, 1] = 0.1, 0.3, 0.5, 0.7
    lens = camera(4, 4)
    half_m = 4.0 * 2 / lens.K[0, 0]  # the wall just fills the image: two pixels a quarter of it
    base = wall(np.repeat(np.repeat(checks, 128, axis=0), 128, axis=1), half_m=half_m)
    image = MeshWorld.of(model(base), AMBIENT).rgb_dn(lens, LOOKING_EAST)[..., 0] / WHITE_DN
    # The outermost quarter of a pixel sees across the border, as the texture repeats: its filter is that wide.
    np.testing.assert_allclose(image[::3, ::3], [[0.1, 0.3], [0.5, 0.7]], atol=0.03)
    shifted = replace(base, uv=base.uv + np.array([1.0, 0.0]))
    again = MeshWorld.of(model(shifted), AMBIENT).rgb_dn(lens, LOOKING_EAST)[..., 0] / WHITE_DN
    np.testing.assert_allclose(again, image, atol=1e-3)
    going_on = MeshWorld.of(model(replace(shifted, repeats=False)), AMBIENT).rgb_dn(lens, LOOKING_EAST)[..., 0]
    np.testing.assert_allclose(going_on[::3, ::3] / WHITE_DN, [[0.3, 0.3], [0.7, 0.7]], atol=1e-3)


def test_a_fine_texture_far_away_has_its_mean() -> None:
    """Texels much smaller than a pixel are averaged in linear light, and do not sparkle."""
    texels = np.random.default_rng(0).random((256, 256, 3)).astype(np.float32)
    texture = wall(texels, x_m=50.0, half_m=100.0)
    world = MeshWorld.of(model(replace(texture, uv=40 * texture.uv)), AMBIENT)
    np.testing.assert_allclose(
        world.rgb_dn(camera(), LOOKING_EAST),
        np.broadcast_to(WHITE_DN * texels.mean(axis=(0, 1)), (27, 36, 3)),
        rtol=0.02,
    )


def test_luma_weighs_linear_colours() -> None:
    """Luma is the weighted sum of what the colour camera sees."""
    red = np.array([[[0.9, 0.1, 0.3]]], dtype=np.float32)
    world = MeshWorld.of(model(wall(red)), AMBIENT)
    expected_dn = WHITE_DN * np.array(LUMA_WEIGHTS_RGB) @ red[0, 0]
    np.testing.assert_allclose(world.luma_dn(camera(), LOOKING_EAST), expected_dn, rtol=1e-3)


def test_eight_bits_round_and_floats_do_not() -> None:
    """8 bits leave values that are gamma-decoded whole numbers; floats keep what the texel has."""
    values = {
        precision: float(
            MeshWorld.of(model(wall(grey(0.4321))), AMBIENT, MeshDetail(precision=precision, event_factor=1)).luma_dn(
                camera(), LOOKING_EAST
            )[13, 18]
        )
        for precision in ("float", "8bit")
    }
    code = round(255 * 0.4321 ** (1 / 2.2))
    assert values["8bit"] == pytest.approx(WHITE_DN * (code / 255) ** 2.2, rel=1e-5)
    assert values["float"] == pytest.approx(WHITE_DN * 0.4321, rel=HALF_FLOAT)
    assert abs(values["8bit"] - WHITE_DN * 0.4321) > 1e-2


def test_bands_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    """An image that is drawn in bands of rows is the one drawn at once, but for the rounding of the level of detail."""
    texels = np.random.default_rng(1).random((64, 64, 3)).astype(np.float32)
    world = MeshWorld.of(model(wall(texels)), AMBIENT)
    at_once = world.rgb_dn(camera(36, 108), LOOKING_EAST)
    monkeypatch.setattr("fedora_generator.mesh.rasteriser.MOST_FRAGMENTS", 36 * 4 * 32)
    in_bands = world.rgb_dn(camera(36, 108), LOOKING_EAST)
    np.testing.assert_allclose(in_bands, at_once, atol=0.01)


_PRINT_DIGEST = """
import hashlib, numpy as np
from tests.generator.mesh_cases import *
from fedora_generator.mesh.world import MeshWorld
texels = np.random.default_rng(2).random((64, 64, 3)).astype(np.float32)
world = MeshWorld.of(model(wall(texels), wall(grey(), x_m=3.0, right_of_y_m=0.1)), AMBIENT)
print(hashlib.sha256(world.rgb_dn(camera(200, 150), LOOKING_EAST).tobytes()).hexdigest())
"""


def test_the_number_of_threads_changes_no_bit() -> None:
    """One thread of Mesa's rasteriser, or two: the same image."""
    digests = set()
    for threads in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", _PRINT_DIGEST],
            env={**os.environ, "LP_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        )
        digests.add(done.stdout)
    assert len(digests) == 1
    assert len(digests.pop().strip()) == 2 * hashlib.sha256().digest_size
