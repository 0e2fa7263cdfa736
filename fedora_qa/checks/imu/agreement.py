"""The IMU against the poses: does integration of the one give the other?"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.imu.parameters import (
    Shown,
    local_measured,
    parameters_measured,
)
from fedora_qa.checks.protocol import ANY_CAUSE, Observation, Statistic, Suspect
from fedora_qa.conventions import NS_PER_S, US_PER_S
from fedora_qa.estimators.imu.summary import InertialFit
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.views.inertial_agreement import (
    Kind,
    Motion,
    Streams,
    coverage_of,
    disagreement,
    fit,
    gross_cause,
    gross_suspects,
    is_absurd,
    streams_of,
)
from fedora_qa.views.motion_samples import place
from fedora_qa.views.sample_defects import frozen_imu, frozen_poses, pose_defects, timestamp_defects
from fedora_qa.views.timing_cues import timing_cues_of


def _agreement(
    state: Sequence[Motion], facts: Facts, kind: Kind, shown: Mapping[str, Shown], unit: str, factor: float
) -> Observation:
    streams = streams_of(state, facts)
    seen = coverage_of(streams, facts)
    if isinstance(streams, str):
        return Observation(seen, unobservable=streams)
    found = fit(streams, kind)
    if found is None:
        return Observation(seen, unobservable="too few poses with IMU samples all the way between them")
    gross = gross_cause(streams, kind, found)
    if gross is not None and gross.is_certain:
        return Observation(seen, (disagreement(facts, streams, kind, gross),))
    defects = (
        *(gross_suspects(kind, gross.hypothesis) if gross else ()),
        *timestamp_defects(facts, "imu"),
        *pose_defects(facts, streams.poses, facts.declared.pose or PoseModel()),
    )
    residual = _residual(found, kind, unit, factor, defects)
    worst = _worst(facts, streams, found, kind, unit, factor, defects)
    timing_cues, check = timing_cues_of(facts), f"imu.{kind}"
    besides = defects if found.settled and not is_absurd(found) else (*defects, *_other_sequence(1.0))
    parameters = parameters_measured(kind, check, found.parameters, shown, timing_cues, besides)
    local = local_measured(facts, streams, kind, check, found, "bias", shown["bias"], timing_cues, defects)
    return Observation(
        seen,
        (residual, worst, *parameters, *local),
        evidence={"residual": _course(facts, streams, found, factor)},
        titles={"residual": f"Residuals of IMU and pose in {kind}; x time [s]; y length [{unit}]"},
    )


def _course(facts: Facts, streams: Streams, found: InertialFit, factor: float) -> NDArray[np.float64]:
    """Return the residuals over time (n, 2): s on the file's clock, and their lengths."""
    seconds = facts.origin_us / US_PER_S + streams.origin_ns / NS_PER_S
    return found.course * [1.0, factor] + [seconds, 0.0]


def _residual(found: InertialFit, kind: Kind, unit: str, factor: float, defects: tuple[Suspect, ...]) -> Statistic:
    """State the scatter that is left after the freed parameters.

    The two streams may share the blame for noise. What is left of another motion is as smooth as that motion.
    """
    smooth = max(found.smoothness, 0.0)
    rms, expected = factor * found.rms, factor * found.expected_rms
    return Statistic(
        name=f"{kind}_residual",
        value=rms,
        unit=unit,
        standard_error=factor * found.rms_error,
        expected=expected,
        model_error_bound=factor * found.model_rms,
        side="upper",
        statement=f"Between neighbouring poses IMU and pose differ in {kind} by {rms:.4g} {unit} rms; noise explains "
        f"{expected:.4g}.",
        code=f"imu.{kind}.residual",
        where=Where(stream="imu"),
        suspects=(
            *defects,
            Suspect("noise_misdeclared", "pose", 0.5 * (1 - smooth)),
            Suspect("noise_misdeclared", "imu", 0.5 * (1 - smooth)),
            *_anything(0.4 * (1 - smooth)),
            *_other_sequence(smooth),
        ),
    )


def _worst(
    facts: Facts,
    streams: Streams,
    found: InertialFit,
    kind: Kind,
    unit: str,
    factor: float,
    defects: tuple[Suspect, ...],
) -> Statistic:
    """State the comparison that fits least."""
    worst = found.worst
    time_ns = streams.time_ns(worst.time_s)
    return Statistic(
        name=f"worst_{kind}",
        value=factor * worst.value,
        unit=unit,
        standard_error=factor * worst.sigma,
        model_error_bound=factor * worst.model_error,
        tests=3 * found.rows,
        statement=f"At {facts.to_file_us(time_ns):.0f} us IMU and pose differ in {kind} by {factor * worst.value:.4g} "
        f"{unit}; noise is {factor * worst.sigma:.2g}.",
        code=f"imu.{kind}.worst",
        where=place(facts, "pose", time_ns),
        suspects=(*_local_suspects(streams, kind, time_ns, max(found.smoothness, 0.0)), *defects),
    )


def _other_sequence(smooth: float) -> tuple[Suspect, ...]:
    return tuple(Suspect("other_sequence", stream, 0.8 * smooth) for stream in ("imu", "pose"))


def _anything(weight: float) -> tuple[Suspect, ...]:
    """Suspect whatever else is found wrong with either stream, at its edges or all along."""
    return tuple(Suspect(ANY_CAUSE, stream, weight) for stream in ("pose", "imu"))


def _local_suspects(streams: Streams, kind: Kind, time_ns: int, smooth: float) -> tuple[Suspect, ...]:
    """Causes at one instant: samples that do not move there, else a jump, else lost samples."""
    imu, poses = streams.imu, streams.poses
    reach_ns = 2 * int(np.median(np.diff(poses.times_ns)))
    suspects = [
        Suspect("teleport", "pose", (1 - smooth) * (0.4 if kind == "translation" else 0.2)),
        Suspect("dropped_samples", "imu", (1 - smooth) * 0.3),
        Suspect("noise_misdeclared", "pose", (1 - smooth) * 0.3),
        *_anything(0.3 * (1 - smooth)),
        *_other_sequence(smooth),
    ]
    frozen = (("pose", poses.times_ns, frozen_poses(poses)), ("imu", imu.times_ns, frozen_imu(imu)))
    for stream, times_ns, rows in frozen:
        if len(rows) and int(np.min(np.abs(times_ns[rows] - time_ns))) <= reach_ns:
            suspects.insert(0, Suspect("frozen_frames", stream, 0.9, float(len(rows)), "samples"))
    return tuple(suspects)
