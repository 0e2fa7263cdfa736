"""Conventions of IMU and poses that are proposed: units, axes, orders of components and senses of angles."""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from fedora_qa.catalogue import hypotheses_of
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.diagnosis.proposed_faults import faults_for
from fedora_qa.estimators.imu.conventions import InertialConvention
from fedora_qa.faults.axes import VectorAxes
from fedora_qa.faults.fault import is_of_part
from fedora_qa.faults.motion import AngleSense, QuaternionOrder
from fedora_qa.faults.units import AngleUnit
from fedora_qa.record.types import Where
from fedora_qa.views.inertial_agreement import InertialConventionTrial
from tests.support.memory_sequence import facts_of, memory_sequence
from tests.support.proposed_faults import alarm


def test_components_that_were_put_first_twice_turn_body_and_world() -> None:
    """Quaternions z, w, x, y are those of a body that is turned about Z, and of a world that is turned about X."""
    facts, order = facts_of(memory_sequence()), QuaternionOrder((2, 3, 0, 1))
    q = np.random.default_rng(0).normal(size=(20, 4))
    i, k = Rotation.from_quat([1.0, 0.0, 0.0, 0.0]), Rotation.from_quat([0.0, 0.0, 1.0, 0.0])
    expected = i * Rotation.from_quat(q) * k.inv()
    assert np.allclose((Rotation.from_quat(q[:, list(order.order)]) * expected.inv()).magnitude(), 0.0, atol=1e-7)
    axes = ((-1, 0, 0), (0, -1, 0), (0, 0, 1))
    convention = InertialConvention(sensor_axes=axes, residual=1.0, declared_residual=9.0, count=9)
    failure = alarm("imu.rotation.disagreement", InertialConventionTrial(convention))
    assert ("quaternion_order", "pose") in [(h.cause, h.stream) for h in hypotheses_of(failure, facts)]
    assert list(faults_for("quaternion_order", "pose", None, (failure,), {}, facts)) == [order, QuaternionOrder()]
    assert list(faults_for("quaternion_order", "pose", None, (), {}, facts)) == [QuaternionOrder()]


def test_a_convention_of_a_part_is_undone_in_its_place() -> None:
    """Rates in deg/s and exchanged axes from 50 to 150 ms of a file whose clock begins at 7 s."""
    facts = replace(facts_of(memory_sequence()), origin_us=7_000_000.0)
    exchanged = ((0, 1, 0), (1, 0, 0), (0, 0, 1))
    convention = InertialConvention(sensor_axes=exchanged, rate_unit=57.3)
    disagreement = alarm("imu.rotation.disagreement", InertialConventionTrial(convention, (0.05, 0.15)))
    place = Where("imu", 7_050_000.0, 7_150_000.0)
    of_part = replace(disagreement, finding=replace(disagreement.finding, where=place))
    rows = tuple(np.searchsorted(facts.clocks["imu"].times_ns, [50 * NS_PER_MS, 150 * NS_PER_MS]).tolist())
    local, whole = faults_for("unit_deg_rad", "imu", 57.3, (of_part,), {}, facts)
    assert (local, whole) == (AngleUnit(57.3, rows), AngleUnit(57.3))
    turned, of_gyro = faults_for("axes_swapped", "imu", None, (of_part,), {}, facts)
    assert isinstance(turned, VectorAxes)
    assert of_gyro == replace(turned, sensors=("gyro",))
    assert turned.rows == rows
    assert [is_of_part(fault) for fault in (local, whole, turned)] == [True, False, True]


def test_poses_of_another_engine_are_undone_with_the_axes_of_world_and_body() -> None:
    """Specific forces state the vertical and the handedness, of which rates state neither."""
    up_y = InertialConvention(sensor_axes=((0, 0, 1), (-1, 0, 0), (0, 1, 0)), up=(0, 1, 0))
    turned = InertialConvention(sensor_axes=((0, 0, -1), (1, 0, 0), (0, -1, 0)))
    alarms = (
        alarm("imu.rotation.disagreement", InertialConventionTrial(turned)),
        alarm("imu.translation.disagreement", InertialConventionTrial(up_y, kind="translation")),
    )
    (fault,) = faults_for("frame_convention", "pose", None, alarms, {}, facts_of(memory_sequence()))
    assert isinstance(fault, VectorAxes)
    world, body = np.array(fault.axes), np.array(fault.body_axes)
    assert np.linalg.det(world) == np.linalg.det(body) == -1
    np.testing.assert_array_equal(world[:, 2], [0, 1, 0])
    np.testing.assert_array_equal(body, np.transpose(up_y.sensor_axes))


def test_a_heading_from_north_is_undone_with_the_turn_of_the_world() -> None:
    quarter = ((0, -1, 0), (1, 0, 0), (0, 0, 1))
    compass = InertialConvention(world_axes=quarter, angle_signs=(-1, 1, 1))
    compared = alarm("imu.translation.disagreement", InertialConventionTrial(compass, kind="translation"))
    facts = facts_of(memory_sequence())
    assert list(faults_for("frame_convention", "pose", None, (compared,), {}, facts)) == [
        AngleSense((-1, 1, 1), quarter)
    ]
