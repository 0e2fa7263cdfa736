"""Sharpness of warped events: votes are Gaussians, and the true flow makes a moving pattern sharpest."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from fedora_qa.estimators.flow.contrast import (
    GAINS,
    SensorFlow,
    SensorView,
    WarpableEvents,
    WarpedEvents,
    best_gain,
    sharpness_under,
)
from fedora_qa.estimators.flow.contrast_kernels import EventsInFlow, carry

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


def warped(
    x: np.ndarray, y: np.ndarray, tau: np.ndarray, candidates: list[tuple[np.ndarray, np.ndarray]]
) -> WarpedEvents:
    """Events in any order, carried by every candidate: a flow and what it is multiplied by."""
    events = WarpableEvents.pixel_by_pixel(x, y, tau)
    return sharpness_under(events, [(SensorFlow(flow).at(events), [turn]) for flow, turn in candidates])


@settings(deadline=None)  # the first call compiles
@given(st.lists(st.tuples(st.integers(36, 44), st.integers(26, 34), st.floats(0.3, 0.7)), min_size=1, max_size=6,
                unique_by=lambda event: event[:2]))  # fmt: skip
def test_votes_are_as_wide_as_gaussians(events: list[tuple[int, int, float]]) -> None:
    """The sum of squares of the image of votes is that of Gaussians at the places that events are carried to."""
    x, y, tau = (np.array(column) for column in zip(*events, strict=True))
    found = warped(x.astype(np.uint16), y.astype(np.uint16), tau, [(uniform_flow(20, 10), UNIT)])
    places = np.stack((x + (0.5 - tau) * 20, y + (0.5 - tau) * 10), axis=-1)
    apart = places[:, np.newaxis] - places
    pairs = norm.pdf(apart[..., 0], scale=2**0.5) * norm.pdf(apart[..., 1], scale=2**0.5)
    assert len(found.carried) == len(events)
    assert found.sharpness[0] * len(events) == pytest.approx(pairs.sum(), rel=0.03)


def test_events_are_carried_to_the_middle() -> None:
    """By the turned flow at the pixel where their point was at the start: here another one than where they fired."""
    flow_px = np.zeros((HEIGHT, WIDTH, 2), np.float32)
    flow_px[:, :40], flow_px[:, 40:] = (8.0, -2.0), (6.0, 0.0)
    event = WarpableEvents.pixel_by_pixel(np.array([42], np.uint16), np.array([20], np.uint16), np.array([0.75]))
    flow = SensorFlow(flow_px).at(event)
    places = []
    for turn in (UNIT, -UNIT, 0.0 * UNIT, 1e3 * UNIT):
        column, row = np.zeros(1, np.float32), np.zeros(1, np.float32)
        in_flow = EventsInFlow(event.x, event.y, event.tau, flow.flows_px, flow.indices)
        carry(in_flow, flow.sensor.folded, turn.astype(np.float32), column, row)
        places += [(column[0], row[0])] if column[0] >= 0 else []
    np.testing.assert_allclose(places, [(42 - 0.25 * 8, 20 + 0.25 * 2), (42 + 0.25 * 6, 20), (42, 20)], atol=1e-5)


def test_flow_is_read_where_the_event_camera_sees_it() -> None:
    """A pixel of the event camera may lie between pixels of the flow, and be larger: the nearest one tells."""
    columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    flow_px = np.stack((2.0 * columns + rows, columns - rows), axis=-1).astype(np.float32)
    seen_px = SensorView(1.5, 0.25, 2.0, -0.75, 1 / 1.5, 1 / 2.0).of(flow_px, np.ones(40, np.bool_), 70).flow_px
    column, row = 15, 7  # of 1.5 * 10 + 0.25 and 2 * 4 - 0.75
    np.testing.assert_allclose(seen_px[4, 10], ((2 * column + row) / 1.5, (column - row) / 2.0), rtol=1e-6)
    assert np.isnan(seen_px[0, 50]).all()  # above the first row
    assert np.isnan(seen_px[20, 60]).all()  # behind the last column
    np.testing.assert_array_equal(
        SensorView().of(flow_px, np.ones(len(flow_px), np.bool_), flow_px.shape[1]).flow_px, flow_px
    )


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("left", [0.0, 3.0])
def test_a_mirrored_grid_keeps_values(axis: int, left: float) -> None:
    """What an event reads in the flow turned over is what it would in a file that stores it so, or a neighbour's."""
    columns, rows = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    flow_px = np.stack((0.2 * columns, 0.2 * rows), axis=-1).astype(np.float32)
    view, shape = SensorView(2.0, left, 2.0, 1.0, 0.5, 0.5), (HEIGHT // 2, WIDTH // 2)
    wanted = np.ones(shape[0], np.bool_)
    x, y = (values.ravel().astype(np.uint16) for values in np.meshgrid(np.arange(shape[1]), np.arange(shape[0])))
    events = WarpableEvents.pixel_by_pixel(x, y, np.zeros(x.size))
    turned = view.mirrored(view.of(flow_px, wanted, shape[1]), axis, flow_px.shape).at(events).flows_px
    stored = view.of(np.flip(flow_px, 1 - axis), wanted, shape[1]).at(events).flows_px
    both = np.isfinite(turned).all(axis=0) & np.isfinite(stored).all(axis=0)
    assert both.mean() > 0.9
    np.testing.assert_allclose(turned[:, both], stored[:, both], atol=0.101)  # 0.2 px a pixel, half as large


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


def test_the_best_gain_lies_between_the_neighbours_of_the_sharpest() -> None:
    """However flat the maximum is, to the last digits of the sharpness; at either end it is that gain itself."""
    flat = 1 - np.arange(4) * 2.0**-53
    for sharpest in range(1, len(GAINS) - 1):
        for before, after in product(flat[1:], flat):
            sharpness = np.full(len(GAINS), 0.1)
            sharpness[sharpest - 1 : sharpest + 2] = before, 1.0, after
            gain = best_gain(sharpness)
            assert GAINS[sharpest - 1] * (1 - 1e-12) <= gain <= GAINS[sharpest + 1] * (1 + 1e-12)
    assert best_gain(-np.array(GAINS)) == GAINS[0]
    assert best_gain(np.array(GAINS)) == GAINS[-1]


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
    half[:, : WIDTH // 2] = np.nan
    alone, together = (warped(x, y, tau, [(one, UNIT), (half, UNIT)]) for one in (half, whole))
    np.testing.assert_array_equal(alone.carried, together.carried)
    assert len(alone.carried) < len(x)
    np.testing.assert_allclose(alone.sharpness, together.sharpness)


def test_nothing_to_carry_is_nothing() -> None:
    """Without events, or without a flow, nothing is carried and nothing breaks."""
    x, y, tau = events_of_dots((5.0, 0.0))
    nowhere = np.full((HEIGHT, WIDTH, 2), np.nan, np.float32)
    for found in (warped(x[:0], y[:0], tau[:0], [(uniform_flow(1, 1), UNIT)]),
                  warped(x, y, tau, [(nowhere, UNIT)])):  # fmt: skip
        assert (len(found.carried), found.sharpness.tolist(), found.way_px) == (0, [0.0], 0.0)


def test_meetings_of_a_pixel_with_itself_are_taken_off() -> None:
    """Of events of one pixel each votes alone, wherever it is carried to: as if no other were there."""
    rng = np.random.default_rng(8)
    tau = np.sort(rng.uniform(0, 1, 12))
    x, y = (np.full(12, at, np.uint16) for at in (40, 30))
    candidates = [(uniform_flow(6.0, -4.0), gain * UNIT) for gain in (0.0, 0.5, 1.0, 1.5)]
    together = warped(x, y, tau, candidates).sharpness
    assert together == pytest.approx([1 / (4 * np.pi)] * 4, rel=0.2)
    assert warped(x + np.arange(12, dtype=np.uint16) % 2, y, tau, candidates).sharpness[0] > 4 / (4 * np.pi)


def test_meetings_are_taken_off_whole_over_all_places_between_nodes() -> None:
    """On average over 11 x 11 pixels, which are 10 nodes wide, events of one pixel add what Gaussians alone would."""
    tau = np.sort(np.random.default_rng(8).uniform(0.4, 0.6, 12))
    candidates = [(uniform_flow(6.0, -4.0), gain * UNIT) for gain in (0.0, 0.5, 1.0, 2.0)]
    found = [
        warped(np.full(12, x, np.uint16), np.full(12, y, np.uint16), tau, candidates).sharpness
        for x in range(40, 51)
        for y in range(25, 36)
    ]
    assert np.mean(found, axis=0) == pytest.approx([1 / (4 * np.pi)] * 4, rel=0.01)


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
