"""Rates of flow are composed and compared: clean files pass, the odd rate is named, with its fault."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.checks.flow_rates.composition import FlowRatesComposition
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.judgement.judge import Judged
from tests.support.flow_world import FlowWorld, judged, make_world

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


@pytest.mark.parametrize("share", [0.05, 0.25, 1.0])
def test_clean_file_passes(share: float) -> None:
    """Nothing but interpolation and rounding remains, at any effort."""
    result = judged(FlowRatesComposition(), clean(), tile_share=share).result
    assert result.outcome == "passed"
    assert max(m.value or 0.0 for m in result.measurements if m.name.endswith("error")) < 0.01


@pytest.mark.parametrize("share", [0.25, 1.0])
def test_coverage_counts_pixels(share: float) -> None:
    """A share of the pixels of each interval is that share, not all intervals."""
    coverage = judged(FlowRatesComposition(), clean(), tile_share=share).result.coverage
    assert coverage is not None
    assert coverage.unit == "pixels of common intervals"
    assert coverage.share == pytest.approx(share, abs=0.03)


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
    "u left": (10, lambda flow: flow * np.float32([-1, 1]), "frame_convention", None),
    "quarter turn": (25, lambda flow: flow[..., ::-1] * np.float32([1, -1]), "frame_convention", None),
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
        alarm
        for alarm in judged(FlowRatesComposition(), with_rate(10, lengthen)).alarms
        if alarm.finding.code.endswith("tile")
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
