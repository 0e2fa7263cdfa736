"""The convention of axes, units, quaternions and gravity under which IMU and poses agree.

The search runs only where both disagree by more than small faults explain, because some candidate always fits. Several
candidates fit alike: the order w, x, y, z fits about as well as an inverse with turned axes. Therefore the simplest
candidate whose residual is close to the least one is returned.
"""

from dataclasses import dataclass, replace
from itertools import permutations, product
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.imu.samples import InertialSamples
from fedora_qa.geometry import so3
from fedora_qa.geometry.motion import interpolate_poses

QuaternionConvention = Literal["xyzw", "wxyz", "inverse", "wxyz inverse"]
GravityConvention = Literal["declared", "missing", "reversed"]

Float64 = NDArray[np.float64]

_QUATERNION_CONVENTIONS: Final[tuple[QuaternionConvention, ...]] = ("xyzw", "wxyz", "inverse", "wxyz inverse")
_DEGREES: Final = float(np.degrees(1.0))
_MILLIMETRES: Final = 1e3
_GRAVITY_FACTORS: Final[dict[GravityConvention, float]] = {"declared": 1.0, "missing": 0.0, "reversed": -1.0}

_RATE_SPANS_S: Final = (0.02, 0.05, 0.1, 0.2)
_FORCE_SPANS_S: Final = (0.02, 0.05, 0.1, 0.2, 0.3)
"""Spans over which motion is averaged. The shortest one at which noise is small against the motion is used, else the
longest."""

_FEWEST_EDGES: Final = 4
"""Poses at the ends of spans, below which nothing is compared."""
_SMALL_NOISE: Final = 0.05
"""Ratio of noise to motion that counts as small."""

_LONGEST_S: Final = 20.0
"""Length of the part of a sequence that is compared. It is enough, as candidates differ grossly."""

_EQUIVALENT_RATIO: Final = 2.0
"""A candidate fits as well as the best one if its residual is at most this many times as large."""

_COARSENESS: Final = 0.01
"""Relative error of the coarse rates and accelerations that are computed here."""

_LARGEST_RESIDUAL: Final = 25.0
"""Mean square residual, over that expected of noise and coarseness, above which no candidate is accepted."""


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


def explain_rates(samples: InertialSamples, sigma_rad: float) -> InertialConvention | None:
    """Return the convention under which mean angular velocities of poses and gyro agree.

    Parameters
    ----------
    samples
        As declared; the first 20 s are used.
    sigma_rad
        Measured noise of the orientations, standard deviation of each axis, rad.

    Returns
    -------
    InertialConvention or None
        The simplest one that fits; None where none fits, or where there are too few samples.
    """
    samples = samples.between(-np.inf, samples.pose_times_s[0] + _LONGEST_S)
    rates = samples.angular_velocities_body_rad_s
    span_s = _averaging_span_s(_RATE_SPANS_S, np.sqrt(2) * sigma_rad / np.array(_RATE_SPANS_S), rates)
    edges = _edges(samples, span_s)
    if len(edges) < _FEWEST_EDGES:
        return None
    times_s = samples.pose_times_s[edges]
    spans_s = np.diff(times_s)[:, None]
    angle = CubicSpline(samples.imu_times_s, rates).antiderivative()
    by_gyro = np.diff(angle(times_s), axis=0) / spans_s
    # Two orientations of sigma each, over the span between them.
    noise = 2 * (sigma_rad / float(np.median(spans_s))) ** 2
    candidates = []
    for quaternions in _QUATERNION_CONVENTIONS:
        q = _under_convention(samples.orientations_xyzw[edges], quaternions)
        # Mean angular velocity in the body between two poses: Log(q_k^-1 q_k+1) / dt.
        by_pose = so3.log_quaternion(so3.compose(so3.inverse(q[:-1]), q[1:])) / spans_s
        variance = _expected_variance(by_pose, noise)
        for axes in signed_permutations():
            turned = by_pose @ np.array(axes).T
            for unit in (1.0, _DEGREES, 1.0 / _DEGREES):
                residual = _mean_square(by_gyro / unit - turned) / variance
                candidates.append(
                    InertialConvention(
                        quaternions, sensor_axes=axes, rate_unit=unit, residual=residual, count=len(by_pose)
                    )
                )
    return _simplest(candidates)


def explain_forces(samples: InertialSamples, gravity_m_s2: float, sigma_m: float) -> InertialConvention | None:
    """Return the convention under which second differences of position agree with specific force.

    Parameters
    ----------
    samples
        As declared; the first 20 s are used.
    gravity_m_s2
        As declared, m/s^2.
    sigma_m
        Measured noise of the positions, standard deviation of each axis, in the unit of the file.

    Returns
    -------
    InertialConvention or None
        The simplest one that fits; None where none fits, or where there are too few samples.
    """
    samples = samples.between(-np.inf, samples.pose_times_s[0] + _LONGEST_S)
    forces = samples.specific_forces_body_m_s2
    # A second difference has the noise sqrt(1 + 4 + 1) sigma / span^2.
    noises = np.sqrt(6) * sigma_m / np.square(_FORCE_SPANS_S)
    edges = _edges(samples, _averaging_span_s(_FORCE_SPANS_S, noises, forces - forces.mean(axis=0)))
    if len(edges) < _FEWEST_EDGES:
        return None
    edges_s = samples.pose_times_s[edges]
    by_position = _accelerations(edges_s, samples.positions_world_m[edges])
    noise = 6 * (sigma_m / float(np.median(np.diff(edges_s))) ** 2) ** 2
    down = np.array([0.0, 0.0, -gravity_m_s2])
    identity = InertialConvention().sensor_axes
    # Axes of the sensor or of the world are exchanged, not both at once.
    exchanges = [(axes, identity) for axes in signed_permutations()]
    exchanges += [(identity, axes) for axes in signed_permutations()]
    candidates = []
    for quaternions in _QUATERNION_CONVENTIONS:
        R, _ = interpolate_poses(
            np.rint(samples.pose_times_s * NS_PER_S).astype(np.int64),
            samples.positions_world_m,
            _under_convention(samples.orientations_xyzw, quaternions),
            at_ns=np.rint(samples.imu_times_s * NS_PER_S).astype(np.int64),
        )
        # Under every exchange of axes the force in the world is a sum of the products R[i, j] f[k], so that these are
        # integrated once. ``turned`` (n, 3, 3, 3) holds their means, weighted as by the second difference of positions.
        products = R[..., None] * samples.specific_forces_body_m_s2[:, None, None, :]
        finite = np.isfinite(products).all(axis=(1, 2, 3))
        if np.count_nonzero(finite) < 4:
            continue
        curve = CubicSpline(samples.imu_times_s[finite], products[finite], extrapolate=False).antiderivative(2)
        turned = _accelerations(edges_s, curve(edges_s))
        finite = np.isfinite(turned).all(axis=(1, 2, 3))
        if np.count_nonzero(finite) < 2:
            continue
        turned, compared = turned[finite], by_position[finite]
        # An exchange of axes alters no mean square.
        variances = {unit: _expected_variance(compared / unit, noise / unit**2) for unit in (1.0, _MILLIMETRES)}
        for sensor, world in exchanges:
            by_force = np.einsum("nijk,kj->ni", turned, np.array(sensor))
            for unit, variance in variances.items():
                difference = compared @ np.array(world) / unit - by_force
                for gravity, factor in _GRAVITY_FACTORS.items():
                    # p'' = R f + g, with g as the candidate has it.
                    residual = _mean_square(difference - factor * down) / variance
                    candidates.append(
                        InertialConvention(
                            quaternions, sensor, world, 1.0, unit, gravity, residual, count=len(compared)
                        )
                    )
    return _simplest(candidates)


def signed_permutations() -> list[tuple[tuple[int, ...], ...]]:
    """Return the 48 signed permutation matrices, as rows: they exchange and reverse axes."""
    rows = np.eye(3, dtype=int)
    return [
        tuple(tuple(int(v) for v in sign * rows[column]) for sign, column in zip(signs, order, strict=True))
        for order in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    ]


def _averaging_span_s(spans_s: tuple[float, ...], noises: Float64, motion: Float64) -> float:
    """Return the shortest span, s, at which noise is small against the motion, else the longest."""
    size = float(np.sqrt(_mean_square(motion))) if motion.size else 0.0
    quiet = (span_s for span_s, noise in zip(spans_s, noises, strict=True) if noise <= _SMALL_NOISE * size)
    return next(quiet, spans_s[-1])


def _expected_variance(motion: Float64, noise: float) -> float:
    """Return the mean square residual that noise and the coarseness of the comparison lead one to expect."""
    return max(noise + _COARSENESS**2 * _mean_square(motion), 1e-30)


def _mean_square(values: Float64) -> float:
    """Return the mean square of values, at least one; a thousand candidates make it worth its own sum."""
    return float(np.vdot(values, values)) / values.size


def _edges(samples: InertialSamples, span_s: float) -> NDArray[np.intp]:
    """Return the indices of poses that are about ``span_s`` apart and within the span of the IMU.

    There are none where the samples are too few for a spline.
    """
    times_s, imu_times_s = samples.pose_times_s, samples.imu_times_s
    if len(times_s) < 2 or len(imu_times_s) < 4:
        return np.empty(0, dtype=np.intp)
    edges = np.arange(0, len(times_s), max(1, round(span_s / float(np.median(np.diff(times_s))))))
    within: NDArray[np.intp] = edges[(times_s[edges] >= imu_times_s[0]) & (times_s[edges] <= imu_times_s[-1])]
    return within


def _accelerations(times_s: Float64, values: Float64) -> Float64:
    """Return the second derivative (n - 2, ...) of values (n, ...): change of slope over the mean step."""
    steps_s = np.diff(times_s).reshape(-1, *[1] * (values.ndim - 1))
    slopes = np.diff(values, axis=0) / steps_s
    means: Float64 = np.diff(slopes, axis=0) / ((steps_s[1:] + steps_s[:-1]) / 2)
    return means


def _simplest(candidates: list[InertialConvention]) -> InertialConvention | None:
    """Return the simplest candidate whose residual is at most twice the least one; None where all are too large."""
    least = min((candidate.residual for candidate in candidates), default=np.inf)
    if least > _LARGEST_RESIDUAL:
        return None
    fitting = [candidate for candidate in candidates if candidate.residual <= _EQUIVALENT_RATIO * max(least, 1.0)]
    simplest = min(fitting, key=lambda candidate: (candidate.complexity, candidate.residual))
    declared = next(candidate.residual for candidate in candidates if candidate.complexity == 0.0)
    return replace(simplest, declared_residual=declared)


def _under_convention(stored: Float64, quaternions: QuaternionConvention) -> Float64:
    """Return quaternions (n, 4) x, y, z, w, body to world, of those stored under a convention."""
    q = stored[:, [1, 2, 3, 0]] if quaternions.startswith("wxyz") else stored
    return so3.inverse(q) if quaternions.endswith("inverse") else q
