"""Normal equations of segments with correlated nuisances, against one dense system of all unknowns."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.normal_equations import (
    BlockEquations,
    MarkovNoise,
    SummedEquations,
    block_equations,
    inverse_of,
    markov_squares,
)

Floats = NDArray[np.float64]
SEGMENTS, ROWS, PARAMETERS, NUISANCES = 4, 30, 3, 2
BANDS = np.tile([np.full(ROWS, -1.0), np.full(ROWS, 2.5)], (3, 1, 1))
WEIGHT = np.linalg.inv(np.diag(np.full(ROWS, 2.5)) - np.eye(ROWS, k=1) - np.eye(ROWS, k=-1))
COVARIANCE = np.minimum.outer(np.arange(1.0, SEGMENTS + 1), np.arange(1.0, SEGMENTS + 1))


@dataclass(frozen=True)
class Rows:
    """Jacobians by parameters (s, n, 3, P) and nuisances (s, n, 3, Q), residuals and model errors (s, n, 3)."""

    jacobians: Floats
    nuisances: Floats
    residuals: Floats
    model_errors: Floats

    def blocks(self) -> list[BlockEquations]:
        joined = np.concatenate((self.jacobians, self.nuisances), axis=-1)
        return [
            block_equations(residuals, jacobians, BANDS, errors)
            for residuals, jacobians, errors in zip(self.residuals, joined, self.model_errors, strict=True)
        ]

    def products(self, first: Floats, second: Floats) -> Floats:
        """First^T C^-1 second of each segment, over rows and axes; both (s, n, 3, ...)."""
        return np.asarray(np.einsum("snap,nm,smaq->spq", first, WEIGHT, second))

    def nuisances_at(self, residuals: Floats) -> Floats:
        """The nuisances (s, Q) that fit residuals best under their prior, by one dense system."""
        own = np.kron(np.linalg.inv(COVARIANCE), np.eye(NUISANCES))
        for segment, normal in enumerate(self.products(self.nuisances, self.nuisances)):
            columns = slice(segment * NUISANCES, (segment + 1) * NUISANCES)
            own[columns, columns] += normal
        right = self.products(self.nuisances, residuals[..., np.newaxis]).ravel()
        return np.linalg.solve(own, right).reshape(SEGMENTS, NUISANCES)


@pytest.fixture(scope="module")
def rows() -> Rows:
    rng = np.random.default_rng(0)
    shape = (SEGMENTS, ROWS, 3)
    return Rows(
        rng.normal(size=(*shape, PARAMETERS)), rng.normal(size=(*shape, NUISANCES)), rng.normal(size=shape),
        rng.normal(size=shape),
    )  # fmt: skip


def left_after_nuisances(rows: Rows, residuals: Floats) -> Floats:
    """Residuals less what the best nuisances explain of them."""
    return residuals - np.einsum("snaq,sq->sna", rows.nuisances, rows.nuisances_at(residuals))


def test_scores_are_those_of_residuals_beside_the_best_nuisances(rows: Rows) -> None:
    """At any parameters, segment by segment; and without nuisances."""
    values = np.array([0.3, -0.2, 0.1])
    residuals = rows.residuals - rows.jacobians @ values
    due = rows.products(rows.jacobians, left_after_nuisances(rows, residuals)[..., np.newaxis])[..., 0]
    np.testing.assert_allclose(SummedEquations(rows.blocks(), PARAMETERS, COVARIANCE).scores(values), due, rtol=1e-9)
    plain = rows.products(rows.jacobians, residuals[..., np.newaxis])[..., 0]
    np.testing.assert_allclose(SummedEquations(rows.blocks(), PARAMETERS, None).scores(values), plain, rtol=1e-9)


def test_sums_are_those_of_what_the_nuisances_leave(rows: Rows) -> None:
    """Both right sides and the normal matrix; of the squares, the least sum with the prior of the nuisances."""
    sums = SummedEquations(rows.blocks(), PARAMETERS, COVARIANCE)
    for right, residuals in ((sums.right, rows.residuals), (sums.model_right, rows.model_errors)):
        left = left_after_nuisances(rows, residuals)
        np.testing.assert_allclose(right, rows.products(rows.jacobians, left[..., np.newaxis])[..., 0].sum(axis=0))
    for column in range(PARAMETERS):
        left = left_after_nuisances(rows, rows.jacobians[..., column])
        due = rows.products(rows.jacobians, left[..., np.newaxis])[..., 0].sum(axis=0)
        np.testing.assert_allclose(sums.normal[:, column], due, rtol=1e-9)
    left, fitted = left_after_nuisances(rows, rows.residuals), rows.nuisances_at(rows.residuals)
    prior = np.einsum("sq,st,tq->", fitted, np.linalg.inv(COVARIANCE), fitted)
    squares = rows.products(left[..., np.newaxis], left[..., np.newaxis]).sum()
    assert sums.squares == pytest.approx(squares + prior)


def test_nuisances_of_several_vectors_are_those_of_one_dense_system(rows: Rows) -> None:
    """A covariance between two nuisances of each segment, of one component each."""
    order = np.arange(1.0, SEGMENTS * NUISANCES + 1)
    covariance, values = np.minimum.outer(order, order), np.array([0.3, -0.2, 0.1])
    residuals = rows.residuals - rows.jacobians @ values
    own = np.linalg.inv(covariance)
    for segment, normal in enumerate(rows.products(rows.nuisances, rows.nuisances)):
        columns = slice(segment * NUISANCES, (segment + 1) * NUISANCES)
        own[columns, columns] += normal
    due = np.linalg.solve(own, rows.products(rows.nuisances, residuals[..., np.newaxis]).ravel())
    sums = SummedEquations(rows.blocks(), PARAMETERS, covariance)
    np.testing.assert_allclose(sums.nuisances(values), due.reshape(SEGMENTS, NUISANCES), rtol=1e-9)
    assert SummedEquations(rows.blocks(), PARAMETERS, None).nuisances(values).shape == (SEGMENTS, 0)


@pytest.mark.parametrize("upper", [0, 1, 2])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 30.0])
def test_markov_noise_is_whitened_as_by_its_dense_covariance(rows: Rows, upper: int, scale: float) -> None:
    """A Wiener process of two components, of no matter which size, that mixes the axes."""
    bands = np.tile([*[np.full(ROWS, -1.0)] * upper, np.full(ROWS, 6.0)], (3, 1, 1))
    white = sum(np.diag(np.full(ROWS - lag, 6.0 if lag == 0 else -1.0), lag) for lag in range(upper + 1))
    white = white + np.triu(white, 1).T
    jacobians, of_noise = rows.jacobians[0], scale * rows.nuisances[0]
    steps = np.arange(1.0, ROWS + 1)
    information = np.stack([np.full(ROWS, -1.0), np.append(np.full(ROWS - 1, 2.0), 1.0)])
    # (n, 3, n, 3): the same on each axis, and the disturbance of all.
    by_noise = np.einsum("nak,nm,mbk->namb", of_noise, np.minimum.outer(steps, steps), of_noise)
    deficits = 0.1 * np.einsum("nak,nak->na", of_noise, of_noise)
    by_noise -= np.einsum("na,nm,ab->namb", deficits, np.eye(ROWS), np.eye(3))
    covariance = np.einsum("nm,ab->namb", white, np.eye(3)) + by_noise
    weight = np.linalg.inv(covariance.reshape(3 * ROWS, 3 * ROWS))
    flat, residuals = jacobians.reshape(3 * ROWS, -1), rows.residuals[0].ravel()
    markov = MarkovNoise(of_noise, information, deficits)
    block = block_equations(rows.residuals[0], jacobians, bands, rows.model_errors[0], markov)
    np.testing.assert_allclose(block.normal, flat.T @ weight @ flat, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(block.right, flat.T @ weight @ residuals, rtol=1e-7, atol=1e-9)
    assert block.squares == pytest.approx(residuals @ weight @ residuals)
    # Products of random signs beside the diagonal scatter by the root of twice the trace at most.
    squares = np.trace(weight @ by_noise.reshape(3 * ROWS, 3 * ROWS))
    assert markov_squares(bands, markov) == pytest.approx(squares, abs=1e-9 + 1.5 * np.sqrt(2 * squares))


def test_equations_count_from_zero_wherever_they_were_linearised(rows: Rows) -> None:
    """Residuals from which a part was subtracted give the equations of those from which none was."""
    values = np.array([0.3, -0.2, 0.1])
    less = Rows(rows.jacobians, rows.nuisances, rows.residuals - rows.jacobians @ values, rows.model_errors)
    for block, whole in zip(less.blocks(), rows.blocks(), strict=True):
        again = block.linearised_at(values)
        np.testing.assert_allclose(again.right, whole.right, atol=1e-9)
        assert again.squares == pytest.approx(whole.squares)


def test_directions_without_information_have_the_least() -> None:
    """The inverse is NumPy's; a direction of none, at any scale, gets 1e-12 of the best one."""
    regular = np.array([[4.0, 1.0], [1.0, 9.0]])
    np.testing.assert_allclose(inverse_of(regular), np.linalg.inv(regular))
    scales = np.array([1.0, 1e6])
    # Scaled to a unit diagonal the information is 2 along (1, 1) and 0 along (1, -1).
    inverse = inverse_of(np.outer(scales, scales)) * np.outer(scales, scales)
    along, across = np.array([1.0, 1.0]) / np.sqrt(2), np.array([1.0, -1.0]) / np.sqrt(2)
    assert across @ inverse @ across == pytest.approx(1 / 2e-12, rel=1e-3)
    assert along @ inverse @ along == pytest.approx(0.5, abs=0.05)
