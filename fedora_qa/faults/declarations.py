"""Faults of what is declared of the event sensor, and of noise and gravity."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import nan
from typing import ClassVar, Final

from fedora_qa.faults.fault import Fault
from fedora_qa.faults.reversible import InapplicableError
from fedora_qa.sequence.declared import Declared, EventModel, ImuModel, PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.sequence import SequenceRows

NOISES: Final[Mapping[str, tuple[str, ...]]] = {
    "imu": ("gyro_noise_density", "accel_noise_density", "gyro_bias_walk", "accel_bias_walk"),
    "pose": ("position_sigma_m", "rotation_sigma_rad"),
    "events": ("threshold_sigma", "leak_rate_hz", "shot_rate_hz", "hot_pixel_rate_hz"),
}
"""Declared noises, by stream: fields of ``ImuModel``, ``PoseModel`` and ``EventModel``."""


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
        Declared less actual value of each wrong noise, a field of ``NOISES``, in its own unit.
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

    @classmethod
    def by_percent(cls, facts: Facts, stream: str, percent: float) -> "NoiseMisdeclared":
        """Return the fault that makes every noise that a correct file declares too large by a ratio."""
        model = _noise_model(facts.declared, stream)
        declared = ((name, getattr(model, name)) for name in NOISES[stream])
        return cls(stream, tuple((name, percent / 100 * value) for name, value in declared if value), percent)

    @classmethod
    def from_actual(cls, facts: Facts, stream: str, actual: Mapping[str, float]) -> "NoiseMisdeclared":
        """Return the fault of a file whose actual noise, by field, was measured."""
        model = _noise_model(facts.declared, stream)
        excess = {name: getattr(model, name) - value for name, value in actual.items()}
        largest = max(actual, key=lambda name: abs(excess[name]))
        percent = 100 * excess[largest] / actual[largest] if actual[largest] else nan
        return cls(stream, tuple(excess.items()), percent)

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
