"""The clock of the IMU against that of the poses."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from fedora_qa.checks.imu.parameters import TIMING_SHOWN, local_measured, parameters_measured
from fedora_qa.checks.protocol import Notice, Observation, Statistic, Suspect, WindowCheck
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.imu.summary import InertialFit
from fedora_qa.sequence.declared import ImuModel
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.inertial_agreement import (
    Kind,
    Motion,
    Streams,
    coverage_of,
    fit,
    gross_cause,
    motion_of,
    streams_of,
)
from fedora_qa.views.sample_defects import timestamp_defects
from fedora_qa.views.timing_cues import TimingCues, timing_cues_of

_SURE: Final = 6.0
_CLOSE: Final = 3.0
_MS_PER_S: Final = 1e3


class ImuTiming(WindowCheck[Motion]):
    """Do IMU and poses run on one clock?

    How late the IMU's stamps are against those of the poses at the first sample (ms), by how much each of the two
    clocks runs fast (ppm), and where the offset differs most from that of the whole sequence, each with its error.

    Why it matters
    --------------
    Visual-inertial methods take one clock for granted. A millisecond at 4 rad/s is 0.23 deg, 5 px of a 1440 px image; a
    clock that is 50 ppm off has drifted by 3 ms after a minute.

    How
    ---
    From the fits of imu.rotation and imu.translation, which are independent data, averaged by their errors. Each
    parameter is tested alone unless several are needed to explain the data. Which clock runs fast can be told, since in
    a second that is too long a body seems to turn too far. Which stream is late cannot be told from the two alone: the
    one whose stamps no longer fall where frames, beginnings or its own period put them is named. Samples that are means
    over the interval before their stamp read as half an interval late; where that is what is found it is said, not
    failed: such a mean is sound data that lacks its declaration (sampling="interval_mean").

    Noise model
    -----------
    As imu.rotation and imu.translation. A derivative taken of noisy samples would bias an offset towards 0: they are
    averaged over 20 ms first, which bends a motion of 3 Hz by 0.6%.

    Cannot see
    ----------
    An offset where the motion is constant: hovering, straight flight at one speed. Then the least detectable offset
    exceeds the millisecond that matters, and the outcome is not_observable. Offsets that IMU and pose share.

    Sources
    -------
    M. Li, A. Mourikis, Online temporal calibration for camera-IMU systems, Int. J. Robotics Research 33 (2014) 947
    (time offset as a parameter of the fit); first principles in ``fedora_qa/estimators/imu/sequence_fit.py``.
    """

    name = "imu.timing"
    needs = ("imu", "pose")

    def measure(self, window: Window) -> Motion | None:
        """Keep the window's own samples."""
        return motion_of(window)

    def conclude(self, state: Sequence[Motion], facts: Facts) -> Observation:
        """Fit the whole sequence."""
        streams = streams_of(state, facts)
        seen = coverage_of(streams, facts)
        if isinstance(streams, str):
            return Observation(seen, unobservable=streams)
        fits = _sound_fits(streams)
        if not fits:
            return Observation(seen, unobservable="IMU and pose cannot be compared: see imu.rotation, imu.translation")
        timing_cues, of_timestamps = timing_cues_of(facts), timestamp_defects(facts, "imu", "pose")
        offset, *rates = (_measured(fits, name, timing_cues, of_timestamps) for name in TIMING_SHOWN)
        offset, notices = (offset, ()) if of_timestamps else _without_averaging(offset, streams, facts)
        surest = min(fits, key=lambda kind: fits[kind].parameters["time_offset"].standard_error)
        shown = TIMING_SHOWN["time_offset"]
        local = local_measured(
            facts, streams, surest, self.name, fits[surest], "time_offset", shown, timing_cues, of_timestamps
        )
        return Observation(seen, (offset, *rates, *local), notices)


def _sound_fits(streams: Streams) -> dict[Kind, InertialFit]:
    """Return the fit of each kind of comparison that does not disagree grossly."""
    kinds: tuple[Kind, ...] = ("rotation", "translation")
    fits: dict[Kind, InertialFit] = {}
    for kind in kinds:
        found = fit(streams, kind)
        if found is not None and found.settled and gross_cause(streams, kind, found) is None:
            fits[kind] = found
    return fits


def _measured(
    fits: dict[Kind, InertialFit], name: str, timing_cues: TimingCues, besides: tuple[Suspect, ...]
) -> Statistic:
    """Average a parameter over the comparisons, by their errors; the surest one says what else would explain it."""
    found = {kind: fit.parameters[name] for kind, fit in fits.items()}
    information = np.array([one.standard_error**-2 for one in found.values()])
    shares = information / information.sum()
    surest = max(found, key=lambda kind: (found[kind].free, -found[kind].standard_error))
    average = replace(
        found[surest],
        value=float(shares @ [one.value for one in found.values()]),
        standard_error=float(information.sum() ** -0.5),
        model_error=float(shares @ [one.model_error for one in found.values()]),
    )
    return parameters_measured(surest, "imu.timing", {name: average}, TIMING_SHOWN, timing_cues, besides)[0]


def _without_averaging(offset: Statistic, streams: Streams, facts: Facts) -> tuple[Statistic, tuple[Notice, ...]]:
    """Expect half an interval where instants are declared and that is what is found."""
    half_ms = _MS_PER_S * float(np.median(np.diff(streams.imu.times_ns))) / NS_PER_S / 2
    limit = _CLOSE * offset.standard_error + offset.model_error_bound
    declared = (facts.declared.imu or ImuModel()).sampling
    sure = half_ms > _SURE * offset.standard_error + offset.model_error_bound
    if declared != "instant" or not sure or abs(offset.value - half_ms) > limit:
        return offset, ()
    message = (
        f"IMU samples are {offset.value:.3g} ms late, half their interval: they read like means over it; declare "
        "sampling='interval_mean' if they are."
    )
    return replace(offset, expected=half_ms), (Notice("imu.timing.interval_mean", message),)
