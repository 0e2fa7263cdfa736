"""The truth that timing is measured against, itself against closed forms."""

import math

import numpy as np
import pytest

from tests.benchmarks.closed_form_events import true_events
from tests.benchmarks.timing_scenes import TEXTURES, TimingScene

TIMES_S = np.linspace(0, 0.2, 401)


def test_a_sinusoid_crosses_at_its_arc_sines() -> None:
    """A sin(2 pi 5 t) for 0.19 s: up to 1.0, down to -1.0 and back, at the times that arc sine gives to 1e-12 s."""
    times_s = TIMES_S[:381]
    signal = lambda t: 1.07 * math.sin(10 * math.pi * t)  # noqa: E731
    events = true_events(signal, times_s, np.array([signal(t) for t in times_s.tolist()]), 0.2)
    rising, falling = 0.2 * np.arange(1, 6), 0.2 * np.arange(4, -6, -1)
    back = 0.2 * np.arange(-4, -1)
    phases = [*np.arcsin(rising / 1.07), *(np.pi - np.arcsin(falling / 1.07)), *(2 * np.pi + np.arcsin(back / 1.07))]
    assert events is not None
    assert [p for _, p in events] == [1] * 5 + [0] * 10 + [1] * 3
    np.testing.assert_allclose([t for t, _ in events], np.array(phases) / (10 * np.pi), atol=1e-12)


@pytest.mark.parametrize(("amplitude", "count"), [(0.6 + 1e-6, 3), (0.6 - 1e-6, 2), (0.6 + 1e-11, None)])
def test_turning_points_are_found_between_samples(amplitude: float, count: int | None) -> None:
    """A hill whose top lies between two samples reaches a level that no sample does; a top that ties has no truth."""
    signal = lambda t: amplitude * math.exp(-(((t - 0.10013) / 0.02) ** 2))  # noqa: E731
    times_s = TIMES_S[:202]  # up to just beyond the top
    samples = np.array([signal(t) for t in times_s.tolist()])
    events = true_events(signal, times_s, samples, 0.2)
    assert samples.max() < 0.6
    assert (None if events is None else sum(p for _, p in events)) == count


@pytest.mark.parametrize("texture", TEXTURES)
def test_a_pixel_alone_is_that_of_the_image(texture: str) -> None:
    """The image of a camera with one pixel is the pixel of the whole image, to rounding."""
    scene = TimingScene.named(texture)
    image = np.log(scene.luma_dn(0.0123))
    for column, row in ((0, 0), (17, 22), (39, 29)):
        assert scene.log_luma(column, row, 0.0123) == pytest.approx(image[row, column], rel=1e-12)
