"""Silences of the whole sensor: lost packets stand out, everything honest does not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fedora_qa.estimators.events.rates import EventSilence, least_probable_silence
from tests.estimators.event_world import MS

US = 1_000
SECOND = 1_000 * MS


def poisson(rate_hz: float, seed: int = 0) -> np.ndarray:
    """A second of events at a steady rate, stamped to the microsecond."""
    rng = np.random.default_rng(seed)
    return np.sort(rng.integers(0, 1_000_000, rng.poisson(rate_hz))) * US


def without(times_ns: np.ndarray, start_ns: int, stop_ns: int) -> np.ndarray:
    return times_ns[(times_ns < start_ns) | (times_ns >= stop_ns)]


def strangest(times_ns: np.ndarray, tick_ns: int = US) -> tuple[EventSilence, int]:
    silence, compared = least_probable_silence(times_ns, 0, SECOND, tick_ns)
    assert silence is not None
    return silence, compared


@given(st.integers(0, 2**32 - 1), st.floats(2.0, 5.5))
@settings(max_examples=40, deadline=None)
def test_steady_events_have_no_strange_silence(seed: int, log_rate: float) -> None:
    """Among the silences of a Poisson stream of 100 to 300 000 events/s none exceeds 6 sigma."""
    assert strangest(poisson(10**log_rate, seed))[0].z < 6


@pytest.mark.parametrize("lost_us", [200, 2_000, 20_000])
def test_lost_packet_stands_out(lost_us: int) -> None:
    """At 200 000 events/s 0.2 ms without events is found, at its place, with the number that is missing."""
    silence, compared = strangest(without(poisson(200_000), 500 * MS, 500 * MS + lost_us * US))
    assert silence.z > 8
    assert silence.start_ns <= 500 * MS <= silence.stop_ns
    assert silence.length_ns == pytest.approx(lost_us * US, rel=0.2)
    assert silence.expected == pytest.approx(0.2 * lost_us, rel=0.3)
    assert compared > 100_000


def test_quiet_streams_cannot_show_it() -> None:
    """At 500 events/s a lost packet of 2 ms is nothing unusual."""
    assert strangest(without(poisson(500), 500 * MS, 502 * MS))[0].z < 5


@pytest.mark.parametrize("turns", [1, 3])
def test_motion_that_turns_is_excused(turns: int) -> None:
    """Events as dense as the speed of a swing, which stands still in between, have no strange silence."""
    rng = np.random.default_rng(2)
    t = rng.uniform(0, 1, 200_000)
    kept = t[rng.uniform(0, 1, t.size) < np.abs(np.cos(turns * np.pi * t)) ** 2]
    assert strangest(np.sort((kept * 1e6).astype(np.int64)) * US)[0].z < 6


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("is_mirrored", [False, True])
def test_the_last_edge_may_leave(seed: int, is_mirrored: bool) -> None:
    """An edge leaves within 20 ms, and 18 ms later another enters within 60 ms; 18 ms lost at once are found."""
    rng = np.random.default_rng(seed)
    t = np.sort(rng.uniform(0, 1, 5_000))
    rate = np.interp(t, [0.0, 0.48, 0.5, 0.518, 0.55, 0.578, 1.0], [1.0, 1.0, 0.1, 0.03, 0.2, 1.0, 1.0])
    is_lost = (t > 0.5) & (t < 0.518)
    faded, lost = t[(rng.uniform(0, 1, t.size) < rate) & ~is_lost], t[~is_lost]
    faded, lost = ((1 - times[::-1] if is_mirrored else times) for times in (faded, lost))
    assert strangest((faded * 1e6).astype(np.int64) * US)[0].z < 5
    assert strangest((lost * 1e6).astype(np.int64) * US)[0].z > 8


def test_a_sensor_that_begins_to_fire_may_pause() -> None:
    """A dozen events, 4 ms of nothing, then a steady stream: before the first event it was silent as well."""
    first_ns, later_ns = np.arange(16, 20) * MS, 24 * MS + poisson(15_000) // 2
    times_ns = np.concatenate([np.repeat(first_ns, 3), later_ns])
    assert strangest(times_ns, tick_ns=MS)[0].z < 3


def test_a_sensor_that_has_hardly_begun_may_pause() -> None:
    """Six events in the sixth millisecond, 2 ms of nothing, then a steady stream; later the same silence is a loss."""
    steady_ns = poisson(20_000)
    begins_ns = 5 * MS + np.arange(6) * 100 * US
    beginning_ns = np.concatenate([begins_ns, steady_ns[steady_ns > 8 * MS]])
    silence, _ = least_probable_silence(beginning_ns, 0, SECOND, US, begins_ns=int(begins_ns[0]))
    assert silence is not None
    assert silence.z < 6
    assert strangest(beginning_ns)[0].z > 6
    later, _ = least_probable_silence(
        without(steady_ns, 500 * MS, 502 * MS), 0, SECOND, US, begins_ns=int(steady_ns[0])
    )
    assert later is not None
    assert later.z > 6


def test_grid_of_packets_is_no_silence() -> None:
    """On a grid of 1 ms the time between ticks is not empty; two lost ticks are."""
    rng = np.random.default_rng(0)
    times_ns = np.repeat(np.arange(1000), rng.poisson(300, 1000)) * MS
    assert least_probable_silence(times_ns, 0, SECOND, MS)[0] is None
    silence, _ = strangest(without(times_ns, 500 * MS, 502 * MS), tick_ns=MS)
    assert silence.length_ns == 2 * MS
    assert silence.z > 8


@pytest.mark.parametrize("times_ns", [[], [5 * MS], [1 * MS, 900 * MS]], ids=["none", "one", "two"])
def test_few_events_tell_nothing(times_ns: list[int]) -> None:
    """No events, one or two: no silence, no crash."""
    assert least_probable_silence(np.array(times_ns, np.int64), 0, SECOND, US)[0] is None


def test_silence_belongs_to_the_window_in_which_it_ends() -> None:
    """Of two windows, only the one with the event after the gap sees it."""
    times_ns = without(poisson(100_000), 490 * MS, 505 * MS)
    before, after = (least_probable_silence(times_ns, a * MS, (a + 500) * MS, US)[0] for a in (0, 500))
    assert before is not None
    assert after is not None
    assert before.z < 6 < after.z
