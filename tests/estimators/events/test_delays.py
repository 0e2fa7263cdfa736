"""Which part of a sequence or an image is late."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.events.delays import (
    CellSums,
    _jackknife,
    delays,
    delays_of_parts,
    largest_rectangle_step,
    largest_segment_step,
)
from fedora_qa.estimators.fitting.tails import student_factor


def sums_of(offset_s: np.ndarray, readings: int = 400, noise: float = 0.05, seed: int = 0) -> CellSums:
    """Normal equations of cells (w, c) with thresholds of 0.2 and the given delays."""
    rng = np.random.default_rng(seed)
    shape = offset_s.shape
    X = rng.normal(size=(*shape, readings, 3)) * [3.0, 3.0, 5.0]
    y = 0.2 * X[..., 0] + 0.2 * X[..., 1] + offset_s[..., np.newaxis] * X[..., 2]
    y += noise * rng.normal(size=y.shape)
    ones = np.full(shape, float(readings))
    return CellSums(
        np.einsum("wcni,wcnj->wcij", X, X), np.einsum("wcni,wcn->wci", X, y), (y**2).sum(axis=-1), ones, ones
    )


def test_cells_tell_their_delays() -> None:
    """Each cell's delay is within five of its errors, which are those of independent readings."""
    offset_s = np.linspace(-0.01, 0.01, 24).reshape(4, 6)
    found = delays(sums_of(offset_s))
    assert np.all(np.abs(found.seconds - offset_s.ravel()) < 5 * found.errors_s)
    assert found.errors_s == pytest.approx(0.05 / 5 / 20, rel=0.2)
    assert found.follows_frames.all()


def test_errors_of_honest_parts_have_unit_spread() -> None:
    """Over many draws windows scatter by their own standard error, to a fifth."""
    scores = []
    for seed in range(30):
        found = delays_of_parts(sums_of(np.zeros((6, 16)), seed=seed), 1)
        scores.append(found.seconds / found.errors_s)
    assert 0.75 < np.std(scores) < 1.1


def test_cells_that_scatter_widen_the_errors_of_all_parts() -> None:
    """Where delays of cells scatter by three formal errors, no tile has a formal error, however its own cells agree."""
    formal_s = 0.05 / 5 / 20
    offset_s = np.random.default_rng(2).normal(0, 3 * formal_s, (4, 16))
    parts = delays_of_parts(sums_of(offset_s), 0)
    assert np.min(parts.errors_s) > 2 * formal_s / np.sqrt(4)


def test_few_edges_that_err_alike_by_chance_make_no_stretch_late() -> None:
    """Four tiles a window tell, each off by an error of its own: no window of 1000 honest files stands out at 5 sigma.

    By leaving out its own tiles alone a window in 70 would, whose four errors agree by chance. The other twelve tiles,
    which tell a hundredth, scatter as they should, so that most tiles show no error.
    """
    rng = np.random.default_rng(4)
    largest, alone = [], []
    for seed in range(200):
        offset_s = np.zeros((5, 16))
        offset_s[:, :4] = rng.normal(0, 3e-3, (5, 4))
        sums = sums_of(offset_s, readings=100, noise=0.05, seed=seed)
        few = replace(CellSums(*(np.where(_told(value), value, value * 1e-2) for value in _parts(sums))),
                      counts=sums.counts)  # fmt: skip
        found = delays_of_parts(few, 1)
        step = largest_segment_step(found.seconds, found.errors_s)
        assert step is not None
        largest.append(abs(step.offset_s) / step.standard_error_s)
        alone.extend(np.abs(found.seconds / _jackknife(few, 1)))
    assert max(largest) < 5
    assert np.mean(np.array(alone) > 5) == pytest.approx(1 / 70, rel=0.3)


def _parts(sums: CellSums) -> list[np.ndarray]:
    return [getattr(sums, name) for name in CellSums.__slots__]


def _told(value: np.ndarray) -> np.ndarray:
    """The first four tiles."""
    tiles = np.arange(value.shape[1]) < 4
    return tiles.reshape(1, -1, *(1,) * (value.ndim - 2))


def test_late_stretch_is_found_with_its_ends() -> None:
    """Windows 3 to 5 that are 2 ms late are named, and by how much."""
    offset_s = np.zeros((10, 16))
    offset_s[3:6] = 2e-3
    found = delays_of_parts(sums_of(offset_s), 1)
    step = largest_segment_step(found.seconds, found.errors_s)
    assert step is not None
    assert np.flatnonzero(step.chosen).tolist() == [3, 4, 5]
    assert step.offset_s == pytest.approx(2e-3, rel=0.1)
    assert step.offset_s > 10 * step.standard_error_s


def test_late_region_is_found_with_its_sides() -> None:
    """A rectangle of 2 x 3 tiles that is early is named; errors of windows do not hide it."""
    early = np.zeros((4, 4))
    early[1:3, 1:4] = -2e-3
    found = delays_of_parts(sums_of(np.tile(early.ravel(), (8, 1))), 0)
    step = largest_rectangle_step(found.seconds, found.errors_s, (4, 4))
    assert step is not None
    assert step.chosen.reshape(4, 4).tolist() == (early < 0).tolist()
    assert step.offset_s == pytest.approx(-2e-3, rel=0.1)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_unknown_parts_belong_to_neither_side(seed: int) -> None:
    """Values that are NaN change neither the step nor its error."""
    rng = np.random.default_rng(seed)
    values, errors = rng.normal(size=6), rng.uniform(0.5, 2.0, size=6)
    spoilt = np.array([*values, np.nan])
    one, other = largest_segment_step(values, errors), largest_segment_step(spoilt, np.array([*errors, 1.0]))
    assert one is not None
    assert other is not None
    assert one.offset_s == pytest.approx(other.offset_s)


def test_empty_cells_are_unknown() -> None:
    """Cells without readings have no delay, and no part of them alone has."""
    nothing = CellSums(
        np.zeros((3, 4, 3, 3)), np.zeros((3, 4, 3)), np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((3, 4))
    )
    found = delays_of_parts(nothing, 1)
    assert not np.isfinite(found.seconds).any()
    assert largest_segment_step(found.seconds, found.errors_s) is None


def test_few_windows_make_regions_uncertain() -> None:
    """One tile against three of equal errors, each known by four degrees of freedom, has 6.86 of them."""
    values, errors = np.array([8.0, 0.0, 0.0, 0.0]), np.ones(4)
    known, estimated = (largest_rectangle_step(values, errors, (2, 2), freedom) for freedom in (np.inf, 4.0))
    assert known is not None
    assert estimated is not None
    freedom = 4.0 * (1 + 1 / 3) ** 2 / (1 + 3 / 9**2)
    assert estimated.standard_error_s == pytest.approx(known.standard_error_s * student_factor(freedom))
