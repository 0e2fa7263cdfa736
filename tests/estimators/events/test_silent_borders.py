"""Silent borders of a sensor: columns that are not there stand out, a view without edges does not."""

import numpy as np
import pytest

from fedora_qa.estimators.events.silent_borders import silent_border

ROWS, COLUMNS = 90, 120


def active_pixels(share: np.ndarray, seed: int) -> np.ndarray:
    """Numbers of pixels with events in columns, by the share of their pixels that an edge reaches."""
    return np.random.default_rng(seed).binomial(ROWS, share)


def uneven(seed: int) -> np.ndarray:
    """Shares of columns of a view with texture, from 0.4 to 0.7."""
    x = np.arange(COLUMNS)
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi)
    return 0.55 + 0.15 * np.sin(x / 9.0 + phase)


@pytest.mark.parametrize("added", [1, 2, 10, COLUMNS])
@pytest.mark.parametrize("seed", range(4))
def test_columns_that_are_not_there_stand_out(added: int, seed: int) -> None:
    """One column more, and twice as many, are found with their number, although the columns differ."""
    border = silent_border(np.append(active_pixels(uneven(seed), seed), np.zeros(added, np.int64)))
    assert border is not None
    assert border.width_px == added
    assert border.z > 6


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("silent", [1, 5, 30])
def test_a_view_that_fades_is_no_border(silent: int, seed: int) -> None:
    """Edges that grow rarer towards an even floor leave its columns silent."""
    share = np.clip((COLUMNS - silent - np.arange(COLUMNS)) / 40.0, 0.0, 1.0) ** 2
    border = silent_border(active_pixels(0.6 * share, seed))
    assert border is not None
    assert border.z < 5


@pytest.mark.parametrize(
    "active", [[], [0, 0, 0], [3, 4, 2], [5, 0, 0, 0], [0] * 119 + [1]], ids=["no", "none", "all", "one", "last"]
)
def test_few_columns_tell_nothing(active: list[int]) -> None:
    """No columns, none with events, all with events, or one: nothing to compare."""
    assert silent_border(np.array(active, np.int64)) is None
