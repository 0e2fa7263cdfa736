"""Rates of the streams: how often colour, depth, flow and poses are written."""

from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, Final

from pydantic import ConfigDict

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
