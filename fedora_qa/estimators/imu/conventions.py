"""The convention of axes, units, quaternions and gravity under which IMU and poses agree.

The search runs only where both disagree by more than small faults explain, because some candidate always fits. Several
candidates fit alike: the order w, x, y, z fits about as well as an inverse with turned axes. Therefore the simplest
candidate whose residual is close to the least one is returned.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product
from math import pi
from typing import Final, Literal
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.imu.samples import InertialSamples
from fedora_qa.geometry import so3
from fedora_qa.geometry.motion import interpolate_poses

QuaternionConvention = str
"""``xyzw`` or another order of components, ``inverse`` for x, y, z, w from world to body, or ``wxyz inverse``."""
GravityConvention = Literal["declared", "missing", "reversed", "subtracted along z"]
SensorFrame = Literal["body", "world"]
AngleSigns = tuple[int, int, int]
WorldAxis = tuple[float, float, float]
Axes = tuple[tuple[float, ...], ...]

Float64 = NDArray[np.float64]

_AXES: Final[Axes] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
QUATERNION_CONVENTIONS: Final[tuple[QuaternionConvention, ...]] = ("xyzw", "wxyz", "inverse", "wxyz inverse")
_RARE_ORDERS: Final[tuple[QuaternionConvention, ...]] = tuple(
    order for order in map("".join, permutations("xyzw")) if order not in QUATERNION_CONVENTIONS
)
"""Orders of components that no library writes; a loop that is written by hand does."""
_AS_DECLARED: Final[AngleSigns] = (1, 1, 1)
_ANGLE_SIGNS: Final[tuple[AngleSigns, ...]] = ((-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, -1))
"""Signs of yaw, pitch and roll with which attitudes are not those of another body in another world: two reversed angles
are a reversed axis of both, as a left-handed frame has it."""
RATE_UNITS: Final = (1.0, float(np.degrees(1.0)), float(np.radians(1.0)), 1e3, 30.0 / pi, 0.5 / pi)
"""Rad/s, deg/s, rad/s that were converted to rad/s once more, mrad/s, and turns a minute and a second, in a rad/s."""
_LENGTH_UNITS: Final = (1.0, 100.0, 1e3)
"""Metres, centimetres and millimetres, in a metre."""
_GRAVITY_FACTORS: Final[dict[GravityConvention, float]] = {"declared": 1.0, "missing": 0.0, "reversed": -1.0}
_UP: Final[WorldAxis] = (0, 0, 1)
_SIDEWAYS: Final[tuple[WorldAxis, ...]] = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0))
"""Axes of the stored world that may point upwards in place of Z."""
_DOWN: Final[WorldAxis] = (0, 0, -1)
_LEAST_TILT: Final = 0.3
"""Least angle of a world that is not level, rad: a bias of the accelerometer that resembles it exceeds 3 m/s^2."""

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
        Rows of the orthogonal matrix P, a signed permutation or any rotation: the stored vector is ``P v`` for the
        vector v in the body frame.
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
    up
        The unit vector of the stored world that points upwards: an axis, or any other.
    angle_signs
        Signs of the stored yaw, pitch and roll, of ``R = R_z(yaw) R_y(pitch) R_x(roll)``: -1 for an angle that is
        counted the other way.
    sensor_frame
        Frame in which the vectors of the sensor are written. Only specific forces state it: they have the vertical.
    axes_of_sensor_alone
        Axes of the sensor under which attitudes as they are stored fit as well; None where they do not, or where this
        convention has them.
    """

    quaternions: QuaternionConvention = "xyzw"
    sensor_axes: Axes = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    world_axes: Axes = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    rate_unit: float = 1.0
    length_unit: float = 1.0
    gravity: GravityConvention = "declared"
    residual: float = 0.0
    declared_residual: float = 0.0
    count: int = 0
    up: WorldAxis = _UP
    angle_signs: AngleSigns = _AS_DECLARED
    sensor_frame: SensorFrame = "body"
    axes_of_sensor_alone: Axes | None = None

    @property
    def component_order(self) -> tuple[int, int, int, int] | None:
        """Which of x, y, z, w (0 to 3) is stored at each place; None for x, y, z, w."""
        order = self.quaternions.removesuffix("inverse").strip() or "xyzw"
        first, second, third, fourth = ("xyzw".index(name) for name in order)
        return None if order == "xyzw" else (first, second, third, fourth)

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

    def turns_as(self, other: "InertialConvention") -> bool:
        """Whether attitudes have another's convention; of left-handed axes, rates have the opposite sensor's axes."""
        axes, of_other = np.array(self.sensor_axes), np.array(other.sensor_axes)
        alike = np.allclose(axes, of_other) or np.allclose(axes, -of_other)
        return alike and (self.quaternions, self.angle_signs) == (other.quaternions, other.angle_signs)

    @property
    def complexity(self) -> float:
        """Distance from the declared convention: the sum over the properties that differ.

        Each property counts 1, but quaternions that are both reordered and inverted 2, and those in an order that no
        library writes 9/4, axes up to 2, or 3 for those turned by any angle, gravity and the axis that points upwards
        1/2, a direction that is no axis 3/4, and signs of angles, or vectors in the world, 3/2: about one axis the
        inverse is the opposite angle.
        """
        return (
            float(self.quaternions != "xyzw")
            + float(self.quaternions == "wxyz inverse")
            + 1.25 * float(self.quaternions in _RARE_ORDERS)
            + _axes_complexity(self.sensor_axes)
            + _axes_complexity(self.world_axes)
            + float(self.rate_unit != 1.0)
            + float(self.length_unit != 1.0)
            + 0.5 * float(self.gravity != "declared")
            + 0.5 * float(self.up != _UP)
            + 0.25 * float(np.count_nonzero(self.up) > 1)
            + 1.5 * float(self.angle_signs != _AS_DECLARED)
            + 1.5 * float(self.sensor_frame != "body")
        )


def _axes_complexity(axes: Axes) -> float:
    """Return 0 for the identity, 1 for one exchange or a frame with Y and Z reversed, 2 for other axes, 3 for turns."""
    matrix = np.array(axes)
    if np.array_equal(matrix, np.eye(3)):
        return 0.0
    if np.count_nonzero(matrix) > 3:
        return 3.0
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
    # Of the world that is stored: a turn mixes components, and alters no rate in the body.
    stored = so3.compose(so3.inverse(samples.turn_xyzw), samples.orientations_xyzw[edges])
    for quaternions, angle_signs, q in _attitudes(stored):
        # Mean angular velocity in the body between two poses: Log(q_k^-1 q_k+1) / dt.
        by_pose = so3.log_quaternion(so3.compose(so3.inverse(q[:-1]), q[1:])) / spans_s
        variance = _expected_variance(by_pose, noise)
        exchanges: list[Axes] = [_AXES] if quaternions in _RARE_ORDERS else [*signed_permutations()]
        if (quaternions, angle_signs) == ("xyzw", _AS_DECLARED):
            exchanges.extend(_turn(by_pose, by_gyro, variance))
        for axes in exchanges:
            turned = by_pose @ np.array(axes).T
            for unit in RATE_UNITS:
                residual = _mean_square(by_gyro / unit - turned) / variance
                candidates.append(
                    InertialConvention(
                        quaternions,
                        sensor_axes=axes,
                        rate_unit=unit,
                        residual=residual,
                        count=len(by_pose),
                        angle_signs=angle_signs,
                    )
                )
    return _simplest(candidates)


def _turn(vectors: Float64, turned: Float64, variance: float) -> list[Axes]:
    """Return the rotation that takes vectors (n, 3) to others; none where one axis has all of them, or where none does.

    Source: G. Wahba, SIAM Review 7 (1965) 409.
    """
    # The rotation about the axis of largest motion follows from the others: these must exceed what counts as a misfit.
    of_axes = np.linalg.eigvalsh(vectors.T @ vectors / len(vectors))
    if not np.isfinite(turned).all() or not of_axes[1] > _LARGEST_RESIDUAL * variance:
        return []
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 - seldom needed, and loads all of scipy.spatial

    with catch_warnings():
        simplefilter("ignore")  # of a rotation that is not unique, which the condition above excludes
        rotation, _ = Rotation.align_vectors(turned, vectors)
    # It is fitted, so that it leaves what noise implies: part of a motion that is lacking, a turn makes up in part.
    if _mean_square(rotation.apply(vectors) - turned) > _EQUIVALENT_RATIO * variance:
        return []
    return [tuple(tuple(map(float, row)) for row in rotation.as_matrix())]


def explain_forces(
    samples: InertialSamples,
    gravity_m_s2: float,
    sigma_m: float,
    angle_signs: AngleSigns = _AS_DECLARED,
    sensor_axes: Axes = _AXES,
) -> InertialConvention | None:
    """Return the convention under which second differences of position agree with specific force.

    Parameters
    ----------
    samples
        As declared; the first 20 s are used.
    gravity_m_s2
        As declared, m/s^2.
    sigma_m
        Measured noise of the positions, standard deviation of each axis, in the unit of the file.
    angle_signs
        Signs of angles under which angular velocities agree, as of ``InertialConvention``: specific forces over a short
        time do not determine them.
    sensor_axes
        Axes of the sensor under which angular velocities agree, likewise.

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
    unturned_forces = _accelerations(edges_s, CubicSpline(samples.imu_times_s, forces).antiderivative(2)(edges_s))
    by_position = _accelerations(edges_s, samples.positions_world_m[edges])
    noise = 6 * (sigma_m / float(np.median(np.diff(edges_s))) ** 2) ** 2
    up = np.array([0.0, 0.0, gravity_m_s2])
    # Poses in the axes A of the world and B of the body have R' = A R B^T and p'' = R' B f + A g: a sensor with the
    # axes B^T, and another axis that points upwards. Both may be left-handed. World axes are those of positions alone.
    exchanges: list[tuple[Axes, Axes]] = [(axes, _AXES) for axes in signed_permutations()]
    exchanges += [(_AXES, axes) for axes in signed_permutations()]
    if np.count_nonzero(sensor_axes) > 3:
        exchanges.append((sensor_axes, _AXES))
    candidates = []
    for quaternions, signs, q in _attitudes(samples.orientations_xyzw):
        if signs not in (_AS_DECLARED, angle_signs):
            continue
        R, _ = interpolate_poses(
            np.rint(samples.pose_times_s * NS_PER_S).astype(np.int64),
            samples.positions_world_m,
            q,
            at_ns=np.rint(samples.imu_times_s * NS_PER_S).astype(np.int64),
        )
        # Under every exchange of axes the force in the world is a sum of the products R[i, j] f[k], so that these are
        # integrated once. ``turned`` (n, 3, 3, 4) holds their means, weighted as by the second difference of positions,
        # and behind them those of R.
        with_one = np.concatenate([forces, np.ones((len(forces), 1))], axis=1)
        products = R[..., None] * with_one[:, None, None, :]
        finite = np.isfinite(products).all(axis=(1, 2, 3))
        if np.count_nonzero(finite) < 4:
            continue
        is_upside_down = float(R[finite, 2, 2].mean()) < 0
        curve = CubicSpline(samples.imu_times_s[finite], products[finite], extrapolate=False).antiderivative(2)
        turned = _accelerations(edges_s, curve(edges_s))
        finite = np.isfinite(turned).all(axis=(1, 2, 3))
        if np.count_nonzero(finite) < 2:
            continue
        turned, compared, unturned = turned[finite], by_position[finite], unturned_forces[finite]
        # An exchange of axes alters no mean square.
        variances = {unit: _expected_variance(compared / unit, noise / unit**2) for unit in _LENGTH_UNITS}
        exchanges_of_attitude = [(_AXES, _AXES)] if quaternions in _RARE_ORDERS else exchanges
        if (quaternions, signs) == ("xyzw", _AS_DECLARED):
            variance = variances[1.0]
            # Positions alone in a turned world: p'' = W (R f + g).
            worlds = _turn(turned[..., :3].trace(axis1=2, axis2=3) - up, compared, variance)
            exchanges_of_attitude = [*exchanges, *((_AXES, world) for world in worlds)]
            for name, factor in _GRAVITY_FACTORS.items():
                residual = _mean_square(compared - unturned + factor * up) / variance
                candidates.append(
                    InertialConvention(gravity=name, residual=residual, count=len(compared), sensor_frame="world")
                )
        for sensor, world in exchanges_of_attitude:
            by_force = np.einsum("nijk,kj->ni", turned[..., :3], np.array(sensor))
            # p'' = R f + g: what the candidate has for -g, and the name of it.
            gravities: list[tuple[GravityConvention, WorldAxis, Float64]] = [
                (gravity, _UP, factor * up) for gravity, factor in _GRAVITY_FACTORS.items()
            ]
            if world == _AXES:
                gravities += [("declared", axis, gravity_m_s2 * np.array(axis)) for axis in _SIDEWAYS]
            if sensor == world == _AXES and is_upside_down:
                # What flies upside down in its own world has a world that is.
                gravities = [each for each in gravities if each[0] != "reversed"]
                gravities.append(("declared", _DOWN, -up))
            if sensor == world == _AXES:
                # f lacks g along the body's Z axis: p'' = R (f + g e_z) + g.
                gravities.append(("subtracted along z", _UP, up - gravity_m_s2 * turned[:, :, 2, 3]))
            for unit, variance in variances.items():
                difference = compared @ np.array(world) / unit - by_force
                tilted = _tilted_world(difference, gravity_m_s2) if world == _AXES else []
                for gravity, upwards, term in (*gravities, *tilted):
                    residual = _mean_square(difference + term) / variance
                    candidates.append(
                        InertialConvention(
                            quaternions,
                            sensor,
                            world,
                            1.0,
                            unit,
                            gravity,
                            residual,
                            0.0,
                            len(compared),
                            upwards,
                            signs,
                        )
                    )
    return _simplest(candidates)


def _tilted_world(
    accelerations_less_forces: Float64, gravity_m_s2: float
) -> list[tuple[GravityConvention, WorldAxis, Float64]]:
    """Return the direction that points upwards in a world that is not level, as -g = mean(R f - p''); none if level."""
    upwards = -accelerations_less_forces.mean(axis=0)
    length = float(np.linalg.norm(upwards))
    if not length > 0 or upwards[2] > np.cos(_LEAST_TILT) * length:
        return []
    east, north, up = (float(component) for component in upwards / length)
    return [("declared", (east, north, up), gravity_m_s2 * upwards / length)]


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
    if (simplest.quaternions, simplest.angle_signs) != ("xyzw", _AS_DECLARED):
        # A sensor with other axes, whose other properties are declared.
        of_sensor = [each for each in fitting if replace(each, sensor_axes=_AXES).complexity == 0.0]
        alone = min(of_sensor, key=lambda candidate: (candidate.complexity, candidate.residual), default=None)
        simplest = replace(simplest, axes_of_sensor_alone=None if alone is None else alone.sensor_axes)
    declared = next(candidate.residual for candidate in candidates if candidate.complexity == 0.0)
    return replace(simplest, declared_residual=declared)


def _attitudes(stored: Float64) -> Iterator[tuple[QuaternionConvention, AngleSigns, Float64]]:
    """Yield conventions of attitudes, and quaternions (n, 4) x, y, z, w, body to world, of those stored under them."""
    for quaternions in (*QUATERNION_CONVENTIONS, *_RARE_ORDERS):
        order = InertialConvention(quaternions).component_order
        q = stored if order is None else stored[:, np.argsort(order)]
        yield quaternions, _AS_DECLARED, so3.inverse(q) if quaternions.endswith("inverse") else q
    angles_rad = so3.angles_from_quaternions(stored)
    for signs in _ANGLE_SIGNS:
        yield "xyzw", signs, so3.quaternions_from_angles(angles_rad * signs)
