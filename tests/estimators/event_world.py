"""A closed-form world for the tests of events: waves in linear intensity that drift, and a sensor that crosses levels.

The mean of a cosine over a pixel is the cosine times two sincs, so frames and event pixels are exact at any size.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.events.footprint import Footprints, FootprintTaps, footprint_axis

Floats = NDArray[np.float64]
Phasors = NDArray[np.complex128]

MS = 1_000_000  # ns
STEP_NS = 200_000


@dataclass(frozen=True)
class Waves:
    """Y(u, v, t) = mean + sum of waves, on the grid of the event camera (px of that camera)."""

    mean_dn: float = 100.0
    amplitude_dn: float = 8.0
    velocity_px_s: tuple[float, float] = (40.0, 15.0)
    seed: int = 0
    count: int = 12
    leak_nat_s: float = 0.0
    """By what a sensor's signal appears to rise besides."""

    def luma(self, t_s: float, shape: tuple[int, int], scale: float = 1.0) -> Floats:
        """Mean luma of every pixel of a camera with ``scale`` times the resolution."""
        k, rows, columns = _phasors(self, shape, scale)
        # cos(a + b) = Re(exp(i a) exp(i b)): a depends on the column, b on the row and on how far waves have moved.
        moved = rows * np.exp(-1j * t_s * (self.velocity_px_s @ k))
        waves_dn: Floats = moved.real @ columns.real.T - moved.imag @ columns.imag.T
        return self.mean_dn + waves_dn


@cache
def _phasors(waves: Waves, shape: tuple[int, int], scale: float) -> tuple[Floats, Phasors, Phasors]:
    """Wave vectors (2, count), rad/px, and phasors at time 0: of rows (H, count), with amplitudes, and of columns."""
    rng = np.random.default_rng(waves.seed)
    angle, size = rng.uniform(0, 2 * np.pi, waves.count), 2 * np.pi / rng.uniform(4, 40, waves.count)
    k, phase = size * np.array([np.cos(angle), np.sin(angle)]), rng.uniform(0, 2 * np.pi, waves.count)
    rows, columns = ((np.arange(pixels)[:, np.newaxis] + 0.5) / scale - 0.5 for pixels in shape)
    amplitudes_dn = waves.amplitude_dn * np.prod(np.sinc(k / scale / (2 * np.pi)), axis=0)
    return k, amplitudes_dn * np.exp(1j * k[1] * rows), np.exp(1j * (k[0] * columns + phase))


@dataclass(frozen=True)
class Checkers(Waves):
    """Sharp squares of ``side_px``, mean - amplitude and mean + amplitude in turn.

    A checkerboard is the product of two square waves, and so is its mean over a pixel of theirs.
    """

    side_px: float = 7.3

    def luma(self, t_s: float, shape: tuple[int, int], scale: float = 1.0) -> Floats:
        """Mean luma of every pixel of a camera with ``scale`` times the resolution."""
        columns, rows = (
            self._square_wave((np.arange(size + 1) / scale - 0.5 - speed * t_s) / self.side_px)
            for size, speed in zip(shape[::-1], self.velocity_px_s, strict=True)
        )
        means: Floats = self.mean_dn + self.amplitude_dn * rows[:, np.newaxis] * columns
        return means

    @staticmethod
    def _square_wave(borders: Floats) -> Floats:
        """Mean between borders of +1 on [0, 1), -1 on [1, 2) and so on: differences of a triangle wave."""
        triangle = 1 - np.abs(np.mod(borders, 2) - 1)
        return np.diff(triangle) / np.diff(borders)


@dataclass(frozen=True)
class Stream:
    """Events in the order of time (ns), as the estimators take them."""

    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    times_ns: NDArray[np.int64]
    p: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.times_ns)

    def keep(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> "Stream":
        """Events by mask or index."""
        return Stream(self.x[chosen], self.y[chosen], self.times_ns[chosen], self.p[chosen])

    def shifted(self, offset_ns: int) -> "Stream":
        """The same events stamped later."""
        return replace(self, times_ns=self.times_ns + offset_ns)


def camera_matrix(width: int, height: int) -> Floats:
    """K of a camera of 60 degrees with its principal point in the middle."""
    focal = width / (2 * np.tan(np.pi / 6))
    return np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])


def footprints(
    K_frame: Floats, shape_frame: tuple[int, int], K_event: Floats, shape_event: tuple[int, int]
) -> Footprints:
    """Those of the pixels of the event camera (h, w) in the frame (H, W)."""
    rows, columns = (footprint_axis(K_frame, shape_frame, K_event, shape_event, axis) for axis in (0, 1))
    return Footprints(rows, columns)


def weighted_means(prints: Footprints, name: str, image: NDArray[Any]) -> Floats:
    """Means (h, w) of an image (H, W) over footprints by a reconstruction, in double precision."""
    rows, columns = (
        _dense(getattr(axis, name), size) for axis, size in zip((prints.rows, prints.columns), image.shape, strict=True)
    )
    return rows @ image @ columns.T


def _dense(taps: FootprintTaps, size: int) -> Floats:
    matrix = np.zeros((len(taps.first), size))
    pixels = taps.first[:, np.newaxis] + np.arange(taps.weights.shape[1])
    np.put_along_axis(matrix, pixels, taps.weights, axis=1)
    return matrix


def log_events(
    world: Waves,
    shape: tuple[int, int],
    stop_ns: int,
    on: float = 0.2,
    off: float = 0.2,
    *,
    phase: float = 1.0,
    response: Callable[[Floats], Floats] = np.log,
) -> Stream:
    """Crossings of L = ln Y, a straight line within 0.2 ms, stamped with the first microsecond not before them.

    The first reference is off the signal by up to ``phase`` thresholds. Another ``response`` takes the place of ln.
    """
    rng = np.random.default_rng(1)
    signal = response(world.luma(0.0, shape)).ravel()
    reference = signal - phase * rng.uniform(-off, on, signal.size)
    found: list[Floats] = []
    for start_ns in range(0, stop_ns, STEP_NS):
        stop_s = (start_ns + STEP_NS) * 1e-9
        following = response(world.luma(stop_s, shape)).ravel() + world.leak_nat_s * stop_s
        while True:
            up, down = following >= reference + on, following <= reference - off
            hit = np.flatnonzero(up | down)
            if not len(hit):
                break
            reference[hit] += np.where(up[hit], on, -off)
            share = (reference[hit] - signal[hit]) / (following[hit] - signal[hit])
            timestamps = np.ceil((start_ns + share * STEP_NS) / 1000) * 1000
            found.append(np.stack([timestamps, hit, up[hit]]))
        signal = following
    return _stream(found, shape[1])


def linear_events(
    world: Waves, shape: tuple[int, int], stop_ns: int, threshold: float = 6.0, *, phase: float = 0.0
) -> Stream:
    """One event a pixel and step of 1 ms where rint(Y) has moved by strictly more than the threshold.

    The first reference is off the value by up to ``phase`` thresholds.
    """
    rng = np.random.default_rng(1)
    reference = np.rint(world.luma(0.0, shape)).ravel()
    reference += np.rint(phase * rng.uniform(-threshold, threshold, reference.size))
    found: list[Floats] = []
    for now_ns in range(MS, stop_ns + 1, MS):
        value = np.rint(world.luma(now_ns * 1e-9, shape)).ravel()
        hit = np.flatnonzero(np.abs(value - reference) > threshold)
        found.append(np.stack([np.full(len(hit), now_ns), hit, value[hit] > reference[hit]]))
        reference[hit] = value[hit]
    return _stream(found, shape[1])


def _stream(found: list[Floats], width: int) -> Stream:
    timestamps, pixels, brighter = np.concatenate(found, axis=1).astype(np.int64)
    order = np.lexsort((brighter, pixels, timestamps))
    timestamps, pixels, brighter = timestamps[order], pixels[order], brighter[order]
    return Stream(
        (pixels % width).astype(np.uint16), (pixels // width).astype(np.uint16), timestamps, brighter.astype(np.uint8)
    )
