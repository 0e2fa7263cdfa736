"""What disturbs all estimates from samples of the IMU and of poses: defects, as checks of such estimates state them."""

from dataclasses import dataclass
from typing import Final, Literal

from fedora_qa.features import Feature

PoseValues = Literal["positions", "orientations"]

OTHER_WEIGHT: Final = 3.0
"""Ratio of specific force to gravity, or of gravity to it, that half of a flight does not exceed: a vehicle that
carries itself accelerates at about 1 g, and turns at 3 g do not last."""


@dataclass(frozen=True, slots=True)
class SampleClockGrid(Feature):
    """All timestamps of a stream lie on a grid coarser than a microsecond.

    Attributes
    ----------
    stream
        ``imu`` or ``pose``.
    period_ns
        Step of the grid.
    """

    stream: str
    period_ns: int


@dataclass(frozen=True, slots=True)
class SampleClockDrift(Feature):
    """A part of an otherwise exact clock has a rate error.

    Attributes
    ----------
    stream
        ``imu`` or ``pose``.
    drift
        Rate error, s/s, positive where the clock runs fast.
    """

    stream: str
    drift: float


@dataclass(frozen=True, slots=True)
class SampleClockOffset(Feature):
    """A part of an otherwise exact clock has an offset.

    Attributes
    ----------
    stream
        ``imu`` or ``pose``.
    offset_ns
        Clock offset, ns, positive where timestamps are too late.
    """

    stream: str
    offset_ns: float


@dataclass(frozen=True, slots=True)
class LinearInterpolation(Feature):
    """Samples lie on straight lines between those of a lower rate.

    Attributes
    ----------
    stream
        ``pose``.
    knot_rate_hz
        The lower rate, Hz.
    """

    stream: str
    knot_rate_hz: float


@dataclass(frozen=True, slots=True)
class RepeatedSamples(Feature):
    """Samples equal the one before in every bit while the body moves.

    Attributes
    ----------
    stream
        ``imu`` or ``pose``.
    count
        Number of such samples.
    """

    stream: str
    count: int


@dataclass(frozen=True, slots=True)
class HeldComponent(Feature):
    """One component of a sensor of the IMU keeps its value in every bit for a while, and varies before and after.

    Attributes
    ----------
    count
        Number of samples with that value, one after the other.
    """

    count: int


@dataclass(frozen=True, slots=True)
class NoiseOfPart(Feature):
    """Noise of a part of the samples of a sensor of the IMU, over that of all others.

    Attributes
    ----------
    start_ns, stop_ns
        Times of the first sample of the part, and of the one behind its last; infinite where it reaches the end.
    ratio
        Of the noises.
    """

    start_ns: float
    stop_ns: float
    ratio: float


@dataclass(frozen=True, slots=True)
class SmoothInterpolation(Feature):
    """Samples lie on cubic curves between those of a lower rate, whose noise alone they have.

    Attributes
    ----------
    stream
        ``pose``.
    knot_rate_hz
        The lower rate, Hz.
    """

    stream: str
    knot_rate_hz: float


@dataclass(frozen=True, slots=True)
class FilteredNoise(Feature):
    """Noise is smaller than declared between neighbours, and larger between samples far apart: it passed a filter.

    Attributes
    ----------
    stream
        ``imu`` or ``pose``.
    kept
        Share of the declared variance that samples far apart have, 0 to 1.
    delay_s
        Delay of a filter that looks back and keeps that share.
    """

    stream: str
    kept: float
    delay_s: float


@dataclass(frozen=True, slots=True)
class ClippedSamples(Feature):
    """Samples of a sensor of the IMU end at a limit: many equal the largest value of an axis bit for bit.

    Attributes
    ----------
    share
        Of the samples of that axis.
    """

    share: float


@dataclass(frozen=True, slots=True)
class NoWeight(Feature):
    """The accelerometer does not measure a weight such as the declared one, as it does in any flight.

    Attributes
    ----------
    ratio
        Median length of specific force over declared gravity.
    steadiness
        Length of the mean specific force over the rms length, 0 to 1: near 1 for a weight in another unit.
    """

    ratio: float
    steadiness: float = 0.0


@dataclass(frozen=True, slots=True)
class LoneSamples(Feature):
    """Single samples lie off the motion of those on both sides, and all others on it: what is off at times is no noise.

    Attributes
    ----------
    stream
        ``pose``.
    count
        Number of such samples.
    largest_m
        Largest distance of a position from the motion, m.
    """

    stream: str
    count: int
    largest_m: float


@dataclass(frozen=True, slots=True)
class NoiseAtTimes(Feature):
    """What differs from a smooth motion does so at times, as jumps do: most samples lie on it.

    Attributes
    ----------
    stream
        ``pose``.
    """

    stream: str


@dataclass(frozen=True, slots=True)
class ComponentNoise(Feature):
    """Noise was added to the components of quaternions: lengths scatter by half as much as rotations, in rad.

    Attributes
    ----------
    stream
        ``pose``.
    sigma
        Standard deviation of the noise of a component.
    """

    stream: str
    sigma: float


@dataclass(frozen=True, slots=True)
class ExcessNoise(Feature):
    """White noise of a stream is larger than declared.

    Attributes
    ----------
    stream
        ``pose``.
    """

    stream: str
