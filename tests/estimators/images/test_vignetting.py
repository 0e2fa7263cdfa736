"""Fall-off of the brightness from ratios of cells: exact where they are, with an error that their scatter confirms."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.images.vignetting import (
    FEWEST_CELLS,
    PARTS,
    CellRatios,
    PairEquations,
    VignettingFit,
    fit_vignetting,
    pair_equations,
)

COUNT = PARTS[0] * PARTS[1]


def cells_of(a: float, exposure: float, seed: int, sigma: float = 0.0, count: int = 300) -> CellRatios:
    """Cells anywhere in the image that move anywhere, whose brightness follows g exp(-a s)."""
    random = np.random.default_rng(seed)
    before, after = random.uniform(0, 1, (2, count))
    log_ratios = exposure - a * (after - before) + sigma * random.standard_normal(count)
    return CellRatios(log_ratios, before - after, np.full(count, 1e-8), 100 * before, random.integers(0, COUNT, count))


def equations_of(cells: CellRatios) -> PairEquations:
    equations = pair_equations(cells)
    assert equations is not None
    return equations


def fit_of(*pairs: CellRatios) -> VignettingFit:
    fit = fit_vignetting([equations_of(pair) for pair in pairs])
    assert fit is not None
    return fit


@settings(deadline=None)  # the first call compiles
@given(a=st.floats(-1, 1), exposures=st.lists(st.floats(-2, 2), min_size=1, max_size=4))
def test_exact_ratios_give_the_fall_off_whatever_the_exposures(a: float, exposures: list[float]) -> None:
    """Each pair has a constant of its own."""
    pairs = [cells_of(a, exposure, seed) for seed, exposure in enumerate(exposures)]
    assert fit_of(*pairs).a == pytest.approx(a, abs=1e-9)


@given(loss_percent=st.floats(0.0, 90.0))
def test_loss_is_that_of_the_corner(loss_percent: float) -> None:
    """A corner at 70% of the brightness has lost 30%; a centre at 70% of that of the corner, -30%."""
    a = -np.log1p(-loss_percent / 100)
    assert VignettingFit(a, 0.1, 0.0, 0.1).loss_percent == pytest.approx(loss_percent)
    assert VignettingFit(-a, 0.1, 0.0, 0.1).loss_percent == pytest.approx(-loss_percent)


def test_errors_are_those_of_many_trials() -> None:
    """Independent cells: estimates scatter as much as stated, or a little less."""
    fits = [fit_of(*(cells_of(0.1, 0.3, 10 * trial + k, 0.02) for k in range(5))) for trial in range(300)]
    pulls = np.array([(fit.a - 0.1) / fit.standard_error for fit in fits])
    assert abs(pulls.mean()) < 0.2
    assert 0.75 < pulls.std() < 1.05


def test_outliers_do_not_move_it() -> None:
    """A tenth of the cells are of other surfaces."""
    cells = cells_of(0.2, 0.0, 1, 0.01)
    cells.log_ratios[::10] += np.where(cells.inward[::10] > 0, 1.5, -0.5)
    assert fit_of(cells).a == pytest.approx(0.2, abs=0.02)


def test_errors_that_parts_share_widen_the_error() -> None:
    """Each part of the image errs by one amount, that of no noise of cells."""
    random = np.random.default_rng(2)
    shared, pairs = 0.05 * random.standard_normal(COUNT), [cells_of(0.0, 0.0, seed, 0.005) for seed in range(6)]
    independent = fit_of(*pairs).standard_error
    for cells in pairs:
        cells.log_ratios[:] += shared[cells.parts] * cells.inward
    assert fit_of(*pairs).standard_error > 2 * independent


def test_one_dn_is_the_step() -> None:
    """Where cells of 100 DN lie half-way to the corner, in the square, a = 0.02 darkens them by 1 DN."""
    cells = cells_of(0.0, 0.0, 3)
    cells.darkening_dn[:] = 100 * 0.5
    assert fit_of(cells).step == pytest.approx(0.02)


def test_bound_is_the_change_by_the_logarithms_of_noisy_sums() -> None:
    """The mean of ln(1 + e) is -sigma^2 / 2: at worst all cells that move inward err so, and no others."""
    exact, variance = cells_of(0.2, 0.1, 4), 1e-3
    cells = replace(exact, rounding_variances=np.full(300, variance))
    inward = np.sign(cells.inward - cells.inward.mean())
    wrong = replace(cells, log_ratios=cells.log_ratios + inward * variance / 2)
    bound = fit_of(cells).model_error_bound
    # Huber's weights discount a part of the change.
    assert 0.9 * bound < fit_of(wrong).a - fit_of(cells).a <= bound


def test_bound_counts_the_scatter_of_the_cells() -> None:
    """Noise of 3% of all cells, which no rounding explains, is in the sums as well."""
    cells = cells_of(0.2, 0.1, 4, sigma=0.03)
    inward = np.sign(cells.inward - cells.inward.mean())
    wrong = replace(cells, log_ratios=cells.log_ratios + inward * 0.03**2 / 2)
    assert fit_of(wrong).a - fit_of(cells).a == pytest.approx(fit_of(cells).model_error_bound, rel=0.2)


def test_too_few_cells_or_no_motion_give_nothing() -> None:
    """Cells that all move alike determine the constant of the pair alone."""
    assert pair_equations(cells_of(0.1, 0.0, 1, count=FEWEST_CELLS - 1)) is None
    assert pair_equations(cells_of(0.1, 0.0, 1, count=FEWEST_CELLS)) is not None
    still = cells_of(0.1, 0.0, 1)
    still.inward[:] = 0.0
    assert pair_equations(still) is None
    assert fit_vignetting([]) is None
