"""Features of an IMU that disagrees with poses: a convention under which they agree, and a bias of a part."""

from dataclasses import dataclass
from typing import Final, Literal

from fedora_qa.estimators.imu.inertial_convention import InertialConvention
from fedora_qa.features import Feature

MotionKind = Literal["rotation", "translation"]

_CERTAIN_SIGMAS: Final = 8.0
"""Standard errors that exceed the limit of any file, for any number of comparisons."""


@dataclass(frozen=True, slots=True)
class InertialConventionTrial(Feature):
    """A convention under which IMU and poses agree where they do not as declared.

    Attributes
    ----------
    convention
        The convention, with its residual and that of the declared convention.
    interval_s
        Start and end of the time in which it holds, s; None for the whole sequence.
    """

    convention: InertialConvention
    interval_s: tuple[float, float] | None = None

    @property
    def is_certain(self) -> bool:
        """Whether the disagreement exceeds ``_CERTAIN_SIGMAS`` standard errors: no other measurement is then needed."""
        value, error = self.convention.disagreement
        return value - 1.0 > _CERTAIN_SIGMAS * error


@dataclass(frozen=True, slots=True)
class BiasOfPart(Feature):
    """The bias of a part of the sequence that removes most of the residuals.

    Attributes
    ----------
    kind
        Kind of the comparison.
    bias
        (3,) along the axes of the sensor, rad/s or m/s^2.
    start_ns, stop_ns
        Of the part, ns from the file's origin; infinite where it reaches an end of the sequence.
    explained
        Share of the squares beyond noise that it removes, 0 to 1.
    """

    kind: MotionKind
    bias: tuple[float, float, float]
    start_ns: float
    stop_ns: float
    explained: float


@dataclass(frozen=True, slots=True)
class DriftingBias(Feature):
    """A bias that changes evenly with time and removes nearly all of the residuals, as no constant one does.

    Attributes
    ----------
    kind
        Kind of the comparison.
    largest
        (3,) the longer one of the biases at both ends, along the axes of the sensor, rad/s or m/s^2.
    explained
        Share of the squares beyond noise that it removes, 0 to 1.
    """

    kind: MotionKind
    largest: tuple[float, float, float]
    explained: float


@dataclass(frozen=True, slots=True)
class OffsetsApart(Feature):
    """One sensor of the IMU is late and the other is not, so that their mean is the delay of neither.

    Attributes
    ----------
    late
        The comparison that has the delay: ``rotation`` for the gyro, ``translation`` for the accelerometer.
    offset_s, standard_error_s
        Delay of that sensor, s, positive where its samples are late, and its standard error.
    """

    late: MotionKind
    offset_s: float
    standard_error_s: float
