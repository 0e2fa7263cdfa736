"""Gains: between two images of the same points, and after rounding, by the codes that are left out."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.estimators.images.gain import brightness_gain, gain_after_rounding, is_informative

Floats = NDArray[np.float64]


def image(seed: int = 0, shape: tuple[int, int] = (90, 120)) -> Floats:
    return np.random.default_rng(seed).uniform(30.0, 150.0, shape)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.5, 1.5), st.integers(0, 1000))
def test_gain_of_rounded_images_is_known_to_its_error(factor: float, seed: int) -> None:
    """Rounding to whole DN leaves the gain within five standard errors, which are below 0.1%."""
    before = image(seed)
    found = brightness_gain(np.rint(before), np.rint(factor * before))
    assert found is not None
    assert 0 < found.standard_error < 1e-3
    assert abs(found.log_gain - np.log(factor)) < 5 * found.standard_error


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000))
def test_gain_changes_its_sign_with_the_order(seed: int) -> None:
    """Exchanging the images negates the gain, since pixels are chosen by both alike."""
    one, other = image(seed), 1.2 * image(seed) + np.random.default_rng(seed + 1).normal(0, 2, (90, 120))
    forth, back = brightness_gain(one, other), brightness_gain(other, one)
    assert forth is not None
    assert back is not None
    assert forth.log_gain == pytest.approx(-back.log_gain, abs=1e-12)
    assert forth.standard_error == pytest.approx(back.standard_error)


def test_what_changes_in_a_third_of_the_image_does_not_matter() -> None:
    """A third of the tiles that show something else leave the median where it is."""
    before = image()
    after = 1.1 * before
    after[:30] = 200.0 - before[:30]
    found = brightness_gain(before, after)
    assert found is not None
    assert found.log_gain == pytest.approx(np.log(1.1), abs=1e-9)


@pytest.mark.parametrize("loss", [0.02, 0.1, -0.05])
def test_a_step_of_vignetting_is_told_from_an_even_step(loss: float) -> None:
    """The gain in the corner is 1 less the loss; in either case the right model is a thousand times likelier."""
    before = image()
    rows, columns = np.mgrid[:90, :120] - np.array([44.5, 59.5])[:, np.newaxis, np.newaxis]
    squares = (rows**2 + columns**2) / (45.0**2 + 60.0**2)
    vignetted, even = (brightness_gain(before, before * gain) for gain in (1 - loss * squares, 1 - loss))
    assert vignetted is not None
    assert even is not None
    assert vignetted.corner_log_gain == pytest.approx(np.log(1 - loss), rel=0.1)
    assert vignetted.corner_evidence > np.log(1e3)
    assert even.corner_evidence < -np.log(1e3)


def test_images_without_a_gain_are_no_evidence_of_vignetting() -> None:
    """Noise alone makes neither of the two models a thousand times likelier; equal images favour neither at all."""
    noise = np.random.default_rng(5).normal(0, 2, (90, 120))
    equal, noisy = (brightness_gain(image(), image() + added) for added in (0.0, noise))
    assert equal is not None
    assert noisy is not None
    assert equal.corner_evidence == 0.0
    assert abs(noisy.corner_evidence) < np.log(1e3)


def test_a_histogram_tells_where_neighbours_of_codes_are_frequent() -> None:
    """Forty codes with fifty values each beside them are enough; the ends, which clipping fills, do not count."""
    counts = np.zeros(256, np.int64)
    counts[10:52] = 50
    assert is_informative(counts)
    counts[10] = 49
    assert not is_informative(counts)
    ends = np.zeros(256, np.int64)
    ends[:42] = 50  # code 1 has no neighbour that counts
    assert not is_informative(ends)
    ends[42] = 50
    assert is_informative(ends)
    assert is_informative(ends[::-1])


def test_standard_error_is_that_of_repetition() -> None:
    """With noise, gains scatter from image to image as their errors say."""
    rng = np.random.default_rng(3)
    found = [brightness_gain(image(i), image(i) + rng.normal(0, 5, (90, 120))) for i in range(60)]
    gains = np.array([one.log_gain for one in found if one is not None])
    claimed = np.mean([one.standard_error for one in found if one is not None])
    assert len(gains) == 60
    assert 0.6 < gains.std() / claimed < 1.5


@pytest.mark.parametrize("level", [0.0, 2.0, 254.0, np.nan], ids=["black", "dark", "clipped", "not shown"])
def test_what_tells_nothing_gives_no_gain(level: float) -> None:
    """Dark, clipped and missing pixels do not count; where nothing else is left there is no gain."""
    assert brightness_gain(np.full((90, 120), level), np.full((90, 120), level)) is None


def test_small_images_give_no_gain() -> None:
    """Too few pixels for tiles are no error."""
    assert brightness_gain(image(shape=(3, 4)), image(shape=(3, 4))) is None


def values(seed: int = 0, count: int = 200_000) -> np.ndarray:
    """Radiance of a scene of many shades, in DN, not rounded."""
    rng = np.random.default_rng(seed)
    return np.clip(rng.normal(110, 45, count), 0, 255)


def histogram(codes: np.ndarray) -> np.ndarray:
    return np.bincount(np.clip(np.rint(codes), 0, 255).astype(np.int64), minlength=256)


@pytest.mark.parametrize("percent", [3.0, -3.0, 9.0, 25.0, -12.0, 2.345, -4.321])
def test_a_gain_after_rounding_is_measured(percent: float) -> None:
    """Values that were rounded, multiplied and rounded again betray the gain to a part of a percent."""
    found = gain_after_rounding(histogram(np.rint(values()) * (1 + percent / 100)))
    assert found is not None
    assert found.gain == pytest.approx(1 + percent / 100, abs=found.half_range + 1e-9)
    assert found.half_range < 0.005


@pytest.mark.parametrize("percent", [3.0, 9.0, 25.0, -12.0, -4.321])
def test_the_range_of_a_gain_holds_gains_of_the_same_codes(percent: float) -> None:
    """All gains within it leave out, or put together, the same codes."""
    found = gain_after_rounding(histogram(np.rint(values()) * (1 + percent / 100)))
    assert found is not None

    def hits(share: float) -> NDArray[np.int64]:
        reached = np.rint((found.gain + share * found.half_range) * np.arange(30, 190)).astype(np.int64)
        return np.bincount(reached, minlength=256)[40:180]

    for share in (-0.99, 0.99):
        np.testing.assert_array_equal(hits(share), hits(0.0))


@settings(max_examples=30)
@given(st.floats(0.3, 3.0), st.integers(0, 2**32 - 1))
def test_a_gain_before_rounding_betrays_nothing(gain: float, seed: int) -> None:
    """Exposure of the sensor, before values are rounded, leaves no code out."""
    assert gain_after_rounding(histogram(gain * values(seed))) is None


@settings(max_examples=30)
@given(st.integers(2, 200), st.integers(0, 2**32 - 1))
@example(shades=144, seed=20157)  # three codes of 43 stand out as those of a gain of 0.835 do; others are absent
def test_few_shades_betray_nothing(shades: int, seed: int) -> None:
    """A scene of few flat colours, in whatever codes, is not taken for a gain."""
    rng = np.random.default_rng(seed)
    counts = np.zeros(256, np.int64)
    np.add.at(counts, rng.integers(0, 256, shades), rng.integers(1, 10_000, shades))
    assert gain_after_rounding(counts) is None


def test_a_curve_is_no_gain() -> None:
    """Codes of a display made from rounded linear values leave codes out, but not those of a gain."""
    codes = 255 * (np.rint(values()) / 255) ** (1 / 2.2)
    assert gain_after_rounding(histogram(codes)) is None


def test_an_empty_histogram_betrays_nothing() -> None:
    """Without values there is no gain."""
    assert gain_after_rounding(np.zeros(256, np.int64)) is None
