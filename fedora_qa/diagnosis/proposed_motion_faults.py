"""The faults of poses and of the IMU that a trial undoes, with axes and sizes from their conventions and fits."""

from collections.abc import Iterator, Mapping, Sequence
from math import hypot, isinf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.imu.agreement import InertialParameter
from fedora_qa.checks.pose.continuity import DisplacedPositions, PairedSteps, PartBetweenJumps, PoseTransform
from fedora_qa.conventions import FRD_FROM_FLU, NED_FROM_ENU, NS_PER_US, SAME_AXES
from fedora_qa.diagnosis.fitted_cause import Faults, FittedCause
from fedora_qa.diagnosis.imu import HALF_TURN, STEADY
from fedora_qa.diagnosis.length_units import ratio_of_units
from fedora_qa.diagnosis.measured_sizes import vector
from fedora_qa.diagnosis.pose import SAME_FACTOR, axes_cause
from fedora_qa.estimators.imu.conventions import GravityConvention, InertialConvention, signed_permutations
from fedora_qa.faults import axes, declarations, gravity, motion, units
from fedora_qa.faults.fault import Matrix3, RowRange, Sensor, Vector3
from fedora_qa.geometry import so3
from fedora_qa.sequence.declared import ImuModel
from fedora_qa.views.inertial_agreement import (
    BiasOfPart,
    ConstantForce,
    DriftingBias,
    InertialConventionTrial,
    MotionKind,
)
from fedora_qa.views.sample_defects import OTHER_WEIGHT, LoneSamples, NoiseAtTimes, NoiseOfPart

_SENSORS: Final[Mapping[MotionKind, Sensor]] = {"rotation": "gyro", "translation": "accelerometer"}
"""The sensor that is compared with poses, by the kind of the comparison."""


def vector_axes(fit: FittedCause) -> Faults:
    """Yield axes of poses or of the IMU under which both agree."""
    cause: Any = fit.cause
    if fit.stream == "pose":
        yield from _axes_of_parts(fit)
    of_vertical = [feature.convention for feature, _ in inertial_conventions(fit) if feature.kind == "translation"]
    if fit.stream == "imu" and any(convention.sensor_frame == "world" for convention in of_vertical):
        yield gravity.SensorsInWorld(("gyro", "accelerometer"))
        yield gravity.SensorsInWorld(("accelerometer",))
    for feature, rows in inertial_conventions(fit):
        convention = feature.convention
        if convention.sensor_frame == "world":
            continue
        if fit.stream == "pose" and feature.kind == "rotation" and any(map(convention.turns_as, of_vertical)):
            # Rates state neither the handedness of the axes nor the vertical, which specific forces have stated.
            continue
        sensor, world = _matrix(convention.sensor_axes), _matrix(convention.world_axes)
        if fit.stream == "imu":
            alone = convention.axes_of_sensor_alone
            of_sensor = sensor if alone is None else _matrix(alone)
            if of_sensor == SAME_AXES:
                continue
            yield axes.VectorAxes(fit.stream, of_sensor, cause=cause, rows=rows)
            # The other sensor may have the axes of the body.
            yield axes.VectorAxes(fit.stream, of_sensor, cause=cause, rows=rows, sensors=(_SENSORS[feature.kind],))
            continue
        if any(sign < 0 for sign in convention.angle_signs):
            if fit.stream == "pose":
                yield motion.AngleSense(convention.angle_signs, world)
        else:
            # The IMU measures P v for v in the body of the poses: R' = R P, so that the axes of the body are P^T.
            body = _matrix(tuple(zip(*sensor, strict=True)))
            if world != SAME_AXES:
                # Of positions alone.
                yield axes.VectorAxes(fit.stream, world, body, cause=cause, rows=rows)
                yield axes.VectorAxes(fit.stream, world, turns_orientations=False, cause=cause, rows=rows)
            elif (with_vertical := (_world_of(convention, body), body)) != (SAME_AXES, SAME_AXES):
                yield axes.VectorAxes(fit.stream, *with_vertical, cause=cause, rows=rows)


def _axes_of_parts(fit: FittedCause) -> Faults:
    """Yield axes under which poses of a part go on across the jumps at its edges."""
    cause: Any = fit.cause
    # What attitudes follow, positions follow as well.
    for transform, rows, begins in sorted(_transforms_of_parts(fit), key=lambda each: each[0].kind == "axes"):
        if transform.kind == "north_east_down" and cause == "frame_convention":
            yield axes.VectorAxes("pose", NED_FROM_ENU, FRD_FROM_FLU, rows=rows)
        elif transform.kind == "axes" and axes_cause(transform.axes) == cause:
            # Out of the part the transform is the inverse of that into it.
            stored = _matrix(transform.axes if begins else tuple(zip(*transform.axes, strict=True)))
            yield axes.VectorAxes("pose", stored, turns_orientations=False, cause=cause, rows=rows)


def _transforms_of_parts(fit: FittedCause) -> Iterator[tuple[PoseTransform, RowRange, bool]]:
    """Yield the transforms under which poses go on across a jump, with the rows of parts that it begins or ends."""
    times_ns = fit.facts.clocks["pose"].times_ns
    for alarm in fit.alarms:
        features = alarm.statistic.features
        parts = [feature for feature in features if isinstance(feature, PartBetweenJumps)]
        for transform in (feature for feature in features if isinstance(feature, PoseTransform)):
            for part in parts:
                yield transform, _rows_between(times_ns, part.start_ns, part.stop_ns), part.begins


def length_units_of_parts(fit: FittedCause) -> Faults:
    """Yield ratios of units of length in which positions of a part are to those on the other side of a jump."""
    for transform, rows, begins in _transforms_of_parts(fit):
        # Out of the part the factor is the reciprocal of that into it.
        if transform.kind == "length_unit" and (
            ratio := ratio_of_units(transform.factor if begins else 1 / transform.factor)
        ):
            yield units.LengthUnit("pose", ratio, rows)


def _rows_between(times_ns: NDArray[np.int64], start_ns: float, stop_ns: float) -> RowRange:
    """Return the rows from one instant to another; to the end where the latter is infinite."""
    first, last = np.searchsorted(times_ns, (start_ns, stop_ns))
    return int(first), None if isinf(stop_ns) else int(last)


def inverted_quaternions(fit: FittedCause) -> Faults:
    """Yield inverses of quaternions, and of poses: in the part of the file that has them first, then in the whole."""
    for transform, rows, _ in _transforms_of_parts(fit):
        if transform.kind == "inverse":
            yield motion.QuaternionInversion(rows)
    yield motion.QuaternionInversion()
    yield motion.PoseInversion()


def _world_of(convention: InertialConvention, body: Matrix3) -> Matrix3:
    """Return axes of the world with the vertical of a convention, of the handedness of the axes of the body.

    Which of its horizontal axes points north has no influence on what the streams measure.
    """
    up = np.array(convention.up) * (-1 if convention.gravity == "reversed" else 1)
    if np.count_nonzero(up) > 1:
        # The shortest rotation that takes the vertical of the format there: of a proper body, as a tilt is no mirror.
        return _shortest_rotation(up)
    right_handed = np.linalg.det(body) > 0
    worlds = (_matrix(candidate) for candidate in signed_permutations())
    possible = [
        world
        for world in worlds
        if np.array_equal(np.array(world)[:, 2], up) and (np.linalg.det(world) > 0) == right_handed
    ]
    # Of four the one nearest to the axes of the format.
    return max(possible, key=lambda world: float(np.trace(world)))


def _shortest_rotation(up: NDArray[np.float64]) -> Matrix3:
    """Return the rotation about a horizontal axis that takes Z to a unit vector."""
    axis = np.cross((0.0, 0.0, 1.0), up)
    angle = np.arctan2(np.linalg.norm(axis), up[2])
    return _matrix(so3.exp(axis / np.linalg.norm(axis) * angle).tolist())


def inertial_conventions(fit: FittedCause) -> Iterator[tuple[InertialConventionTrial, RowRange | None]]:
    """Yield the conventions under which IMU and poses agree, with the rows of the part in which they do."""
    # Specific forces determine the axes of the world as well, and the handedness: the vertical is theirs.
    for alarm in sorted(fit.alarms, key=lambda alarm: alarm.finding.code.startswith("imu.rotation")):
        where = alarm.finding.where
        for feature in alarm.statistic.features:
            if not isinstance(feature, InertialConventionTrial):
                continue
            if feature.interval_s is None or where.start_us is None or where.stop_us is None:
                yield feature, None
                continue
            # Values outside of the place of the finding follow the declared convention.
            ends_ns = [NS_PER_US * (end_us - fit.facts.origin_us) for end_us in (where.start_us, where.stop_us)]
            first, last = np.searchsorted(fit.facts.clocks[fit.stream].times_ns, ends_ns)
            yield feature, (int(first), int(last))


def angle_unit(fit: FittedCause) -> Faults:
    """Yield the unit of angles: in the part of the file that has it first, then in the whole file."""
    for feature, rows in inertial_conventions(fit):
        if rows is not None and feature.convention.rate_unit != 1.0:
            yield units.AngleUnit(feature.convention.rate_unit, rows)
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    for part in dict.fromkeys(feature for feature in features if isinstance(feature, NoiseOfPart)):
        # Noise is measured to a few percent: the factor is that of the unit.
        if abs(part.ratio / fit.size - 1.0) < SAME_FACTOR:
            rows = _rows_between(fit.facts.clocks["imu"].times_ns, part.start_ns, part.stop_ns)
            yield units.AngleUnit(fit.size, rows)
    yield units.AngleUnit(fit.size)


def component_orders(fit: FittedCause) -> Faults:
    """Yield orders under which IMU and poses agree, w put first twice where rates have its axes, and w first.

    That of a part of the file comes first.
    """
    for transform, rows, _ in _transforms_of_parts(fit):
        if transform.kind == "component_order":
            yield motion.QuaternionOrder(rows=rows)
    conventions = [each.convention for each, rows in inertial_conventions(fit) if rows is None]
    orders = [motion.QuaternionOrder(each.component_order, each.quaternions.endswith("inverse"))
              for each in conventions if each.component_order is not None]  # fmt: skip
    if any(each.sensor_axes == HALF_TURN for each in conventions):
        orders.append(motion.QuaternionOrder((2, 3, 0, 1)))
    yield from dict.fromkeys((*orders, motion.QuaternionOrder()))


def _matrix(rows: Sequence[Sequence[float]]) -> Matrix3:
    first, second, third = ((float(x), float(y), float(z)) for x, y, z in rows)
    return first, second, third


def gravity_magnitude(fit: FittedCause) -> Faults:
    """Yield the magnitude of gravity that the specific forces show, or that is declared."""
    if fit.stream == "imu":
        yield gravity.GravityError("gravity_magnitude", fit.size)
    else:
        yield declarations.GravityMisdeclared(fit.size)


def missing_gravity(fit: FittedCause) -> Faults:
    """Yield gravity that was removed: in the part of the file that lacks it first, then in the whole file."""
    for rows in _parts_with(fit, "missing"):
        yield gravity.GravityError("gravity_missing", rows=rows)
    yield gravity.GravityError("gravity_missing")
    yield gravity.GravityAlongBody()
    declared_m_s2 = (fit.facts.declared.imu or ImuModel()).gravity
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    forces = (feature for feature in features if isinstance(feature, ConstantForce) and feature.steadiness < STEADY)
    constants = dict.fromkeys(force.lacking_m_s2 for force in forces)
    biases = _vectors(fit, "translation", "bias")
    for lacking in (*constants, *((-x, -y, -z) for x, y, z in biases)):
        # No sensor has a bias of its weight: that is what was taken off, such as the mean of all samples.
        if abs(hypot(*lacking) / declared_m_s2 - 1.0) < 1.0 / OTHER_WEIGHT:
            yield gravity.GravityAlongBody(lacking)


def reversed_gravity(fit: FittedCause) -> Faults:
    """Yield gravity of the wrong sign: in the part of the file that has it first, then in the whole file."""
    for rows in _parts_with(fit, "reversed"):
        yield gravity.GravityError("gravity_sign", rows=rows)
    yield gravity.GravityError("gravity_sign")
    yield gravity.ForceSign()


def _parts_with(fit: FittedCause, convention: GravityConvention) -> Iterator[RowRange]:
    """Yield the rows of parts of the IMU whose specific forces have another gravity than declared."""
    for feature, rows in inertial_conventions(fit):
        if rows is not None and feature.convention.gravity == convention:
            yield rows


def gyro_bias(fit: FittedCause) -> Faults:
    """Yield biases of the gyro: of a part of the file first, then of the whole."""
    for part, rows in _biases_of_parts(fit, "rotation"):
        yield motion.GyroBias(part, rows)
    if not _drifts(fit, "rotation"):
        yield from map(motion.GyroBias, _vectors(fit, "rotation", "bias"))


def accel_bias(fit: FittedCause) -> Faults:
    """Yield biases of the accelerometer: of a part of the file first, then of the whole."""
    for part, rows in _biases_of_parts(fit, "translation"):
        yield motion.AccelBias(part, rows)
    if not _drifts(fit, "translation"):
        yield from map(motion.AccelBias, _vectors(fit, "translation", "bias"))


def _vectors(fit: FittedCause, kind: MotionKind, group: str) -> Iterator[Vector3]:
    """Yield the fitted values of a group of three parameters: in place of the group that was freed first, then beside.

    Beside a group that explains the same, the values are any.
    """
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    fitted = (feature for feature in features if isinstance(feature, InertialParameter) and feature.kind == kind)
    instead = dict.fromkeys(each.instead[group] for each in fitted if group in each.instead)
    yield from ((x, y, z) for x, y, z in instead)
    if beside := vector(group, fit.results.get(f"imu.{kind}")):
        yield beside


def _drifts(fit: FittedCause, kind: MotionKind) -> bool:
    """Whether a bias drifts, so that none that is constant undoes it."""
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    return any(isinstance(feature, DriftingBias) and feature.kind == kind for feature in features)


def _biases_of_parts(fit: FittedCause, kind: MotionKind) -> Iterator[tuple[Vector3, RowRange]]:
    """Yield the biases of parts of the IMU, with the rows of these parts."""
    times_ns = fit.facts.clocks["imu"].times_ns
    features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
    for part in dict.fromkeys(feature for feature in features if isinstance(feature, BiasOfPart)):
        if part.kind == kind:
            yield part.bias, _rows_between(times_ns, part.start_ns, part.stop_ns)


def displaced_positions(fit: FittedCause) -> Faults:
    """Yield the displacement of positions from a jump to the one that undoes it."""
    times_ns = fit.facts.clocks["pose"].times_ns
    features = [feature for alarm in fit.alarms for feature in alarm.statistic.features]
    if any(isinstance(feature, LoneSamples | NoiseAtTimes) for feature in features):
        return  # of many jumps, the largest two are not those of one displacement
    for displaced in dict.fromkeys(feature for feature in features if isinstance(feature, DisplacedPositions)):
        rows = _rows_between(times_ns, displaced.start_ns, displaced.stop_ns)
        yield motion.Teleport(displaced.displacement_m, rows)


def lever_arm(fit: FittedCause) -> Faults:
    """Yield displacements of the poses in the body, those of a part first.

    That of the IMU from the point of the poses is measured: that of the point of the poses is its opposite.
    """
    if fit.stream == "pose":
        features = (feature for alarm in fit.alarms for feature in alarm.statistic.features)
        for paired in dict.fromkeys(feature for feature in features if isinstance(feature, PairedSteps)):
            rows = _rows_between(fit.facts.clocks["pose"].times_ns, paired.start_ns, paired.stop_ns)
            yield motion.PoseLeverArm(paired.arm_body_m, rows)
        for x_m, y_m, z_m in _vectors(fit, "translation", "lever"):
            yield motion.PoseLeverArm((-x_m, -y_m, -z_m))
