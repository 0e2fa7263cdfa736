"""Fields of one rate are composed along the paths of pixels, and two rates share intervals."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sequence.window import Sampling
from fedora_qa.views.flow_chains import Chain, compose, segments
from tests.support.flow_world import FlowWorld, make_world, pixel_grid, true_flow_px

Fields = NDArray[Any]


@cache
def clean() -> FlowWorld:
    return make_world((10, 25, 50))


def test_composition_is_the_true_flow() -> None:
    """Five fields of 50 Hz follow each pixel of a plane to where it truly is after 0.1 s, within the stated bound."""
    window = clean().windows(Sampling())[0]
    columns, rows = (grid[20:-20:4, 20:-20:4].ravel() for grid in pixel_grid())
    composed = compose(window, Chain("flow/50hz", (0, 1, 2, 3, 4)), columns, rows)
    true_px = true_flow_px(0.0, 0.1)[20:-20:4, 20:-20:4].reshape(-1, 2)
    used = composed.clear & composed.stays
    assert np.count_nonzero(used) > 500
    errors_px = np.linalg.norm(composed.displacement_px - true_px, axis=-1)
    assert np.all(errors_px[used] <= composed.bound_px[used])
    assert np.median(composed.bound_px[used]) < 0.02


def test_steps_too_small_for_a_break_are_in_the_bound() -> None:
    """Two surfaces meet at 40.2 px, and at 42.8 px one field later; what is read between them mixes both flows."""
    near_px, far_px = 2.6, 2.52

    def two_surfaces(name: str, fields: Fields) -> Fields:
        if name != "flow/50hz":
            return fields
        flow_px = np.zeros_like(fields)
        for field, edge in ((0, 40.2), (1, 42.8)):
            flow_px[field, ..., 0] = np.where(np.arange(fields.shape[2]) <= edge, near_px, far_px)
        return flow_px

    window = clean().with_flow(two_surfaces).windows(Sampling())[0]
    columns, rows = np.arange(30.0, 50.0), np.full(20, 60.0)
    composed = compose(window, Chain("flow/50hz", (0, 1)), columns, rows)
    errors_px = np.abs(composed.displacement_px[:, 0] - 2 * np.where(columns <= 40.2, near_px, far_px))
    assert composed.clear.all()
    assert errors_px.max() > 0.04
    assert np.all(errors_px <= composed.bound_px)


def test_common_intervals() -> None:
    """Two rates meet at the ends of the shortest interval that both fill by whole fields."""
    window = clean().windows(Sampling())[0]
    found = [(segment.slow.rows, segment.fast.rows) for segment in segments(window, "flow/10hz", "flow/25hz")]
    assert found == [((0, 1), (0, 1, 2, 3, 4))]
    found = [(segment.slow.rows, segment.fast.rows) for segment in segments(window, "flow/25hz", "flow/50hz")]
    assert found[:2] == [((0,), (0, 1)), ((1,), (2, 3))]
