"""Summaries of comparisons of IMU and poses, of rows whose residuals are chosen by hand."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from fedora_qa.estimators.fitting.grouped_fit import FitParameters, GroupedFit
from fedora_qa.estimators.fitting.normal_equations import block_equations
from fedora_qa.estimators.imu.samples import ComparisonRows
from fedora_qa.estimators.imu.summary import FEWEST_ROWS, OUTLIER, InertialFit, disturbed_interval, summarise

BIAS = FitParameters(("bias",), {"bias": (0,)}, (1e3,), (1e3,))
STEP_S = 0.01


def rows_of(residuals: ArrayLike, *, first: int = 0, sigma: float = 1.0, gain: float = 0.0) -> ComparisonRows:
    """Rows (n, 3) a step apart from number ``first`` on, of independent noise; a bias adds ``gain`` times its size."""
    values = np.asarray(residuals, dtype=np.float64)
    count = len(values)
    poses = first + np.arange(count)
    return ComparisonRows(
        poses=poses,
        times_s=STEP_S * poses,
        spans_s=np.full(count, STEP_S),
        residuals=values,
        model_errors=np.zeros((count, 3)),
        jacobians=np.full((count, 3, 1), gain),
        bias_jacobians=np.zeros((count, 3, 3)),
        covariance_bands=np.full((3, 1, count), sigma**2),
    )


def along_x(sizes: ArrayLike) -> NDArray[np.float64]:
    """Residuals of one axis."""
    return np.outer(np.asarray(sizes, dtype=np.float64), [1.0, 0.0, 0.0])


def summary(segments: Sequence[ComparisonRows], left_out: Sequence[int] = ()) -> InertialFit:
    """The summary of segments, without some rows of the first."""
    kept = [np.ones(len(rows), np.bool_) for rows in segments]
    kept[0][list(left_out)] = False
    used = [rows.select(keep) for rows, keep in zip(segments, kept, strict=True)]
    blocks = [block_equations(r.residuals, r.jacobians, r.covariance_bands, r.model_errors) for r in used]
    fit = GroupedFit(blocks, BIAS, np.zeros(1))
    return summarise(fit, list(segments), kept, np.zeros(1), None, list(segments), settled=True)


def test_rms_is_that_of_the_rows_that_were_fitted() -> None:
    """Residuals of 1 and 3, whose rows are expected to scatter by 2; a row that is left out is an outlier."""
    first = rows_of([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [99.0, 0.0, 0.0]], sigma=1.0)
    second = rows_of([[3.0, -3.0, 3.0]] * 2, first=3, sigma=3.0)
    found = summary([first, second], left_out=[2])
    assert (found.rms, found.expected_rms) == pytest.approx((np.sqrt(5), np.sqrt(5)))
    assert (found.rows, found.outliers) == (5, 1)
    assert found.worst.value == 99.0


@pytest.mark.parametrize("size", [1.0, 5.0])
def test_error_of_the_rms_is_that_of_second_differences(size: float) -> None:
    """Over many draws of second differences of white noise, the correlation of whose neighbours is -2/3.

    Of eight segments, the last has noise of another size.
    """
    noise = np.diff(np.random.default_rng(0).standard_normal((600, 8, 42, 3)), 2, axis=2)
    noise[:, -1] *= size
    measured = np.sqrt(np.mean(noise**2, axis=(1, 2, 3)))
    sizes = (*[1.0] * 7, size)
    segments = [rows_of(rows, sigma=of * np.sqrt(6)) for rows, of in zip(noise[0], sizes, strict=True)]
    assert np.std(measured) == pytest.approx(summary(segments).rms_error, rel=0.1)


def test_smoothness_is_the_correlation_of_neighbours() -> None:
    """n alternating or equal residuals have n - 1 products of neighbours; a row that is missing parts two of them."""
    equal, turning = along_x(np.ones(10)), along_x((-1.0) ** np.arange(10))
    assert summary([rows_of(equal)]).smoothness == pytest.approx(9 / 10)
    assert summary([rows_of(turning)]).smoothness == pytest.approx(-9 / 10)
    apart = rows_of(equal)
    apart = replace(apart, poses=apart.poses + (np.arange(10) >= 4))
    assert summary([apart]).smoothness == pytest.approx(8 / 10)
    assert summary([rows_of(equal), rows_of(equal, first=10)]).smoothness == pytest.approx(18 / 20)
    assert summary([rows_of(np.zeros((10, 3)))]).smoothness == 0.0


def test_worst_row_is_that_of_most_sigmas() -> None:
    """Five sigmas of 1 outweigh two sigmas of 10, of whichever segment and axis."""
    fine, coarse = rows_of(np.zeros((4, 3))), rows_of([[0.0, 20.0, 0.0]] * 3, first=4, sigma=10.0)
    fine.residuals[2, 1] = -5.0
    fine.model_errors[2] = 0.1, -0.2, 0.0
    for segments in ((fine, coarse), (coarse, fine)):
        worst = summary(segments).worst
        assert (worst.time_s, worst.value, worst.sigma) == (2 * STEP_S, -5.0, 1.0)
        assert worst.model_error == pytest.approx(0.2)
        assert worst.sensitivity == ((1.0, 0.0), (10.0, 0.0))
    assert summary([fine]).model_rms == pytest.approx(np.sqrt((0.1**2 + 0.2**2) / 12))


@pytest.mark.parametrize("count", [1, 999, 1000, 1001, 2500])
def test_course_holds_the_longest_residual_of_each_run(count: int) -> None:
    """A thousand runs at most, as even as NumPy splits them; of equal residuals the first."""
    residuals = np.random.default_rng(1).integers(0, 4, (count, 3)).astype(float)
    rows = rows_of(residuals)
    lengths = np.linalg.norm(residuals, axis=1)
    runs = np.array_split(np.arange(count), min(count, 1000))
    expected = [(rows.times_s[run][lengths[run].argmax()], lengths[run].max()) for run in runs]
    np.testing.assert_allclose(summary([rows]).course, expected)


def disturbed(first: int, last: int, size: float, count: int = 100) -> tuple[float, float] | None:
    """The disturbance of rows in two segments, of which those from ``first`` to ``last`` are off."""
    residuals = np.zeros((count, 3))
    residuals[first : last + 1, 2] = -size
    half = count // 2
    return disturbed_interval([rows_of(residuals[:half]), rows_of(residuals[half:], first=half)])


def test_a_disturbance_lasts_from_its_first_row_to_its_last() -> None:
    """It exceeds what the noise and the error of the model allow, and leaves a tenth of the rows alone."""
    assert disturbed(20, 70, OUTLIER + 0.01) == pytest.approx((0.2, 0.7))
    assert disturbed(20, 70, OUTLIER) is None
    assert disturbed(5, 94, 99.0) == pytest.approx((0.05, 0.94))
    assert disturbed(5, 95, 99.0) is None
    # Of few rows, as many must be alone as a segment needs.
    assert disturbed(0, 29 - FEWEST_ROWS, 99.0, count=30) is not None
    assert disturbed(0, 30 - FEWEST_ROWS, 99.0, count=30) is None
    allowed = rows_of(along_x(np.r_[10.0, np.zeros(20)]))
    assert disturbed_interval([replace(allowed, model_errors=allowed.residuals / 4)]) is None
    assert disturbed_interval([replace(allowed, model_errors=allowed.residuals / 6)]) is not None


def local_of(deviations: Sequence[float]) -> tuple[InertialFit, list[ComparisonRows]]:
    """Segments whose bias is 5 plus a deviation each; these add up to 0, so that the bias of all is 5."""
    made = [rows_of(np.full((10, 3), 5.0 + d), first=10 * i, gain=1.0) for i, d in enumerate(deviations)]
    return summary(made), made


@pytest.mark.parametrize(("deviations", "worst"), [((0.8, -1.0, 0.2), 0), ((0.6, -1.0, 0.4), 1)])
def test_of_segments_that_deviate_alike_the_largest_value_counts(deviations: Sequence[float], worst: int) -> None:
    """Deviations of 0.8 and -1 are alike, and 5.8 is more than 4; one of 0.6 is smaller."""
    found, segments = local_of(deviations)
    local = found.local_deviations["bias"]
    assert (local.value, local.deviation) == pytest.approx((5.0 + deviations[worst], deviations[worst]), abs=1e-4)
    assert (local.start_s, local.stop_s) == tuple(segments[worst].times_s[[0, -1]])
    assert local.standard_error == pytest.approx(30**-0.5, rel=1e-3)
    assert local.tests == 3


def test_two_segments_have_no_local_deviation() -> None:
    assert local_of((1.0, -1.0))[0].local_deviations == {}
