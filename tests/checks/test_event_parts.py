"""Parts of a sequence or an image whose events lie elsewhere, on images whose shift is known."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, shift

from fedora_qa.checks.event_response.orientation import EventSymmetry
from fedora_qa.diagnosis.event_response.orientation import hypotheses_of_symmetry
from fedora_qa.estimators.events.orientation import SYMMETRIES
from fedora_qa.estimators.events.shift import CLEAR, IntervalChanges, ShiftSums, most_shifted
from fedora_qa.estimators.events.shift_kernels import USABLE
from fedora_qa.views.event_camera import GRID, tile_around

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


def test_mirrored_frames_are_suspected_beside_mirrored_events() -> None:
    """Against frames alone one cannot tell which of the two is mirrored; exchanged axes only events can have."""
    for rival in range(2 * len(SYMMETRIES) - 1):
        symmetry = EventSymmetry.numbered(rival)
        words, causes = symmetry.text, {(each.cause, each.stream) for each in hypotheses_of_symmetry(symmetry)}
        assert (("mirrored", "rgb") in causes) == ("mirrored" in words and "axes" not in words)
        assert (("mirrored", "events") in causes) == ("mirrored" in words)
