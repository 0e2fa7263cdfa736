"""Hypotheses that IMU and poses share: defects of samples, noise that differs from its declaration, exchanged axes."""

from collections.abc import Mapping, Sequence

import numpy as np

from fedora_qa.checks.declared_noise import MeasuredNoise
from fedora_qa.conventions import NS_PER_MS
from fedora_qa.diagnosis.features import only_feature
from fedora_qa.diagnosis.hypothesis import Hypothesis
from fedora_qa.diagnosis.support import support
from fedora_qa.features import Feature
from fedora_qa.judgement.judge import Alarm
from fedora_qa.views.sample_defects import (
    ComponentNoise,
    ExcessNoise,
    LinearInterpolation,
    LoneSamples,
    RepeatedSamples,
    SampleClockDrift,
    SampleClockGrid,
    SampleClockOffset,
)

_SAME_FACTOR = 0.2
"""Largest relative difference of a ratio of noise from the factor of a unit that counts as that unit: noise is measured
to a few percent."""


def defect_hypotheses(features: Sequence[Feature]) -> tuple[Hypothesis, ...]:
    """Return the causes of the defects among the features, in their order."""
    hypotheses: list[Hypothesis] = []
    of_timestamps = support("motion.timestamps")
    for feature in features:
        match feature:
            case SampleClockGrid(stream, period_ns):
                hypotheses.append(Hypothesis("quantised_time", stream, of_timestamps, period_ns / NS_PER_MS, "ms"))
            case SampleClockDrift(stream, drift):
                hypotheses.append(Hypothesis("clock_rate", stream, of_timestamps, 1e6 * drift, "ppm"))
            case SampleClockOffset(stream, offset_ns):
                hypotheses.append(Hypothesis("time_offset", stream, of_timestamps, offset_ns / NS_PER_MS, "ms"))
            case LinearInterpolation(stream, knot_rate_hz):
                strength = support("motion.interpolated_samples")
                hypotheses.append(Hypothesis("interpolated_pose", stream, strength, knot_rate_hz, "Hz"))
            case RepeatedSamples(stream, count):
                strength = support("motion.repeated_samples")
                hypotheses.append(Hypothesis("frozen_frames", stream, strength, float(count), "samples"))
            case LoneSamples(stream, _, largest_m):
                hypotheses.append(Hypothesis("teleport", stream, support("motion.lone_samples"), largest_m, "m"))
            case ComponentNoise(stream):
                strength = support("motion.noise_of_components")
                hypotheses.append(Hypothesis("quaternion_not_unit", stream, strength))
            case ExcessNoise(stream):
                hypotheses.append(Hypothesis("noise_misdeclared", stream, support("motion.excess_noise")))
    return tuple(hypotheses)


def noise_hypotheses(alarm: Alarm, stream: str, unit_causes: Mapping[str, float]) -> tuple[Hypothesis, ...]:
    """Return the causes of noise that differs from its declaration.

    Parameters
    ----------
    alarm
        Of a statistic with a ``MeasuredNoise`` among its features.
    stream
        Of the samples, ``imu`` or ``pose``.
    unit_causes
        Factor by cause, for causes that multiply all values, and so the noise, by the factor.

    Returns
    -------
    tuple
        Defects of samples first.
    """
    features = alarm.statistic.features
    defects = defect_hypotheses(features)
    noise = only_feature(features, MeasuredNoise)
    misdeclared = support("motion.noise_beside_defects" if defects else "motion.noise_misdeclared")
    other_sequence = Hypothesis("other_sequence", stream, support("motion.noise_of_other_sequence"))
    if not noise.declared > 0:
        return (*defects, Hypothesis("noise_misdeclared", stream, misdeclared, -100.0, "percent"), other_sequence)
    ratio = noise.sigma / noise.declared
    # The declaration is wrong by declared / sigma - 1, whose relative error is that of sigma.
    error = 100.0 * (1.0 / ratio - 1.0) if ratio > 0 else None
    # d(declared / sigma) = declared / sigma^2 d sigma, in percent.
    standard_error = 100.0 * noise.standard_error / noise.sigma / ratio if ratio > 0 else None
    units = (
        Hypothesis(cause, stream, support("motion.noise_of_unit"), factor, "1")
        for cause, factor in unit_causes.items()
        if abs(ratio / factor - 1.0) < _SAME_FACTOR
    )
    return (
        *defects,
        *units,
        Hypothesis("noise_misdeclared", stream, misdeclared, error, "percent", standard_error),
        other_sequence,
    )


def axes_cause(axes: tuple[tuple[int, ...], ...]) -> str:
    """Return the cause of a signed permutation of axes: an exchange of two, or another convention."""
    matrix = np.array(axes)
    # An exchange of two axes has no negative entry and leaves one axis in place: trace 1. A cyclic one has trace 0.
    return "axes_swapped" if np.all(matrix >= 0) and int(np.trace(matrix)) == 1 else "frame_convention"
