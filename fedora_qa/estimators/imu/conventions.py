"""Gross disagreements of IMU and poses: which exchange of axes, units or quaternions makes them agree.

Asked only where the two disagree beyond what small faults explain: on clean files an explanation is always found. The
simplest candidate whose residual is close to the least wins, because several fit alike: w, x, y, z fits about as well
as an inverse with turned axes.
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

Float64 = NDArray[np.float64]
QuaternionConvention = Literal["xyzw", "wxyz", "inverse", "wxyz inverse"]
GravityConvention = Literal["declared", "missing", "reversed"]

_QUATERNION_CONVENTIONS: Final[tuple[QuaternionConvention, ...]] = ("xyzw", "wxyz", "inverse", "wxyz inverse")
_DEGREES: Final = float(np.degrees(1.0))
_MILLIMETRES: Final = 1e3
_GRAVITY_FACTORS: Final[dict[GravityConvention, float]] = {"declared": 1.0, "missing": 0.0, "reversed": -1.0}

_RATE_SPANS_S: Final = (0.02, 0.05, 0.1, 0.2)
_FORCE_SPANS_S: Final = (0.02, 0.05, 0.1, 0.2, 0.3)
"""Spans over which motion is averaged: the shortest at which noise is small beside it, or the longest."""

_FEWEST_EDGES: Final = 4

_SMALL_NOISE: Final = 0.05
"""Noise over motion that counts as small."""

_LONGEST_S: Final = 20.0
"""As much of a sequence is enough to distinguish candidates that differ grossly."""

_EQUIVALENT_RATIO: Final = 2.0
"""A candidate that leaves at most so many times what the best one leaves fits as well."""

_COARSENESS: Final = 0.01
"""Share of the motion by which the crude rates and accelerations here may be wrong."""

_LARGEST_RESIDUAL: Final = 25.0
"""Mean square residual, in units of what noise and coarseness leave, beyond which a candidate explains nothing."""


@dataclass(frozen=True, slots=True)
class InertialConvention:
    """The convention under which the file's IMU and poses would agree.

    Attributes
    ----------
    quaternions
        Order of their components, and the direction of the rotation.
    sensor_axes
        Rows of the signed permutation P: the sensor wrote ``P v`` for the vector v in the body.
    world_axes
        Likewise of the positions in the world.
    rate_unit, length_unit
        Factor by which angular velocities and positions are too large.
    gravity
        What part of gravity the accelerometer measures.
    residual
        Mean square residual under it, in units of what noise and the coarseness of the comparison leave.
    declared_residual
        The same under the declared convention.
    count
        Number of comparisons, three axes each.
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
        """Share (0 to 1) of what the declared convention leaves beyond noise that this one accounts for."""
        excess = max(self.declared_residual - 1.0, 1e-30)
        return max(0.0, 1.0 - max(self.residual - 1.0, 0.0) / excess) if self.declared_residual > 1.0 else 0.0

    @property
    def disagreement(self) -> tuple[float, float]:
        """Root mean square residual of the declared convention, in units of noise, and its standard error."""
        # The rms of n unit normal values has the standard error 1 / sqrt(2 n); here n is three axes each.
        return float(np.sqrt(self.declared_residual)), 1.0 / float(np.sqrt(6 * self.count))

    @property
    def complexity(self) -> float:
        """Distance from the declared convention: one for each property that differs, more for turned axes."""
        return (
            float(self.quaternions != "xyzw")
            + float(self.quaternions == "wxyz inverse")
            + _axes_complexity(self.sensor_axes)
            + _axes_complexity(self.world_axes)
            + float(self.rate_unit != 1.0)
            + float(self.length_unit != 1.0)
            + 0.5 * float(self.gravity != "declared")
        )


def explain_rates(samples: InertialSamples, sigma_rad: float) -> InertialConvention | None:
    """Find the convention under which mean angular velocities of pose and gyro agree.

    Parameters
    ----------
    samples
        As declared; the first 20 s are used.
    sigma_rad
        Noise of the orientations, as measured.

    Returns
    -------
    InertialConvention or None
        The simplest that fits; None where none does, or where there are too few samples.
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
        for axes, unit in product(signed_permutations(), (1.0, _DEGREES, 1.0 / _DEGREES)):
            residual = _normalised_residual(by_gyro / unit - by_pose @ np.array(axes).T, by_pose, noise)
            candidates.append(
                InertialConvention(quaternions, sensor_axes=axes, rate_unit=unit, residual=residual, count=len(by_pose))
            )
    return _simplest(candidates)


def explain_forces(samples: InertialSamples, gravity_m_s2: float, sigma_m: float) -> InertialConvention | None:
    """Find the convention under which second differences of position agree with specific force.

    Parameters
    ----------
    samples
        As declared; the first 20 s are used.
    gravity_m_s2
        As declared.
    sigma_m
        Noise of the positions, as measured, in the file's own unit.

    Returns
    -------
    InertialConvention or None
        The simplest that fits; None where none does, or where there are too few samples.
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
        # All exchanges of axes are sums of the products R[i, j] f[k], so that these are integrated once. Their means
        # (n, 3, 3, 3) are those by which the second difference between the edges weighs them.
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
        for sensor, world in exchanges:
            by_force = np.einsum("nijk,kj->ni", turned, np.array(sensor))
            for unit, (gravity, factor) in product((1.0, _MILLIMETRES), _GRAVITY_FACTORS.items()):
                acceleration = compared @ np.array(world) / unit
                # p'' = R f + g, with g as the candidate has it.
                residual = _normalised_residual(acceleration - by_force - factor * down, acceleration, noise / unit**2)
                candidates.append(
                    InertialConvention(
                        quaternions, sensor, world, 1.0, unit, gravity, residual, count=len(acceleration)
                    )
                )
    return _simplest(candidates)


def signed_permutations() -> list[tuple[tuple[int, ...], ...]]:
    """Return the 48 matrices that exchange and reverse axes."""
    rows = np.eye(3, dtype=int)
    return [
        tuple(tuple(int(v) for v in sign * rows[column]) for sign, column in zip(signs, order, strict=True))
        for order in permutations(range(3))
        for signs in product((1, -1), repeat=3)
    ]


def _averaging_span_s(spans_s: tuple[float, ...], noises: Float64, motion: Float64) -> float:
    """Return the shortest span at which noise is small beside the motion, or the longest."""
    size = float(np.sqrt(np.mean(np.square(motion)))) if motion.size else 0.0
    quiet = (span_s for span_s, noise in zip(spans_s, noises, strict=True) if noise <= _SMALL_NOISE * size)
    return next(quiet, spans_s[-1])


def _normalised_residual(residuals: Float64, motion: Float64, noise: float) -> float:
    """Return the mean square residual in units of noise (a variance) and of the coarseness of the comparison."""
    coarse = _COARSENESS**2 * float(np.mean(np.square(motion)))
    return float(np.mean(np.square(residuals))) / max(noise + coarse, 1e-30)


def _edges(samples: InertialSamples, span_s: float) -> NDArray[np.intp]:
    """Return every so many-th pose within the IMU's span; none where IMU samples are too few for a spline."""
    times_s, imu_times_s = samples.pose_times_s, samples.imu_times_s
    if len(times_s) < 2 or len(imu_times_s) < 4:
        return np.empty(0, dtype=np.intp)
    edges = np.arange(0, len(times_s), max(1, round(span_s / float(np.median(np.diff(times_s))))))
    within: NDArray[np.intp] = edges[(times_s[edges] >= imu_times_s[0]) & (times_s[edges] <= imu_times_s[-1])]
    return within


def _accelerations(times_s: Float64, values: Float64) -> Float64:
    """Return (n - 2, ...) changes of slope of values (n, ...), over the mean of the two steps."""
    steps_s = np.diff(times_s).reshape(-1, *[1] * (values.ndim - 1))
    slopes = np.diff(values, axis=0) / steps_s
    means: Float64 = np.diff(slopes, axis=0) / ((steps_s[1:] + steps_s[:-1]) / 2)
    return means


def _simplest(candidates: list[InertialConvention]) -> InertialConvention | None:
    """Return the simplest candidate that leaves at most twice what the best one leaves."""
    least = min((candidate.residual for candidate in candidates), default=np.inf)
    if least > _LARGEST_RESIDUAL:
        return None
    fitting = [candidate for candidate in candidates if candidate.residual <= _EQUIVALENT_RATIO * max(least, 1.0)]
    simplest = min(fitting, key=lambda candidate: (candidate.complexity, candidate.residual))
    declared = next(candidate.residual for candidate in candidates if candidate.complexity == 0.0)
    return replace(simplest, declared_residual=declared)


def _under_convention(stored: Float64, quaternions: QuaternionConvention) -> Float64:
    """Return x, y, z, w, body to world, of quaternions stored under a convention."""
    q = stored[:, [1, 2, 3, 0]] if quaternions.startswith("wxyz") else stored
    return so3.inverse(q) if quaternions.endswith("inverse") else q


def _axes_complexity(axes: tuple[tuple[int, ...], ...]) -> float:
    """Return 0 for the identity, 1 for one exchange or a frame with Y and Z reversed, 2 for anything else."""
    matrix = np.array(axes)
    if np.array_equal(matrix, np.eye(3)):
        return 0.0
    exchange = bool(np.all(matrix >= 0)) and int(np.trace(matrix)) == 1
    return 1.0 if exchange or np.array_equal(matrix, np.diag((1, -1, -1))) else 2.0
