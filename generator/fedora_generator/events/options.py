"""Options of an event camera: its model, its thresholds, and the effects of a real sensor."""

import math
from dataclasses import dataclass, fields
from typing import ClassVar, Final, Literal

from pydantic import ConfigDict

LEAST_THRESHOLD: Final = 1e-6
"""Below, a reference could no longer move by its threshold in float64, and one edge would fill the memory."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EventSensorOptions:
    """The sensor model and its effects; an effect of 0 is not added and costs nothing.

    Attributes
    ----------
    model
        ``log`` or ``linear``.
    threshold_on, threshold_off
        Contrast thresholds, nat (log) or DN (linear).
    log_eps_dn
        DN added before the logarithm.
    linear_below_dn
        T, DN: below, the response is (luma + log_eps_dn) ln(T) / T (lin-log); 0: the logarithm throughout.
    initial_phase
        ``zero``: the first reference is the first signal. ``uniform``: the first reference is such that the signal
        lies anywhere between its two thresholds, as in a pixel that has been running.
    packet_interval_us
        Timestamps are moved up to multiples of this, counted from the start; 0 is asynchronous.
    threshold_sigma
        Spread of the thresholds over pixels, in their own unit.
    leak_rate_hz
        The reference falls by ``leak_rate_hz * threshold_on`` a second: that many brighter events at rest.
    shot_rate_hz
        Spurious events a pixel, half of each polarity.
    bandwidth_hz
        First-order low-pass of the signal before the comparator.
    refractory_us
        An event sooner than this after its pixel's last event is dropped; the reference moves all the same.
    hot_pixel_count, hot_pixel_rate_hz
        Pixels that also fire at random, and the rate of each.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    model: Literal["log", "linear"]
    threshold_on: float
    threshold_off: float
    log_eps_dn: float = 0.0
    linear_below_dn: float = 0.0
    initial_phase: Literal["zero", "uniform"] = "zero"
    packet_interval_us: int = 0
    threshold_sigma: float = 0.0
    leak_rate_hz: float = 0.0
    shot_rate_hz: float = 0.0
    bandwidth_hz: float = 0.0
    refractory_us: int = 0
    hot_pixel_count: int = 0
    hot_pixel_rate_hz: float = 0.0

    def __post_init__(self) -> None:
        if self.model not in ("log", "linear"):
            raise ValueError(f"Expected model to be 'log' or 'linear', got {self.model!r}")
        if self.initial_phase not in ("zero", "uniform"):
            raise ValueError(f"Expected initial_phase to be 'zero' or 'uniform', got {self.initial_phase!r}")
        for field in fields(self):
            value = getattr(self, field.name)
            least = LEAST_THRESHOLD if field.name in ("threshold_on", "threshold_off") else 0
            if not isinstance(value, str) and not (math.isfinite(value) and value >= least):
                raise ValueError(f"Expected {field.name} to be finite and at least {least}, got {value}")
        if 0 < self.linear_below_dn <= 1:
            raise ValueError(f"Expected linear_below_dn to be 0 or above 1, got {self.linear_below_dn}")
