"""The clock of the IMU compared with that of the poses."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fedora_qa.checks.imu.agreement import TIMING_TEXTS, local_statistics, parameter_statistics
from fedora_qa.checks.protocol import Notice, Observation, Statistic, WindowCheck
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.imu.summary import InertialFit
from fedora_qa.sequence.declared import ImuModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.inertial_agreement import (
    MotionKind,
    OffsetsApart,
    WindowMotion,
    convention_trial,
    coverage_of,
    fit_of,
    motion_of,
    streams_of,
)
from fedora_qa.views.sample_defect_detection import held_imu, timestamp_defects

_RESOLVED_SIGMAS: Final = 6.0
"""Least half interval, in standard errors of the offset, that is distinguishable from no offset."""

_EQUAL_SIGMAS: Final = 3.0
"""Standard errors within which an offset counts as half an interval."""

_MS_PER_S: Final = 1e3


class ImuTiming(WindowCheck[WindowMotion]):
    """Do IMU and poses have timestamps of one clock?

    The clock offset of the IMU against the poses at the first sample (ms, positive: IMU late), the rate error of each
    of the two clocks (ppm, positive: fast), and the segment whose offset differs most from that of the whole sequence.
    Each is stated with its error.

    Why it matters
    --------------
    Visual-inertial methods assume one clock. A millisecond at 4 rad/s is 0.23 deg, 5 px of a 1440 px image. A clock
    with an error of 50 ppm has drifted by 3 ms after a minute.

    How
    ---
    The values are the means, weighted by their errors, of the fits of ``imu.rotation`` and ``imu.translation``, which
    use independent data. Each parameter is tested alone unless several are needed to explain the data. The fit
    determines which clock is fast: if a second of the IMU is too long, the integrated rotation is too large. It does
    not determine which stream is late: the stream whose timestamps do not agree with frames, with the begin of the file
    or with its own period is named. Samples that are means over the interval before their timestamp have an apparent
    offset of half an interval. An offset of this size is a notice and no finding: such samples are correct, and only
    their declaration (sampling="interval_mean") is missing.

    Noise model
    -----------
    As in ``imu.rotation`` and ``imu.translation``. A derivative of noisy samples would bias an offset towards 0: they
    are averaged over 20 ms first, which reduces a motion of 3 Hz by 0.6%.

    Cannot detect
    -------------
    An offset under constant motion: hovering, straight flight at constant speed. The least detectable offset then
    exceeds the material size of a millisecond, and the outcome is not_observable. Offsets that IMU and poses share.

    Sources
    -------
    M. Li, A. Mourikis, Online temporal calibration for camera-IMU systems, Int. J. Robotics Research 33 (2014) 947
    (time offset as a parameter of the fit); first principles in ``fedora_qa/estimators/imu/sequence_fit.py``.
    """

    name = "imu.timing"
    needs = ("imu", "pose")

    def measure(self, window: Window) -> WindowMotion | None:
        """Keep the window's own samples."""
        return motion_of(window)

    def conclude(self, state: Sequence[WindowMotion], facts: Facts) -> Observation:
        """Fit the whole sequence."""
        streams = streams_of(state, facts)
        coverage = coverage_of(streams, facts)
        if isinstance(streams, str):
            return Observation(coverage, unobservable=streams)
        # The fits that converged under the declared conventions.
        kinds: tuple[MotionKind, ...] = ("rotation", "translation")
        fits: dict[MotionKind, InertialFit] = {}
        for kind in kinds:
            fit = fit_of(streams, kind)
            # Under a wrong convention the fitted offset describes the convention, not the clocks.
            if fit is not None and fit.settled and convention_trial(streams, kind, fit) is None:
                fits[kind] = fit
        if not fits:
            reason = "IMU and pose cannot be compared: see imu.rotation, imu.translation"
            return Observation(coverage, unobservable=reason)
        of_timestamps = timestamp_defects(facts, "imu", "pose")
        defects = (*of_timestamps, *held_imu(streams.imu, streams.frozen_imu), *_offsets_apart(fits))
        statistics: list[Statistic] = []
        for name in TIMING_TEXTS:
            fitted = {kind: fit.parameters[name] for kind, fit in fits.items()}
            information = np.array([parameter.standard_error**-2 for parameter in fitted.values()])
            # Inverse-variance weights: both fits use independent data. Features are those of the most precise.
            weights = information / information.sum()
            stated = max(fitted, key=lambda kind: (fitted[kind].free, -fitted[kind].standard_error))
            average = replace(
                fitted[stated],
                value=float(weights @ [parameter.value for parameter in fitted.values()]),
                standard_error=float(information.sum() ** -0.5),
                model_error=float(weights @ [parameter.model_error for parameter in fitted.values()]),
            )
            statistics.append(parameter_statistics(stated, self.name, {name: average}, TIMING_TEXTS, defects)[0])
        notices: tuple[Notice, ...] = ()
        if not of_timestamps and (facts.declared.imu or ImuModel()).sampling == "instant":
            offset = statistics[0]
            # A mean over the interval before its timestamp is the motion half an interval earlier.
            half_ms = _MS_PER_S * float(np.median(np.diff(streams.imu.times_ns))) / NS_PER_S / 2
            limit = _EQUAL_SIGMAS * offset.standard_error + offset.model_error_bound
            resolved = half_ms > _RESOLVED_SIGMAS * offset.standard_error + offset.model_error_bound
            if resolved and not abs(offset.value - half_ms) > limit:
                message = (
                    f"IMU samples are {offset.value:.3g} ms late, half their interval, as means over it are; "
                    "declare sampling='interval_mean' if they are means."
                )
                statistics[0] = replace(offset, expected=half_ms)
                notices = (Notice("imu.timing.interval_mean", message),)
        most_precise = min(fits, key=lambda kind: fits[kind].parameters["time_offset"].standard_error)
        local = local_statistics(
            facts,
            streams,
            most_precise,
            self.name,
            fits[most_precise],
            "time_offset",
            TIMING_TEXTS["time_offset"],
            defects,
        )
        return Observation(coverage, (*statistics, *local), notices)


def _offsets_apart(fits: Mapping[MotionKind, InertialFit]) -> tuple[OffsetsApart, ...]:
    """Return the delay of one sensor where the other has none, by both fits."""
    offsets = {kind: fit.parameters["time_offset"] for kind, fit in fits.items()}
    late = [kind for kind, offset in offsets.items() if offset.free]
    others = [offset for offset in offsets.values() if not offset.free]
    if len(late) != 1 or len(others) != 1:
        return ()
    offset, other = offsets[late[0]], others[0]
    # The other fit must have resolved the delay, and measures less than half of it.
    resolved = abs(offset.value) > _RESOLVED_SIGMAS * other.standard_error + other.model_error
    if not resolved or 2 * abs(other.value) > abs(offset.value):
        return ()
    return (OffsetsApart(late[0], offset.value, offset.standard_error),)
