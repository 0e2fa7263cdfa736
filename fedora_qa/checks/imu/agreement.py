"""The IMU compared with the poses: statistics of residuals and of fitted parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from fedora_qa.checks.protocol import Observation, Statistic
from fedora_qa.conventions import NS_PER_S, US_PER_S
from fedora_qa.estimators.fitting.grouped_fit import ParameterEstimate, group_of
from fedora_qa.estimators.fitting.robust import SensitivityRange, sensitivity_range
from fedora_qa.estimators.imu.conventions import Axes, InertialConvention
from fedora_qa.estimators.imu.summary import InertialFit
from fedora_qa.features import Feature
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import ImuModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.inertial_agreement import (
    BiasOfPart,
    ConstantForce,
    DriftingBias,
    GainOfPart,
    InertialConventionTrial,
    InertialStreams,
    MotionKind,
    WindowMotion,
    convention_trial,
    coverage_of,
    fit_of,
    is_implausible,
    streams_of,
)
from fedora_qa.views.motion_samples import imu_roundings, location_of, pose_model
from fedora_qa.views.sample_defect_detection import (
    clipped_samples,
    frozen_poses,
    held_components,
    held_imu,
    pose_defects,
    steadiness_of,
    timestamp_defects,
    weightless,
)

_DEGREES: Final = float(np.degrees(1.0))


@dataclass(frozen=True, slots=True)
class ParameterText:
    """Text and units of a parameter's statement.

    Attributes
    ----------
    sentence
        With the fields ``{size}``, ``{axis}`` and ``{sense}``.
    senses
        Words for a positive and for a negative value.
    unit, factor
        Stated unit, and its multiple of the fit's unit.
    """

    sentence: str
    senses: tuple[str, str]
    unit: str
    factor: float


_SIGNS: Final = ("", "-")

ROTATION_TEXTS: Final[Mapping[str, ParameterText]] = {
    "bias": ParameterText("The gyro has a bias of {sense}{size} rad/s about {axis}", _SIGNS, "rad/s", 1.0),
    "tilt": ParameterText("The gyro is rotated by {sense}{size} deg about {axis} against the body of the poses",
                          _SIGNS, "deg", _DEGREES),
    "scale": ParameterText("The gain of the gyro is {size} percent too {sense}", ("large", "small"), "percent", 100.0),
}  # fmt: skip

TRANSLATION_TEXTS: Final[Mapping[str, ParameterText]] = {
    "gravity": ParameterText("Gravity is {size} m/s^2 {sense} than declared", ("larger", "smaller"), "m/s^2", 1.0),
    "bias": ParameterText("The accelerometer has a bias of {sense}{size} m/s^2 along {axis}", _SIGNS, "m/s^2", 1.0),
    "slope": ParameterText("Gravity has {sense}{size} m/s^2 along the world's {axis}", _SIGNS, "m/s^2", 1.0),
    "lever": ParameterText("The IMU is {sense}{size} m along {axis} from the poses' origin", _SIGNS, "m", 1.0),
}  # fmt: skip

TIMING_TEXTS: Final[Mapping[str, ParameterText]] = {
    "time_offset": ParameterText(
        "The IMU's timestamps are {size} ms {sense} against the poses'", ("late", "early"), "ms", 1e3
    ),
    "clock_rate": ParameterText("The IMU's clock is {size} ppm {sense}", ("fast", "slow"), "ppm", 1e6),
    "pose_clock_rate": ParameterText("The poses' clock is {size} ppm {sense}", ("fast", "slow"), "ppm", 1e6),
}


_OF_REAL_SENSORS: Final = frozenset({"bias", "scale", "gravity"})
"""Groups of parameters that describe a real sensor; an excess of gravity is a gain of the accelerometer as well."""

_SENSOR_OF: Final[Mapping[MotionKind, str]] = {"rotation": "gyro", "translation": "accelerometer"}


@dataclass(frozen=True, slots=True)
class InertialParameter(Feature):
    """A parameter of the fit of IMU against pose, of the whole sequence or of a part.

    Attributes
    ----------
    kind
        Kind of the comparison.
    name
        Name of the parameter, with its axis.
    value, standard_error
        In the unit of the fit.
    component_ratio
        Absolute value over that of the largest component of its group's vector.
    explained
        Share of the explainable deviation that each group explains, as in ``ParameterEstimate``.
    instead
        Values of other groups in place of this one, as in ``ParameterEstimate``.
    """

    kind: MotionKind
    name: str
    value: float
    standard_error: float
    component_ratio: float
    explained: Mapping[str, float]
    instead: Mapping[str, tuple[float, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ResidualSmoothness(Feature):
    """Smoothness of the residuals.

    Attributes
    ----------
    correlation
        Correlation of neighbouring residuals, 0 at least: 0 for noise, near 1 for another motion.
    """

    correlation: float


@dataclass(frozen=True, slots=True)
class RepeatsNearby(Feature):
    """Samples near the worst residual equal the one before.

    Attributes
    ----------
    stream
        ``imu`` or ``pose``.
    count
        Number of such samples in the whole stream.
    """

    stream: str
    count: int


@dataclass(frozen=True, slots=True)
class UnsettledFit(Feature):
    """The fit did not converge, or gives implausible parameters: the two motions differ in another way."""


def agreement_observation(
    state: Sequence[WindowMotion],
    facts: Facts,
    kind: MotionKind,
    texts: Mapping[str, ParameterText],
    unit: str,
    factor: float,
) -> Observation:
    """Return the statistics of the comparison of IMU and poses in rotation or translation.

    Parameters
    ----------
    state
        Samples of all windows, in the order of time.
    kind
        ``rotation`` or ``translation``.
    texts
        Texts of the stated parameters, by group.
    unit, factor
        Unit of residuals, and its multiple of the fit's unit.

    Returns
    -------
    Observation
        The rms residual, the worst residual, the parameters and their local deviations; only the disagreement where the
        streams agree under another convention with certainty.
    """
    streams = streams_of(state, facts)
    coverage = coverage_of(streams, facts)
    if isinstance(streams, str):
        return Observation(coverage, unobservable=streams)
    fit = fit_of(streams, kind)
    if fit is None:
        return Observation(coverage, unobservable="too few poses with IMU samples throughout the time between them")
    trial = convention_trial(streams, kind, fit)
    # Under a wrong convention the fitted parameters do not measure small faults.
    if trial is not None and trial.is_certain:
        forces = streams.imu.specific_forces_body_m_s2
        constants = _lacking_constants(fit, trial, steadiness_of(forces))
        return Observation(coverage, (_disagreement(facts, streams, kind, trial, constants),))
    samples = streams.imu.angular_velocities_body_rad_s if kind == "rotation" else streams.imu.specific_forces_body_m_s2
    rounding = imu_roundings(streams.imu)[0 if kind == "rotation" else 1]
    defects: tuple[Feature, ...] = (
        *((trial,) if trial else ()),
        *timestamp_defects(facts, "imu"),
        *held_imu(streams.imu, streams.frozen_imu),
        *held_components(samples, rounding),
        *clipped_samples(samples),
        *weightless(streams.imu.specific_forces_body_m_s2, (facts.declared.imu or ImuModel()).gravity),
        *pose_defects(facts, streams.poses, pose_model(facts, streams.poses)),
    )
    if part := fit.partial_bias:
        start_ns, stop_ns = (streams.origin_ns + NS_PER_S * end_s for end_s in (part.start_s, part.stop_s))
        defects = (*defects, BiasOfPart(kind, part.bias, start_ns, stop_ns, part.explained))
    elif fit.partial_gain is not None:
        defects = (*defects, GainOfPart(fit.partial_gain.gain, fit.partial_gain.explained))
    elif drift := fit.bias_drift:
        x, y, z = max(drift.first, drift.last, key=lambda bias: sum(value**2 for value in bias))
        defects = (*defects, DriftingBias(kind, (x, y, z), drift.explained))
    smoothness = ResidualSmoothness(max(fit.smoothness, 0.0))

    rms, expected = factor * fit.rms, factor * fit.expected_rms
    residual = Statistic(
        name=f"{kind}_residual",
        value=rms,
        unit=unit,
        standard_error=factor * fit.rms_error,
        expected=expected,
        model_error_bound=factor * fit.model_rms,
        side="upper",
        statement=f"Between neighbouring poses IMU and pose differ in {kind} by {rms:.4g} {unit} rms; "
        f"{expected:.4g} is expected from noise.",
        code=f"imu.{kind}.residual",
        where=Where(stream="imu"),
        features=(*defects, smoothness),
    )

    worst_ns = streams.time_ns(fit.worst.time_s)
    # Streams of which samples within two steps of the poses repeat the one before.
    imu, poses = streams.imu, streams.poses
    reach_ns = 2 * int(np.median(np.diff(poses.times_ns)))
    frozen = (("imu", imu.times_ns, streams.frozen_imu), ("pose", poses.times_ns, frozen_poses(poses)))
    repeats = tuple(
        RepeatsNearby(stream, len(rows))
        for stream, times_ns, rows in frozen
        if len(rows) and int(np.min(np.abs(times_ns[rows] - worst_ns))) <= reach_ns
    )
    worst = Statistic(
        name=f"worst_{kind}",
        value=factor * fit.worst.value,
        unit=unit,
        standard_error=factor * fit.worst.sigma,
        model_error_bound=factor * fit.worst.model_error,
        tests=3 * fit.rows,  # three axes a row
        sensitivity=_in_units(factor, fit.worst.sensitivity),
        statement=f"At {facts.to_file_us(worst_ns):.0f} us IMU and pose differ in {kind} by "
        f"{factor * fit.worst.value:.4g} {unit}; noise is {factor * fit.worst.sigma:.2g}.",
        code=f"imu.{kind}.worst",
        where=location_of(facts, "pose", worst_ns),
        features=(*defects, smoothness, *repeats),
    )

    unsettled = () if fit.settled and not is_implausible(fit) else (UnsettledFit(),)
    check = f"imu.{kind}"
    judged, properties = dict(texts), dict[str, ParameterText]()
    if not facts.declared.has_vertical:
        judged.pop("slope", None)  # the world was rotated to have none
    if facts.declared.kind == "recorded" and facts.declared.imu is None:
        # Real sensors have biases and gains; without a declaration they are not judged.
        properties = {group: judged.pop(group) for group in _OF_REAL_SENSORS & judged.keys()}
    parameters = parameter_statistics(kind, check, fit.parameters, judged, (*defects, *unsettled))
    inferred: dict[str, str | float] = {
        f"imu.{_SENSOR_OF[kind]}_{statistic.name}_{statistic.unit.replace('/', '_').replace('^', '')}": statistic.value
        for statistic in parameter_statistics(kind, check, fit.parameters, properties)
    }
    local = (
        local_statistics(facts, streams, kind, check, fit, "bias", texts["bias"], defects) if "bias" in judged else ()
    )
    seconds = facts.origin_us / US_PER_S + streams.origin_ns / NS_PER_S  # of the streams' origin on the file's clock
    return Observation(
        coverage,
        (residual, worst, *parameters, *local),
        # Columns: time in s on the file's clock, and the length of the residual in the unit stated.
        evidence={"residual": fit.course * [1.0, factor] + [seconds, 0.0]},
        titles={"residual": f"Residuals of IMU and pose in {kind}, as declared; x time [s]; y length [{unit}]"},
        inferred=inferred,
    )


def _lacking_constants(
    fit: InertialFit, trial: InertialConventionTrial, steadiness: float
) -> tuple[ConstantForce, ...]:
    """Return the constant that was taken off specific forces instead of gravity; nothing where none was.

    A body whose attitude hardly changes agrees without gravity, too, but for what its turns make of the constant.
    """
    if trial.convention.gravity != "missing" or trial.interval_s is not None:
        return ()
    bias = [fit.parameters[f"bias_{axis}"] for axis in "xyz"]
    if not all(parameter.free for parameter in bias):
        return ()
    x, y, z = (-parameter.value for parameter in bias)
    return (ConstantForce((x, y, z), steadiness),)


def _disagreement(
    facts: Facts,
    streams: InertialStreams,
    kind: MotionKind,
    trial: InertialConventionTrial,
    further: tuple[Feature, ...] = (),
) -> Statistic:
    """Return the disagreement of the streams as declared, and the convention under which they agree."""
    where, when = Where(stream="imu"), ""
    value, error = trial.convention.disagreement
    if trial.interval_s is not None:
        where = location_of(facts, "imu", *(streams.time_ns(time_s) for time_s in trial.interval_s))
        when = f" from {where.start_us:.0f} to {where.stop_us:.0f} us"
    # Differences from the declared convention, in words.
    convention, declared, parts = trial.convention, InertialConvention(), []
    if convention.quaternions != declared.quaternions:
        parts.append(f"quaternions are taken as {convention.quaternions}")
    if convention.angle_signs != declared.angle_signs:
        reversed_angles = zip(("yaw", "pitch", "roll"), convention.angle_signs, strict=True)
        parts.append(f"{', '.join(name for name, sign in reversed_angles if sign < 0)} counts the other way")
    if convention.sensor_axes != declared.sensor_axes:
        parts.append(f"the sensor's axes are {_axes_text(convention.sensor_axes)} of the body")
    if convention.sensor_frame != declared.sensor_frame:
        parts.append("the sensor's axes are those of the world")
    if convention.world_axes != declared.world_axes:
        parts.append(f"positions are {_axes_text(convention.world_axes)} of the world")
    if convention.up != declared.up:
        parts.append(f"{_axes_text((convention.up,))} of the world points upwards")
    if convention.rate_unit != 1.0:
        parts.append(f"angular velocity is divided by {convention.rate_unit:.4g}")
    if convention.length_unit != 1.0:
        parts.append(f"positions are divided by {convention.length_unit:g}")
    if convention.gravity == "subtracted along z":
        parts.append("gravity was subtracted along the sensor's z")
    elif convention.gravity != "declared":
        parts.append(f"gravity is {convention.gravity} in the specific force")
    return Statistic(
        name="disagreement",
        value=value,
        unit="1",
        standard_error=error,
        expected=1.0,
        side="upper",
        statement=f"Pose and IMU disagree in {kind}{when} {value:.3g} times as much as "
        f"noise implies; they agree if {' and '.join(parts)}.",
        code=f"imu.{kind}.disagreement",
        where=where,
        severity="critical",
        features=(trial, *further),
    )


def _axes_text(axes: Axes) -> str:
    """Return axes as ``(-y, x, z)``, or as sums where they are turned by any angle."""
    rows = ([(value, name) for value, name in zip(row, "xyz", strict=True) if value] for row in axes)
    sums = (" + ".join(name if value == 1 else f"-{name}" if value == -1 else f"{value:.3f} {name}"
                       for value, name in row) for row in rows)  # fmt: skip
    return "(" + ", ".join(sums) + ")"


def parameter_statistics(
    kind: MotionKind,
    check: str,
    fitted: Mapping[str, ParameterEstimate],
    texts: Mapping[str, ParameterText],
    defects: tuple[Feature, ...] = (),
) -> tuple[Statistic, ...]:
    """Return the statistics of the fitted parameters that have a text.

    Parameters
    ----------
    kind
        Kind of the comparison.
    fitted
        Parameters by name.
    texts
        Texts by group.
    defects
        Defects of the samples, which disturb the fit.

    Returns
    -------
    tuple
        In the order of ``fitted``.
    """
    stated = {name: parameter for name, parameter in fitted.items() if group_of(name) in texts}
    # The largest component of each group's vector.
    sizes: dict[str, float] = {}
    for name, parameter in stated.items():
        sizes[group_of(name)] = max(abs(parameter.value), sizes.get(group_of(name), 0.0))
    statistics = []
    for name, parameter in stated.items():
        text = texts[group_of(name)]
        value, error = text.factor * parameter.value, text.factor * parameter.standard_error
        # Names of vector components end in their axis.
        sentence = text.sentence.format(size=f"{abs(value):.4g}", axis=name[-1], sense=text.senses[int(value < 0)])
        ratio = abs(parameter.value) / (sizes[group_of(name)] or 1.0)
        statistics.append(
            Statistic(
                name=name,
                value=value,
                unit=text.unit,
                standard_error=error,
                model_error_bound=text.factor * parameter.model_error,
                statement=f"{sentence} (+- {error:.2g}).",
                code=f"{check}.{group_of(name)}",
                where=Where(stream="imu"),
                features=(
                    *defects,
                    InertialParameter(
                        kind,
                        name,
                        parameter.value,
                        parameter.standard_error,
                        ratio,
                        parameter.explained,
                        parameter.instead,
                    ),
                ),
            )
        )
    return tuple(statistics)


def _in_units(factor: float, sensitivity: SensitivityRange | None) -> SensitivityRange | None:
    if sensitivity is None:
        return None
    (low_error, low_bound), (high_error, high_bound) = sensitivity
    return (factor * low_error, factor * low_bound), (factor * high_error, factor * high_bound)


def local_statistics(
    facts: Facts,
    streams: InertialStreams,
    kind: MotionKind,
    check: str,
    fit: InertialFit,
    group: str,
    text: ParameterText,
    defects: tuple[Feature, ...] = (),
) -> tuple[Statistic, ...]:
    """Return the largest local deviation of a group of parameters from its value in the whole sequence.

    Parameters
    ----------
    streams
        Both streams.
    kind
        Kind of the comparison.
    fit
        Fit of this kind.
    group
        Group of the parameters.
    text
        Text of the group.
    defects
        Defects of the samples, which disturb the fit.

    Returns
    -------
    tuple
        One statistic; none for too few segments, or a fit that did not converge.
    """
    names = [name for name in fit.local_deviations if group_of(name) == group]
    if not names or not fit.settled:
        return ()
    # The component with the most significant deviation stands for its group: all are tested.
    local = fit.local_deviations
    name = max(names, key=lambda candidate: abs(local[candidate].deviation) / local[candidate].standard_error)
    worst = local[name]
    where = location_of(facts, "imu", streams.time_ns(worst.start_s), streams.time_ns(worst.stop_s))
    size = f"{text.factor * worst.value:.4g} {text.unit}"
    # Of all segments and components: a fault may lie in any.
    sensitivities = [sensitivity for name in names if (sensitivity := local[name].sensitivity) is not None]
    of_all = sensitivity_range(*np.array(sensitivities).reshape(-1, 2).T)
    return (
        Statistic(
            name=f"local_{group}",
            value=text.factor * worst.deviation,
            unit=text.unit,
            standard_error=text.factor * worst.standard_error,
            model_error_bound=text.factor * worst.model_error,
            # Each segment was compared, in every component of the group.
            tests=worst.tests * len(names),
            sensitivity=_in_units(text.factor, of_all),
            statement=f"From {where.start_us:.0f} to {where.stop_us:.0f} us {name} is {size}, "
            f"{text.factor * worst.deviation:+.4g} off its value in the whole sequence.",
            code=f"{check}.local_{group}",
            where=where,
            features=(
                *defects,
                InertialParameter(kind, name, worst.value, worst.standard_error, 1.0, fit.parameters[name].explained),
            ),
        ),
    )
