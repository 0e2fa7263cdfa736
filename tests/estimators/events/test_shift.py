"""Changes of intervals, and parts whose events lie elsewhere, on images whose shift is known."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, shift

from fedora_qa.estimators.events.shift import (
    CLEAR,
    IntervalChanges,
    ShiftSums,
    cross_correlation,
    intervals,
    most_shifted,
    peak,
    slope_sums,
)
from fedora_qa.estimators.events.shift_kernels import KEPT, SETTLED, USABLE
from fedora_qa.views.event_camera import GRID, tile_around

TEXTURE = gaussian_filter(np.random.default_rng(0).normal(0, 1, (24, 36)), 1.5)
ALL = np.ones(TEXTURE.shape, np.bool_)
SHAPE = (96, 128)
THRESHOLD = 0.2


def scene(seed: int = 0) -> NDArray[np.float64]:
    """A smooth change of L, of standard deviation 1."""
    image = gaussian_filter(np.random.default_rng(seed).normal(size=SHAPE), 2.0)
    return image / image.std()


def tile_sums(
    level: NDArray[np.float64], change: NDArray[np.float64], events: NDArray[np.float64], usable: NDArray[np.bool_]
) -> ShiftSums:
    """Sums of each of the tiles of an image."""
    return IntervalChanges(level, change, events, usable.view(np.uint8)).tile_sums(USABLE, GRID)


def sums_with(moved: NDArray[np.bool_], right_px: float) -> ShiftSums:
    """Sums of the tiles of a change whose events lie farther right where ``moved``."""
    change = scene()
    elsewhere = shift(change, (0, right_px), order=3, mode="wrap")
    return tile_sums(change, change, np.where(moved, elsewhere, change), np.ones(SHAPE, np.bool_))


@pytest.mark.parametrize("right_px", [-3.0, 0.5, 2.0])
def test_shifted_tiles_are_found(right_px: float) -> None:
    """A quarter of the image is named with its shift, to a tenth of a pixel and a tenth of the shift."""
    moved = np.zeros(SHAPE, np.bool_)
    moved[24:72, 32:96] = True
    found = most_shifted(sums_with(moved, right_px), 1, THRESHOLD, CLEAR)
    assert found is not None
    assert found.axis == 0
    assert found.shift_px == pytest.approx(right_px, abs=0.1 + 0.1 * abs(right_px))
    assert tile_around(found.alike, SHAPE) == (32, 24, 96, 72)
    assert abs(found.shift_px) > 5 * found.standard_error_px


def test_the_shifted_parts_may_be_the_most() -> None:
    """Where all tiles but four are shifted, these are named and not the four."""
    moved = np.ones(SHAPE, np.bool_)
    moved[:48, :64] = False
    found = most_shifted(sums_with(moved, 2.0), 1, THRESHOLD, CLEAR)
    assert found is not None
    assert found.shift_px == pytest.approx(2.0, abs=0.3)
    assert not found.alike.reshape(GRID, GRID)[:2, :2].any()


def test_parts_of_another_scene_have_no_shift() -> None:
    """Events of unrelated texture correlate too little for a peak of their own."""
    unrelated = tile_sums(scene(), scene(), scene(seed=1), np.ones(SHAPE, np.bool_))
    assert most_shifted(unrelated, 1, THRESHOLD, CLEAR) is None


def test_dark_tiles_are_left_out() -> None:
    """Tiles without a usable pixel neither crash nor count."""
    usable = np.ones(SHAPE, np.bool_)
    usable[:24] = False
    found = most_shifted(tile_sums(scene(), scene(), scene(), usable), 1, THRESHOLD, CLEAR)
    assert found is not None
    assert found.compared == GRID * (GRID - 1)
    assert abs(found.shift_px) < 1e-6


def signals(levels: np.ndarray, lit: np.ndarray) -> Callable[[int], tuple[np.ndarray, np.ndarray]]:
    """What frames show, a frame at a time."""
    return lambda frame: (levels[frame].astype(np.float32), lit[frame])


def flags_of(counts: np.ndarray, levels: np.ndarray) -> list[np.ndarray]:
    """Flags of all intervals, all pixels lit."""
    lit = np.ones(levels.shape, np.bool_)
    found = intervals(signals(levels, lit), counts, 0.2, 0.2, range(len(counts)))
    return [one.flags[0].copy() for one in found]


def test_pixels_whose_events_change_sign_have_turned() -> None:
    """Both signs in an interval, another sign than before, or nothing known before: turned; no events: not."""
    counts = np.zeros((3, 2, 1, 4), np.int32)
    counts[0, 1, 0, :3] = 1  # brighter; the last pixel is silent
    counts[1, :, 0, 0] = 1  # both signs
    counts[1, 0, 0, 1] = 2  # darker
    counts[2, 1, 0, 2] = 1  # brighter again
    turned = [(flags & KEPT == 0).tolist() for flags in flags_of(counts, np.zeros((4, 1, 4)))]
    assert turned == [[True, True, True, False], [True, True, False, False], [False] * 4]


def test_pixels_whose_frames_change_against_their_last_events_have_turned() -> None:
    """A pixel on its way back through both thresholds is silent: only its frames tell that it has turned."""
    counts = np.zeros((2, 2, 1, 3), np.int32)
    counts[0, 1, 0, :2] = 1  # brighter; the last pixel is silent
    levels = np.cumsum([[[0.0, 0.0, 0.0]], [[1.0, 1.0, -1.0]], [[-0.5, 0.5, -1.0]]], axis=0)
    _, later = flags_of(counts, levels)
    assert (later & KEPT == 0).tolist() == [False] * 3
    assert (later & SETTLED == 0).tolist() == [True, False, False]
    assert np.all(later & USABLE)


def test_intervals_say_what_frames_and_events_have_changed() -> None:
    """The change is that of the levels, events count by their thresholds, and dark pixels of either frame are out."""
    rng = np.random.default_rng(3)
    levels, counts = rng.normal(size=(3, 4, 5)).astype(np.float32), rng.poisson(1, (2, 2, 4, 5)).astype(np.int32)
    lit = rng.uniform(size=levels.shape) < 0.7
    for i, found in zip([1], intervals(signals(levels, lit), counts, 0.2, 0.3, [1]), strict=True):
        assert np.allclose(found.change, levels[i + 1] - levels[i], atol=1e-6)
        assert np.allclose(found.events, 0.2 * counts[i, 1] - 0.3 * counts[i, 0])
        assert np.array_equal(found.flags & USABLE != 0, lit[i] & lit[i + 1])


def test_intervals_that_are_not_asked_for_count_all_the_same() -> None:
    """Who has turned follows from all events before, whether their interval is asked for or not."""
    rng = np.random.default_rng(5)
    levels, counts = rng.normal(size=(6, 4, 5)), rng.poisson(0.5, (5, 2, 4, 5)).astype(np.int32)
    lit = np.ones(levels.shape, np.bool_)
    every = [one.flags.copy() for one in intervals(signals(levels, lit), counts, 0.2, 0.3, range(5))]
    some = [one.flags.copy() for one in intervals(signals(levels, lit), counts, 0.2, 0.3, [2, 4])]
    assert np.array_equal(some, [every[2], every[4]])
    assert len(np.unique(some)) > 2


def test_slopes_are_those_of_their_definition() -> None:
    """Sums over a part of the image: of |g| and g^2 of the level and g^2 of its change, where both pixels are used."""
    rng = np.random.default_rng(4)
    level, change = rng.normal(size=(2, 9, 12))
    flags = rng.integers(0, 8, (9, 12)).astype(np.uint8)
    part = IntervalChanges(level, change, change, flags).sums(KEPT, [(2, 8, 1, 11)])
    inside = slice(2, 8), slice(1, 11)
    used = (flags & KEPT > 0)[inside]
    for axis, along in ((0, 1), (1, 0)):
        both = used[:, 1:] & used[:, :-1] if along else used[1:] & used[:-1]
        slopes, steeper = (np.diff(image[inside], axis=along)[both] for image in (level, change))
        due = np.sum(np.abs(slopes)), np.sum(slopes**2), np.sum(steeper**2)
        assert np.allclose(part.slopes[0, :, axis], due)
    assert np.allclose(slope_sums(level[inside], change[inside], used), part.slopes[0])
    assert np.allclose(part.squares[0], np.sum(change[inside][used] ** 2))


def test_what_came_before_the_first_interval_tells_who_has_turned() -> None:
    """A pixel that goes on as before is kept; one that turns, and one of which nothing is known, are not."""
    counts, levels = np.zeros((1, 2, 1, 3), np.int32), np.zeros((2, 1, 3), np.float32)
    counts[0, 1] = 1
    before = np.zeros((2, 1, 3), np.int32)
    before[1, 0, 0], before[0, 0, 1] = 1, 1
    lit = np.ones(levels.shape, np.bool_)
    (told,), (untold,) = (
        [one.flags.copy() for one in intervals(signals(levels, lit), counts, 0.2, 0.2, [0], known)]
        for known in (before, None)
    )
    assert (told & KEPT > 0).tolist() == [[True, False, False]]
    assert not np.any(untold & KEPT)


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
