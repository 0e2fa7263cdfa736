"""A convention under which IMU and poses agree, as a feature."""

from dataclasses import dataclass
from typing import Final

from fedora_qa.estimators.imu.inertial_convention import InertialConvention
from fedora_qa.features import Feature

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
