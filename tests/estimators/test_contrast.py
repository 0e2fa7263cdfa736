"""Sharpness of warped events: votes are B-splines, and the true flow makes a moving pattern sharpest."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.stats import norm

from fedora_qa.estimators.contrast import GAINS, best_gain, sharpness_under
from fedora_qa.estimators.contrast_kernels import meetings_with_oneself, vote_warped

HEIGHT, WIDTH = 60, 90
UNIT = np.eye(2)


def events_of_dots(velocity_px: tuple[float, float], late: float = 0.0, seed: int = 3) -> tuple[np.ndarray, ...]:
    """Dots that drift by ``velocity_px`` an interval, each of which fires when it is in a pixel; columns, rows, tau."""
    rng = np.random.default_rng(seed)
    tau = np.sort(rng.uniform(0, 1, 6000))
    dot = rng.integers(0, 60, tau.size)
    starts = rng.uniform((20, 15), (WIDTH - 20, HEIGHT - 15), (60, 2))
    at = np.rint(starts[dot] + np.multiply.outer(tau - 0.5, velocity_px)).astype(np.uint16)
    return at[:, 0], at[:, 1], tau + late


def uniform_flow(u: float, v: float) -> np.ndarray:
    return np.broadcast_to(np.array([u, v], np.float32), (HEIGHT, WIDTH, 2)).copy()


@settings(deadline=None)  # the first call compiles
@given(st.floats(0, 1), st.floats(-6, 6), st.floats(-6, 6))
def test_a_vote_is_a_quadratic_spline(tau: float, u: float, v: float) -> None:
    """One event leaves the product of two B-splines, of sum 1, at the place where it is at the middle."""
    image, flow = np.zeros((1, HEIGHT, WIDTH)), uniform_flow(u, v)
    at = np.array([40], np.uint16), np.array([30], np.uint16), np.array([tau])
    carried = vote_warped(*at, flow[np.newaxis], np.zeros(1, np.int64), UNIT[np.newaxis], 12.0, image)
    spline = BSpline.basis_element([-1.5, -0.5, 0.5, 1.5], extrapolate=False)
    column, row = 40 + (0.5 - tau) * float(flow[0, 0, 0]), 30 + (0.5 - tau) * float(flow[0, 0, 1])
    expected = np.outer(*(np.nan_to_num(spline(np.arange(n) - x)) for n, x in ((HEIGHT, row), (WIDTH, column))))
    assert carried == 1
    np.testing.assert_allclose(image[0], expected, atol=1e-6)


@pytest.mark.parametrize("velocity_px", [(12.0, 0.0), (-7.0, 5.0)])
@pytest.mark.parametrize("too_large", [0.8, 1.0, 1.3])
def test_gain_of_a_drift_is_found(velocity_px: tuple[float, float], too_large: float) -> None:
    """Dots that drift are sharpest under the flow divided by what it is too large by, whenever their clock starts."""
    x, y, tau = events_of_dots(velocity_px)
    flow = uniform_flow(*(too_large * component for component in velocity_px))
    found = [
        best_gain(sharpness_under(x, y, tau + late, [(flow, gain * UNIT) for gain in GAINS]).sharpness)
        for late in (0.0, 0.1)
    ]
    assert found == pytest.approx([1 / too_large] * 2, rel=0.03)


def test_backward_and_exchanged_flow_smear() -> None:
    """The true flow is sharper than none, and none is sharper than the flow turned round or with exchanged axes."""
    x, y, tau = events_of_dots((9.0, 4.0))
    flow = uniform_flow(9.0, 4.0)
    true, none, back, exchanged = sharpness_under(
        x, y, tau, [(flow, UNIT), (flow, 0 * UNIT), (flow, -UNIT), (flow, UNIT[::-1])]
    ).sharpness
    assert true > 1.5 * none > 1.5 * back
    assert true > 1.5 * exchanged


def test_all_candidates_carry_the_same_events() -> None:
    """An event without a flow in one candidate counts for none, so that sharpness can be compared."""
    x, y, tau = events_of_dots((5.0, 0.0))
    whole, half = uniform_flow(5.0, 0.0), uniform_flow(5.0, 0.0)
    half[:, : WIDTH // 2] = np.nan
    alone, together = (sharpness_under(x, y, tau, [(one, UNIT), (half, UNIT)]) for one in (half, whole))
    assert alone.carried == together.carried < len(x)
    np.testing.assert_allclose(alone.sharpness, together.sharpness)


def test_nothing_to_carry_is_nothing() -> None:
    """Without events, or without a flow, nothing is carried and nothing breaks."""
    x, y, tau = events_of_dots((5.0, 0.0))
    nowhere = np.full((HEIGHT, WIDTH, 2), np.nan, np.float32)
    for found in (sharpness_under(x[:0], y[:0], tau[:0], [(uniform_flow(1, 1), UNIT)]),
                  sharpness_under(x, y, tau, [(nowhere, UNIT)])):  # fmt: skip
        assert (found.carried, found.sharpness.tolist(), found.way_px) == (0, [0.0], 0.0)


def test_meetings_of_a_pixel_with_itself_are_those_of_all_pairs() -> None:
    """Without an image of votes: the sum over ordered pairs of a pixel's events of the Gaussian at their distance."""
    rng = np.random.default_rng(8)
    x, y = (rng.integers(20, 24, 40).astype(np.uint16) for _ in range(2))
    tau = np.sort(rng.uniform(0, 1, x.size))
    turns = np.array([0.0 * UNIT, UNIT, 1.5 * UNIT])
    flow = uniform_flow(4.0, -3.0)[np.newaxis]
    found = meetings_with_oneself(x, y, tau, flow, np.zeros(3, np.int64), turns, 12.0, 1.2, x.size)
    same = (x[:, np.newaxis] == x) & (y[:, np.newaxis] == y) & ~np.eye(x.size, dtype=bool)
    for gain, met in zip((0.0, 1.0, 1.5), found, strict=True):
        apart = 5.0 * gain * (tau[:, np.newaxis] - tau)
        assert met == pytest.approx(float(norm.pdf(apart, scale=1.2 * 2**0.5)[same].sum()) / (1.2 * (4 * np.pi) ** 0.5))


def test_pixels_that_fire_in_place_move_no_gain() -> None:
    """As many events that flicker in still pixels as there are drifting ones would draw the gain to 0; they do not."""
    x, y, tau = events_of_dots((5.0, 2.0))
    rng = np.random.default_rng(6)
    pixels = rng.integers((15, 15), (WIDTH - 15, HEIGHT - 15), (400, 2))[rng.integers(0, 400, tau.size)]
    late = rng.uniform(0, 1, tau.size)
    columns = [np.concatenate(pair) for pair in ((x, pixels[:, 0]), (y, pixels[:, 1]), (tau, late))]
    both = columns[0].astype(np.uint16), columns[1].astype(np.uint16), columns[2]
    flow = uniform_flow(5.0, 2.0)
    gain = best_gain(sharpness_under(*both, [(flow, gain * UNIT) for gain in GAINS]).sharpness)
    assert gain == pytest.approx(1.0, abs=0.05)
