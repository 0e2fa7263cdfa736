"""The event camera: luminance samples or light known at all times in, events out.

``log``: L = ln(Y + log_eps_dn), linear below ``linear_below_dn`` if that is given; a straight line between samples; an
event whenever L reaches reference +- threshold, which then is the new reference, as many as fit. ``linear``: the
sensor's own rint(Y); one event where it differs from the reference by strictly more than the threshold, the reference
becomes the value (as the simulated DVS plugin does).
"""

import math
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_generator.errors import SceneError
from fedora_generator.events.comparator import Comparator, SignalNotFiniteError
from fedora_generator.events.keys import (
    EventBatch,
    KeyLayout,
    align_to_packets,
    decode,
    drop_refractory,
    sort_and_decode,
    sort_by_timestamp,
)
from fedora_generator.events.noise import LowPass, PoissonEvents, draw_hot_pixels, draw_thresholds
from fedora_generator.events.options import EventSensorOptions
from fedora_qa.conventions import NS_PER_S, NS_PER_US

Floats = NDArray[np.float64]
Keys = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pixels:
    """The state of a log sensor that crossings need; ``reference`` and ``signal`` (H, W) are changed in place.

    Thresholds are (H, W), or (1, W) where all rows share them. The signal is ln(luma_dn + log_eps_dn) plus what has
    leaked: ``leak_per_s`` times ``threshold_on`` a second since the recording began, at ``origin_ns``.
    """

    reference: Floats
    signal: Floats
    threshold_on: Floats
    threshold_off: Floats
    log_eps_dn: float = 0.0
    leak_per_s: float = 0.0
    origin_ns: int = 0


class CrossingSource(Protocol):
    """Light that is known at all times, not in images only."""

    def crossings(self, pixels: Pixels, start_ns: int, stop_ns: int) -> Keys:
        """Sorted keys of the events in (start, stop]; reference and signal are left as at ``stop_ns``.

        Raises
        ------
        SignalNotFiniteError
            A pixel has no logarithm; its value stays in the signal.
        """


def follows_light(options: EventSensorOptions) -> bool:
    """Whether a sensor can follow light: a logarithm of it, without a bandwidth, which depends on the past."""
    return options.model == "log" and options.bandwidth_hz == options.linear_below_dn == 0


# Keys of the random streams: adding one effect leaves the draws of the others as they were.
_ON, _OFF, _PHASE, _SHOT, _HOT_PLACE, _HOT = range(6)
_LONG_AGO_US: Final = -(1 << 62)


class EventSensor:
    """A sensor of ``height`` x ``width`` pixels: ``start`` once, ``advance`` in time, ``finish`` once.

    Everything random follows from ``seed``; spurious events do not depend on how time is cut into steps.
    """

    def __init__(self, options: EventSensorOptions, height: int, width: int, seed: np.random.SeedSequence) -> None:
        if min(height, width) < 1:
            raise ValueError(f"Expected a sensor of at least 1 x 1 pixels, got {width} x {height}")
        if options.hot_pixel_count > height * width:
            raise ValueError(
                f"Expected at most {height * width} hot pixels on {width} x {height}, got {options.hot_pixel_count}"
            )
        self._options = options
        self._layout = KeyLayout(height, width)
        self._shape = shape = (height, width)
        self._seed = seed
        self._threshold_on = draw_thresholds(options.threshold_on, options.threshold_sigma, shape, self._rng(_ON))
        self._threshold_off = draw_thresholds(options.threshold_off, options.threshold_sigma, shape, self._rng(_OFF))
        self._hot = draw_hot_pixels(options.hot_pixel_count, height * width, self._rng(_HOT_PLACE))
        # Shot noise at every pixel, and hot pixels; a source without a rate or without pixels is left out.
        all_places, hot_places = (self._layout.places_of(pixels) for pixels in (np.arange(height * width), self._hot))
        sources = (
            PoissonEvents(options.shot_rate_hz, all_places, self._layout, self._child_seed(_SHOT)),
            PoissonEvents(options.hot_pixel_rate_hz, hot_places, self._layout, self._child_seed(_HOT)),
        )
        self._spurious = tuple(source for source in sources if source.rate_hz > 0 and source.among.size)
        self._low_pass: LowPass | None = None
        self._start_ns: int | None = None
        self._now_ns = 0
        self._signal = np.empty(shape)
        self._previous = np.empty(shape)
        self._comparator = Comparator(self._layout, self._threshold_on, self._threshold_off, np.empty(shape))
        self._last_us = np.full(self._layout.places if options.refractory_us else 0, _LONG_AGO_US)
        self._pending = np.empty(0, np.int64)

    @property
    def hot_pixels(self) -> NDArray[np.int64]:
        """Hot pixels (n, 2), column and row."""
        rows, columns = np.divmod(self._hot, self._shape[1])
        return np.stack([columns, rows], axis=-1)

    @property
    def excursions(self) -> Floats:
        """Signal minus reference (H, W), in the unit of the thresholds; always between them."""
        return self._signal - self._comparator.reference

    @property
    def thresholds(self) -> Floats:
        """Thresholds of every pixel (2, H, W): brighter, then darker."""
        return np.stack(
            [np.broadcast_to(threshold, self._shape) for threshold in (self._threshold_on, self._threshold_off)]
        )

    def start(self, t_ns: int, luma_dn: Floats) -> None:
        """Take the first image, ``luma_dn`` (H, W) linear DN, at ``t_ns``, a whole microsecond."""
        if self._start_ns is not None:
            raise RuntimeError("Expected start once, got it again; make a new EventSensor for each sequence")
        _require_whole_microsecond(t_ns)
        self._respond(luma_dn)
        self._require_finite()
        if self._options.bandwidth_hz:
            self._low_pass = LowPass(self._options.bandwidth_hz, self._signal)
        if self._options.model == "linear":
            np.rint(self._signal, out=self._signal)
        reference = self._signal.copy()
        if self._options.initial_phase == "uniform":
            reference -= self._rng(_PHASE).uniform(-self._threshold_off, self._threshold_on, self._shape)
        self._comparator.reset(reference)
        self._start_ns = self._now_ns = t_ns

    def advance(self, t_ns: int, luma_dn: Floats) -> EventBatch:
        """Take the next image at ``t_ns``; return the events in (the last ``t_ns``, this ``t_ns``].

        With packets, the events of an unfinished packet are held back until time has reached its timestamp.
        """
        if self._start_ns is None:
            raise RuntimeError("Expected start before advance; show the first image with start")
        _require_whole_microsecond(t_ns)
        if t_ns <= self._now_ns:
            raise ValueError(f"Expected a time after {self._now_ns} ns, got {t_ns} ns; show images in order")
        self._signal, self._previous = self._previous, self._signal
        self._respond(luma_dn)
        options = self._options
        # Bandwidth, the linear model's rounding, and leak, which acts as a signal that rises for ever.
        if self._low_pass is not None:
            self._low_pass.advance((t_ns - self._now_ns) / NS_PER_S, self._signal)
        if options.model == "linear":
            np.rint(self._signal, out=self._signal)
        if options.leak_rate_hz:
            self._signal += options.leak_rate_hz * ((t_ns - self._start_ns) / NS_PER_S) * self._threshold_on
        start_ns, stop_ns = self._now_ns - self._start_ns, t_ns - self._start_ns
        try:
            if options.model == "linear":
                keys = self._comparator.steps(self._signal, stop_ns)
            else:
                keys = self._comparator.crossings(self._previous, self._signal, start_ns, stop_ns)
        except SignalNotFiniteError:
            self._require_finite()
            raise
        self._now_ns = t_ns
        first_us, last_us = start_ns // NS_PER_US, stop_ns // NS_PER_US
        if not (self._spurious or options.refractory_us or options.packet_interval_us):
            spare = self._comparator.spare(keys.size)
            return sort_and_decode(keys, self._layout, first_us, last_us, self._start_ns // NS_PER_US, spare)
        spare = np.empty(keys.size, np.int64)  # effects may keep the array
        keys = sort_by_timestamp(keys.copy(), self._layout.timestamp_shift, first_us, last_us, spare)
        return self._decode(self._with_effects(keys, last_us))

    def follow(self, t_ns: int, source: CrossingSource) -> EventBatch:
        """Follow the light until ``t_ns``, a whole microsecond; return the events since the last time, as ``advance``.

        Raises
        ------
        ValueError
            Time does not increase, or the sensor cannot follow light (``follows_light``).
        """
        if self._start_ns is None:
            raise RuntimeError("Expected start before follow; show the first image with start")
        if not follows_light(self._options):
            raise ValueError("Expected a log sensor without a bandwidth, got another; show it images with advance")
        _require_whole_microsecond(t_ns)
        if t_ns <= self._now_ns:
            raise ValueError(f"Expected a time after {self._now_ns} ns, got {t_ns} ns; go on in order")
        pixels = Pixels(
            reference=self._comparator.reference,
            signal=self._signal,
            threshold_on=self._threshold_on,
            threshold_off=self._threshold_off,
            log_eps_dn=self._options.log_eps_dn,
            leak_per_s=self._options.leak_rate_hz,
            origin_ns=self._start_ns,
        )
        try:
            keys = source.crossings(pixels, self._now_ns, t_ns)
        except SignalNotFiniteError:
            self._require_finite()
            raise
        self._comparator.reset(pixels.reference)
        self._now_ns = t_ns
        return self._decode(self._with_effects(keys, (t_ns - self._start_ns) // NS_PER_US))

    def finish(self) -> EventBatch:
        """Events of an unfinished packet, which closes with the recording at the time of the last image."""
        keys, self._pending = self._pending, np.empty(0, np.int64)
        if self._start_ns is not None:
            stop_us = (self._now_ns - self._start_ns) // NS_PER_US
            keys = np.sort(self._layout.with_timestamp(keys, stop_us))
        return self._decode(keys)

    def _rng(self, stream: int) -> np.random.Generator:
        return np.random.default_rng(self._child_seed(stream))

    def _child_seed(self, stream: int) -> np.random.SeedSequence:
        return np.random.SeedSequence(self._seed.entropy, spawn_key=(*self._seed.spawn_key, stream))

    def _respond(self, luma_dn: Floats) -> None:
        """Put the photoreceptor's response to an image into the signal; the image itself is not kept."""
        if luma_dn.shape != self._shape:
            raise ValueError(f"Expected luma_dn of shape {self._shape}, got {luma_dn.shape}")
        if self._options.model == "linear":
            np.copyto(self._signal, luma_dn)
            return
        if self._options.log_eps_dn:
            luma_dn = luma_dn + self._options.log_eps_dn
        with np.errstate(divide="ignore", invalid="ignore"):  # _require_finite reports them
            np.log(luma_dn, out=self._signal)
        below_dn = self._options.linear_below_dn
        if below_dn:
            # lin-log: from 0 in the dark on a straight line to ln T at T.
            np.copyto(self._signal, luma_dn * (math.log(below_dn) / below_dn), where=luma_dn < below_dn)

    def _with_effects(self, keys: Keys, stop_us: int) -> Keys:
        """Return sorted keys up to ``stop_us``: spurious events added, refractory events dropped, packets formed."""
        if self._spurious:
            keys = np.sort(np.concatenate([keys, *(source.take_until(stop_us) for source in self._spurious)]))
        if self._options.refractory_us:
            kept = drop_refractory(keys, self._layout.timestamp_shift, self._options.refractory_us, self._last_us)
            keys = keys[:kept]
        if not self._options.packet_interval_us:
            return keys
        align_to_packets(keys, self._layout.timestamp_shift, self._options.packet_interval_us)
        keys = np.sort(np.concatenate([self._pending, keys]))
        split = int(np.searchsorted(keys, self._layout.first_key_after(stop_us)))
        self._pending = keys[split:]
        return keys[:split]

    def _decode(self, keys: Keys) -> EventBatch:
        return decode(keys, self._layout, (self._start_ns or 0) // NS_PER_US)

    def _require_finite(self) -> None:
        broken = np.flatnonzero(~np.isfinite(self._signal))
        if broken.size:
            row, column = divmod(int(broken[0]), self._layout.width)
            raise SceneError(
                f"Expected luma_dn + log_eps_dn above 0 and finite, got {broken.size} pixels without a logarithm, "
                f"first (column {column}, row {row}); give the scene light or set log_eps_dn"
            )


def _require_whole_microsecond(t_ns: int) -> None:
    if t_ns % NS_PER_US:
        raise ValueError(f"Expected a time on a whole microsecond, got {t_ns} ns; sample on the grid of the stamps")
