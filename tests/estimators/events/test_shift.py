"""Changes of intervals, and parts whose events lie elsewhere, on images whose shift is known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, shift

from fedora_qa.estimators.events.levels import level_changes
from fedora_qa.estimators.events.pixels import by_pixel
from fedora_qa.estimators.events.shift import (
    CLEAR,
    LEAST_PAIRS,
    RADIUS_PX,
    IntervalChanges,
    ShiftSums,
    cross_correlation,
    lattice_peak,
    lattice_spread,
    most_shifted,
    peak,
    peak_spread,
    shifts_of_parts,
    slope_sums,
    slopes_where_fired,
)
from fedora_qa.estimators.events.shift_errors import (
    bracketed_level_errors,
    open_level_errors,
    reference_lags,
    step_of_level,
)
from fedora_qa.estimators.events.shift_kernels import FIRED, KNOWN, OPEN, USABLE
from fedora_qa.estimators.fitting.robust import MAD_TO_SIGMA
from fedora_qa.views.sensor_events import GRID, tile_around

TEXTURE = gaussian_filter(np.random.default_rng(0).normal(0, 1, (24, 36)), 1.5)
ALL = np.ones(TEXTURE.shape, np.bool_)
SHAPE = (96, 128)
THRESHOLD = 0.2


MARGIN_PX = 16


def scene(seed: int = 0) -> NDArray[np.float64]:
    """A smooth change of L, of standard deviation 1, with a margin around the image."""
    image = gaussian_filter(np.random.default_rng(seed).normal(size=[size + 2 * MARGIN_PX for size in SHAPE]), 2.0)
    normalised: NDArray[np.float64] = image / image.std()
    return normalised


def inner(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """The image without the margin."""
    return image[MARGIN_PX:-MARGIN_PX, MARGIN_PX:-MARGIN_PX].copy()


def tile_sums(change: NDArray[np.float64], events: NDArray[np.float64], usable: NDArray[np.bool_]) -> ShiftSums:
    """Sums of each of the tiles of an image, whose corners are interpolated by splines; events lack the margin."""
    flags = np.where(usable, USABLE | KNOWN, 0).astype(np.uint8)
    corners = shift(change, (-0.5, -0.5), order=5)
    return IntervalChanges(inner(change), (inner(change), inner(corners)), (flags, flags), events).tile_sums(GRID)


def sums_with(moved: NDArray[np.bool_], right_px: float) -> ShiftSums:
    """Sums of the tiles of a change whose events lie farther right where ``moved``."""
    change = scene()
    elsewhere = shift(change, (0, right_px), order=5)
    return tile_sums(change, np.where(moved, inner(elsewhere), inner(change)), np.ones(SHAPE, np.bool_))


@pytest.mark.parametrize("right_px", [-3.0, 0.5, 2.0])
def test_shifted_tiles_are_found(right_px: float) -> None:
    """A quarter of the image is named with its shift, to a tenth of a pixel and a tenth of the shift."""
    moved = np.zeros(SHAPE, np.bool_)
    moved[24:72, 32:96] = True
    found = most_shifted(shifts_of_parts(sums_with(moved, right_px), 1, THRESHOLD, CLEAR))
    assert found is not None
    assert found.axis == 0
    assert found.shift_px == pytest.approx(right_px, abs=0.1 + 0.1 * abs(right_px))
    assert tile_around(found.alike, SHAPE) == (32, 24, 96, 72)
    assert abs(found.shift_px) > 5 * found.standard_error_px


def test_the_shifted_parts_may_be_the_most() -> None:
    """Where all tiles but four are shifted, these are named and not the four."""
    moved = np.ones(SHAPE, np.bool_)
    moved[:48, :64] = False
    found = most_shifted(shifts_of_parts(sums_with(moved, 2.0), 1, THRESHOLD, CLEAR))
    assert found is not None
    assert found.shift_px == pytest.approx(2.0, abs=0.3)
    assert not found.alike.reshape(GRID, GRID)[:2, :2].any()


def test_other_assumptions_and_spreads_widen_errors() -> None:
    """The distance of a peak under another assumption is added in squares; a larger spread counts, and none excludes.

    Peaks of all parts lie at (1, -1); under the other assumption that of the first part lies at (2, 1).
    """
    rng = np.random.default_rng(7)
    parts = 6
    alike, moved = gaussian_lattices(1.0, -1.0, 3.0), gaussian_lattices(2.0, 1.0, 3.0)
    slopes = np.ones((parts, 3, 2)) * rng.uniform(1.0, 2.0, (parts, 1, 1))
    sums = ShiftSums(np.array([alike] * parts), np.full((parts, 2), alike.max()), slopes)
    own = np.array([bracketed_level_errors(each / 3, THRESHOLD) for each in slopes])
    plain = most_shifted(shifts_of_parts(sums, 3, THRESHOLD, 0.0))
    assert plain is not None
    np.testing.assert_allclose(plain.errors_px, own)
    other = np.array([moved, *[alike] * (parts - 1)])
    widened = most_shifted(shifts_of_parts(sums, 3, THRESHOLD, 0.0, variants=[other, other]))
    assert widened is not None
    due = np.hypot(own[0], np.sqrt(2) * np.array([1.0, 2.0]))
    np.testing.assert_allclose(widened.errors_px[0], due, rtol=0.05)
    np.testing.assert_allclose(widened.errors_px[1:], own[1:])
    spreads = [np.array([9.0, 0.0]), None, *[np.zeros(2)] * (parts - 2)]
    spread = most_shifted(shifts_of_parts(sums, 3, THRESHOLD, 0.0, spreads=spreads))
    assert spread is not None
    assert spread.compared == parts - 1
    np.testing.assert_allclose(spread.errors_px, [[9.0, own[0, 1]], *own[2:]])


@pytest.mark.parametrize(("parts", "is_widened"), [(9, False), (10, True)])
def test_the_scatter_of_many_parts_is_their_error(parts: int, is_widened: bool) -> None:
    """Ten parts that scatter by more than their errors have their scatter as error, 1.4826 times the median deviation.

    Shifts to the right grow evenly from part to part, none is downward.
    """
    shifts = 0.5 * (np.arange(parts) - (parts - 1) / 2)
    patches = np.array([gaussian_lattices(right, 0.0, 3.0) for right in shifts])
    sums = ShiftSums(patches, np.ones((parts, 2)), np.full((parts, 3, 2), 100.0))
    found = most_shifted(shifts_of_parts(sums, 1, THRESHOLD, 0.0))
    assert found is not None
    own = bracketed_level_errors(sums.slopes[0], THRESHOLD)
    # Half of all scores are of the axis without a shift: the median is that of both axes.
    scores = np.abs(np.concatenate([shifts, np.zeros(parts)])) / own[0]
    due = own * max(1.0, MAD_TO_SIGMA * np.median(scores)) if is_widened else own
    np.testing.assert_allclose(found.errors_px, np.tile(due, (parts, 1)), rtol=0.1)


def test_parts_that_agree_are_not_shifted() -> None:
    """Nor is a part without a peak of its own, which comes first here."""
    alike = gaussian_lattices(1.0, -1.0, 3.0)
    sums = ShiftSums(np.array([0 * alike, *[alike] * 5]), np.ones((6, 2)), np.ones((6, 3, 2)))
    found = most_shifted(shifts_of_parts(sums, 1, THRESHOLD, CLEAR))
    assert found is not None
    assert (found.shift_px, found.compared) == (0.0, 5)
    assert found.part > 0
    assert np.isfinite(found.standard_error_px)


def test_parts_of_another_scene_have_no_shift() -> None:
    """Events of unrelated texture correlate too little for a peak of their own."""
    unrelated = tile_sums(scene(), inner(scene(seed=1)), np.ones(SHAPE, np.bool_))
    assert most_shifted(shifts_of_parts(unrelated, 1, THRESHOLD, CLEAR)) is None


def test_dark_tiles_are_left_out() -> None:
    """Tiles without a usable pixel neither crash nor count."""
    usable = np.ones(SHAPE, np.bool_)
    usable[:24] = False
    found = most_shifted(shifts_of_parts(tile_sums(scene(), inner(scene()), usable), 1, THRESHOLD, CLEAR))
    assert found is not None
    assert found.compared == GRID * (GRID - 1)
    assert abs(found.shift_px) < 5 * found.standard_error_px


def test_slopes_are_those_of_their_definition() -> None:
    """Sums over a part of the image: of |g| and g^2 of the level and g^2 of its change, by pairs of usable pixels.

    A pair counts by the share of its pixels whose change by events is known.
    """
    rng = np.random.default_rng(4)
    level, change = rng.normal(size=(2, 9, 12))
    flags = rng.choice(np.array([0, USABLE, USABLE | KNOWN], np.uint8), (9, 12))
    part = IntervalChanges(level, (change, change), (flags, flags), change).sums([(2, 8, 1, 11)])
    inside = slice(2, 8), slice(1, 11)
    usable, known = (flags > 0)[inside], (flags & KNOWN > 0)[inside]
    for axis, along in ((0, 1), (1, 0)):
        first, second = (
            (
                (slice(None), slice(None, -1)),
                (slice(None), slice(1, None)),
            )
            if along
            else ((slice(None, -1),), (slice(1, None),))
        )
        weights = (usable[first] & usable[second]) * (known[first] / 2 + known[second] / 2)
        slopes, steeper = (np.diff(image[inside], axis=along) for image in (level, change))
        due = [np.sum(weights * values) for values in (np.abs(slopes), slopes**2, steeper**2)]
        assert np.allclose(part.slopes[0, :, axis], due)
    assert np.allclose(part.squares[0], np.sum(change[inside][usable] ** 2))
    all_known = np.where(flags > 0, USABLE | KNOWN, 0).astype(np.uint8)
    whole = IntervalChanges(level, (change, change), (all_known, all_known), change).sums([(0, 9, 0, 12)])
    assert np.allclose(slope_sums(level, change, flags > 0), whole.slopes[0])


def defined_correlations(changes: IntervalChanges, box: tuple[int, int, int, int]) -> NDArray[np.float64]:
    """Correlations of a part by the definition, pair by pair."""
    size, (height, width) = 2 * RADIUS_PX + 1, changes.events.shape
    sums, energies, shares = np.zeros((2, size, size)), np.zeros((2, 2, size, size)), np.zeros((2, size, size))
    part = [(row, column) for row in range(*box[:2]) for column in range(*box[2:])]
    for lattice, (change, flags) in enumerate(zip(changes.changes, changes.flags, strict=True)):
        usable = flags > 0
        rows, columns = np.nonzero(usable)
        inside = usable & np.isin(np.arange(height), range(*box[:2]))[:, np.newaxis]
        inside &= np.isin(np.arange(width), range(*box[2:]))
        c = np.where(usable, change - change[inside].mean(), 0.0)
        # Events lie at the centres of pixels.
        if lattice == 0:
            e = np.where(inside, changes.events - changes.events[inside].mean(), 0.0)
        for down in range(size):
            for right in range(size):
                partners = [(row - down + RADIUS_PX, column - right + RADIUS_PX) for row, column in part]
                pairs = [(x, at) for x, at in zip(part, partners, strict=True)
                         if rows.min() <= at[0] <= rows.max() and columns.min() <= at[1] <= columns.max()]  # fmt: skip
                shares[lattice, down, right] = len(pairs) / len(part)
                sums[lattice, down, right] = sum(e[x] * c[at] for x, at in pairs)
                energies[lattice, :, down, right] = sum(c[at] ** 2 for _, at in pairs), sum(e[x] ** 2 for x, _ in pairs)
    roots = np.sqrt(energies.prod(axis=1))
    normalised = np.divide(sums, roots, where=roots > 0, out=np.zeros_like(sums))
    return np.where(shares >= LEAST_PAIRS, normalised * roots[0, RADIUS_PX, RADIUS_PX], 0.0)


@pytest.mark.parametrize("box", [(0, 5, 0, 6), (5, 12, 7, 15), (18, 26, 21, 27), (0, 26, 0, 27)])
def test_correlations_of_parts_are_those_of_their_definition(box: tuple[int, int, int, int]) -> None:
    """Frames count beyond the part, also in corners of the image, and both energies are those of the pairs."""
    rng = np.random.default_rng(6)
    events, *images = rng.normal(1, 1, (3, 26, 27))
    flags = tuple(rng.choice(np.array([0, USABLE], np.uint8), (26, 27), p=[0.1, 0.9]) for _ in range(2))
    # Corners at the last row and column lie outside of frames that see no more than the sensor.
    flags[1][-1], flags[1][:, -1] = 0, 0
    changes = IntervalChanges(images[0], (images[0], images[1]), (flags[0], flags[1]), events)
    sums, usable = changes.sums([box]), flags[0][box[0] : box[1], box[2] : box[3]] > 0
    assert np.allclose(sums.patches[0], defined_correlations(changes, box), atol=1e-4)
    # By Cauchy and Schwarz, no shift exceeds the energies at no shift.
    assert sums.patches[0].max() <= np.sqrt(sums.squares[0].prod())
    assert np.allclose(sums.squares[0, 0], np.sum(images[0][box[0] : box[1], box[2] : box[3]][usable] ** 2))


@pytest.mark.parametrize("seed", range(4))
def test_saturated_areas_do_not_move_the_peak(seed: int) -> None:
    """Masks of events and of changes lie where their images lie: the same mask for both gives -0.08 px."""
    level = scene(seed)
    change = shift(level, (1.0, 1.0), order=5) - level
    change_at_corners, level_at_corners = (shift(image, (-0.5, -0.5), order=5) for image in (change, level))
    flags = [np.where(inner(image) < 0.5, USABLE, 0).astype(np.uint8) for image in (level, level_at_corners)]
    changes = IntervalChanges(
        inner(level), (inner(change), inner(change_at_corners)), (flags[0], flags[1]), inner(change)
    )
    peak_px = lattice_peak(changes.patches(changes.events))
    assert peak_px is not None
    assert (peak_px.right_px, peak_px.down_px) == pytest.approx((0, 0), abs=0.02)


THRESHOLDS = 0.2, 0.25
FRAMES_S = 0.4, 0.6
"""Times of both frames within 1 s of events."""


def strips(
    positions: NDArray[np.float64], edges: NDArray[np.float64], heights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Means over squares of 1 px around positions of steps at edges, in closed form."""
    return np.clip(positions[..., np.newaxis] + 0.5 - edges, 0, 1) @ heights


class EdgeWorld:
    """Vertical and horizontal edges, as sharp as edges are, that move evenly over a sensor."""

    def __init__(self, seed: int, shape: tuple[int, int] = (48, 64)) -> None:
        self.shape = shape
        rng = np.random.default_rng(seed)
        self.velocity_px_s = rng.uniform(6, 12, 2) * rng.choice([-1, 1], 2)
        self.edges = [np.sort(rng.uniform(-20, size + 20, (size + 40) // 6)) for size in self.shape]
        self.heights = [rng.uniform(0.5, 1.5, len(each)) * (-1) ** np.arange(len(each)) for each in self.edges]

    def level(self, time_s: float, down_px: float, right_px: float) -> NDArray[np.float64]:
        """(h, w) level at the pixels, moved down and to the right of their places."""
        rows, columns = (
            strips(np.arange(size) + moved - speed * time_s, edges, heights)
            for size, moved, speed, edges, heights in zip(
                self.shape, (down_px, right_px), self.velocity_px_s, self.edges, self.heights, strict=True
            )
        )
        return rows[:, np.newaxis] + columns

    def events(self, down_px: float, right_px: float) -> tuple[NDArray[np.int64], ...]:
        """Rows, columns, times (ns) and polarities of an ideal sensor that is moved."""
        before = self.level(0.0, down_px, right_px)
        # References of a sensor that has been at work for long are uniform.
        reference = before + np.random.default_rng(1).uniform(-THRESHOLDS[0], THRESHOLDS[1], before.shape)
        fired = []
        for step in range(1, 201):
            after = self.level(step / 200, down_px, right_px)
            for sign, threshold in ((-1, THRESHOLDS[0]), (1, THRESHOLDS[1])):
                while (crossed := sign * (after - reference) >= threshold).any():
                    reference = np.where(crossed, reference + sign * threshold, reference)
                    rows, columns = np.nonzero(crossed)
                    # Edges are steps of the level that pixels average: between both times it is linear.
                    change = after[crossed] - before[crossed]
                    share = np.divide(reference[crossed] - before[crossed], change, where=change != 0,
                                      out=np.zeros(len(rows)))  # fmt: skip
                    times_ns = 5e6 * (step - 1 + np.clip(share, 0, 1))
                    fired.append((rows, columns, times_ns.astype(np.int64), np.full(len(rows), sign > 0)))
            before = after
        rows, columns, times_ns, brighter = (np.concatenate(each) for each in zip(*fired, strict=True))
        order = np.argsort(times_ns, kind="stable")
        return rows[order], columns[order], times_ns[order], brighter[order]

    def changes(self, down_px: float, right_px: float) -> IntervalChanges:
        """Changes of frames, and of events that lie farther down and to the right."""
        rows, columns, times_ns, brighter = self.events(-down_px, -right_px)
        events = by_pixel(
            columns.astype(np.uint16), rows.astype(np.uint16), times_ns, brighter.astype(np.uint8), self.shape
        )
        frames_ns = round(1e9 * FRAMES_S[0]), round(1e9 * FRAMES_S[1])
        by_events = level_changes(events, self.shape, frames_ns, THRESHOLDS)
        flags = np.where(by_events.is_known, USABLE | KNOWN, USABLE).astype(np.uint8)
        centres, corners = (
            self.level(FRAMES_S[1], apart, apart) - self.level(FRAMES_S[0], apart, apart) for apart in (0.0, 0.5)
        )
        return IntervalChanges(self.level(FRAMES_S[0], 0, 0), (centres, corners), (flags, flags), by_events.mean)


@settings(max_examples=15, deadline=None)
@given(st.floats(-2.5, 2.5), st.floats(-2.5, 2.5), st.integers(0, 1000))
def test_shifts_of_events_of_sharp_edges_are_estimated(down_px: float, right_px: float, seed: int) -> None:
    """Any fraction of a pixel, in a world in closed form, to five standard deviations of one interval."""
    changes = EdgeWorld(seed).changes(down_px, right_px)
    found = lattice_peak(changes.patches(changes.events))
    assert found is not None
    assert (found.right_px, found.down_px) == pytest.approx((right_px, down_px), abs=0.25)


@pytest.mark.parametrize("planted_px", [0.0, 0.3, 0.5])
def test_the_mean_over_worlds_is_drawn_nowhere(planted_px: float) -> None:
    """Neither to whole pixels nor along the motion. A parabola through sums of events without turns gives 0.03 px."""
    worlds = [EdgeWorld(seed).changes(-planted_px, planted_px) for seed in range(16)]
    found = [lattice_peak(world.patches(world.events)) for world in worlds]
    mean = np.mean([(each.right_px, -each.down_px) for each in found if each is not None], axis=0)
    assert len(found) == len(worlds)
    assert mean == pytest.approx([planted_px, planted_px], abs=0.05)


def test_small_tiles_have_no_peaks_of_other_edges() -> None:
    """Tiles of 6 x 8 pixels, smaller than the farthest shift, peak where their events are.

    In one interval 2.4% of them peak elsewhere (10 of 410 in 40 worlds), where parallel edges agree by chance. Of
    products within a tile, scaled by the number of pairs, 62% do.
    """
    parts = [EdgeWorld(seed, (24, 32)).changes(0, 0).tile_sums(GRID) for seed in range(12)]
    sums = ShiftSums(*(np.concatenate([getattr(each, name) for each in parts]) for name in ShiftSums.__slots__))
    strengths = sums.patches.max(axis=(1, 2, 3)) / np.maximum(np.sqrt(sums.squares.prod(axis=1)), 1e-300)
    peaks = [lattice_peak(patch) for patch in sums.patches[strengths >= CLEAR]]
    far = [max(abs(each.right_px), abs(each.down_px)) > 2 for each in peaks if each is not None]
    assert len(far) > 80
    assert np.mean(far) < 0.1


def gaussian_lattices(right_px: float, down_px: float, width_px: float) -> NDArray[np.float64]:
    """A Gaussian correlation at whole and at half shifts."""
    axis = np.arange(-8, 9.0)
    return np.array([
        np.exp(-((axis - half - right_px) ** 2 + (axis[:, np.newaxis] - half - down_px) ** 2) / (2 * width_px**2))
        for half in (0.0, 0.5)
    ])  # fmt: skip


@settings(max_examples=50, deadline=None)
@given(st.floats(-6, 6), st.floats(-6, 6), st.floats(0.5, 1.5))
def test_peaks_of_gaussians_are_where_they_are(right_px: float, down_px: float, width_px: float) -> None:
    """Also narrow ones, between all shifts of both lattices, to a hundredth of a pixel."""
    found = lattice_peak(gaussian_lattices(right_px, down_px, width_px))
    assert found is not None
    assert (found.right_px, found.down_px) == pytest.approx((right_px, down_px), abs=0.015)


def test_peaks_at_the_border_are_none() -> None:
    """A correlation that rises to the border belongs to a farther shift; one without a positive value to none."""
    assert lattice_peak(gaussian_lattices(9.0, 0.0, 1.0)) is None
    assert lattice_peak(-gaussian_lattices(0.0, 0.0, 1.0)) is None
    beside_no_pairs = gaussian_lattices(4.0, 0.0, 1.0)
    beside_no_pairs[:, :, 13:] = 0.0
    assert lattice_peak(beside_no_pairs) is None


def test_the_spread_is_the_scatter_over_the_root_of_the_number() -> None:
    """Parts with a known scatter of their shifts, of equal weight: the error of their mean."""
    rng = np.random.default_rng(2)
    moved = rng.normal(0, 0.1, (300, 2))
    spread = lattice_spread(np.array([gaussian_lattices(right, down, 1.0) for right, down in moved]))
    assert spread == pytest.approx([0.1 / 300**0.5] * 2, rel=0.3)
    alone = np.array([gaussian_lattices(0, 0, 1.0), -3 * gaussian_lattices(4, 0, 1.0)])
    assert lattice_spread(alone) is None


@pytest.mark.parametrize(("right", "down"), [(0, 0), (3, -2), (-7, 5)])
def test_whole_shifts_are_read_exactly(right: int, down: int) -> None:
    """A pattern in the middle, moved by whole pixels, is found there; its negative as well, with its own sign."""
    image = np.zeros((40, 50))
    image[12:28, 15:35] = TEXTURE[:16, :20]
    moved = np.roll(image, (down, right), axis=(0, 1))
    found = peak(cross_correlation(image, moved, np.ones(image.shape, np.bool_)))
    assert found is not None
    assert found.right_px == pytest.approx(right, abs=0.1)
    assert found.down_px == pytest.approx(down, abs=0.1)


def test_fractions_of_a_pixel_are_read_to_a_twentieth() -> None:
    """A smooth pattern moved by (0.4, -0.25) px by splines is read to 0.05 px."""
    image = gaussian_filter(np.pad(TEXTURE, 12), 1.0)
    moved = shift(image, (-0.25, 0.4), order=5)
    found = peak(cross_correlation(image, moved, np.ones(image.shape, np.bool_)))
    assert found is not None
    assert (found.right_px, found.down_px) == pytest.approx((0.4, -0.25), abs=0.05)


def test_no_peak_where_nothing_agrees() -> None:
    """Blank images, or opposite ones, have none within reach."""
    assert peak(cross_correlation(0 * TEXTURE, TEXTURE, ALL)) is None
    assert peak(cross_correlation(TEXTURE, TEXTURE, ~ALL)) is None


def gaussian(right_px: float, down_px: float) -> NDArray[np.float64]:
    """A patch with a peak at an offset, of a width of 5 px: nearly a parabola."""
    offsets = np.arange(-RADIUS_PX, RADIUS_PX + 1)
    return np.exp(-((offsets - right_px) ** 2 + (offsets[:, np.newaxis] - down_px) ** 2) / 50)


def test_peaks_are_positive_and_inside() -> None:
    """A correlation that nowhere exceeds 0 has no peak; one at the border can be of a farther shift."""
    assert peak(gaussian(0.0, 0.0) - 1.0) is None
    barely = peak(gaussian(0.0, 0.0) - 0.999)
    assert barely is not None
    assert (barely.right_px, barely.down_px) == pytest.approx((0.0, 0.0), abs=1e-9)
    for row, column in ((0, 5), (5, 0), (2 * RADIUS_PX, 5), (5, 2 * RADIUS_PX), (1, 5), (5, 2 * RADIUS_PX - 1)):
        single = np.zeros((2 * RADIUS_PX + 1, 2 * RADIUS_PX + 1))
        single[row, column] = 1.0
        found = peak(single)
        if {row, column} & {0, 2 * RADIUS_PX}:
            assert found is None
        else:
            assert found is not None
            assert (found.right_px, found.down_px) == (column - RADIUS_PX, row - RADIUS_PX)


def test_spread_of_a_peak_is_that_of_its_intervals() -> None:
    """Patches as wide and high as each other move the peak of their sum to the mean of theirs, for small shifts."""
    shifts = 0.05 * np.random.default_rng(5).normal(size=(20, 2))
    patches = np.array([gaussian(right, down) for right, down in shifts])
    spread = peak_spread(patches, patches.sum(axis=0))
    assert spread == pytest.approx(shifts.std(axis=0, ddof=1) / np.sqrt(20), rel=0.03)
    lonely = np.array([gaussian(0.0, 0.0), np.zeros_like(patches[0])])
    assert peak_spread(lonely, lonely.sum(axis=0)) is None


def test_levels_between_events_err_as_uniform_ones() -> None:
    """A regression on slopes h has the error s / sqrt(sum h^2), with s that of a difference of two uniform levels.

    Open levels are uniform over 2 C. The lag is half a threshold over the slope.
    """
    rng = np.random.default_rng(6)
    sums = np.array([[30.0, 50.0], [20.0, 70.0], [4.0, 9.0]])
    errors, lags = open_level_errors(sums, THRESHOLD)
    uniform = THRESHOLD * rng.uniform(-1, 1, (2, 200_000))
    assert errors == pytest.approx(np.std(uniform[1] - uniform[0]) / np.sqrt(sums[2]), rel=0.01)
    assert lags == pytest.approx(0.5 * THRESHOLD * np.array([30 / 20, 50 / 70]))
    # Between two events of one polarity, f C on average: at most f (1 - f) C^2, as of a level that is 0 or C.
    shares = rng.random((2, 200_000))
    bracketed = THRESHOLD * (rng.random(shares.shape) < shares) - THRESHOLD * shares
    due = np.std(bracketed[1] - bracketed[0]) / np.sqrt(sums[2])
    assert bracketed_level_errors(sums, THRESHOLD) == pytest.approx(due, rel=0.01)


def faint_texture(amplitude: float, width_px: float) -> IntervalChanges:
    """A wave of a width (period over 2 pi) to the right, moved by half a pixel; every third pixel has fired once."""
    columns = np.arange(160.0)
    rows = np.ones((40, 1))
    level, moved = (rows * amplitude * np.sin((columns - px) / width_px) for px in (0.0, 0.5))
    fired = np.zeros(level.shape, np.bool_)
    fired[:, ::3] = True
    flags = (USABLE + (FIRED + OPEN) * fired).astype(np.uint8)
    return IntervalChanges(level, (moved - level, moved - level), (flags, flags), np.where(fired, 1.0, 0.0))


@pytest.mark.parametrize("width_px", [2.0, 3.0])
@pytest.mark.parametrize("amplitude", [0.02, 0.05, 0.5])
def test_references_lag_behind_faint_texture(amplitude: float, width_px: float) -> None:
    """C mean|g| / mean g^2 = C (2 / pi) / (1 / 2) width / amplitude in closed form, if that exceeds half a period."""
    threshold = 0.2
    expected_px = threshold * 4 / np.pi * width_px / amplitude
    right_px, down_px = reference_lags(faint_texture(amplitude, width_px).lag_sums(), threshold)
    assert down_px == 0.0
    if expected_px > np.pi * width_px:
        assert right_px == pytest.approx(expected_px, rel=0.05)
    else:
        assert right_px == 0.0


def test_pixels_whose_change_is_known_do_not_lag() -> None:
    """Where events lie before and after both frames, references do not stand for levels."""
    changes = faint_texture(0.02, 2.0)
    flags = tuple(np.where(each & OPEN > 0, USABLE | KNOWN | FIRED, each).astype(np.uint8) for each in changes.flags)
    known = replace(changes, flags=(flags[0], flags[1]))
    assert not reference_lags(known.lag_sums(), 0.2).any()


def test_slopes_count_where_levels_change() -> None:
    """Of two ramps of which one moves, only that one counts, in proportion to its change; the border does not."""
    level, change, usable = np.zeros((6, 20)), np.zeros((6, 20)), np.ones((6, 20), np.bool_)
    level[:, :10], level[:, 10:] = 0.5 * np.arange(10), 5.0 + 2.0 * np.arange(10)
    change[:, :9] = 0.1
    assert slopes_where_fired(level, change, usable)[1, 0] == pytest.approx(6 * (8 * 0.2 + 0.1) * 0.5**2)
    usable[:, :5], level[:, :5] = False, np.nan
    assert slopes_where_fired(level, change, usable)[0, 0] == pytest.approx(6 * (3 * 0.2 + 0.1) * 0.5)
    assert not slopes_where_fired(level.T, change.T, usable.T)[:, 0].any()


@pytest.mark.parametrize("largest", [0.05, 0.2, 1.0])
def test_the_step_of_a_level_follows_from_how_often_pixels_fire(largest: float) -> None:
    """Changes far below a threshold give the threshold, too; the change of the pixels that fire does not."""
    threshold, rng = 0.2, np.random.default_rng(3)
    change = largest * rng.uniform(0, 1, 400_000) ** 2
    # The level lies anywhere between two steps before.
    events = np.floor(change / threshold + rng.uniform(0, 1, len(change)))
    strength = float(np.corrcoef(change, events)[0, 1])
    assert step_of_level(strength, len(change) * change.var(), len(change) * events.var()) == pytest.approx(
        threshold, rel=0.05
    )
    assert change[events > 0].sum() / events.sum() < (threshold if largest > threshold else largest)
