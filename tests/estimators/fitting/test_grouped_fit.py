"""Grouped fits against dense generalised least squares."""

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.grouped_fit import FitParameters, GroupedFit, group_of
from fedora_qa.estimators.fitting.normal_equations import BlockEquations, block_equations

NAMES = ("offset", "slope_x", "slope_y", "slope_z")
PARAMETERS = FitParameters(NAMES, {"offset": (0,), "slope": (1, 2, 3)}, (1e3,) * 4, (1e3,) * 4)
AT_ZERO = np.zeros(4)


def banded(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The covariance of differences of white noise, as bands and dense."""
    bands = np.array([np.full(count, -1.0), np.full(count, 2.5)])
    dense = np.diag(bands[1]) + np.diag(bands[0, 1:], 1) + np.diag(bands[0, 1:], -1)
    return bands, dense


def alike(bands: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same bands on each of three axes."""
    return np.tile(bands, (3, 1, 1))


def rows(values: NDArray[np.float64], seed: int, count: int = 60) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Jacobians, and residuals with noise of the banded covariance."""
    random = np.random.default_rng(seed)
    jacobians = random.standard_normal((count, 3, len(values)))
    noise = np.linalg.cholesky(banded(count)[1]) @ random.standard_normal((count, 3))
    return jacobians, jacobians @ values + noise


def blocks(values: NDArray[np.float64], number: int = 8, first_seed: int = 0) -> list[BlockEquations]:
    made = []
    for seed in range(first_seed, first_seed + number):
        jacobians, residuals = rows(values, seed)
        made.append(block_equations(residuals, jacobians, alike(banded(60)[0]), np.zeros_like(residuals)))
    return made


def test_all_parameters_together_are_generalised_least_squares() -> None:
    """The joint solution is that of dense linear algebra."""
    values = np.array([0.3, -0.2, 0.1, 0.5])
    information, right = np.zeros((4, 4)), np.zeros(4)
    weight = np.linalg.inv(banded(60)[1])
    for seed in range(8):
        jacobians, residuals = rows(values, seed)
        for axis in range(3):
            information += jacobians[:, axis].T @ weight @ jacobians[:, axis]
            right += jacobians[:, axis].T @ weight @ residuals[:, axis]
    fit = GroupedFit(blocks(values), PARAMETERS, AT_ZERO)
    np.testing.assert_allclose(fit.values_of_all(), np.linalg.solve(information, right), rtol=1e-6)


def test_noise_frees_nothing_and_its_errors_hold() -> None:
    """Without a fault no group is freed, and values lie about as far from 0 as their errors say."""
    deviations = []
    for seed in range(0, 400, 8):
        fit = GroupedFit(blocks(AT_ZERO, first_seed=seed), PARAMETERS, AT_ZERO)
        assert fit.free == ()
        deviations += [one.value / one.standard_error for one in fit.estimates.values()]
    assert 0.7 < np.std(deviations) < 1.1
    assert np.max(np.abs(deviations)) < 4.5


def test_a_fault_frees_its_own_group_only() -> None:
    """A group that is off is freed and found to size; the other is tested beside it and stays at 0."""
    values = np.array([0.0, 2.0, 0.0, -1.0])
    fit = GroupedFit(blocks(values), PARAMETERS, AT_ZERO)
    fitted = fit.estimates
    assert fit.free == ("slope",)
    assert not fitted["offset"].free
    assert abs(fitted["offset"].value) < 5 * fitted["offset"].standard_error
    for name, value in zip(NAMES, values, strict=True):
        assert fitted[name].value == pytest.approx(value, abs=5 * fitted[name].standard_error)
    assert fitted["slope_x"].explained["slope"] > 0.99
    assert fitted["slope_x"].explained["offset"] < 0.1


def test_values_count_from_zero_wherever_it_was_linearised() -> None:
    """What was taken out of the samples is part of the value."""
    values = np.array([0.0, 2.0, 0.0, -1.0])
    whole = GroupedFit(blocks(values), PARAMETERS, AT_ZERO)
    rest = GroupedFit(blocks(values - [0.0, 1.5, 0.0, 0.0]), PARAMETERS, np.array([0.0, 1.5, 0.0, 0.0]))
    np.testing.assert_allclose(rest.values_of_free(), whole.values_of_free(), rtol=1e-9)
    assert rest.misfit == pytest.approx(whole.misfit, rel=1e-6)


def test_excess_noise_widens_the_errors_and_frees_nothing() -> None:
    """Noise of five times the declared size frees no group, and all errors grow fivefold."""
    quiet = GroupedFit(blocks(AT_ZERO), PARAMETERS, AT_ZERO).estimates
    loud_blocks = []
    for seed in range(8):
        jacobians, residuals = rows(AT_ZERO, seed)
        loud_blocks.append(block_equations(5 * residuals, jacobians, alike(banded(60)[0]), np.zeros_like(residuals)))
    loud = GroupedFit(loud_blocks, PARAMETERS, AT_ZERO)
    assert loud.free == ()
    assert loud.misfit == pytest.approx(5, rel=0.1)
    for name, one in loud.estimates.items():
        assert one.standard_error > 4 * quiet[name].standard_error


def test_what_the_data_do_not_show_is_as_uncertain_as_it_can_be() -> None:
    """A parameter without influence has the error of its largest conceivable value."""
    jacobians, residuals = rows(AT_ZERO, 0)
    jacobians[..., 0] = 0.0
    fit = GroupedFit(
        [block_equations(residuals, jacobians, alike(banded(60)[0]), np.zeros_like(residuals))], PARAMETERS, AT_ZERO
    )
    assert fit.estimates["offset"].standard_error == pytest.approx(1e3, rel=0.2)


def test_known_error_of_the_model_is_carried_to_the_parameters() -> None:
    """A model error along a column moves that parameter by just its size."""
    made = []
    for seed in range(4):
        jacobians, residuals = rows(AT_ZERO, seed)
        made.append(block_equations(residuals, jacobians, alike(banded(60)[0]), 0.01 * jacobians[..., 0]))
    assert GroupedFit(made, PARAMETERS, AT_ZERO).estimates["offset"].model_error == pytest.approx(0.01, rel=1e-6)


def test_nuisances_are_eliminated_as_in_a_joint_solution() -> None:
    """Eliminating nuisances that walk from stretch to stretch equals solving for all unknowns with their prior."""
    number, random = 5, np.random.default_rng(3)
    covariance = np.minimum.outer(np.arange(1.0, 6), np.arange(1.0, 6))
    made = []
    joint, right = np.zeros((4 + number, 4 + number)), np.zeros(4 + number)
    joint[4:, 4:] = np.linalg.inv(covariance)
    weight = np.linalg.inv(banded(60)[1])
    for place in range(number):
        jacobians, residuals = rows(AT_ZERO, place)
        nuisance = random.standard_normal((60, 3, 1))
        made.append(block_equations(residuals, np.concatenate((jacobians, nuisance), axis=-1), alike(banded(60)[0]),
                                    np.zeros_like(residuals)))  # fmt: skip
        unknowns = [*range(4), 4 + place]
        for axis in range(3):
            columns = np.concatenate((jacobians[:, axis], nuisance[:, axis]), axis=-1)
            joint[np.ix_(unknowns, unknowns)] += columns.T @ weight @ columns
            right[unknowns] += columns.T @ weight @ residuals[:, axis]
    fit = GroupedFit(made, PARAMETERS, AT_ZERO, covariance)
    np.testing.assert_allclose(fit.values_of_all(), np.linalg.solve(joint, right)[:4], rtol=1e-5)


@pytest.mark.parametrize(("name", "group"), [("bias_x", "bias"), ("time_offset", "time_offset"), ("slope_z", "slope")])
def test_groups_by_name(name: str, group: str) -> None:
    """An axis at the end of a name is not part of the group's."""
    assert group_of(name) == group


def test_stretches_deviate_as_their_own_errors_say() -> None:
    """Alone, each stretch strays from the fit of all by its own standard error; one that is off stands out, to size."""
    deviations = []
    for seed in range(0, 240, 8):
        local = GroupedFit(blocks(AT_ZERO, first_seed=seed), PARAMETERS, AT_ZERO).local("offset")
        deviations += list(local.deviations / local.standard_errors)
    assert np.std(deviations) == pytest.approx(1.0, abs=0.1)
    made = [*blocks(AT_ZERO, number=7), *blocks(np.array([3.0, 0.0, 0.0, 0.0]), number=1, first_seed=7)]
    fit = GroupedFit(made, PARAMETERS, AT_ZERO)
    local = fit.local("offset")
    assert int(np.argmax(np.abs(local.deviations) / local.standard_errors)) == 7
    there = fit.values_of_free()[0] + local.deviations[7]
    assert there == pytest.approx(3.0, abs=4 * local.standard_errors[7])


@pytest.mark.parametrize("motion", [0.0, 0.7, 5.0])
def test_noise_that_regressors_share_with_residuals_is_taken_off(motion: float) -> None:
    """Values scatter about the truth no wider than their errors say, where a regressor's noise is the residual's own.

    The noise that serves as scatter is another draw of both. Without it the mean is off by nearly 1 at rest.
    """
    deviations, parameters = [], FitParameters(("gain",), {"gain": (0,)}, (1e3,), (1e3,))
    for seed in range(60):
        random = np.random.default_rng(seed)
        signal = motion * random.standard_normal((80, 3))
        own, other = random.standard_normal((2, 80, 3))
        white = np.tile(np.ones((1, 80)), (3, 1, 1))
        nothing = np.zeros((80, 3))
        found = GroupedFit(
            [block_equations(own, (signal + own)[..., None], white, nothing)],
            parameters,
            np.zeros(1),
            scatters=[block_equations(other, other[..., None], white, nothing)],
        ).estimates["gain"]
        assert not found.free
        deviations.append(found.value / found.standard_error)
    assert abs(np.mean(deviations)) < 0.4
    assert 0.7 < np.std(deviations) < 1.2


def nearly_collinear(error_at: float) -> GroupedFit:
    """Offset and gain whose columns differ by a thousandth, and residuals of a sine that neither describes."""
    made = []
    for segment in range(8):
        times = np.linspace(segment, segment + 1, 60)
        jacobians = np.zeros((60, 3, 2))
        jacobians[:, 0, 0], jacobians[:, 0, 1] = 1.0, 1.0 + 1e-3 * np.sin(2 * np.pi * times / 8)
        residuals = np.zeros((60, 3))
        residuals[:, 0] = 0.1 + error_at * np.sin(2 * np.pi * (times / 8 + 0.1))
        made.append(block_equations(residuals, jacobians, np.ones((3, 1, 60)) * 1e-6, np.zeros_like(residuals)))
    collinear = FitParameters(("offset", "gain"), {"offset": (0,), "gain": (1,)}, (1e3,) * 2, (0.05,) * 2)
    return GroupedFit(made, collinear, np.zeros(2))


def test_collinear_parameters_that_absorb_an_unknown_residual_measure_nothing() -> None:
    """A sine of 0.1 gives values of 100, whose whole size counts as model error; without it the offset is measured."""
    absorbed = nearly_collinear(0.1)
    assert set(absorbed.free) == {"offset", "gain"}
    for parameter in absorbed.estimates.values():
        assert abs(parameter.value) > 10
        assert not parameter.determined
        assert parameter.model_error == abs(parameter.value)
    offset = nearly_collinear(0.0).estimates["offset"]
    assert offset.value == pytest.approx(0.1)
    assert offset.determined


def test_a_barred_group_stays_out() -> None:
    """The next best group takes its place."""
    values = np.array([5.0, 1.0, 0.0, 0.0])
    free = GroupedFit(blocks(values), PARAMETERS, AT_ZERO).free
    assert free[0] == "offset"
    assert GroupedFit(blocks(values), PARAMETERS, AT_ZERO, barred=("offset",)).free == ("slope",)


AXES = FitParameters(
    ("bias_x", "bias_y", "offset"), {"bias": (0, 1), "offset": (2,)}, (1e4,) * 3, (1e4,) * 3
)  # fmt: skip


def on_axes(values: NDArray[np.float64], number: int = 8, count: int = 50) -> list[BlockEquations]:
    """Segments without noise, each of whose three parameters acts on one axis by its own size."""
    jacobians, white = np.tile(np.eye(3), (count, 1, 1)), np.ones((3, 1, count))
    return [block_equations(jacobians @ values, jacobians, white, np.zeros((count, 3))) for _ in range(number)]


def test_orthogonal_groups_explain_their_own_squares() -> None:
    """Of values 2, 1 and 3 on three axes the squares are 5 and 9 of 14; what the first leaves, the second explains."""
    fit = GroupedFit(on_axes(np.array([2.0, 1.0, 3.0])), AXES, np.zeros(3))
    fitted = fit.estimates
    assert fit.free == ("offset", "bias")
    assert fitted["offset"].explained == pytest.approx({"offset": 9 / 14, "bias": 5 / 14})
    assert fitted["bias_x"].explained == pytest.approx({"offset": 9 / 14, "bias": 1.0})


def test_groups_that_are_not_free_leave_their_rivals_all_they_explain() -> None:
    fitted = GroupedFit(on_axes(np.array([0.0, 0.0, 3.0])), AXES, np.zeros(3)).estimates
    assert fitted["bias_y"].explained == pytest.approx({"offset": 1.0})
    silent = GroupedFit(on_axes(np.zeros(3)), AXES, np.zeros(3)).estimates
    assert silent["bias_y"].explained == {}


@pytest.mark.parametrize("values", [(0.0, 0.0, 0.0), (2.0, 1.0, 0.0)], ids=["nothing free", "bias free"])
def test_biases_of_segments_move_their_own_parameter_at_most_by_their_mean(values: tuple[float, ...]) -> None:
    """Bounds of segments add up whatever their signs; a segment itself deviates by its own, and from a free mean."""
    bounds = np.zeros((8, 2))
    bounds[:, 0], bounds[3, 1] = np.arange(8.0), 4.0
    fit = GroupedFit(on_axes(np.array(values)), AXES, np.zeros(3), segment_biases=bounds)
    fitted = fit.estimates
    assert [fitted[name].model_error for name in AXES.names] == pytest.approx([28 / 8, 4 / 8, 0.0], abs=1e-6)
    mean_bounds = bounds.mean(axis=0) if fit.free else np.zeros(2)
    for axis, name in enumerate(AXES.names[:2]):
        np.testing.assert_allclose(fit.local(name).model_errors, bounds[:, axis] + mean_bounds[axis], atol=1e-6)
    np.testing.assert_allclose(fit.local("offset").model_errors, 0.0, atol=1e-6)


def with_means(means: NDArray[np.float64], noise: float, count: int = 50) -> GroupedFit:
    """One offset of segments of 50 rows of three axes, which differ by their means and by steps up and down."""
    offset = FitParameters(("offset",), {"offset": (0,)}, (1e4,), (1e4,))
    made = []
    for mean in means:
        residuals = np.tile(mean + noise * (-1.0) ** np.arange(count), (3, 1)).T
        made.append(block_equations(residuals, np.ones((count, 3, 1)), np.ones((3, 1, count)), np.zeros((count, 3))))
    return GroupedFit(made, offset, np.zeros(1))


def test_segments_that_scatter_give_the_error_of_their_mean() -> None:
    """Of eight means about 0 it is their standard deviation over the root of eight; three are too few to tell."""
    means = np.array([0.5, -0.7, 0.1, 0.9, -0.4, -0.8, 0.6, -0.2])
    error = with_means(means, 0.1).estimates["offset"].standard_error
    assert error == pytest.approx(means.std(ddof=1) / np.sqrt(8), rel=1e-6)
    few = with_means(np.array([0.5, -0.7, 0.2]), 0.1)
    assert few.estimates["offset"].standard_error == pytest.approx(max(1.0, few.misfit) / np.sqrt(3 * 150), rel=1e-6)


@pytest.mark.parametrize("noise", [0.5, 1.0, 3.0])
def test_segments_that_agree_have_the_error_of_their_rows(noise: float) -> None:
    """The rms of 1200 rows over their root, never less than declared; one parameter was fitted."""
    fit = with_means(np.zeros(8), noise)
    assert fit.misfit == pytest.approx(noise * np.sqrt(1200 / 1199), rel=1e-6)
    assert fit.estimates["offset"].standard_error == pytest.approx(max(1.0, fit.misfit) / np.sqrt(1200), rel=1e-6)
    local = fit.local("offset")
    np.testing.assert_allclose(local.standard_errors, max(1.0, fit.misfit) / np.sqrt(150), rtol=1e-6)


def test_few_segments_that_scatter_by_chance_are_seldom_taken_to_differ() -> None:
    """Means of four segments scatter as their 150 rows say: the error of their mean is widened once in a hundred."""
    means = np.random.default_rng(7).normal(0, 150**-0.5, (2000, 4))
    errors = [with_means(row, 0.9).estimates["offset"].standard_error for row in means]
    assert 0.004 < np.mean(np.array(errors) > 1.01 / np.sqrt(600)) < 0.02
