"""Profiles of image edges around steps of depth: their form, their centroid, and their shift in a closed-form world."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from fedora_qa.estimators.depth.edge_profiles import (
    FARTHEST_PX,
    RADIUS_PX,
    REACH,
    EdgeShift,
    difference_profiles,
    edge_shift,
    find_peaks,
    peak_fraction_gain,
    peaks_near,
    root_counts,
    tile_profiles,
)
from fedora_qa.estimators.depth.inverse_depth import DepthSteps, depth_steps
from tests.support.outline_world import FRAMES, OutlineWorld

OFFSETS = np.arange(-RADIUS_PX, RADIUS_PX + 1)


def quadratic(x: np.ndarray) -> np.ndarray:
    """The quadratic B-spline around 0, by scipy."""
    return np.nan_to_num(BSpline.basis_element([-1.5, -0.5, 0.5, 1.5], extrapolate=False)(x))


@given(st.floats(-FARTHEST_PX + 0.5, FARTHEST_PX - 0.5), st.floats(0, 0.2), st.floats(0, 0.2))
def test_place_of_a_spline_is_exact(shift_px: float, before: float, after: float) -> None:
    """A quadratic B-spline is found exactly where it is, also when the background differs on its two sides."""
    middle = RADIUS_PX + round(shift_px)
    background = np.where(np.arange(len(OFFSETS)) < middle, before, after)
    background[middle] = 0.5 * (before + after)
    profile = quadratic(OFFSETS - shift_px) + background
    found = peaks_near(profile, np.array(middle))
    assert find_peaks(profile) in (middle - 1, middle, middle + 1)
    assert float(found.positions_px) == pytest.approx(shift_px, abs=1e-9)
    # The samples of a B-spline add up to 1, so that its share is 1 over the sum of the profile.
    assert float(found.fractions) == pytest.approx(1.0 / profile.sum())


def test_peaks_are_those_of_the_spline_as_matched_filter() -> None:
    """Of any profile, by SciPy's spline and NumPy's correlation; only places with surroundings count."""
    profiles = np.random.default_rng(1).random((200, len(OFFSETS)))
    inner = slice(RADIUS_PX - FARTHEST_PX, RADIUS_PX + FARTHEST_PX + 1)
    due = [inner.start + np.argmax(np.correlate(one, quadratic(np.arange(-1, 2)), "same")[inner]) for one in profiles]
    assert find_peaks(profiles).tolist() == due


@pytest.mark.parametrize("reach", [REACH, REACH + 1])
def test_a_mirrored_profile_has_the_mirrored_peak(reach: int) -> None:
    """Of any profile: the position changes its sign and stays near the sample, and the share stays the same."""
    profiles = np.random.default_rng(2).random((200, len(OFFSETS)))
    samples = find_peaks(profiles)
    found, mirrored = (
        peaks_near(profiles, samples, reach),
        peaks_near(profiles[:, ::-1], 2 * RADIUS_PX - samples, reach),
    )
    np.testing.assert_allclose(mirrored.positions_px, -found.positions_px, atol=1e-12)
    np.testing.assert_allclose(mirrored.fractions, found.fractions, atol=1e-12)
    off_px = np.abs(found.positions_px - (samples - RADIUS_PX))
    assert off_px.max() == pytest.approx(reach)


def test_an_even_profile_has_no_peak() -> None:
    """What does not rise above its background is left at its sample, with no share."""
    found = peaks_near(np.ones(len(OFFSETS)), np.array(RADIUS_PX + 3))
    assert (float(found.positions_px), float(found.fractions)) == (3.0, 0.0)


def test_profile_of_averaged_steps_is_the_spline() -> None:
    """Edges at all places within their pixel, each pixel the mean over its square, give 1/8, 3/4, 1/8."""
    profiles = []
    for place in np.linspace(19.5, 20.5, 401)[:-1] + 1 / 802:
        borders = np.arange(41) - 0.5
        image = np.diff(np.maximum(borders - place, 0.0))[np.newaxis].repeat(5, axis=0)
        depth_m = np.where(np.arange(40) < place, 4.0, 8.0)[np.newaxis].repeat(5, axis=0)
        steps = depth_steps(depth_m, 0, farthest_m=30.0)
        differences = np.abs(np.diff(image, axis=1))
        profiles.append(tile_profiles(differences, steps, 0, (steps.columns, steps.rows), first_px=0.5))
    far, near = np.sum(profiles, axis=(0, 2))
    assert not far.any()
    np.testing.assert_allclose(near[RADIUS_PX - 2 : RADIUS_PX + 3] / near.sum(), [0, 1 / 8, 3 / 4, 1 / 8, 0], atol=1e-5)


def test_reads_between_pixels_are_linear() -> None:
    """Places of another camera fall between pixels: the profile is read there, along both axes alike."""
    strength = np.add.outer(3.0 * np.arange(30), 2.0 * np.arange(40)) + 1.0
    steps = DepthSteps(np.array([20.25]), np.array([14.5]), np.array([1.0]), np.array([True]))
    along = tile_profiles(strength, steps, 0, (steps.columns, steps.rows), first_px=0.0)
    across = tile_profiles(strength.T, steps, 1, (steps.rows, steps.columns), first_px=0.0)
    expected = 3.0 * 14.5 + 2.0 * (20.25 + OFFSETS) + 1.0
    np.testing.assert_allclose(along.sum(axis=(0, 1)), expected / expected.sum())
    np.testing.assert_allclose(across.sum(axis=(0, 1)), expected / expected.sum())


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("mirrored", [(False, False), (True, False), (False, True), (True, True)])
def test_differences_are_those_of_the_mirrored_image(mirrored: tuple[bool, bool], axis: int) -> None:
    """Profiles of the differences that NumPy takes of the image that it has mirrored."""
    rng = np.random.default_rng(3)
    picture = rng.random((50, 60)).astype(np.float32)
    columns, rows = rng.uniform(13, 45, (2, 40))
    steps = DepthSteps(columns, rows, np.ones(40), rng.random(40) < 0.5)
    turned = picture[:: -1 if mirrored[1] else 1, :: -1 if mirrored[0] else 1]
    differences = np.abs(np.diff(turned.astype(np.float64), axis=1 - axis))
    found = difference_profiles(picture, steps, axis, (columns, rows), mirrored)
    due = tile_profiles(differences, steps, axis, (columns, rows), first_px=0.5)
    # Tiles of the differences are narrower by a part of a pixel: all of them together are compared.
    np.testing.assert_allclose(found.sum(axis=1), due.sum(axis=1), rtol=1e-6)


def test_roots_of_counts_are_those_of_a_histogram() -> None:
    """Points in each pixel, counted by NumPy; points outside do not count."""
    columns, rows = np.random.default_rng(4).integers(-2, 9, (2, 300))
    inside = (rows >= 0) & (rows < 5) & (columns >= 0) & (columns < 7)
    due = np.zeros((5, 7))
    np.add.at(due, (rows[inside], columns[inside]), 1.0)
    np.testing.assert_allclose(root_counts(columns, rows, 5, 7), np.sqrt(due), rtol=1e-6)


def test_steps_near_the_border_are_left_out() -> None:
    """A step whose profile would leave the image has no voice."""
    steps = DepthSteps(np.array([5.0, 20.0]), np.array([3.0, 3.0]), np.ones(2), np.array([True, True]))
    sums = tile_profiles(np.ones((10, 40)), steps, 0, (steps.columns, steps.rows), first_px=0.0)
    assert sums.sum() == pytest.approx(1.0)


FLAT = OutlineWorld()
LINE = np.array([1 / 8, 3 / 4, 1 / 8])


def measured(world: OutlineWorld, axis: int, frames: int = FRAMES) -> EdgeShift:
    sums = []
    for depth_m, luma in (world.frame(i) for i in range(frames)):
        steps = depth_steps(depth_m, axis, farthest_m=30.0)
        strength = np.abs(np.diff(np.log(luma), axis=1 - axis))
        sums.append(tile_profiles(strength, steps, axis, (steps.columns, steps.rows), first_px=0.5))
    found = edge_shift(np.array(sums))
    assert found is not None
    return found


@pytest.mark.parametrize(("right_px", "down_px"), [(0.0, 0.0), (0.5, -0.5), (-0.2, 0.1), (3.0, 0.5), (-6.5, 2.0)])
def test_shift_is_measured(right_px: float, down_px: float) -> None:
    """Shifts of fractions of a pixel and of several are found within a few of their standard errors."""
    for axis, true_px in enumerate((right_px, down_px)):
        found = measured(FLAT.altered(shift_px=(right_px, down_px)), axis)
        assert found.shift_px == pytest.approx(true_px, abs=4 * found.standard_error_px + abs(found.lean_px))
        assert found.standard_error_px < 0.1


def test_errors_are_those_of_chance() -> None:
    """Over many worlds without texture, deviations in standard errors spread by about one."""
    worlds = (FLAT.altered(seed=seed, boxes=16) for seed in range(24))
    found = [measured(world, axis, frames=5) for world in worlds for axis in (0, 1)]
    scores = [one.shift_px / one.standard_error_px for one in found]
    assert 0.5 < np.sqrt(np.mean(np.square(scores))) < 1.6


def test_texture_of_the_nearer_surface_leans_and_cancels() -> None:
    """Texture on one side draws left and right outlines apart by a tenth of a pixel; their mean stays in place."""
    found = measured(FLAT.altered(lean_dn=25.0), 0)
    assert abs(found.lean_px) > 0.05
    assert abs(found.shift_px) < 3 * found.standard_error_px


def test_too_few_tiles_tell_nothing() -> None:
    """A scene without steps, or with all of them in one place, has no shift."""
    assert edge_shift(np.zeros((3, 2, 16, 25))) is None
    one_tile = np.zeros((3, 2, 16, 25))
    one_tile[:, :, 0] = 1.0
    assert edge_shift(one_tile) is None


def test_texture_that_two_peaks_share_is_no_error_of_their_difference() -> None:
    """Of one peak there is none; of a peak that is blurred everywhere alike, its error is far below that of either."""
    rng = np.random.default_rng(8)
    peak = quadratic(np.arange(-RADIUS_PX, RADIUS_PX + 1.0))
    blurred = np.convolve(peak, np.full(9, 1 / 9), "same")
    texture = rng.uniform(0.01, 0.1, (4, 2, 16, 1)) * np.ones(len(peak))
    sharp = texture + peak
    assert peak_fraction_gain(sharp, sharp) == (0.0, 0.0)
    gain, error = peak_fraction_gain(texture + blurred, sharp)
    first, second = edge_shift(texture + blurred), edge_shift(sharp)
    assert first is not None
    assert second is not None
    assert gain == pytest.approx(second.peak_fraction - first.peak_fraction)
    assert 0 < error < 0.05 * gain
    few = np.where(np.arange(16)[:, np.newaxis] < 4, sharp, 0.0)
    assert peak_fraction_gain(few, few) == (0.0, 0.0)


def sides(far: np.ndarray, near: np.ndarray) -> EdgeShift:
    """The shift from one profile a side, the same in all tiles."""
    found = edge_shift(np.array([far, near])[np.newaxis, :, np.newaxis].repeat(8, axis=2))
    assert found is not None
    return found


def lines(*places_and_strengths: tuple[int, float]) -> np.ndarray:
    """An even background with lines."""
    profile = np.full(2 * RADIUS_PX + 1, 0.02)
    for place, strength in places_and_strengths:
        profile[RADIUS_PX + place - 1 : RADIUS_PX + place + 2] += strength * LINE
    return profile


@settings(deadline=None, max_examples=40)
@given(
    st.integers(-FARTHEST_PX, FARTHEST_PX), st.floats(0.0, 3.0), st.integers(-FARTHEST_PX, FARTHEST_PX), st.floats(0, 1)
)
def test_line_beside_one_side_is_no_shift(place: int, strength: float, other: int, faint: float) -> None:
    """A line of any strength beside the outline of one side of things is allowed for, wherever it lies."""
    outlined = lines((0, 1.0))
    outshone = lines((0, faint), (place, strength), (other, strength))
    for far, near in ((outlined, outshone), (outshone, outlined)):
        found = sides(far, near)
        assert abs(found.shift_px) <= found.model_error_bound_px + 1e-9


@settings(deadline=None, max_examples=30)
@given(st.floats(0.0, 0.6), st.sampled_from([-1, 1]))
def test_light_from_one_side_is_no_shift(strength: float, direction: int) -> None:
    """Texture that widens all outlines to the same side shows as skew, which is allowed for."""
    skewed = lines((0, 1.0), (2 * direction, strength))
    found = sides(skewed, skewed)
    assert abs(found.shift_px) <= found.model_error_bound_px + 1e-9


def test_what_both_sides_show_is_a_shift() -> None:
    """Both sides as far off the same way leave nothing to allow for."""
    shifted = lines((-5, 1.0))
    found = sides(shifted, shifted)
    assert (found.shift_px, found.model_error_bound_px) == pytest.approx((-5.0, 0.0), abs=1e-9)
