"""Sharpness of warped events: votes are Gaussians, and the true flow makes a moving pattern sharpest."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from fedora_qa.estimators.contrast import (
    GAINS,
    SeenFlow,
    WarpedEvents,
    best_gain,
    blank_canvas,
    pixel_by_pixel,
    sharpness_under,
)
from fedora_qa.estimators.contrast_kernels import PARTS, carry, meetings_with_oneself, sum_of_squares

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


def uniform_flow(u: float, v: float) -> SeenFlow:
    return SeenFlow(np.broadcast_to(np.array([u, v], np.float32), (HEIGHT, WIDTH, 2)).copy())


def warped(
    x: np.ndarray, y: np.ndarray, tau: np.ndarray, candidates: list[tuple[SeenFlow, np.ndarray]]
) -> WarpedEvents:
    """Events in any order, carried on a canvas that must be blank again afterwards."""
    order, canvas = pixel_by_pixel(x, y), blank_canvas(HEIGHT, WIDTH)
    found = sharpness_under(x[order], y[order], tau[order], candidates, canvas)
    assert not canvas.any()
    return found


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.tuples(st.floats(0, 1), st.floats(30, 34), st.floats(30, 34)), min_size=1, max_size=6))
def test_votes_are_gaussians(events: list[tuple[float, float, float]]) -> None:
    """The sum of squares is that of the image of votes: each the Gaussian of sum 1 at where the event is carried to."""
    weights = np.exp(-0.5 * np.square(np.arange(-3, 5) - np.arange(PARTS)[:, None] / PARTS)).astype(np.float32)
    weights /= weights.sum(axis=1, keepdims=True)
    places = np.array([(column, row) for _, column, row in events], dtype=np.float32)
    canvas = blank_canvas(HEIGHT, WIDTH)
    image = sum(np.outer(*(norm.pdf(np.arange(n) - at) for n, at in zip((HEIGHT, WIDTH), place[::-1], strict=True)))
                for place in places)  # fmt: skip
    assert sum_of_squares(places, weights, canvas) == pytest.approx(float(np.sum(np.square(image))), rel=0.01)
    assert not canvas.any()


def test_events_are_carried_to_the_middle() -> None:
    """By the turned flow at the pixel where their point was at the start: here another one than where they fired."""
    flow_px = np.zeros((HEIGHT, WIDTH, 2), np.float32)
    flow_px[:, :40], flow_px[:, 40:] = (8.0, -2.0), (6.0, 0.0)
    one, at = SeenFlow(flow_px), (np.array([42], np.uint16), np.array([20], np.uint16), np.array([0.75]))
    turns = np.array([UNIT, -UNIT, 0.0 * UNIT])
    places = carry(*at, flow_px, np.array(one.view), one.at(*at[:2]), turns, (HEIGHT, WIDTH))
    np.testing.assert_allclose(places[:, 0], [(42 - 0.25 * 8, 20 + 0.25 * 2), (42 + 0.25 * 6, 20), (42, 20)], atol=1e-5)


def test_flow_is_read_where_the_event_camera_sees_it() -> None:
    """A pixel of the event camera may lie between pixels of the flow, and be larger; a mirrored grid keeps values."""
    columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    flow_px = np.stack((2.0 * columns + rows, columns - rows), axis=-1).astype(np.float32)
    seen = SeenFlow(flow_px, (1.5, 0.25, 2.0, -0.5, 1 / 1.5, 1 / 2.0))
    x, y = np.array([10, 50, 60], np.uint16), np.array([4, 0, 20], np.uint16)
    column, row = 1.5 * 10 + 0.25, 2.0 * 4 - 0.5
    expected = ((2 * column + row) / 1.5, (column - row) / 2.0)
    nothing = (np.nan, np.nan)  # above the first row, and behind the last column but a quarter
    np.testing.assert_allclose(seen.at(x, y), [expected, nothing, nothing], rtol=1e-6)
    np.testing.assert_array_equal(SeenFlow(flow_px).mirrored(0).at(x[:1], y[:1])[0], flow_px[4, WIDTH - 1 - 10])
    np.testing.assert_array_equal(SeenFlow(flow_px).mirrored(1).at(x[:1], y[:1])[0], flow_px[HEIGHT - 1 - 4, 10])


@pytest.mark.parametrize("velocity_px", [(12.0, 0.0), (-7.0, 5.0)])
@pytest.mark.parametrize("too_large", [0.8, 1.0, 1.3])
def test_gain_of_a_drift_is_found(velocity_px: tuple[float, float], too_large: float) -> None:
    """Dots that drift are sharpest under the flow divided by what it is too large by, whenever their clock starts."""
    x, y, tau = events_of_dots(velocity_px)
    flow = uniform_flow(*(too_large * component for component in velocity_px))
    found = [
        best_gain(warped(x, y, tau + late, [(flow, gain * UNIT) for gain in GAINS]).sharpness) for late in (0.0, 0.1)
    ]
    assert found == pytest.approx([1 / too_large] * 2, rel=0.03)


def test_backward_and_exchanged_flow_smear() -> None:
    """The true flow is sharper than none, and none is sharper than the flow turned round or with exchanged axes."""
    x, y, tau = events_of_dots((9.0, 4.0))
    flow = uniform_flow(9.0, 4.0)
    true, none, back, exchanged = warped(
        x, y, tau, [(flow, UNIT), (flow, 0 * UNIT), (flow, -UNIT), (flow, UNIT[::-1])]
    ).sharpness
    assert true > 1.5 * none > 1.5 * back
    assert true > 1.5 * exchanged


def test_all_candidates_carry_the_same_events() -> None:
    """An event without a flow in one candidate counts for none, so that sharpness can be compared."""
    x, y, tau = events_of_dots((5.0, 0.0))
    whole, half = uniform_flow(5.0, 0.0), uniform_flow(5.0, 0.0)
    half.flow_px[:, : WIDTH // 2] = np.nan
    alone, together = (warped(x, y, tau, [(one, UNIT), (half, UNIT)]) for one in (half, whole))
    assert alone.carried == together.carried < len(x)
    np.testing.assert_allclose(alone.sharpness, together.sharpness)


def test_nothing_to_carry_is_nothing() -> None:
    """Without events, or without a flow, nothing is carried and nothing breaks."""
    x, y, tau = events_of_dots((5.0, 0.0))
    nowhere = SeenFlow(np.full((HEIGHT, WIDTH, 2), np.nan, np.float32))
    for found in (warped(x[:0], y[:0], tau[:0], [(uniform_flow(1, 1), UNIT)]),
                  warped(x, y, tau, [(nowhere, UNIT)])):  # fmt: skip
        assert (found.carried, found.sharpness.tolist(), found.way_px) == (0, [0.0], 0.0)


def test_meetings_of_a_pixel_with_itself_are_those_of_all_pairs() -> None:
    """Without an image of votes: the sum over ordered pairs of a pixel's events of the Gaussian at their distance."""
    rng = np.random.default_rng(8)
    x, y = (rng.integers(20, 24, 40).astype(np.uint16) for _ in range(2))
    tau = np.sort(rng.uniform(0, 1, x.size))
    turns = np.array([0.0 * UNIT, UNIT, 1.5 * UNIT])
    order, flows = pixel_by_pixel(x, y), np.broadcast_to((4.0, -3.0), (1, x.size, 2)).copy()
    pixels = (y.astype(np.int64) * WIDTH + x)[order]
    found = meetings_with_oneself(pixels, tau[order], flows, np.zeros(3, np.int64), turns, 1.2, x.size)
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
    gain = best_gain(warped(*both, [(flow, gain * UNIT) for gain in GAINS]).sharpness)
    assert gain == pytest.approx(1.0, abs=0.05)
