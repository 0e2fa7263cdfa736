"""Light that is known at all times, and the state of the pixels that its crossings depend on."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fedora_generator.events.options import EventSensorOptions

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
    """Whether a sensor can follow light: not with a bandwidth, which depends on the past, nor ``linear`` images."""
    return options.model == "log" and options.bandwidth_hz == 0
