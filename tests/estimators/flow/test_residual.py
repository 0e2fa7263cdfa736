"""The residual flow of tiles: recovered in pixels, unbiased, with errors that bound what noise does."""

import numpy as np
import pytest

from fedora_qa.estimators.flow.residual import (
    TileGrid,
    TileResiduals,
    patches_of,
    pixels_of,
    solved,
    sums_of_tiles,
    tile_residuals,
)
from fedora_qa.estimators.flow.warp import read_at_pixels, read_between, smooth

SIZE = 240
_RNG = np.random.default_rng(11)
_WAVES = _RNG.uniform(-1.2, 1.2, (300, 2))
_AMPLITUDES = 1 / (np.hypot(*_WAVES.T) + 0.1)
_PHASES = _RNG.uniform(0, 2 * np.pi, 300)


def texture(shift_px: tuple[float, float] = (0.0, 0.0), contrast_dn: float = 30.0) -> np.ndarray:
    """A texture with a spectrum that falls as 1/frequency, in closed form, moved right and down by the shift."""
    places = np.arange(SIZE, dtype=float)
    columns = np.exp(1j * np.outer(_WAVES[:, 0], places - shift_px[0]) + 1j * _PHASES[:, None]) * _AMPLITUDES[:, None]
    image = (np.exp(1j * np.outer(_WAVES[:, 1], places - shift_px[1])).T @ columns).real
    return np.asarray(128 + contrast_dn * image / np.sqrt((_AMPLITUDES**2).sum() / 2), dtype=np.float32)


def measure(before: np.ndarray, after: np.ndarray, flow_px: tuple[float, float], variance_dn2: float) -> TileResiduals:
    """Residuals of a constant flow between two images."""
    origins = TileGrid.of(SIZE, SIZE).origins
    columns, rows = pixels_of(origins)
    flat = (-1, columns.shape[-1])
    at_columns, at_rows = (
        (places + np.float64(shift)).astype(np.float32).reshape(flat)
        for places, shift in zip((columns, rows), flow_px, strict=True)
    )
    warped = read_between(smooth(after), at_columns, at_rows).reshape(columns.shape)
    first = patches_of(read_at_pixels(smooth(before)), origins)
    return tile_residuals(first, warped, np.ones((len(origins), 32, 32), dtype=bool), variance_dn2)


@pytest.mark.parametrize("true_px", [(0.25, -0.4), (3.5, 2.25), (-7.1, 0.0)])
def test_right_flow_leaves_nothing(true_px: tuple[float, float]) -> None:
    """8-bit frames and the true flow: every tile within 0.02 px, their mean within 0.001 px."""
    before, after = np.rint(texture()), np.rint(texture(true_px))
    errors = measure(before, after, true_px, 1 / 12).flow_errors_px
    assert np.abs(errors).max() < 0.02
    assert np.abs(errors.mean(axis=0)).max() < 1e-3


@pytest.mark.parametrize("wrong_px", [(0.1, 0.0), (-0.3, 0.2), (0.0, -0.6)])
def test_error_of_the_flow_is_measured(wrong_px: tuple[float, float]) -> None:
    """Flow that is off by less than a pixel is measured to 10%, with its sign: stored minus true."""
    errors = measure(texture(), texture((2.3, 1.1)), (2.3 + wrong_px[0], 1.1 + wrong_px[1]), 1 / 12).flow_errors_px
    np.testing.assert_allclose(np.median(errors, axis=0), wrong_px, atol=0.1 * np.hypot(*wrong_px))


def test_noise_stays_within_the_stated_errors() -> None:
    """White noise of 1 DN: errors over their stated standard errors spread by at most 1, and by no less than 0.4."""
    rng = np.random.default_rng(5)
    scaled = []
    for _ in range(6):
        before, after = (texture(shift) + rng.standard_normal((SIZE, SIZE)) for shift in ((0.0, 0.0), (1.5, 0.5)))
        result = measure(before.astype(np.float32), after.astype(np.float32), (1.5, 0.5), 1.0)
        scaled.append(result.flow_errors_px / np.sqrt(np.diagonal(result.noise_covariances_px2, axis1=1, axis2=2)))
    assert 0.4 < np.std(scaled) < 1.0
    assert abs(np.mean(scaled)) < 5 / np.sqrt(np.size(scaled))


def test_exposure_does_not_matter() -> None:
    """A gain of 5% and 3 DN more light change no tile by more than 0.01 px."""
    plain = measure(texture(), texture((1.2, 0.3)), (1.2, 0.3), 1 / 12).flow_errors_px
    brighter = measure(texture(), 1.05 * texture((1.2, 0.3)) + 3, (1.2, 0.3), 1 / 12).flow_errors_px
    np.testing.assert_allclose(brighter, plain, atol=0.01)


def test_unrelated_frames_are_unexplained() -> None:
    """Nothing in common: more than half of the contrast is left in every tile; the right flow leaves less than 1%."""
    other = texture()[::-1, ::-1].copy()
    assert measure(texture(), other, (0.0, 0.0), 1 / 12).unexplained.min() > 0.5
    assert measure(texture(), texture((2.5, 0.0)), (2.5, 0.0), 1 / 12).unexplained.max() < 0.01


def test_plain_wall_says_that_it_cannot_tell() -> None:
    """Without texture the stated error is far beyond a pixel, and nothing divides by zero."""
    wall = np.full((SIZE, SIZE), 80.0, dtype=np.float32)
    result = measure(wall, wall, (0.0, 0.0), 1 / 12)
    assert np.isfinite(result.flow_errors_px).all()
    assert np.linalg.eigvalsh(result.noise_covariances_px2)[:, 1].min() > 100


def test_stripes_say_along_which_direction_they_cannot_tell() -> None:
    """Vertical stripes give u and not v."""
    stripes = np.broadcast_to(100 + 40 * np.cos(0.5 * np.arange(SIZE)), (SIZE, SIZE)).astype(np.float32)
    covariances = measure(stripes, stripes, (0.0, 0.0), 1 / 12).noise_covariances_px2
    assert np.sqrt(covariances[:, 0, 0]).max() < 0.01
    assert np.sqrt(covariances[:, 1, 1]).min() > 1.0


def test_unused_pixels_do_not_count() -> None:
    """Garbage under the mask changes nothing, and the share of valid pixels is told."""
    rng = np.random.default_rng(6)
    before = rng.uniform(0, 255, (3, 36, 36)).astype(np.float32)
    warped = (before + rng.standard_normal(before.shape)).astype(np.float32)
    valid = np.ones((3, 32, 32), dtype=bool)
    valid[:, :, 16:] = False
    spoilt = warped.copy()
    spoilt[:, :, 24:] = 1e4
    clean, masked = (tile_residuals(before, w, valid, 1.0) for w in (warped, spoilt))
    np.testing.assert_allclose(masked.flow_errors_px, clean.flow_errors_px, atol=1e-5)
    assert masked.valid_share.tolist() == [0.5] * 3


def test_sums_are_those_of_plain_arrays() -> None:
    """Products of slopes, 1, level and difference over the valid pixels, each formed apart in double precision."""
    rng = np.random.default_rng(2)
    before, warped = (rng.uniform(0, 255, (3, 36, 36)).astype(np.float32) for _ in range(2))
    valid = rng.uniform(size=(3, 32, 32)) < 0.7
    valid[2] = False
    mean = 0.5 * (before.astype(np.float64) + warped)
    inner = (slice(None), slice(2, -2), slice(2, -2))
    taps = np.array([1, -8, 0, 8, -1]) / 12
    across, down = (
        np.apply_along_axis(lambda line: np.convolve(line, taps[::-1], "valid"), axis, mean) for axis in (2, 1)
    )
    counts = np.maximum(valid.sum(axis=(1, 2)), 1)
    level = mean[inner] - ((mean[inner] * valid).sum(axis=(1, 2)) / counts)[:, None, None]
    difference = warped[inner].astype(np.float64) - before[inner]
    design = np.stack((across[:, 2:-2], down[:, :, 2:-2], np.ones_like(level), level, difference), axis=1)
    design = (design * valid[:, None]).reshape(3, 5, -1)
    expected = design @ design.transpose(0, 2, 1)
    np.testing.assert_allclose(sums_of_tiles(before, warped, valid, 2), expected, rtol=1e-4, atol=1.0)


def test_normal_equations_are_solved_as_numpy_does() -> None:
    """Also where the matrix asks for another pivot than the first."""
    rng = np.random.default_rng(8)
    roots = rng.normal(size=(40, 5, 7)) * 10.0 ** rng.uniform(-2, 2, (40, 5, 1))
    roots[0, 0, 1:], roots[0, 0, 0], roots[0, 1, 0] = 0.0, 1e-7, 1e3
    sums = roots @ roots.transpose(0, 2, 1)
    matrix, vector = sums[:, :4, :4].copy(), sums[:, :4, 4]
    matrix += np.eye(4) * (1e-9 * np.trace(matrix, axis1=1, axis2=2) + 1e-9)[:, None, None]
    errors, inverses, left, variances = solved(sums, 1e-3, 12.0)
    sizes = np.linalg.solve(matrix, vector[:, :, None])[:, :, 0]
    np.testing.assert_allclose(errors, sizes[:, :2], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(inverses, np.linalg.inv(matrix)[:, :2, :2], rtol=1e-6, atol=1e-9)
    rest = np.maximum(sums[:, 4, 4] - np.sum(sizes * vector, axis=1), 0.0)
    np.testing.assert_allclose(left, rest, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(variances, np.maximum(12 * left / np.maximum(sums[:, 2, 2] - 4, 1), 1e-3))


@pytest.mark.parametrize(("height", "width", "count"), [(540, 720, 16 * 22), (48, 48, 1), (47, 200, 0), (10, 10, 0)])
def test_grid_holds_whole_tiles_clear_of_the_border(height: int, width: int, count: int) -> None:
    """As many as fit 8 px clear of the border; none in an image that is too small."""
    grid = TileGrid.of(height, width)
    assert len(grid.origins) == count
    if count:
        assert grid.origins.min() >= 8
        assert (grid.origins.max(axis=0) + 32 <= np.array([width, height]) - 8).all()


def test_sample_depends_on_the_seed_only() -> None:
    """The same share and seed give the same tiles; other fields other tiles; all of them at share 1."""
    grid = TileGrid.of(540, 720)
    first, again, other = grid.sample(0.25, 25, 7), grid.sample(0.25, 25, 7), grid.sample(0.25, 25, 8)
    assert len(first) == 88
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    np.testing.assert_array_equal(grid.sample(1.0, 1), grid.origins)
    assert len(grid.sample(1e-9, 1)) == 1


@pytest.mark.parametrize("channels", [(), (2,)])
def test_patches_are_the_pixels_they_name(channels: tuple[int, ...]) -> None:
    """`patches_of` an image is that image at the columns and rows of `pixels_of`."""
    image = np.random.default_rng(0).random((90, 120, *channels))
    origins = TileGrid.of(90, 120).origins
    columns, rows = pixels_of(origins)
    np.testing.assert_array_equal(patches_of(image, origins), image[rows, columns])
