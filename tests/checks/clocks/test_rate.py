"""The rate of a clock: chosen periods, jitter, drift and rounding."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fedora_qa.checks.clocks.rate import ClocksRate
from fedora_qa.judgement.judge import judge
from tests.support.altered_clocks import CLOCKS, as_recording, hypotheses_for, judgement_of, with_factor, with_step
from tests.support.facts import MS, PERIODS_NS, clock, exact_facts, with_clock


def test_a_drifting_clock_lies_on_no_grid() -> None:
    """A clock that runs 500 ppm fast, of steps all alike, is not taken for one of coarse timestamps."""
    hypotheses = hypotheses_for("clocks.rate", with_factor("rgb", 1 + 500e-6))
    assert {hypothesis.cause for hypothesis in hypotheses} == {"clock_rate"}


def test_jitter_is_no_change_of_rate() -> None:
    """Of 300 clocks with white jitter no change of rate is reported, and the scores have about unit spread."""
    rng = np.random.default_rng(11)
    scores = []
    for _ in range(300):
        timestamps = np.rint(np.arange(400) * 5000 + rng.normal(0, 40, 400)).astype(np.int64) * 1000
        measured = ClocksRate().examine(with_clock(exact_facts(), "pose", clock(timestamps))).measurements
        change = next(m for m in measured if m.name == "pose.rate_change")
        assert change.value < change.model_error_bound + 5 * change.standard_error
        scores.append(change.value / change.standard_error)
    # The range of four standard normal values is 2.06 standard deviations (Tippett, Biometrika 17 (1925)).
    assert np.mean(scores) == pytest.approx(2.06 / np.sqrt(2), rel=0.1)


def test_a_jump_is_not_another_rate() -> None:
    """A clock that was set by 6 ms half-way ran at its nominal rate before and after."""
    assert not judgement_of("clocks.rate", with_step("rgb", 50, 6 * MS)).alarms


def test_rounding_moves_the_slope_by_no_more_than_is_allowed() -> None:
    """Half of the timestamps early and the other half late, as rounding at worst, stay within the model error bound."""
    timestamps = np.arange(2000) * MS + np.where(np.arange(2000) < 1000, -500, 500)
    observation = ClocksRate().examine(with_clock(exact_facts(), "imu", clock(timestamps)))
    error = next(m for m in observation.measurements if m.name == "imu.rate_error")
    assert error.model_error_bound == pytest.approx(error.value, rel=2e-3)


@given(st.sampled_from(sorted(PERIODS_NS)), st.floats(0.3, 2000.0))
def test_any_rounded_clock_keeps_its_rate(stream: str, rate_hz: float) -> None:
    """Whole-microsecond rounding of a whole rate is no clock error, at any rate."""
    nominal = max(round(rate_hz), 1)
    timestamps = np.rint(1e6 * np.arange(200) / nominal).astype(np.int64) * 1000
    observation = ClocksRate().examine(with_clock(exact_facts(), stream, clock(timestamps)))
    assert judge({"clocks.rate": observation}, [ClocksRate()], 1e-4)[0].result.outcome == "passed"


CHOSEN_US = [
    *[("pose", period_us) for period_us in (15_000, 35_000, 7_500, 12_500, 16_700, 33_330, 33_300, 45_000)],
    *[("imu", period_us) for period_us in (500, 1_500, 2_500, 3_000, 6_000, 7_000, 9_000, 11_000, 13_000, 17_000)],
]


@pytest.mark.parametrize(("stream", "period_us"), CHOSEN_US)
def test_a_period_that_a_writer_chooses_is_no_clock_error(stream: str, period_us: int) -> None:
    """Every third sample of 5 ms, a timer of 7 ms, 30 Hz as 33.3 ms."""
    facts = with_clock(exact_facts(), stream, clock(np.arange(0, 2_000_000, period_us) * 1000))
    assert judgement_of("clocks.rate", facts).result.outcome == "passed"


def test_every_fourth_frame_of_video_is_no_clock_error() -> None:
    """7.5 Hz is no whole rate; its period is four of those that colour keeps."""
    frames_ns = np.rint(1e6 * np.arange(120) / 30).astype(np.int64) * 1000
    facts = with_clock(with_clock(exact_facts(), "rgb", clock(frames_ns)), "depth", clock(frames_ns[::4]))
    assert judgement_of("clocks.rate", facts).result.outcome == "passed"


@pytest.mark.parametrize("ppm", [5.0, -20.0, 100.0])
@pytest.mark.parametrize("period_us", [1_000, 3_000, 5_000, 15_000, 20_000, 40_000])
def test_a_drift_of_a_chosen_period_is_measured(period_us: int, ppm: float) -> None:
    """A clock that runs by a few ppm too fast is off the period that was chosen, not off another one."""
    timestamps_ns = np.rint(np.arange(0, 2_000_000, period_us) * (1 + 1e-6 * ppm)).astype(np.int64) * 1000
    result = judgement_of("clocks.rate", with_clock(exact_facts(), "pose", clock(timestamps_ns)))
    assert result.result.outcome == "failed"
    assert result.alarms[0].statistic.value == pytest.approx(ppm, abs=1.5)


def test_the_rate_of_a_recorded_stream_is_stated() -> None:
    """25.8 Hz is that of its sensor, though 26 Hz are nearer than 1 percent."""
    free = with_clock(exact_facts(), "rgb", clock(np.arange(0, 2000 * MS, 38_765_000)))
    assert judgement_of("clocks.rate", free).result.outcome == "failed"
    result = judgement_of("clocks.rate", as_recording(free)).result
    assert result.outcome == "passed"
    assert CLOCKS["clocks.rate"].examine(as_recording(free)).inferred["rgb.rate_hz"] == pytest.approx(25.797, abs=1e-3)


def test_a_recorded_clock_that_changes_its_rate_is_judged() -> None:
    ns = np.arange(0, 2000 * MS, 5 * MS)
    altered = with_clock(exact_facts(), "pose", clock(np.where(ns > 1000 * MS, ns + (ns - 1000 * MS) // 1000, ns)))
    assert judgement_of("clocks.rate", as_recording(altered)).result.outcome == "failed"
