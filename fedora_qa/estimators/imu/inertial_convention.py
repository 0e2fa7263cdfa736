"""A convention of axes, units, quaternions and gravity under which IMU and poses agree."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

QuaternionConvention = Literal["xyzw", "wxyz", "inverse", "wxyz inverse"]
GravityConvention = Literal["declared", "missing", "reversed"]


@dataclass(frozen=True, slots=True)
class InertialConvention:
    """The convention under which the IMU and the poses of a file would agree.

    Attributes
    ----------
    quaternions
        Order of their components, and the direction of the rotation.
    sensor_axes
        Rows of the signed permutation P: the stored vector is ``P v`` for the vector v in the body frame.
    world_axes
        The same for positions in the world frame.
    rate_unit, length_unit
        Factor by which the stored angular velocities, and the stored positions, are too large.
    gravity
        Which gravity the measured specific force contains: as declared, none, or the reverse.
    residual
        Mean square residual under this convention, over that expected of noise and of the coarseness of the
        comparison.
    declared_residual
        The same under the declared convention.
    count
        Number of comparisons, of three axes each.
    """

    quaternions: QuaternionConvention = "xyzw"
    sensor_axes: tuple[tuple[int, ...], ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    world_axes: tuple[tuple[int, ...], ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    rate_unit: float = 1.0
    length_unit: float = 1.0
    gravity: GravityConvention = "declared"
    residual: float = 0.0
    declared_residual: float = 0.0
    count: int = 0

    @property
    def explained(self) -> float:
        """Share, 0 to 1, of the declared convention's residual beyond noise that this convention removes."""
        # 1 - (residual - 1) / (declared residual - 1), as noise alone leaves 1.
        excess = max(self.declared_residual - 1.0, 1e-30)
        return max(0.0, 1.0 - max(self.residual - 1.0, 0.0) / excess) if self.declared_residual > 1.0 else 0.0

    @property
    def disagreement(self) -> tuple[float, float]:
        """Root mean square residual of the declared convention, in units of noise, and its standard error."""
        # The rms of n unit normal values has the standard error 1 / sqrt(2 n); here n is three axes each.
        return float(np.sqrt(self.declared_residual)), 1.0 / float(np.sqrt(6 * self.count))

    @property
    def complexity(self) -> float:
        """Distance from the declared convention: the sum over the properties that differ.

        Each property counts 1, but quaternions that are both reordered and inverted 2, axes up to 2, and gravity 1/2.
        """
        return (
            float(self.quaternions != "xyzw")
            + float(self.quaternions == "wxyz inverse")
            + _axes_complexity(self.sensor_axes)
            + _axes_complexity(self.world_axes)
            + float(self.rate_unit != 1.0)
            + float(self.length_unit != 1.0)
            + 0.5 * float(self.gravity != "declared")
        )


def _axes_complexity(axes: tuple[tuple[int, ...], ...]) -> float:
    """Return 0 for the identity, 1 for one exchange or a frame with Y and Z reversed, 2 for anything else."""
    matrix = np.array(axes)
    if np.array_equal(matrix, np.eye(3)):
        return 0.0
    exchange = bool(np.all(matrix >= 0)) and int(np.trace(matrix)) == 1
    return 1.0 if exchange or np.array_equal(matrix, np.diag((1, -1, -1))) else 2.0
