"""Faults of what is declared of sensors, noise and gravity; and canaries, for which no row is altered.

The layout and the attributes are read when a file is opened, before a view of it exists. Canaries of these are
therefore planted in the result of opening, as the problem that opening would report.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar, Final

import numpy as np

from fedora_qa.conventions import NS_PER_S
from fedora_qa.faults.canary_conditions import CanaryConditions, UnplantableError
from fedora_qa.faults.fault import Fault, InapplicableError
from fedora_qa.layout.dataset_binder import LayoutProblem
from fedora_qa.sequence.declared import Camera, DeclarationProblem, Declared, EventModel, ImuModel, PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

_LOG_TO_LINEAR_DN: Final = 100.0
"""Grey value, DN, at which both models give the same threshold: dL = dY / Y."""


@dataclass(frozen=True, slots=True)
class ThresholdMisdeclared:
    """Contrast thresholds are declared too large by a factor each.

    Attributes
    ----------
    on_percent, off_percent
        Excess of the declared over the actual threshold, of brighter and of darker events.
    """

    on_percent: float
    off_percent: float
    cause: ClassVar[str] = "threshold_misdeclared"
    stream: ClassVar[str] = "events"

    @property
    def magnitude(self) -> float:
        """Mean excess of both, percent."""
        return (self.on_percent + self.off_percent) / 2

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare larger thresholds."""
        gains = 1 + self.on_percent / 100, 1 + self.off_percent / 100
        return self._declared(facts, f"thresholds are declared {self.magnitude:.3g}% too large", *gains)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the actual thresholds."""
        gains = 1 / (1 + self.on_percent / 100), 1 / (1 + self.off_percent / 100)
        return self._declared(facts, f"thresholds are declared without {self.magnitude:.3g}%", *gains)

    def _declared(self, facts: Facts, description: str, on: float, off: float) -> Fault:
        model = _event_model(facts.declared)
        changed = replace(model, threshold_on=on * model.threshold_on, threshold_off=off * model.threshold_off)
        return Fault(description, declared=replace(facts.declared, events=changed))


@dataclass(frozen=True, slots=True)
class EventModelMisdeclared:
    """The other sensor model is declared.

    Attributes
    ----------
    threshold_factor
        Declared threshold, in the unit of the declared model, over the actual one, in the unit of the actual model.
    """

    threshold_factor: float = 1.0
    cause: ClassVar[str] = "event_model_misdeclared"
    stream: ClassVar[str] = "events"
    magnitude: ClassVar[None] = None

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the other model."""
        return self._declared(facts, self.threshold_factor)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the actual model."""
        return self._declared(facts, 1 / self.threshold_factor)

    def _declared(self, facts: Facts, factor: float) -> Fault:
        model = _event_model(facts.declared)
        changed = replace(
            model,
            model="linear" if model.model == "log" else "log",
            threshold_on=factor * model.threshold_on,
            threshold_off=factor * model.threshold_off,
        )
        description = f"events are declared of the {changed.model} model"
        return Fault(description, declared=replace(facts.declared, events=changed))


@dataclass(frozen=True, slots=True)
class NoiseMisdeclared:
    """Noise is declared too large.

    Attributes
    ----------
    stream
        ``imu``, ``pose`` or ``events``.
    excess
        Declared less actual value of each wrong noise, a field of ``ImuModel``, ``PoseModel`` or ``EventModel``, in its
        own unit.
    percent
        Excess over the actual noise, where they have one ratio.
    """

    stream: str
    excess: tuple[tuple[str, float], ...]
    percent: float | None = None
    cause: ClassVar[str] = "noise_misdeclared"

    @property
    def magnitude(self) -> float | None:
        """Excess, percent of the actual noise."""
        return self.percent

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the wrong noise."""
        return self._declared(facts, f"noise of {self.stream} is declared too large", 1)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the actual noise."""
        return self._declared(facts, f"noise of {self.stream} is declared as it is", -1)

    def _declared(self, facts: Facts, description: str, sign: int) -> Fault:
        declared, model = facts.declared, _noise_model(facts.declared, self.stream)
        changes = {name: getattr(model, name) + sign * excess for name, excess in self.excess}
        match model:
            case ImuModel():
                return Fault(description, declared=replace(declared, imu=replace(model, **changes)))
            case PoseModel():
                return Fault(description, declared=replace(declared, pose=replace(model, **changes)))
            case EventModel():
                return Fault(description, declared=replace(declared, events=replace(model, **changes)))


@dataclass(frozen=True, slots=True)
class GravityMisdeclared:
    """Gravity is declared too large.

    Attributes
    ----------
    excess_m_s2
        Declared less actual gravity.
    """

    excess_m_s2: float
    cause: ClassVar[str] = "gravity_magnitude"
    stream: ClassVar[str] = "metadata"

    @property
    def magnitude(self) -> float:
        """Excess, m/s^2."""
        return self.excess_m_s2

    def plant(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare a larger gravity."""
        return self._declared(facts, f"gravity is declared {self.excess_m_s2:.3g} m/s^2 too large", self.excess_m_s2)

    def undo(self, facts: Facts, sequence: SequenceRows) -> Fault:
        """Declare the actual gravity."""
        return self._declared(facts, f"gravity is declared without {self.excess_m_s2:.3g} m/s^2", -self.excess_m_s2)

    def _declared(self, facts: Facts, description: str, more_m_s2: float) -> Fault:
        model = facts.declared.imu
        if model is None:
            raise InapplicableError("Expected a declared IMU, got none")
        changed = replace(model, gravity=model.gravity + more_m_s2)
        return Fault(description, declared=replace(facts.declared, imu=changed))


def _event_model(declared: Declared) -> EventModel:
    if declared.events is None:
        raise InapplicableError("Expected a declared event sensor, got none")
    return declared.events


def _noise_model(declared: Declared, stream: str) -> ImuModel | PoseModel | EventModel:
    """Return the declaration of a stream; without one an IMU and poses are free of noise."""
    match stream:
        case "imu":
            return declared.imu or ImuModel()
        case "pose":
            return declared.pose or PoseModel()
        case _:
            return _event_model(declared)


def absent_stream(conditions: CanaryConditions) -> Fault:
    """The stream imu is declared and absent."""
    layout = conditions.facts.layout
    description = "the imu is declared and absent"
    problem = LayoutProblem("integrity.layout.missing", "missing_stream", "imu", "path/imu/ts", description)
    return Fault(description, layout=replace(layout, problems=(*layout.problems, problem)))


def missing_attribute(conditions: CanaryConditions) -> Fault:
    """The attribute that states the version of the format is missing."""
    description = "the attribute format_version is missing"
    problem = DeclarationProblem("", "format_version", description, "missing_stream")
    declared = conditions.facts.declared
    return Fault(description, declared=replace(declared, problems=(*declared.problems, problem)))


def wrong_label(conditions: CanaryConditions) -> Fault:
    """A dataset has a label with a unit that no layout uses."""
    declared, keys = conditions.facts.declared, sorted(conditions.facts.layout.bindings)
    if not keys:
        raise UnplantableError("no dataset carries a label")
    return Fault(
        f"{keys[0]} is labelled in furlongs", declared=replace(declared, units={**declared.units, keys[0]: "furlong"})
    )


def stretched_mounting(conditions: CanaryConditions) -> Fault:
    """The first column of the rotation of a camera is 10% too long."""
    name = min(conditions.facts.declared.cameras)
    camera = conditions.facts.declared.cameras[name]
    # (R^T R)_00 - 1 = 1.1^2 - 1 = 0.21, far above rounding.
    stretched = camera.T_body_camera @ np.diag([1.1, 1.0, 1.0, 1.0])
    return _with_cameras(conditions, f"T_body_camera of the {name} camera is stretched by 10%",
                         {name: replace(camera, T_body_camera=stretched)})  # fmt: skip


def wider_camera(conditions: CanaryConditions) -> Fault:
    """A camera is declared one column wider than it is."""
    cameras = conditions.facts.declared.cameras
    if not cameras:
        raise UnplantableError("the file declares no camera")
    name = min(cameras)
    wider = replace(cameras[name], width=cameras[name].width + 1)
    return _with_cameras(conditions, f"the {name} camera is declared a column too wide", {name: wider})


def other_event_model(conditions: CanaryConditions) -> Fault:
    """Events are declared of the other model. The thresholds are the same contrast at a grey value of 100 DN."""
    model = conditions.facts.declared.events
    if model is None:
        raise UnplantableError("the file declares no event model")
    # dY = Y dL: a threshold of C nat is 100 C DN at Y = 100 DN.
    factor = _LOG_TO_LINEAR_DN if model.model == "log" else 1 / _LOG_TO_LINEAR_DN
    return conditions.planted(EventModelMisdeclared(factor))


def smaller_thresholds(conditions: CanaryConditions) -> Fault:
    """Both thresholds are declared too small, so that the measured ones exceed them by the size of the canary."""
    model = conditions.facts.declared.events
    if model is None:
        raise UnplantableError("the file declares no event model")
    percent = conditions.size("threshold_on", at_least=20.0)
    # The check measures 100 (measured / declared - 1) percent: declared = measured / (1 + percent / 100).
    excess_percent = 100 * (1 / (1 + percent / 100) - 1)
    smaller = conditions.planted(ThresholdMisdeclared(excess_percent, excess_percent))
    return replace(smaller, description=f"events step by {percent:.3g}% more than declared")


def other_pose_noise(conditions: CanaryConditions) -> Fault:
    """Positions are noisier than declared. Where no noise is declared, a noise is declared that they do not have."""
    model = conditions.facts.declared.pose or PoseModel()
    sigma_m = _other_noise(conditions, model.position_sigma_m, "position_noise")
    excess_m = ("position_sigma_m", sigma_m - model.position_sigma_m)
    other = conditions.planted(NoiseMisdeclared("pose", (excess_m,)))
    return replace(other, description=f"a noise of {sigma_m:.3g} m is declared of positions")


def other_imu_noise(conditions: CanaryConditions) -> Fault:
    """Angular velocities are noisier than declared.

    Where no noise is declared, a noise is declared that they do not have.
    """
    model, period_s = conditions.facts.declared.imu or ImuModel(), conditions.period_ns("imu") / NS_PER_S
    if period_s <= 0:
        raise UnplantableError("the timestamps of the imu do not advance")
    # sigma of a sample (rad/s) = density (rad/s/sqrt(Hz)) * sqrt(rate)
    root_hz = period_s**-0.5
    density = _other_noise(conditions, root_hz * model.gyro_noise_density, "gyro_noise") / root_hz
    excess = ("gyro_noise_density", density - model.gyro_noise_density)
    other = conditions.planted(NoiseMisdeclared("imu", (excess,)))
    return replace(other, description=f"a noise density of {density:.3g} rad/s/sqrt(Hz) is declared of the gyro")


def _other_noise(conditions: CanaryConditions, declared_sigma: float, name: str) -> float:
    """Return the standard deviation to declare, in the unit of ``declared_sigma``.

    Measured over declared noise then exceeds 1 by the size of the canary. Where no noise is declared (0), the result is
    the size of the canary itself.
    """
    # Without declared noise there is no ratio: the detection limit is a standard deviation.
    return declared_sigma / (1 + conditions.size(f"{name}_ratio")) if declared_sigma else conditions.size(name)


def _with_cameras(conditions: CanaryConditions, description: str, changed: Mapping[str, Camera]) -> Fault:
    declared = conditions.facts.declared
    return Fault(description, declared=replace(declared, cameras={**declared.cameras, **changed}))
