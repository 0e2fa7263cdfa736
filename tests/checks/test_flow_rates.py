"""Rates of flow are composed and compared: clean files pass, the odd rate is named, with its fault."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.checks.flow_rates.composition import FlowRatesComposition
from fedora_qa.diagnosis.hypotheses import hypotheses_of
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Judged
from fedora_qa.sequence.window import Sampling
from fedora_qa.views.flow_chains import Chain, compose, segments
from tests.support.flow_world import FlowWorld, judged, make_world, pixel_grid, true_flow_px

Fields = NDArray[Any]


@cache
def clean() -> FlowWorld:
    return make_world((10, 25, 50))


def with_rate(rate_hz: int, change: Callable[[Fields], Fields]) -> FlowWorld:
    """The clean file with one rate changed."""
    stream = f"flow/{rate_hz}hz"
    return clean().with_flow(lambda name, fields: change(fields.copy()) if name == stream else fields)


def best(result: Judged) -> Hypothesis:
    """The hypothesis that explains most, over all alarms."""
    assert result.result.outcome == "failed", result.result
    support: dict[tuple[str, str], float] = {}
    hypotheses = [hypothesis for alarm in result.alarms for hypothesis in hypotheses_of(alarm, clean().facts)]
    for hypothesis in hypotheses:
        key = hypothesis.cause, hypothesis.stream
        support[key] = support.get(key, 0.0) + hypothesis.support
    cause = max(support, key=lambda key: support[key])
    return max((h for h in hypotheses if (h.cause, h.stream) == cause), key=lambda hypothesis: hypothesis.support)


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


@pytest.mark.parametrize("share", [0.05, 0.25, 1.0])
def test_clean_file_passes(share: float) -> None:
    """Nothing but interpolation and rounding remains, at any effort."""
    result = judged(FlowRatesComposition(), clean(), tile_share=share).result
    assert result.outcome == "passed"
    assert max(one.value or 0.0 for one in result.measurements if one.name.endswith("error")) < 0.01


def next_field(fields: Fields) -> Fields:
    return np.concatenate((fields[:1], fields[:-1]))


def frozen(fields: Fields) -> Fields:
    fields[8:11] = fields[7]
    return fields


RATE_FAULTS: dict[str, tuple[int, Callable[[Fields], Fields], str, float | None]] = {
    "sign": (10, lambda flow: -flow, "flow_sign", None),
    "sign of the middle": (25, lambda flow: -flow, "flow_sign", None),
    "axes": (50, lambda flow: flow[..., ::-1], "axes_swapped", None),
    "v up": (10, lambda flow: flow * np.float32([1, -1]), "frame_convention", None),
    "gain": (50, lambda flow: 1.05 * flow, "flow_gain", 5.0),
    "small gain": (25, lambda flow: 0.995 * flow, "flow_gain", -0.5),
    "px/s": (10, lambda flow: 10 * flow, "flow_unit", 10.0),
    "px/s of the fastest": (50, lambda flow: 50 * flow, "flow_unit", 50.0),
    "px s": (25, lambda flow: 0.04 * flow, "flow_unit", 0.04),
    "mirrored": (25, lambda flow: flow[:, :, ::-1], "mirrored", None),
    "late by one": (25, next_field, "flow_interval_shifted", 1.0),
    "frozen": (50, frozen, "frozen_frames", 3.0),
}


@pytest.mark.parametrize(("rate_hz", "change", "cause", "size"), RATE_FAULTS.values(), ids=RATE_FAULTS)
def test_the_odd_rate_is_named(
    rate_hz: int, change: Callable[[Fields], Fields], cause: str, size: float | None
) -> None:
    """Of three rates the one that disagrees with the others is named, with its fault and size."""
    hypothesis = best(judged(FlowRatesComposition(), with_rate(rate_hz, change)))
    assert (hypothesis.cause, hypothesis.stream) == (cause, f"flow/{rate_hz}hz")
    if size is not None:
        assert hypothesis.magnitude == pytest.approx(size, rel=0.03)


def test_fields_of_another_rate_are_recognised() -> None:
    """Fields of 50 Hz under the name of 25 Hz are recognised bit for bit, and not taken for a gain of a half."""
    fast = clean().rows_by_key["path/flow/50hz"]
    hypothesis = best(judged(FlowRatesComposition(), with_rate(25, lambda flow: fast[::2][: len(flow)])))
    assert (hypothesis.cause, hypothesis.stream) == ("flow_rate_mixed", "flow/25hz")


@pytest.mark.parametrize("cause", ["flow_sign", "axes_swapped", "mirrored"])
def test_faults_of_all_rates_are_faults_of_flow(cause: str) -> None:
    """A fault that all rates share, and that does not compose, is one of the flow as a whole."""
    changes: dict[str, Callable[[Fields], Fields]] = {
        "flow_sign": lambda flow: -flow,
        "axes_swapped": lambda flow: flow[..., ::-1],
        "mirrored": lambda flow: flow[:, :, ::-1],
    }
    hypothesis = best(judged(FlowRatesComposition(), clean().with_flow(lambda _, flow: changes[cause](flow))))
    assert (hypothesis.cause, hypothesis.stream) == (cause, "flow")


def test_two_rates_leave_both_suspected() -> None:
    """Of two rates either may be wrong: both are suspected, and the finding says which pair it is."""
    world = with_rate(50, lambda flow: 1.05 * flow).without("flow/10hz")
    result = judged(FlowRatesComposition(), world)
    gains = {
        hypothesis.stream: hypothesis.support
        for hypothesis in hypotheses_of(result.alarms[0], world.facts)
        if hypothesis.cause == "flow_gain"
    }
    assert gains["flow/25hz"] == pytest.approx(gains["flow/50hz"], rel=0.05)
    assert "flow/25hz" in result.alarms[0].finding.message
    assert "flow/50hz" in result.alarms[0].finding.message


def test_a_bad_corner_is_placed() -> None:
    """A corner of one field that is 2% too long is found, and its tile and interval named."""

    def lengthen(flow: Fields) -> Fields:
        flow[2, 48:96, 72:120] *= 1.02
        return flow

    alarm = next(
        one
        for one in judged(FlowRatesComposition(), with_rate(10, lengthen)).alarms
        if one.finding.code.endswith("tile")
    )
    left, top, right, bottom = alarm.finding.where.tile or (0, 0, 0, 0)
    assert 48 <= left < right <= 144
    assert 24 <= top < bottom <= 120
    assert alarm.finding.where.index_start == 2


def test_one_rate_is_not_applicable() -> None:
    """With one rate there is nothing to compare with."""
    world = clean().without("flow/10hz").without("flow/25hz")
    assert FlowRatesComposition().not_applicable(world.facts)
    assert not FlowRatesComposition().not_applicable(clean().facts)


def later(world: FlowWorld, stream: str, shift_ns: int) -> FlowWorld:
    """The file with one rate's stamps shifted."""
    clock = world.facts.clocks[stream]
    assert clock.ends_ns is not None
    shifted = replace(clock, times_ns=clock.times_ns + shift_ns, ends_ns=clock.ends_ns + shift_ns)
    return replace(world, facts=replace(world.facts, clocks={**world.facts.clocks, stream: shifted}))


def test_rates_that_never_meet_are_not_observable() -> None:
    """Stamps that share no ends leave nothing to compare, and that is said."""
    world = clean().without("flow/10hz")
    result = judged(FlowRatesComposition(), later(world, "flow/50hz", 3_000_000)).result
    assert result.outcome == "not_observable"
    assert "common interval" in result.reason


@pytest.mark.parametrize("filling", [np.nan, np.inf, 0.0, 1e30])
def test_worthless_fields_never_raise(filling: float) -> None:
    """Fields without a value, or with impossible ones, are no exception: not observable, or a finding."""
    result = judged(FlowRatesComposition(), with_rate(50, lambda flow: np.full_like(flow, filling))).result
    assert result.outcome in {"not_observable", "failed", "passed"}
    assert (result.outcome == "failed") is (filling in {0.0, 1e30}) or not np.isfinite(filling)
