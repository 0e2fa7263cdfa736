"""Images read at some of their pixels agree with what OpenCV and NumPy make of all of them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.conventions import LUMA_WEIGHTS_RGB
from fedora_qa.estimators.images.event_colours import edge_aware_colours
from fedora_qa.estimators.images.luma import cut_off, luma_of, luma_of_linear
from fedora_qa.estimators.images.order import is_constant, reduced, reduced_flow
from fedora_qa.estimators.images.samples import RETURN_PX, along_the_flow, noise_variances, steepness, tracked_motion_px
from fedora_qa.estimators.images.values import count_not_finite, count_outside, positive_extremes
from tests.estimators.event_world import Checkers, Waves, footprints, weighted_means

Float32 = NDArray[np.float32]
RNG = np.random.default_rng(5)
NOISE_RNG = np.random.default_rng(4)
ODD = np.array([0.0, -0.0, -1.0, 1.0, 2.5, 30.0, np.inf, -np.inf, np.nan, 1e-40], np.float32)


def texture(height: int = 90, width: int = 120) -> Float32:
    return np.asarray(cv2.GaussianBlur(RNG.normal(100, 60, (height, width)).astype(np.float32), (0, 0), 0.8))


def test_steepness() -> None:
    """The steep places of a sample are those of the smoothed image, borders and chance aside."""
    image = texture(400, 500)
    down, right = np.gradient(cv2.GaussianBlur(image, (0, 0), 1.0))
    expected = np.percentile(np.hypot(right, down), 99.0)
    assert steepness(image, 99.0) == pytest.approx(expected, rel=0.05)


def test_steepness_of_a_ramp() -> None:
    """An even image has no slope, however bright, and a ramp of 3 by 4 DN a pixel one of 5, borders aside."""
    assert steepness(np.full((90, 120), 250, np.float32), 100.0) < 1e-4
    ramp = np.add.outer(4 * np.arange(90.0), 3 * np.arange(120.0)).astype(np.float32)
    assert steepness(ramp, 50.0) == pytest.approx(5.0, rel=1e-5)


def test_points_along_the_flow() -> None:
    """Both frames where a flow leads, averaged over 3 x 3, as blurring and remapping them whole gives them."""
    before, after = texture(), texture()
    flow_px = RNG.normal(0, 4, (90, 120, 2)).astype(np.float32)
    flow_px[10:20, 30:60] = np.nan
    first, second = along_the_flow(before, after, flow_px, 3)
    np.testing.assert_allclose(first, cv2.blur(before, (3, 3))[::3, ::3], rtol=1e-5)
    rows, columns = np.mgrid[0:90:3, 0:120:3].astype(np.float32)
    x, y = columns + flow_px[::3, ::3, 0], rows + flow_px[::3, ::3, 1]
    shown = (x >= 0) & (x <= 119) & (y >= 0) & (y <= 89)
    expected = cv2.remap(cv2.blur(after, (3, 3)), np.where(shown, x, 0), np.where(shown, y, 0), cv2.INTER_LINEAR)
    np.testing.assert_allclose(second, np.where(shown, expected, np.nan), atol=0.05)


def test_frames_off_the_grid_of_the_flow_are_refused() -> None:
    """A frame of another size than the flow is no place to read from."""
    with pytest.raises(ValueError, match="flow's grid"):
        along_the_flow(texture(), texture(80, 120), np.zeros((90, 120, 2), np.float32), 2)


@pytest.mark.parametrize(("step", "skip"), [(1, 1), (2, 1), (7, 1), (4, 2), (7, 3)])
def test_reduced_images_are_means_of_blocks(step: int, skip: int) -> None:
    """Of rows of a box, as OpenCV's area average has them; blocks with anything invalid in these do not count."""
    image, flow_px = texture(), RNG.normal(0, 4, (90, 120, 2)).astype(np.float32)
    flow_px[40, 50], flow_px[41, 80] = (np.nan, 1.0), (1e9, 0.0)
    box = left, top, right, bottom = 11, 5, 118, 84
    rows, columns = (bottom - top) // step, (right - left) // step

    def means(values: Float32) -> Float32:
        blocks = values[top : top + rows * step, left : left + columns * step]
        looked_at = np.arange(rows * step) % step % skip == 0
        cut = np.ascontiguousarray(blocks[looked_at])
        return np.asarray(cv2.resize(cut, (columns, rows), interpolation=cv2.INTER_AREA))

    np.testing.assert_allclose(reduced(image, box, step, skip), means(image), rtol=1e-5)
    speeds = np.hypot(flow_px[..., 0], flow_px[..., 1])
    bad = means((~(speeds < 1e4)).astype(np.float32)) > 0
    found, valid = reduced_flow(flow_px, box, step, skip, 1e4)
    expected = ~bad
    expected[:2], expected[-2:], expected[:, :2], expected[:, -2:] = False, False, False, False
    np.testing.assert_array_equal(valid, expected)
    np.testing.assert_allclose(step * found[valid], means(flow_px)[valid], atol=1e-4)


def test_one_value() -> None:
    """One pixel is enough for an image to be of more than one value."""
    image = np.full((5, 7), 3.0, np.float32)
    assert is_constant(image)
    image[4, 6] = 4.0
    assert not is_constant(image)


def test_luma_and_what_is_cut_off() -> None:
    """Luma is the weighted sum of what codes stand for; white in any channel may be cut off, and bright luma."""
    rgb = RNG.integers(0, 256, (30, 40, 3)).astype(np.uint8)
    linear = np.linspace(0, 255, 256) ** 2 / 255
    luma = luma_of(rgb, np.outer(LUMA_WEIGHTS_RGB, linear).astype(np.float32))
    np.testing.assert_allclose(luma, linear[rgb] @ np.array(LUMA_WEIGHTS_RGB), rtol=1e-5)
    np.testing.assert_array_equal(cut_off(rgb, luma, 200.0), (rgb == 255).any(axis=2) | (luma >= 200.0))


def test_linear_luma_is_that_of_the_table() -> None:
    """To the bit, for every code of every channel."""
    codes = np.arange(256, dtype=np.uint8)
    channels = codes, np.roll(codes, 77), codes[::-1]
    rgb = np.stack([np.tile(channel, 3).reshape(16, 48) for channel in channels], axis=-1)
    table = np.outer(LUMA_WEIGHTS_RGB, np.arange(256.0)).astype(np.float32)
    np.testing.assert_array_equal(luma_of_linear(rgb, np.array(LUMA_WEIGHTS_RGB)), luma_of(rgb, table))


def test_colours_of_single_footprints() -> None:
    """Those of the pixels that are asked for are those of the whole image."""
    K_frame = np.array([[90.0, 0, 59.5], [0, 90.0, 44.5], [0, 0, 1]])
    K_event = np.array([[40.0, 0, 25.5], [0, 40.0, 19.5], [0, 0, 1]])
    prints = footprints(K_frame, (90, 120), K_event, (40, 52))
    rgb, linear = RNG.integers(0, 256, (90, 120, 3)).astype(np.uint8), np.linspace(0, 255, 256) ** 2 / 255
    pixels = RNG.integers(0, 40 * 52, 200)
    whole = [np.maximum(weighted_means(prints, "edge_aware", linear[rgb[..., i]]), 0).ravel()[pixels] for i in range(3)]
    np.testing.assert_allclose(edge_aware_colours(prints, rgb, linear, pixels), np.stack(whole, axis=1), atol=1e-9)


def test_counts_of_odd_values() -> None:
    """Zeros of both signs, infinities, NaN and subnormal numbers are counted as NumPy counts them."""
    u, v = (part.ravel() for part in np.meshgrid(ODD, ODD))
    nan, infinite, beyond = count_not_finite(np.stack((u, v), axis=-1), 2.0)
    far = [np.isfinite(part) & (np.abs(part) > 2) for part in (u, v)]
    assert beyond == np.count_nonzero(far[0] | far[1]) > 0
    assert count_not_finite(np.stack((u, v), axis=-1)) == (nan, infinite, 0)
    assert nan == np.count_nonzero(np.isnan(u) | np.isnan(v))
    assert infinite == np.count_nonzero(np.isinf(u) | np.isinf(v))
    outside = int(np.count_nonzero(~((ODD >= 1) & (ODD <= 30)) & ~np.isnan(ODD)))
    assert count_outside(ODD, 1.0, 30.0) == (1, outside)
    assert positive_extremes(np.array([0.0, -2.0, np.nan, np.inf], np.float32)) is None
    for near, within in (
        ((), []),
        (((2.0, 30.0),), [2.5, 30.0]),
        (((3.0, 4.0),), []),
        (((2.0, 3.0), (29.0, 31.0)), [2.5, 30.0]),
    ):
        least, most, found = positive_extremes(ODD, near) or (0.0, 0.0, ODD)
        assert (least, most, found.tolist()) == (float(np.float32(1e-40)), 30.0, within)


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 12_000))
def test_values_near_two_ends_are_picked_out(seed: int, count: int) -> None:
    """Wherever they stand in a long row of values, those within either range are found, in their order."""
    values = np.random.default_rng(seed).normal(5, 3, count).astype(np.float32)
    least, most, found = positive_extremes(values, ((0.5, 0.75), (9.0, 12.0))) or (np.inf, 0.0, values[:0])
    within = values[((values >= 0.5) & (values <= 0.75)) | ((values >= 9) & (values <= 12))]
    np.testing.assert_array_equal(found, within)
    assert (least, most) == (min(values[values > 0], default=np.inf), max(values[values > 0], default=0.0))


@pytest.mark.parametrize("sigma_dn", [0.3, 1.0, 5.0])
def test_white_noise_is_measured(sigma_dn: float) -> None:
    """Over 200 patches of 32 px the mean variance is right to 3%."""
    noise = NOISE_RNG.normal(0.0, sigma_dn, (200, 32, 32)).astype(np.float32)
    assert noise_variances(noise).mean() == pytest.approx(sigma_dn**2, rel=0.03)


def test_what_bends_along_one_axis_is_no_noise() -> None:
    """A slope, and an edge along the columns, however high."""
    columns, rows = np.meshgrid(np.arange(32.0), np.arange(32.0))
    patches = np.stack([3 * columns - rows + 7, 200.0 * (columns > 15)]).astype(np.float32)
    np.testing.assert_allclose(noise_variances(patches), 0.0, atol=1e-9)


def test_texture_only_adds() -> None:
    """Fine texture under noise reads as more noise, never as less."""
    columns, rows = np.meshgrid(np.arange(32.0), np.arange(32.0))
    texture = 20 * np.sin(1.2 * columns) * np.sin(0.9 * rows)
    noise = NOISE_RNG.normal(0.0, 1.0, (50, 32, 32))
    assert (noise_variances((texture + noise).astype(np.float32)) > 1.0).all()


SHAPE = (100, 140)


@pytest.mark.parametrize("motion_px", [0.0, 0.4, 1.3, 4.0, 9.5])
@pytest.mark.parametrize("world", [Waves(amplitude_dn=20.0, mean_dn=128.0, seed=3), Checkers(60.0, 50.0)])
def test_motion_is_that_of_the_texture(motion_px: float, world: Waves) -> None:
    """To a fifth of a pixel, and never above it by more than its error."""
    if isinstance(world, Checkers) and motion_px > 0.5 * world.side_px:
        pytest.skip("a checkerboard repeats itself")
    moving = replace(world, velocity_px_s=(0.8 * motion_px, 0.6 * motion_px))
    light_dn = np.stack([moving.luma(0.0, SHAPE), moving.luma(1.0, SHAPE)]).astype(np.float32)
    assert tracked_motion_px(light_dn) == pytest.approx(max(motion_px - RETURN_PX, 0.0), abs=0.2)


def test_nothing_is_stated_without_corners() -> None:
    """Of an even image, and of one that has nothing in common with the next."""
    rng = np.random.default_rng(2)
    assert tracked_motion_px(np.full((2, *SHAPE), 100, np.float32)) == 0.0
    assert tracked_motion_px(rng.uniform(0, 255, (2, *SHAPE)).astype(np.float32)) < 1.0
