"""Errors of fields of one rate whose tiles scatter differently."""

from dataclasses import replace

import numpy as np
import pytest

from fedora_qa.checks.flow_photometric.rate_statistics import fit_fields, scales_of
from fedora_qa.estimators.fitting.tails import student_factor
from fedora_qa.estimators.flow.field_fit import fit_field, templates_of_flow
from fedora_qa.views.flow_intervals import Interval
from fedora_qa.views.flow_residuals import FieldResidual

TILES = 9
ERROR_PX = 0.01


def field(row: int, scatter_px: float, flow_px: float) -> FieldResidual:
    """A field whose tiles scatter by so much about no residual, stated to err by 0.01 px, and that moves by flow_px."""
    rng = np.random.default_rng(row)
    errors = rng.normal(0, scatter_px, (TILES, 2))
    flows = flow_px * rng.uniform(0.5, 1.5, (TILES, 2))
    templates = templates_of_flow(flows, np.zeros((TILES, 2, 2)), np.sin(2 * np.pi * flows), None)
    fit = fit_field(errors, np.tile(np.eye(2) * ERROR_PX**2, (TILES, 1, 1)), templates)
    interval = Interval("flow/10hz", row, 0, 100_000_000)
    seen = FieldResidual(interval, row, TILES, TILES, 0)
    return replace(seen, spread=fit.spread, freedom=fit.freedom, evidence=fit.evidence)


def test_a_field_of_motion_among_equal_frames_keeps_its_error() -> None:
    """Two fields whose frames are equal to the last bit make a third, of a fast turn, no more certain."""
    still, moving = [field(0, 1e-8, 1e-8), field(2, 1e-8, 1e-8)], field(1, ERROR_PX, 30.0)
    scales = scales_of([still[0], moving, still[1]])
    assert scales[0] == scales[2] < 1e-4
    assert scales[1] == pytest.approx(student_factor(moving.freedom) * np.sqrt(moving.spread))
    rate = fit_fields([still[0], moving, still[1]])
    alone = fit_fields([moving])
    assert rate is not None
    assert alone is not None
    assert rate.gain.errors[0] == pytest.approx(alone.gain.errors[0], rel=0.05)


def test_fields_alike_share_their_error() -> None:
    """Ten honest fields have one factor, that of their median."""
    scales = scales_of([field(row, ERROR_PX, 3.0) for row in range(10)])
    assert scales == pytest.approx([scales[0]] * 10)
    assert scales[0] == pytest.approx(1.0, abs=0.25)


def test_fields_that_tell_no_scatter_have_formal_errors() -> None:
    """Without degrees of freedom the factor is 1."""
    assert scales_of([FieldResidual(Interval("flow/10hz", 0, 0, 1), 0, 0, 0, 0)]) == [1.0]
