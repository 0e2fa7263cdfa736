"""Rates of the streams, and the timestamps that follow: int64 microseconds from the start."""

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict

from fedora_generator.errors import SceneError
from fedora_qa.conventions import FLOW_RATES_HZ, US_PER_S

FASTEST_HZ: Final = 10_000.0
"""All timestamps of a sequence are in memory: 288 MB an hour at this rate."""

_DECIMALS: Final = 3


def exact_hz(rate_hz: float) -> Fraction:
    """Return the decimal number that is meant, without the rounding of binary floating point."""
    return Fraction(str(rate_hz))


def rate_text(rate_hz: float) -> str:
    """Return a rate as names of streams spell it: ``10``, ``12.5``."""
    return f"{rate_hz:.{_DECIMALS}f}".rstrip("0").rstrip(".")


def require_rate(name: str, rate_hz: float) -> None:
    """Raise ValueError for a rate that is no decimal number above 0 and up to 10 kHz, with three decimals at most."""
    if not (0 < rate_hz <= FASTEST_HZ and (exact_hz(rate_hz) * 10**_DECIMALS).denominator == 1):
        raise ValueError(
            f"Expected {name} above 0 and up to {FASTEST_HZ:g} Hz, with {_DECIMALS} decimals at most, got {rate_hz}"
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class RateOptions:
    """Rates of the streams, Hz; that of the inertial unit is ``imu.rate_hz``.

    Without ``depth_hz`` depth has the rate of the colour frames. Flow starts and ends on depth frames, so that a whole
    number of depth frames fits into each of its intervals.
    """

    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid")

    frames_hz: float = 50.0
    depth_hz: float | None = None
    flow_hz: tuple[float, ...] = tuple(map(float, FLOW_RATES_HZ))
    pose_hz: float = 200.0

    def __post_init__(self) -> None:
        for name, rate_hz in (
            ("frames_hz", self.frames_hz),
            ("depth_hz", self.of_depth_hz),
            ("pose_hz", self.pose_hz),
            *(("flow_hz", rate_hz) for rate_hz in self.flow_hz),
        ):
            require_rate(name, rate_hz)
        if not self.flow_hz:
            raise ValueError("Expected a rate in flow_hz, got none; leave flow out by --streams")
        if len(set(self.flow_hz)) < len(self.flow_hz):
            raise ValueError(f"Expected each rate once in flow_hz, got {', '.join(map(rate_text, self.flow_hz))}")
        for rate_hz in self.flow_hz:
            if (exact_hz(self.of_depth_hz) / exact_hz(rate_hz)).denominator != 1:
                raise ValueError(
                    f"Expected flow_hz by which the {rate_text(self.of_depth_hz)} Hz of depth can be divided, as flow "
                    f"starts and ends on depth frames, got {rate_text(rate_hz)}; choose another, or raise depth_hz"
                )

    @property
    def of_depth_hz(self) -> float:
        """The rate of depth, Hz."""
        return self.frames_hz if self.depth_hz is None else self.depth_hz

    @property
    def frame_interval_us(self) -> float:
        """The interval of the faster of colour and depth, us."""
        return US_PER_S / max(self.frames_hz, self.of_depth_hz)


LONGEST_S: Final = 3600.0
"""All streams are written piece by piece; only timestamps are in memory for the whole length, 29 MB an hour."""

PIECE: Final = 1 << 16
"""Timestamps that are processed together: about a minute of the fastest clock, and whole chunks of its dataset."""


def whole_us(duration_s: float) -> int:
    """Return a duration in whole microseconds."""
    if not (math.isfinite(duration_s) and 0 < duration_s <= LONGEST_S):
        raise SceneError(f"Expected a duration above 0 and up to {LONGEST_S:g} s, got {duration_s:g} s")
    if (duration_us := round(duration_s * US_PER_S)) == 0:
        raise SceneError(f"Expected a duration of at least a microsecond, got {duration_s:g} s")
    return duration_us


def timestamps_us(duration_us: int, rate_hz: float) -> NDArray[np.int64]:
    """Return the timestamps (n,) of a stream, from 0 to the last that fits, both included: n = floor(rate T) + 1."""
    period_us = US_PER_S / exact_hz(rate_hz)
    count = int(duration_us / period_us) + 1
    # In whole numbers: the timestamps of a rate are among those of its multiples, to the microsecond.
    return np.arange(count, dtype=np.int64) * period_us.numerator // period_us.denominator


def pieces(times_us: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Cut times (n,) into pieces of bounded size, so that memory does not grow with n."""
    return np.split(times_us, range(PIECE, len(times_us), PIECE))


def intervals_us(duration_us: int, rate_hz: float) -> NDArray[np.int64]:
    """Return start and end (k, 2) of the abutting intervals of a flow rate."""
    timestamps = timestamps_us(duration_us, rate_hz)
    return np.stack([timestamps[:-1], timestamps[1:]], axis=-1)
