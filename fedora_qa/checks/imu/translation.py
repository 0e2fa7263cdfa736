"""The IMU against the poses: does integration of the one give the other?"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.imu.parameters import (
    ROTATION_SHOWN,
    TRANSLATION_SHOWN,
    Shown,
    local_measured,
    parameters_measured,
)
from fedora_qa.checks.protocol import ANY_CAUSE, Observation, Statistic, Suspect, WindowCheck
from fedora_qa.conventions import NS_PER_S, US_PER_S
from fedora_qa.estimators.imu.summary import InertialFit
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import PoseModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
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
    motion_of,
    streams_of,
)
from fedora_qa.views.motion_samples import place
from fedora_qa.views.sample_defects import frozen_imu, frozen_poses, pose_defects, stamp_defects
from fedora_qa.views.timing_cues import timing_cues_of


class Rotation(WindowCheck[Motion]):
    """Does the gyro, integrated, give the rotation between poses?

    The scatter of rotation residuals between neighbouring poses (mrad), the worst of them, and the gyro's bias (rad/s),
    misalignment (deg) and gain (percent), and the stretch where the bias differs most, each with its error. Where the
    two streams disagree grossly: by how much, and which reading reconciles them, of the whole or of a part.

    Why it matters
    --------------
    Gyro and pose are one motion told twice. Whoever integrates the one between the other's samples inherits every
    difference: a bias of 0.01 rad/s is 10 deg after 17 s.

    How
    ---
    Increments from the integral of a cubic spline through the gyro plus the coning term of each substep, against
    q_k^-1 q_k+1; residuals in the world's axes. Gross readings first: exchanged axes, degrees, other orders of the
    quaternion are tried where the fit does not settle. Then weighted least squares over the whole sequence, iterated in
    the stamps; a group of parameters (bias, axes, gain, clocks) is freed only where it explains the residuals far
    beyond chance, and every other is tested alone beside those. Rows far out are left out of the fit, and stated. The
    sequence is cut into stretches of 0.5 to 5 s, and each is asked for its own bias: one that steps does not average
    out.

    Noise model
    -----------
    Pose noise as declared, which neighbours share with opposite sign, the gyro's white noise, stamps rounded to a
    microsecond (0.29 us times the rate), stored digits; a declared walk of the bias as one unknown a stretch. Errors
    are formal ones, scaled by a misfit above 1, widened where the spread over stretches exceeds them. Allowed for is
    the integration's own error, from every second sample (Richardson: fourth order, a fifteenth of the difference).
    Gain and timing are told by the gyro's own samples: what their noise does to the fit is measured from two halves of
    them, taken off, and not counted as knowledge, so that quiet flight is uncertain rather than wrong.

    Cannot see
    ----------
    Faults that gyro and pose share; misalignment about an axis about which the body never turns; drops of samples whose
    stamps went with them (clocks.gaps).

    Sources
    -------
    J. Bortz, IEEE Trans. AES 7 (1971) 61; P. Savage, J. Guidance 21 (1998) 19; C. Forster et al., On-manifold
    preintegration, IEEE Trans. Robotics 33 (2017) 1; ``fedora_qa/estimators/imu/preintegration.py``,
    ``grouped_fit.py``, ``split_samples.py``.
    """

    name = "imu.rotation"
    needs = ("imu", "pose")

    def measure(self, window: Window) -> Motion | None:
        """Keep the window's own samples."""
        return motion_of(window)

    def conclude(self, state: Sequence[Motion], facts: Facts) -> Observation:
        """Fit the whole sequence."""
        return _agreement(state, facts, "rotation", ROTATION_SHOWN, "mrad", 1e3)


class Translation(WindowCheck[Motion]):
    """Does the specific force, integrated twice with gravity, give the path of the poses?

    The scatter of the residuals of neighbouring second differences (m/s), the worst of them, and the accelerometer's
    bias (m/s^2), the size and slope of gravity (m/s^2), the lever arm between IMU and poses (m), and the stretch where
    the bias differs most, each with its error. Where the two streams disagree grossly: by how much, and which reading
    reconciles them, of the whole or of a part.

    Why it matters
    --------------
    Specific force with gravity of another size, or none, or of another sign, passes every test of the stream alone and
    ruins every filter. Lever arms of centimetres are forgotten easily, and look like timing in turns.

    How
    ---
    Second differences of consecutive positions against the double integral of ``R f + g``, R interpolated between the
    poses: no velocity is needed, and the gyro has no part in it. Gross readings and fit as in imu.rotation. In level
    flight gravity and bias along Z are one and the same to these streams: both are then named. Whether the sensor's
    gravity or the declared one is odd is told by which of the two is a number in use (9.8, 9.80665, 9.81 ...).

    Noise model
    -----------
    Position noise as declared, which three neighbours share (1, -2, 1); white noise of the accelerometer; noisy
    orientations, which turn the force and so disturb across it only; rounded stamps (0.29 us times the speed), stored
    digits; a declared walk of the bias as one unknown a stretch. Errors and the integration's allowance as in
    imu.rotation.

    Cannot see
    ----------
    What stays below position noise over the time that it takes to average it; a lever arm where the body does not turn;
    whether IMU or poses are off the body's origin.

    Sources
    -------
    First principles: ``fedora_qa/estimators/imu/specific_force.py``; C. Forster et al., IEEE Trans. Robotics 33 (2017)
    1, section VI, for the integrals of which these are differences.
    """

    name = "imu.translation"
    needs = ("imu", "pose")

    def measure(self, window: Window) -> Motion | None:
        """Keep the window's own samples."""
        return motion_of(window)

    def conclude(self, state: Sequence[Motion], facts: Facts) -> Observation:
        """Fit the whole sequence."""
        return _agreement(state, facts, "translation", TRANSLATION_SHOWN, "m/s", 1.0)


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
        *stamp_defects(facts, "imu"),
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
