"""Area averages over the event camera's pixels against closed forms and brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.events.footprint import LEFT_BY_SHARP, FootprintAxis
from tests.estimators.event_world import Waves, camera_matrix, footprints, weighted_means

FINE = 4  # steps of a frame pixel: 9 fine pixels make an event pixel at the ratio of 9/4
EVENT, FRAME = (8, 12), (18, 27)
PRINTS = footprints(camera_matrix(27, 18), FRAME, camera_matrix(12, 8), EVENT)


def average(image: np.ndarray) -> np.ndarray:
    """Means over footprints, by the uniform reconstruction."""
    return weighted_means(PRINTS, "uniform", image)


def edge_aware_average(image: np.ndarray) -> np.ndarray:
    """Means over footprints, by the edge-aware reconstruction."""
    return weighted_means(PRINTS, "edge_aware", image)


def split_bound(contrast: np.ndarray) -> np.ndarray:
    """Sum of s (1 - s) d over the footprints, relative to their size, of the shares s of pixels with contrast d."""
    return average(contrast) - weighted_means(PRINTS, "split", contrast)


def mean_over(fine: np.ndarray, size: int) -> np.ndarray:
    """Means over blocks of an image."""
    rows, columns = fine.shape[0] // size, fine.shape[1] // size
    return fine[: rows * size, : columns * size].reshape(rows, size, columns, size).mean(axis=(1, 3))


def test_averages_of_a_plane_are_exact() -> None:
    """a + b u + c v averages to its value at the footprint's centre, by both reconstructions."""
    rows, columns = np.indices(FRAME)
    centre_rows, centre_columns = np.indices(EVENT)
    expected = 3 + 2 * ((centre_columns + 0.5) * 2.25 - 0.5) - 5 * ((centre_rows + 0.5) * 2.25 - 0.5)
    assert np.allclose(edge_aware_average(3.0 + 2 * columns - 5 * rows), expected, atol=1e-9)
    # An even pixel that is cut off centre gives its mean, not its slope: at most half of the slope where it is cut.
    assert np.all(np.abs(average(3.0 + 2 * columns - 5 * rows) - expected) < 3.5)
    assert np.allclose(average(np.full(FRAME, 7.0)), 7.0)
    assert PRINTS.rows.inside.all()
    assert PRINTS.columns.inside.all()


def test_what_is_packed_is_unpacked() -> None:
    """An axis as one array, and back: the same weights, for the same pixels."""
    for axis in (PRINTS.rows, PRINTS.columns):
        unpacked = FootprintAxis.unpacked(axis.packed())
        assert np.array_equal(unpacked.inside, axis.inside)
        for name in ("uniform", "edge_aware", "split"):
            assert np.array_equal(getattr(unpacked, name).first, getattr(axis, name).first)
            assert np.array_equal(getattr(unpacked, name).weights, getattr(axis, name).weights)


def test_even_average_is_that_of_even_pixels() -> None:
    """With every frame pixel of one value, the mean over 2.25 x 2.25 px is that of the finer image, exactly."""
    frame = np.random.default_rng(0).uniform(0, 255, FRAME)
    fine = frame.repeat(FINE, axis=0).repeat(FINE, axis=1)
    assert np.allclose(average(frame), mean_over(fine, 9))


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=50, deadline=None)
def test_split_bound_holds_for_any_image(seed: int) -> None:
    """However the light lies within the pixels, the even average errs by no more than the bound."""
    rng = np.random.default_rng(seed)
    fine = rng.choice([0.0, 100.0, 255.0], (FRAME[0] * FINE, FRAME[1] * FINE), p=[0.5, 0.2, 0.3])
    blocks = fine.reshape(FRAME[0], FINE, FRAME[1], FINE)
    contrast = blocks.max(axis=(1, 3)) - blocks.min(axis=(1, 3))
    error = np.abs(average(mean_over(fine, FINE)) - mean_over(fine, 9))
    assert np.all(error <= split_bound(contrast) + 1e-9)


def test_split_bound_is_reached_by_a_step_along_the_border() -> None:
    """A step that runs where the footprint cuts the pixel errs by s (1 - s) of its height over the footprint."""
    frame = np.zeros(FRAME)
    frame[:, 2] = 0.75 * 80.0  # bright right of 1/4 of the pixel, which is where the first footprint ends
    contrast = np.zeros(FRAME)
    contrast[:, 2] = 80.0
    error = average(frame)[:, 0] - 0.0
    assert np.allclose(error, 0.25 * 0.75 * 80.0 / 2.25)
    assert np.all(error <= split_bound(contrast)[:, 0] + 1e-9)


def test_sharp_average_is_nearer_to_the_truth_on_smooth_images() -> None:
    """Against closed-form means of waves of 4 event px and longer, the cubic errs at most a third as much."""
    world = Waves(seed=3)
    frame, truth = world.luma(0.1, FRAME, 2.25), world.luma(0.1, EVENT)
    sharp, even = (np.std(method(frame) - truth) for method in (edge_aware_average, average))
    assert sharp < even / 3


def test_footprints_beyond_the_frame_are_marked() -> None:
    """A frame that looks past the event camera's left edge leaves its first columns outside."""
    K = camera_matrix(27, 18)
    K[0, 2] -= 3.0
    inside = footprints(K, FRAME, camera_matrix(12, 8), EVENT).columns.inside
    assert inside[2:].all()
    assert not inside[:2].any()


@pytest.mark.parametrize(("moved_px", "share"), [(1, 0.68), (2, 0.38), (3, 0.23), (4, 0.20)])
def test_sharp_reconstruction_of_steps_is_off_by_a_share_of_what_the_even_one_moves(
    moved_px: int, share: float
) -> None:
    """Amplitudes of the change by moving unit steps, integrated over all places of the step, are those documented."""
    places = np.arange(0, 27, 0.01)
    columns = np.clip(np.arange(27) + 1 - places[:, np.newaxis], 0, 1)
    frames = np.broadcast_to(columns[:, np.newaxis, :], (len(places), 18, 27))
    centres = 2.25 * (np.arange(12) + 0.5)
    truth = np.clip((centres + 1.125 - places[:, np.newaxis]) / 2.25, 0, 1)
    even, sharp = (np.array([method(frame)[4] for frame in frames]) for method in (average, edge_aware_average))
    shift = 100 * moved_px
    inner = slice(4, 8)

    def amplitude(read: np.ndarray) -> float:
        change, due = (image[shift:, inner] - image[:-shift, inner] for image in (read, truth))
        return float((change * due).sum() / (due * due).sum())

    off, moved = 1 - amplitude(sharp), amplitude(sharp) - amplitude(even)
    assert off / moved == pytest.approx(share, abs=0.02)
    assert off / moved <= LEFT_BY_SHARP
