"""Silences at the ends of a file, in a world of pixels whose light is proportional to the position of the camera."""

from collections.abc import Callable

import numpy as np
import pytest

from fedora_qa.estimators.events.pixels import by_pixel
from fedora_qa.estimators.events.silent_ends import SilentEnd, Track, count_pairs, silent_end

_MS = 1_000_000
_END_MS = 1000
_INSTANTS_MS = np.arange(0.0, _END_MS + 0.5, 0.5)


def steady(times_ms: np.ndarray) -> np.ndarray:
    """A camera that moves at 1 m/s."""
    return times_ms / 1000


def resting(times_ms: np.ndarray) -> np.ndarray:
    """A camera that rests for 300 ms, and then moves."""
    return np.asarray(np.maximum(times_ms - 300, 0) / 1000)


def silence_at_begin(
    path_m: Callable[[np.ndarray], np.ndarray],
    cut_ms: float = 0.0,
    period_m: float = 0.05,
    noise_m: float = 0.0,
    drifts: bool = False,
    bias_m_s: float = 0.0,
) -> SilentEnd | None:
    """Compare the silence before the first event of 900 pixels, whose light passes a threshold every period or more."""
    rng = np.random.default_rng(0)
    # No pixel is at its threshold at the begin.
    position_m = path_m(_INSTANTS_MS)
    pixels, crossings_ns = [], []
    for pixel, period in enumerate(period_m * rng.uniform(1, 4, 900)):
        crossings_m = np.arange(1, int(position_m[-1] / period) + 1) * period
        crossings_ns.append(np.interp(crossings_m, position_m + 1e-9 * _INSTANTS_MS, _INSTANTS_MS) * _MS)
        pixels.append(np.full(len(crossings_m), pixel))
    times = np.concatenate(crossings_ns).astype(np.int64)
    order = np.argsort(times)
    kept = order[times[order] >= cut_ms * _MS]
    times, columns, rows = times[kept], np.concatenate(pixels)[kept] % 30, np.concatenate(pixels)[kept] // 30
    polarities = np.ones(len(times), np.uint8)
    events = by_pixel(columns.astype(np.uint16), rows.astype(np.uint16), times, polarities, (30, 30))
    edges_ns = np.arange(0, _END_MS + 1, 2) * _MS
    samples_ms = np.arange(0.0, _END_MS + 1, 5)
    values = np.zeros((len(samples_ms), 3))
    values[:, 0] = path_m(samples_ms) + bias_m_s * samples_ms / 1000
    values += noise_m * rng.standard_normal(values.shape)
    track = Track((samples_ms * _MS).astype(np.int64), values, drifts)
    return silent_end((0.0, float(times[0])), float(times[-1]), edges_ns, count_pairs(events, edges_ns), [track])


@pytest.mark.parametrize("noise_m", [0.0, 0.005])
def test_events_that_are_cut_off_are_improbable(noise_m: float) -> None:
    """The camera moved by 0.4 m before the first event, in which each pixel passes its threshold twice or more."""
    end = silence_at_begin(steady, cut_ms=400, noise_m=noise_m)
    assert end is not None
    assert end.z > 6
    assert end.expected > 100


@pytest.mark.parametrize("noise_m", [0.0, 0.005, 0.05])
def test_a_camera_at_rest_gives_no_events(noise_m: float) -> None:
    """Noise of the poses is no motion."""
    end = silence_at_begin(resting, noise_m=noise_m)
    assert end is not None
    assert end.z < 1


@pytest.mark.parametrize("period_m", [0.15, 0.25])
def test_no_pixel_fires_before_its_light_has_changed_by_a_threshold(period_m: float) -> None:
    """All pixels are at their references at the begin: the first event comes after a whole period of the steepest."""
    end = silence_at_begin(steady, period_m=period_m)
    assert end is not None
    assert end.z < 1


def test_a_constant_rate_of_a_gyro_is_no_motion() -> None:
    """What is integrated has an unknown bias: steady motion states nothing, and a bias at rest is none."""
    for end in (
        silence_at_begin(steady, cut_ms=400, drifts=True),
        silence_at_begin(resting, drifts=True, bias_m_s=0.2),
    ):
        assert end is not None
        assert end.z < 1
    swinging = lambda ms: 1.8 * ms / 1000 + 0.2 * np.sin(ms / 120)  # noqa: E731
    turns = silence_at_begin(swinging, cut_ms=400, period_m=0.01, drifts=True, bias_m_s=0.2)
    assert turns is not None
    assert turns.z > 6


def test_pairs_are_counted_by_their_interval() -> None:
    """Of three events of a pixel, 5 ms and 20 ms apart, one follows within 6.25 and 12.5 ms, and two within 25 ms."""
    x = np.zeros(4, np.uint16)
    x[1] = 1
    times_ns = np.array([1, 2, 6, 26]) * _MS
    events = by_pixel(x, np.zeros(4, np.uint16), times_ns, np.ones(4, np.uint8), (1, 2))
    counts = count_pairs(events, np.array([0, 10, 30]) * _MS)
    assert counts.tolist() == [[1, 0], [1, 0], [1, 1], [1, 1], [1, 1]]
