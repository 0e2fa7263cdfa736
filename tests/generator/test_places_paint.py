"""Pictures painted by rule: noise as ordered, and no seam where they repeat."""

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_generator.mesh.places.materials import MATERIALS, Material
from fedora_generator.mesh.places.paint import between, courses, flakes, flat, fractal, lettering
from fedora_generator.mesh.places.park import PARK_MATERIALS
from fedora_generator.mesh.places.racetrack import RACETRACK_MATERIALS

ALL: Mapping[str, Material] = {**MATERIALS, **PARK_MATERIALS, **RACETRACK_MATERIALS}


@given(seed=st.integers(0, 1000), slope=st.floats(0, 2), longest=st.floats(8, 64))
@settings(max_examples=25)
def test_noise_lies_in_its_band(seed: int, slope: float, longest: float) -> None:
    """Mean 0, standard deviation 1, and no power at wavelengths outside the band (by numpy's own transform)."""
    noise = fractal(np.random.default_rng(seed), (64, 96), slope, longest, shortest_px=4.0)
    frequencies = np.hypot(np.fft.fftfreq(64)[:, None], np.fft.fftfreq(96)[None, :])
    outside = (frequencies > 0.2501) | (frequencies < 0.9999 / longest)
    assert noise.mean() == pytest.approx(0, abs=1e-5)
    assert noise.std() == pytest.approx(1, abs=1e-4)
    assert np.abs(np.fft.fft2(noise.astype(np.float64)))[outside].max() < 1e-2


def test_flakes_continue_across_the_edges() -> None:
    """The same flakes on a picture rolled by half of its size would look the same: what leaves enters opposite."""
    picture = flakes(np.random.default_rng(2), flat((64, 64), (0, 0, 0)), 1, 60.0, 60.0, [(1.0, 1.0, 1.0)])
    assert picture.max() > 0.5
    columns, rows = (np.flatnonzero(picture.max(axis=(axis, 2)) > 0.1) for axis in (0, 1))
    gaps = [int((np.diff(np.append(found, found[0] + 64)) > 1).sum()) for found in (columns, rows)]
    assert max(gaps) <= 1


def test_courses_number_whole_stones() -> None:
    """Each stone has one tone, and as many tones occur as there are stones."""
    tones, joints, down = courses(np.random.default_rng(1), (64, 96), rows=4, columns=6, joint_px=2.0)
    assert len(np.unique(tones)) == 24
    assert 0 <= joints.min() < joints.max() <= 1
    assert np.allclose(down[:, 0], ((np.arange(64) + 0.5) / 16) % 1, atol=1e-6)


def test_lettering_stands_in_the_middle() -> None:
    """What is written is where it should be, and legible against its ground."""
    sign = lettering(flat((60, 240), (0, 0, 0)), "I", (1.0, 1.0, 1.0))[..., 0]
    weight = sign.sum()
    assert (sign * np.arange(240)).sum() / weight == pytest.approx(119.5, abs=12)
    assert (sign * np.arange(60)[:, None]).sum() / weight == pytest.approx(29.5, abs=4)


def test_two_deviations_reach_either_colour() -> None:
    """Closed form of the mix."""
    mixed = between(np.float32([[-2, 0, 2, 5]]), (0, 0, 0), (1, 0.5, 0.2))
    assert np.allclose(mixed[0], [(0, 0, 0), (0.5, 0.25, 0.1), (1, 0.5, 0.2), (1, 0.5, 0.2)])


@pytest.mark.parametrize("name", sorted(ALL))
def test_materials_repeat_without_a_seam(name: str) -> None:
    """The step over an edge is no larger than the largest between two rows or columns within; nothing is black,
    nothing shines by day, and nothing is without texture."""
    material = ALL[name]
    picture = material.picture(np.random.default_rng(1), material.shape).astype(np.float64)
    assert picture.shape == (*material.shape, 3)
    assert 0 < picture.min() <= picture.max() <= 1
    assert picture.std(axis=(0, 1)).max() > 0.02
    for axis in (0, 1):
        steps = np.abs(np.diff(picture, axis=axis, append=np.take(picture, [0], axis=axis)))
        means = steps.mean(axis=(1 - axis, 2))
        assert means[-1] <= 1.1 * means[:-1].max()
