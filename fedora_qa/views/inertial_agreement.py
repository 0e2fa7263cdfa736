"""What the checks of IMU against pose share: both streams, the fit, the search for gross causes, suspects."""

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Final, Literal

import numpy as np

from fedora_qa.checks.protocol import Statistic, Suspect
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.fitting.grouped_fit import group_of
from fedora_qa.estimators.imu.conventions import Hypothesis, explain_forces, explain_rates
from fedora_qa.estimators.imu.samples import InertialNoise, InertialSamples
from fedora_qa.estimators.imu.sequence_fit import ROTATION, TRANSLATION, fit_inertial
from fedora_qa.estimators.imu.summary import InertialFit
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.declared import ImuModel, PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import ImuSamples, PoseSamples, Window
from fedora_qa.views.motion_samples import (
    inertial_noise,
    inertial_samples,
    join_imu,
    join_poses,
    measured_pose_sigmas,
    owned_imu,
    owned_poses,
    place,
    why_unusable,
)
from fedora_qa.views.pose_conventions import axes_cause

Kind = Literal["rotation", "translation"]

_FEWEST_POSES: Final = 16
_FAR_OFF: Final = 6.0
_CERTAIN: Final = 8.0
"""Standard errors that are beyond the limit of any file, however many comparisons it has."""
_EDGE_STEPS: Final = 1.5
"""Steps of the poses at either end of a local disturbance that may hold samples of both kinds."""
_LARGE: Final = {
    "time_offset": 0.1,
    "clock_rate": 0.02,
    "pose_clock_rate": 0.02,
    "tilt": 0.1,
    "scale": 0.1,
    "bias": 1.0,
    "gravity": 1.0,
    "slope": 1.0,
    "lever": 1.0,
}
"""Beyond these a parameter is no small fault any more: its cause is looked for among gross ones."""

_ABSURD: Final = 5.0
"""Multiples of these that no sensor shows: half a radian of turn, half of a gain, half a second."""


class Concluded:
    """What was computed of all windows up to one, kept for the other checks that conclude from the same samples.

    It goes with the window's samples, and not from one process to another.
    """

    def __init__(self) -> None:
        self.streams: Streams | None = None
        self.of: Facts | None = None

    def __reduce__(self) -> tuple[type["Concluded"], tuple[()]]:
        return Concluded, ()


@dataclass(frozen=True, slots=True)
class Motion:
    """The samples of one window."""

    imu: ImuSamples | None
    poses: PoseSamples | None
    concluded: Concluded = field(default_factory=Concluded, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Streams:
    """Both streams of a sequence on one axis of time, which starts at ``origin_ns``, and what was found of them."""

    samples: InertialSamples
    noise: InertialNoise
    poses: PoseSamples
    imu: ImuSamples
    origin_ns: int
    fits: dict[Kind, InertialFit | None] = field(default_factory=dict, compare=False, repr=False)
    causes: dict[Kind, "Gross | None"] = field(default_factory=dict, compare=False, repr=False)

    def time_ns(self, time_s: float) -> int:
        """Return an instant as nanoseconds from the file's origin."""
        return self.origin_ns + round(time_s * NS_PER_S)


def motion_of(window: Window) -> Motion | None:
    """Keep the window's own samples of both streams."""
    return window.once("motion", lambda: _motion_of(window))


def _motion_of(window: Window) -> Motion | None:
    imu, poses = owned_imu(window), owned_poses(window)
    return None if imu is None and poses is None else Motion(imu, poses)


def streams_of(state: Sequence[Motion], facts: Facts) -> Streams | str:
    """Join all windows; a sentence where the two streams cannot be compared."""
    unusable = why_unusable(facts, "imu", "pose")
    if unusable:
        return unusable
    imu = join_imu([motion.imu for motion in state if motion.imu is not None])
    poses = join_poses([motion.poses for motion in state if motion.poses is not None])
    if len(poses.times_ns) < _FEWEST_POSES or len(imu.times_ns) < _FEWEST_POSES:
        return f"fewer than {_FEWEST_POSES} finite samples of pose or IMU"
    if poses.times_ns[0] >= imu.times_ns[-1] or imu.times_ns[0] >= poses.times_ns[-1]:
        return "IMU and pose do not overlap in time"
    concluded = state[-1].concluded
    known = concluded.streams if concluded.of is facts else None
    if known is None or not (_are_equal(known.poses, poses) and _are_equal(known.imu, imu)):
        known = _streams(imu, poses, facts)
        concluded.streams, concluded.of = known, facts
    return known


def _are_equal(one: ImuSamples | PoseSamples, other: ImuSamples | PoseSamples) -> bool:
    return all(np.array_equal(getattr(one, each.name), getattr(other, each.name)) for each in fields(one))


def _streams(imu: ImuSamples, poses: PoseSamples, facts: Facts) -> Streams:
    model = facts.declared.imu or ImuModel()
    return Streams(
        samples=inertial_samples(imu, poses, model),
        noise=inertial_noise(model, facts.declared.pose or PoseModel(), imu, poses),
        poses=poses,
        imu=imu,
        origin_ns=int(imu.times_ns[0]),
    )


def coverage_of(streams: Streams | str, facts: Facts) -> Coverage:
    """Return how many poses were compared."""
    seen = 0 if isinstance(streams, str) else len(streams.poses.times_ns)
    return Coverage(seen, len(facts.clocks["pose"].times_ns), "poses")


def fit(streams: Streams, kind: Kind) -> InertialFit | None:
    """Fit one kind of comparison, once; None where there is too little in common."""
    if kind not in streams.fits:
        streams.fits[kind] = _fit(streams, kind)
    return streams.fits[kind]


def _fit(streams: Streams, kind: Kind) -> InertialFit | None:
    comparison = ROTATION if kind == "rotation" else TRANSLATION
    walk = streams.noise.gyro_walk if kind == "rotation" else streams.noise.accel_walk
    return fit_inertial(streams.samples, streams.noise, comparison, bias_walk=walk)


@dataclass(frozen=True, slots=True)
class Gross:
    """An odd reading under which the streams agree, and from when to when it holds, s; None: throughout."""

    hypothesis: Hypothesis
    span_s: tuple[float, float] | None = None

    @property
    def is_certain(self) -> bool:
        """Whether the streams disagree so much that nothing else need be measured of them."""
        value, error = self.hypothesis.disagreement
        return value - 1.0 > _CERTAIN * error


def gross_cause(streams: Streams, kind: Kind, found: InertialFit) -> Gross | None:
    """Return the odd reading under which the streams agree, where they disagree by more than a small fault.

    First of the whole sequence; where none explains that, and the disagreement is a local one, of that part alone.
    It is looked for once.
    """
    if kind not in streams.causes:
        streams.causes[kind] = _gross_cause(streams, kind, found)
    return streams.causes[kind]


def _gross_cause(streams: Streams, kind: Kind, found: InertialFit) -> Gross | None:
    if (
        found.settled
        and not _exceeds(found, 1.0)
        and found.rms - found.model_rms - found.expected_rms < _FAR_OFF * found.rms_error
    ):
        return None
    for span_s in (None, found.disturbed) if found.disturbed else (None,):
        hypothesis = _explained(streams, kind, span_s)
        if hypothesis is not None and hypothesis.oddness > 0:
            return Gross(hypothesis, span_s)
    return None


def is_absurd(found: InertialFit) -> bool:
    """Whether a freed parameter is so large that the fit bends one motion into another."""
    return _exceeds(found, _ABSURD)


def _exceeds(found: InertialFit, multiple: float) -> bool:
    large = {name: multiple * _LARGE[group_of(name)] for name in found.parameters}
    return any(one.free and abs(one.value) > large[name] for name, one in found.parameters.items())


def _explained(streams: Streams, kind: Kind, span_s: tuple[float, float] | None) -> Hypothesis | None:
    samples = streams.samples
    if span_s is not None:
        step_s = _EDGE_STEPS * float(np.median(np.diff(samples.pose_times_s)))
        samples = samples.between(span_s[0] + step_s, span_s[1] - step_s)
    if len(samples.pose_times_s) < _FEWEST_POSES or len(samples.imu_times_s) < _FEWEST_POSES:
        return None
    position_m, rotation_rad = measured_pose_sigmas(streams.poses)
    if kind == "rotation":
        return explain_rates(samples, rotation_rad)
    return explain_forces(samples, streams.noise.gravity_m_s2, position_m)


def disagreement(facts: Facts, streams: Streams, kind: Kind, gross: Gross) -> Statistic:
    """State how far the streams disagree as declared, and which reading reconciles them."""
    hypothesis, where, when = gross.hypothesis, Where(stream="imu"), ""
    value, error = hypothesis.disagreement
    if gross.span_s is not None:
        where = place(facts, "imu", *(streams.time_ns(time_s) for time_s in gross.span_s))
        when = f" from {where.start_us:.0f} to {where.stop_us:.0f} us"
    return Statistic(
        name="disagreement",
        value=value,
        unit="1",
        standard_error=error,
        expected=1.0,
        side="upper",
        statement=f"Pose and IMU disagree in {kind}{when} {value:.3g} times as much as "
        f"noise allows; they agree if {_in_words(hypothesis)}.",
        code=f"imu.{kind}.disagreement",
        where=where,
        severity="critical",
        suspects=gross_suspects(kind, hypothesis),
    )


def gross_suspects(kind: Kind, hypothesis: Hypothesis) -> tuple[Suspect, ...]:
    """Return the causes of an odd reading."""
    weight = 0.95 * hypothesis.explained
    causes: list[Suspect] = []
    if "wxyz" in hypothesis.reading:
        causes.append(Suspect("quaternion_order", "pose", weight))
    if "inverse" in hypothesis.reading:
        causes.append(Suspect("quaternion_inverted", "pose", weight))
    if hypothesis.rate_unit != 1.0:
        causes.append(Suspect("unit_deg_rad", "imu", weight, hypothesis.rate_unit, "1"))
    if hypothesis.length_unit != 1.0:
        causes.append(Suspect("unit_mm_m", "pose", weight, hypothesis.length_unit, "1"))
    if hypothesis.world_axes != Hypothesis().world_axes:
        causes.append(Suspect(axes_cause(hypothesis.world_axes), "pose", weight))
    if hypothesis.sensor_axes != Hypothesis().sensor_axes:
        causes.extend(_sensor_suspects(kind, hypothesis, weight))
    elif hypothesis.gravity != "declared":
        cause = "gravity_missing" if hypothesis.gravity == "missing" else "gravity_sign"
        causes.append(Suspect(cause, "imu", weight))
    return tuple(causes)


def _sensor_suspects(kind: Kind, hypothesis: Hypothesis, weight: float) -> tuple[Suspect, ...]:
    """Blame turned axes on the sensor, or on the pose: that turns gravity over in the world as well."""
    cause = axes_cause(hypothesis.sensor_axes)
    of_imu, of_pose = Suspect(cause, "imu", weight), Suspect("frame_convention", "pose", weight)
    if kind == "rotation":
        return (of_imu, of_pose) if cause == "frame_convention" else (of_imu,)
    return (of_pose,) if hypothesis.gravity == "reversed" else (of_imu,)


def _in_words(hypothesis: Hypothesis) -> str:
    said = []
    if hypothesis.reading != "xyzw":
        said.append(f"quaternions are read as {hypothesis.reading}")
    if hypothesis.sensor_axes != Hypothesis().sensor_axes:
        said.append(f"the sensor's axes are {_axes_in_words(hypothesis.sensor_axes)} of the body")
    if hypothesis.world_axes != Hypothesis().world_axes:
        said.append(f"positions are {_axes_in_words(hypothesis.world_axes)} of the world")
    if hypothesis.rate_unit != 1.0:
        said.append(f"angular velocity is divided by {hypothesis.rate_unit:.4g}")
    if hypothesis.length_unit != 1.0:
        said.append(f"positions are divided by {hypothesis.length_unit:g}")
    if hypothesis.gravity != "declared":
        said.append(f"gravity is {hypothesis.gravity} in the specific force")
    return " and ".join(said)


def _axes_in_words(axes: tuple[tuple[int, ...], ...]) -> str:
    def named(row: tuple[int, ...]) -> str:
        column = int(np.argmax(np.abs(row)))
        return ("-" if row[column] < 0 else "") + "xyz"[column]

    return "(" + ", ".join(named(row) for row in axes) + ")"
