"""Regular clocks against clocks in closed form: the fit, a displaced part, rounding to a grid."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from fedora_qa.estimators.clocks.regular_clock import (
    ClockStep,
    clock_steps,
    displaced_part,
    fit_regular_clock,
    has_odd_grid_above_period,
    is_rounded,
    rounding_grid_ns,
    slewed_part,
    varying_delay,
)


@given(st.integers(3, 400), st.integers(1, 10**9), st.integers(-(10**15), 10**15))
def test_exact_clock(count: int, period_ns: int, start_ns: int) -> None:
    """An exact clock is recovered whatever its origin, and nothing is missing."""
    fit = fit_regular_clock(start_ns + period_ns * np.arange(count))
    assert fit is not None
    assert fit.period_ns == pytest.approx(period_ns, rel=1e-12)
    assert (fit.missing, fit.tick_ns) == (0, period_ns)


@given(st.lists(st.integers(1, 38), min_size=1, max_size=6, unique=True), st.floats(0.5, 3000.0))
def test_missing_samples_are_counted(lost: list[int], rate_hz: float) -> None:
    """Inner samples taken out of a rounded clock are counted, and do not move its period."""
    whole = np.rint(1e6 * np.arange(40) / rate_hz).astype(np.int64) * 1000
    fit = fit_regular_clock(np.delete(whole, lost))
    assert fit is not None
    assert fit.missing == len(lost)
    assert fit.period_ns == pytest.approx(1e9 / rate_hz, abs=1000)


def test_period_error_is_honest() -> None:
    """Over many jittered clocks the period's error has the stated size."""
    rng = np.random.default_rng(3)
    scores = []
    for _ in range(400):
        timestamps = np.rint(1e6 * np.arange(200) + rng.normal(0, 5e4, 200)).astype(np.int64)
        fit = fit_regular_clock(timestamps)
        assert fit is not None
        scores.append((fit.period_ns - 1e6) / fit.period_error_ns)
    assert np.std(scores) == pytest.approx(1.0, abs=0.15)


def test_too_few_timestamps_say_nothing() -> None:
    """Two stamps fit every clock."""
    assert fit_regular_clock(np.array([0, 5])) is None


@pytest.mark.parametrize(("rate_hz", "display_hz"), [(50, 60), (25, 60), (24, 60), (40, 59.94), (50, 144)])
def test_ticks_of_a_display_are_a_grid(rate_hz: float, display_hz: float) -> None:
    """Ticks that are no whole microseconds are found, and no double step counts as a lost sample."""
    ticks = np.ceil(np.arange(120) * display_hz / rate_hz)
    fit = fit_regular_clock(np.rint(1e6 * ticks / display_hz).astype(np.int64) * 1000)
    assert fit is not None
    assert (fit.missing, len(fit.jump_after), fit.regular) == (0, 0, True)
    assert fit.grid_ns == pytest.approx(1e9 / display_hz, abs=1000)


def test_lost_samples_are_no_ticks() -> None:
    """Samples of a display that are lost anywhere leave the line of a clock of another rate."""
    lost = np.random.default_rng(0).choice(np.arange(1, 59), 10, replace=False)
    fit = fit_regular_clock(np.rint(1e6 * np.delete(np.arange(60), lost) / 60).astype(np.int64) * 1000)
    assert fit is not None
    assert (fit.missing, fit.grid_ns) == (10, 1000)


US = 1000
PERIOD_US = 5000


def timestamps_us(count: int = 400) -> NDArray[np.int64]:
    return PERIOD_US * np.arange(count, dtype=np.int64)


@given(
    st.integers(-2400, 2400).filter(lambda us: abs(us) > 3), st.integers(1, 180), st.integers(20, 180),
    st.integers(-(10**15), 10**15),
)  # fmt: skip
def test_a_late_part_is_found_with_its_rows_and_size(late_us: int, first: int, count: int, start_us: int) -> None:
    """Any offset of more than rounding and less than half a period, anywhere, whatever the origin of the clock."""
    times_us = start_us + timestamps_us()
    times_us[first : first + count] += late_us
    found = displaced_part(times_us * US, resolution_ns=US)
    assert found is not None
    assert (found.first, found.last) == (first, first + count - 1)
    assert (found.offset_ns, found.drift) == (late_us * US, 0.0)


@pytest.mark.parametrize("first", [40, 300, 399])
def test_a_part_that_lasts_to_the_end_is_found(first: int) -> None:
    """It has one jump, into it; of the last row alone as well."""
    times_us = timestamps_us()
    times_us[first:] += 70
    found = displaced_part(times_us * US, resolution_ns=US)
    assert found is not None
    assert (found.first, found.last, found.offset_ns) == (first, 399, 70 * US)


@given(
    st.integers(-(PERIOD_US - 1), 10 * PERIOD_US).filter(lambda us: abs(us) > 3), st.integers(1, 399),
    st.integers(-(10**15), 10**15),
)  # fmt: skip
def test_a_step_is_exact_also_beyond_a_period(late_us: int, row: int, start_us: int) -> None:
    """Unlike the displaced part, which is known up to whole periods."""
    times_us = start_us + timestamps_us()
    assert not clock_steps(times_us * US, resolution_ns=US)
    times_us[row:] += late_us
    assert clock_steps(times_us * US, resolution_ns=US) == (ClockStep(row, late_us * US),)


def test_a_clock_that_was_set_back_has_two_steps() -> None:
    """More than two are losses here and there, or no exact clock."""
    times_us = timestamps_us()
    times_us[100:200] += 12_000
    steps = clock_steps(times_us * US, resolution_ns=US)
    assert steps == (ClockStep(100, 12_000 * US), ClockStep(200, -12_000 * US))
    times_us[300:] += 5000
    assert not clock_steps(times_us * US, resolution_ns=US)


@pytest.mark.parametrize(("count", "is_exact"), [(150, True), (300, False)])
def test_a_clock_most_of_whose_steps_differ_is_not_exact(count: int, is_exact: bool) -> None:
    """Timestamps that are late and early in turn change each step: the clock is exact by the other steps, or not."""
    times_us = timestamps_us()
    times_us[50 : 50 + count] += 70 * (-1) ** np.arange(count)
    assert (displaced_part(times_us * US, resolution_ns=US) is not None) == is_exact


def test_a_tenth_of_the_timestamps_must_lie_outside() -> None:
    """Of 400 timestamps at most 360 can be displaced in part."""
    for count, is_part in ((360, True), (361, False)):
        times_us = timestamps_us()
        times_us[20 : 20 + count] += 70
        assert (displaced_part(times_us * US, resolution_ns=US) is not None) == is_part


@pytest.mark.parametrize("rate", [60e-6, -120e-6])
def test_a_fast_part_is_found_with_its_rate(rate: float) -> None:
    """A clock that runs fast for a while and is set right again."""
    times_us = timestamps_us()
    times_us[100:300] += np.rint(PERIOD_US * rate * np.arange(200)).astype(np.int64)
    found = displaced_part(times_us * US, resolution_ns=US)
    assert found is not None
    assert found.drift == pytest.approx(rate, rel=0.03)
    assert found.last == 299


LOST = np.delete(timestamps_us(), [50, 51, 200])
JITTER = timestamps_us() + np.random.default_rng(0).integers(-40, 40, 400)
UNTOUCHED = {
    "exact": timestamps_us(),
    "late throughout": timestamps_us() + 7,
    "fast throughout": np.rint(timestamps_us() * 1.0002).astype(np.int64),
    "samples lost": LOST,
    "jitter": JITTER,
    "period of no whole microseconds": np.rint(np.arange(400) * 1e6 / 30).astype(np.int64),
    "two stamps": timestamps_us(2),
    "one stamp again and again": np.zeros(50, np.int64),
}


@pytest.mark.parametrize("times_us", UNTOUCHED.values(), ids=UNTOUCHED)
def test_what_was_not_moved_in_part_is_not_found(times_us: NDArray[np.int64]) -> None:
    """Clocks that are sound, or wrong as a whole, or lack samples."""
    assert displaced_part(times_us * US, resolution_ns=US) is None
    assert slewed_part(times_us * US, resolution_ns=US) is None


@given(st.floats(1e-3, 0.2), st.sampled_from([-1, 1]), st.integers(0, 250), st.integers(40, 140))
def test_a_clock_that_is_slewed_for_a_while_is_found(size: float, sign: int, first: int, count: int) -> None:
    """It keeps the offset that it gained, also where that exceeds a period; the slew begins between two samples."""
    rate, start_us, duration_us = sign * size, (first + 0.4) * PERIOD_US, count * PERIOD_US
    true_us = timestamps_us()
    times_us = true_us + np.rint(rate * np.clip(true_us - start_us, 0, duration_us)).astype(np.int64)
    slewed = slewed_part(times_us * US, resolution_ns=US)
    assert slewed is not None
    # An offset is rounded to 1 us, which moves a line through n of them by less than 1 us.
    assert slewed.drift * duration_us == pytest.approx(rate * duration_us, abs=2)
    assert abs(rate) * abs(slewed.start_ns / US - start_us) < 2
    assert slewed.drift * slewed.duration_ns / US == pytest.approx(rate * duration_us, abs=2)


@pytest.mark.parametrize(
    "moved_us",
    [
        np.where(np.arange(400) < 150, 0, 700),
        np.where((np.arange(400) > 100) & (np.arange(400) < 250), 700, 0),
        np.rint(np.arange(400) * 0.13).astype(np.int64),
        np.random.default_rng(0).integers(-90, 90, 400) * (abs(np.arange(400) - 200) < 60),
        (1.3e-3 * np.clip(np.arange(400) - 100, 0, 150) ** 2).astype(np.int64),
    ],
    ids=["set once", "late for a while", "fast throughout", "jitter for a while", "ever faster"],
)
def test_what_does_not_drift_evenly_for_a_while_was_not_slewed(moved_us: NDArray[np.int64]) -> None:
    """Jumps, a rate of the whole clock, jitter and a curve are no slew."""
    assert slewed_part((timestamps_us() + moved_us) * US, resolution_ns=US) is None


def timestamps_ns(period_us: float, count: int = 400) -> NDArray[np.int64]:
    return np.rint(period_us * np.arange(count)).astype(np.int64) * US


def rounded(times_ns: NDArray[np.int64], grid_us: int) -> NDArray[np.int64]:
    return (times_ns + grid_us * US // 2) // (grid_us * US) * (grid_us * US)


@given(st.integers(2, 4000), st.sampled_from([1000, 5000, 20000, 33333]))
def test_grid_is_found_or_does_no_harm(grid_us: int, period_us: int) -> None:
    """A found grid is the true one; none is missed whose rounding shows in a tenth of the steps or more."""
    found = rounding_grid_ns(rounded(timestamps_ns(period_us), grid_us), resolution_ns=US)
    assert found in (0, grid_us * US)
    odd = (period_us / grid_us) % 1.0
    if 0.1 < odd < 0.9:
        assert found == grid_us * US


@given(st.floats(300.0, 14000.0), st.floats(0.0, 1.0), st.sampled_from([5000.0, 20000.0, 1e6 / 30]))
def test_ticks_that_are_no_whole_microseconds_are_measured(tick_us: float, phase: float, period_us: float) -> None:
    """The last tick before each instant, in whole microseconds: steps state the grid to their rounding."""
    ticks = np.floor(period_us * np.arange(200) / tick_us + phase)
    grid_ns = rounding_grid_ns(np.rint(tick_us * ticks).astype(np.int64) * US, resolution_ns=US)
    assert grid_ns == 0 or grid_ns == pytest.approx(tick_us * US, rel=1e-3)
    odd = (period_us / tick_us) % 1.0
    if 0.15 < odd < 0.85:
        assert grid_ns > 0


@pytest.mark.parametrize("period_us", [1000.0, 5000.0, 33333.0, 1e6 / 30, 1e6 / 29.97])
def test_whole_microseconds_are_no_grid(period_us: float) -> None:
    """Stamps in the format's own unit are not rounded beyond it, whether the period is whole or not."""
    assert rounding_grid_ns(timestamps_ns(period_us), resolution_ns=US) == 0


@pytest.mark.parametrize("start_s", [0, 1_750_000_000], ids=["0", "1970"])
def test_a_grid_of_nanoseconds_is_found_whenever_time_began(start_s: int) -> None:
    """A float holds no nanoseconds since 1970: it is exact for times from the first one on only."""
    times_ns = 10**9 * start_s + np.rint(5e6 / 3 * np.arange(400)).astype(np.int64)
    assert rounding_grid_ns(times_ns // 50 * 50, resolution_ns=1) == 50


def test_part_of_a_stream() -> None:
    """A clock that is rounded from the middle on shows there."""
    times_ns = timestamps_ns(5000.0)
    times_ns[200:] = rounded(times_ns[200:], 700)
    assert rounding_grid_ns(times_ns, resolution_ns=US) == 700 * US


def test_short_part_of_a_short_stream() -> None:
    """Fifty rounded timestamps within a hundred fill no long segment, and a short one."""
    times_ns = timestamps_ns(5000.0, 101)
    times_ns[25:75] = rounded(times_ns[25:75], 2100)
    assert rounding_grid_ns(times_ns, resolution_ns=US) == 2100 * US


@pytest.mark.parametrize("lost", [[100], [90, 91, 92], [70, 90, 101, 125]])
def test_lost_samples_are_no_grid(lost: list[int]) -> None:
    """Gaps are whole periods, yet lie off the line of a rounded clock."""
    assert rounding_grid_ns(np.delete(timestamps_ns(5000.0), lost), resolution_ns=US) == 0


def test_jitter_is_no_grid() -> None:
    """Steps of many lengths are noise, not rounding."""
    jitter_us = np.random.default_rng(0).integers(-300, 300, 400)
    assert rounding_grid_ns(timestamps_ns(5000.0) + jitter_us * US, resolution_ns=US) == 0


def test_too_few() -> None:
    """A short stream shows no grid."""
    assert rounding_grid_ns(timestamps_ns(5000.0, 10), resolution_ns=US) == 0


def test_jumps_of_an_exact_clock_are_stated_to_size() -> None:
    """Two jumps are taken off the line; three are jitter of the steps, and a step of two periods is a gap."""
    times_ns = 5_000_000 * np.arange(100)
    times_ns[30:] += 70_000
    times_ns[60:] -= 20_000
    fit = fit_regular_clock(times_ns)
    assert fit is not None
    assert (fit.jump_after.tolist(), fit.jumps_ns.tolist()) == ([29, 59], [70_000.0, -20_000.0])
    assert (fit.period_ns, fit.period_error_ns, fit.irregular_steps) == pytest.approx((5e6, 0.0, 0), abs=1e-6)
    times_ns[80:] += 5_000
    thrice = fit_regular_clock(times_ns)
    assert thrice is not None
    assert (len(thrice.jump_after), thrice.irregular_steps) == (0, 3)
    gap = fit_regular_clock(np.delete(5_000_000 * np.arange(100), [40, 41]))
    assert gap is not None
    assert (gap.gap_after.tolist(), gap.missing, len(gap.jump_after)) == ([39], 2, 0)


def test_jumps_are_few_and_beyond_rounding() -> None:
    """One of eleven steps is a jump, one of nine is not, and none of a microsecond."""
    for count, jump_ns, jumps in ((12, 1001, 1), (12, 1000, 0), (10, 5000, 0)):
        times_ns = 5_000_000 * np.arange(count)
        times_ns[5:] += jump_ns
        fit = fit_regular_clock(times_ns)
        assert fit is not None
        assert len(fit.jump_after) == jumps


@pytest.mark.parametrize("grid_us", [1300, 1900])
def test_double_steps_of_a_rounded_clock_are_no_gaps(grid_us: int) -> None:
    """A grid a little above the period repeats timestamps, and one below skips teeth; neither loses a sample."""
    skipping = rounded(timestamps_ns(2000.0), grid_us)
    fit = fit_regular_clock(skipping)
    assert fit is not None
    assert fit.missing == 0
    assert fit.grid_ns == grid_us * US
    assert fit.period_ns == pytest.approx(2e6, rel=1e-3)


@pytest.mark.parametrize("grid_us", [1100, 1700, 3000])
def test_repeats_of_a_rounded_clock_are_no_samples_written_twice(grid_us: int) -> None:
    """Rounded to a grid above its period, a clock repeats evenly; a sample written twice delays all later ones."""
    assert is_rounded(rounded(timestamps_ns(1000.0), grid_us))
    twice = np.sort(np.concatenate([timestamps_ns(1000.0), timestamps_ns(1000.0)[10:90:10]]))
    assert not is_rounded(twice)
    assert not is_rounded(timestamps_ns(1000.0))


def test_few_repeats_are_rounding_where_the_grid_is_the_period_of_no_whole_rate() -> None:
    """300 Hz on a grid of 3.4 ms repeats now and then; 3 repeats of 250 Hz on its own period are samples twice."""
    few = rounded(timestamps_ns(1e6 / 300, 120), 3400)
    assert 0 < np.count_nonzero(np.diff(few) == 0) < 6
    assert has_odd_grid_above_period(few)
    assert is_rounded(few)
    whole = np.sort(np.concatenate([timestamps_ns(4000.0, 120), timestamps_ns(4000.0, 120)[[20, 60, 100]]]))
    assert not has_odd_grid_above_period(whole)
    assert not is_rounded(whole)
    odd = np.sort(np.concatenate([timestamps_ns(3400.0, 120), timestamps_ns(3400.0, 120)[[20, 21, 22, 23, 24]]]))
    assert not has_odd_grid_above_period(odd)
    for without in (timestamps_ns(3400.0), np.zeros(9, np.int64), np.append(few, few[-1] + 1000)):
        assert not has_odd_grid_above_period(without)


NUMBERS = np.arange(1001)
MS = 1000 * US


@pytest.mark.parametrize("longest_us", [40, 16_000])
def test_a_delay_that_comes_and_goes_is_that_of_its_samples(longest_us: int) -> None:
    """Samples of a queue that fills and empties are late, by more than a period as well; the clock is that before."""
    late_us = np.rint(longest_us * np.clip(1 - np.abs(NUMBERS - 700) / 100, 0, None)).astype(np.int64)
    delay = varying_delay(NUMBERS * MS + late_us * US, 0.0, resolution_ns=US)
    assert delay is not None
    assert delay.returns
    assert (delay.start_ns, delay.period_ns, delay.range_ns) == (0.0, MS, longest_us * US)
    assert delay.offset_ns == pytest.approx(longest_us * US / 2, rel=0.1)


def test_a_delay_that_varies_slowly_is_larger_than_its_changes() -> None:
    """Frames that are stamped before an exposure which follows the light."""
    early_us = 4000 + np.rint(300 * np.sin(np.arange(51) / 15)).astype(np.int64)
    delay = varying_delay(np.arange(51) * 20 * MS - early_us * US, 0.0, resolution_ns=US)
    assert delay is not None
    assert not delay.returns
    assert delay.offset_ns == pytest.approx(-4.2 * MS, abs=0.3 * MS)
    assert abs(delay.offset_ns) > delay.range_ns


@pytest.mark.parametrize(
    "times_us",
    [
        1000 * NUMBERS,
        1000 * NUMBERS + 4000,
        1000 * NUMBERS + 70 * ((NUMBERS >= 200) & (NUMBERS < 400)),
        1000 * NUMBERS + np.where((NUMBERS >= 200) & (NUMBERS < 400), (NUMBERS - 200) // 7, 0),
        np.rint(1001.5 * NUMBERS).astype(np.int64) + 4000,
        1000 * NUMBERS[NUMBERS != 300],
        1000 * (np.arange(61) * 1_000_000 // 60 // 1000),
    ],
    ids=["exact", "offset", "offset of a part", "rate of a part", "rate", "lost sample", "grid"],
)
def test_no_delay_varies_of_another_fault_of_a_clock(times_us: NDArray[np.int64]) -> None:
    """A constant, a line, a lost sample and a grid have names of their own."""
    assert varying_delay(times_us * US, 0.0, resolution_ns=US) is None
