"""Pictures painted by rule: noise as ordered, flakes without a seam, stones and letters in their places."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_generator.mesh.places.materials import MATERIALS
from fedora_generator.mesh.places.paint import between, courses, flakes, flat, fractal, lettering


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
    assert (sign * np.arange(240)).sum() / weight == pytest.approx(119.5, abs=2)
    assert (sign * np.arange(60)[:, None]).sum() / weight == pytest.approx(29.5, abs=2)


def test_two_deviations_reach_either_colour() -> None:
    """Closed form of the mix."""
    mixed = between(np.float32([[-2, 0, 2, 5]]), (0, 0, 0), (1, 0.5, 0.2))
    assert np.allclose(mixed[0], [(0, 0, 0), (0.5, 0.25, 0.1), (1, 0.5, 0.2), (1, 0.5, 0.2)])


def test_a_picture_follows_from_its_seed() -> None:
    """The same numbers paint the same leaves, bit for bit, and others paint other ones."""
    leaves = MATERIALS["leaves"]
    once, again, other = (leaves.picture(np.random.default_rng(seed), leaves.shape) for seed in (4, 4, 5))
    assert np.array_equal(once, again)
    assert not np.array_equal(once, other)
