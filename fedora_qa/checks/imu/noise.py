"""The noise of the IMU compared with its declaration."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fedora_qa.checks.declared_noise import noise_against_declared, undeclared_noise
from fedora_qa.checks.exact import count_of_faults
from fedora_qa.checks.protocol import Observation, WindowCheck
from fedora_qa.conventions import NS_PER_S
from fedora_qa.estimators.imu.sampled_curves import VectorSamples
from fedora_qa.estimators.imu.samples import TIMESTAMP_SIGMA_S
from fedora_qa.estimators.imu.white_noise import noise_level
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import ImuSamples, Window
from fedora_qa.views.motion_samples import NOISE_ORDER, imu_roundings, join_imu, location_of, owned_imu, why_unusable
from fedora_qa.views.sample_defect_detection import filtered_noise, frozen_imu, noise_of_part, timestamp_defects

Float64 = NDArray[np.float64]


class ImuNoise(WindowCheck[ImuSamples]):
    """Does the noise of the IMU equal the declared noise?

    The standard deviation of white noise of gyro and accelerometer, as a ratio to ``density * sqrt(rate)``, or itself
    where a density of 0 is declared; and the number of frozen samples. Where no density is declared, as in recordings
    without a data sheet, both are stated and not judged.

    Why it matters
    --------------
    Filters weight IMU and cameras by the declared densities. A buffer that is written again without being refreshed
    gives old samples, which no filter models.

    How
    ---
    As in ``pose.noise``: divided differences of order 8 over nine neighbouring samples, in which motion vanishes. A
    sample is frozen if it equals the one before in every bit while its neighbours change by a tenth of the typical
    change, and by more than rounding: sixteen units in the last place, because a steady motion in rotated axes repeats
    to within them.

    Noise model
    -----------
    As in ``pose.noise``: Gaussian and white; correlation of neighbouring differences; the amount that two higher orders
    remove; rounded timestamps; stored digits. Rates are differences of orientations, whose components reach 1, and have
    their rounding.

    Cannot detect
    -------------
    Biases and their random walks, which are slow (``imu.rotation``, ``imu.translation``). Noise that is not white,
    except for its highest frequencies. Frozen samples of a body at rest.

    Sources
    -------
    IEEE Std 952-1997, annex C (density and sample noise); first principles in
    ``fedora_qa/estimators/imu/white_noise.py``.
    """

    name = "imu.noise"
    needs = ("imu",)

    def measure(self, window: Window) -> ImuSamples | None:
        """Keep the window's own samples."""
        return owned_imu(window)

    def conclude(self, state: Sequence[ImuSamples], facts: Facts) -> Observation:
        """Compare both sensors with their declarations, or state their noise where there is none."""
        imu = join_imu(state)
        coverage = Coverage(len(imu.times_ns), len(facts.clocks["imu"].times_ns), "samples")
        rates, forces = imu.angular_velocities_body_rad_s, imu.specific_forces_body_m_s2
        gyro = noise_level(imu.times_ns, VectorSamples(rates), order=NOISE_ORDER)
        accel = noise_level(imu.times_ns, VectorSamples(forces), order=NOISE_ORDER)
        unusable = why_unusable(facts, "imu")
        if unusable or gyro is None or accel is None:
            return Observation(coverage, unobservable=unusable or "too few consecutive samples to measure noise")
        roundings = imu_roundings(imu)
        frozen = frozen_imu(imu, roundings)
        repeats = count_of_faults(
            "frozen",
            len(frozen),
            "samples",
            statement=f"{len(frozen)} IMU samples equal the one before exactly while the body moves.",
            code="imu.noise.frozen",
            where=location_of(facts, "imu", int(imu.times_ns[frozen[0]])) if len(frozen) else Where(stream="imu"),
        )
        model = facts.declared.imu
        if model is None:
            notice, inferred = undeclared_noise(
                "imu.noise", "imu", {"gyro": (gyro, "rad/s"), "accelerometer": (accel, "m/s^2")}
            )
            return Observation(coverage, (repeats,), (notice,), inferred=inferred)
        # White noise of density N sampled at rate f has sigma = N sqrt(f) (IEEE Std 952-1997, annex C).
        root_rate = float(np.sqrt(NS_PER_S / np.median(np.diff(imu.times_ns))))
        gyro_rounding, accel_rounding = roundings
        gyro_sigma, accel_sigma = root_rate * model.gyro_noise_density, root_rate * model.accel_noise_density
        gyro_floor, accel_floor = (
            _floor(imu.times_ns, rates, gyro_rounding),
            _floor(imu.times_ns, forces, accel_rounding),
        )
        of_timestamps = timestamp_defects(facts, "imu")
        return Observation(
            coverage,
            (
                noise_against_declared(
                    "gyro", "rad/s", gyro, gyro_sigma, gyro_floor,
                    check="imu.noise", stream="imu",
                    features=(
                        *of_timestamps,
                        *noise_of_part(imu.times_ns, rates),
                        *filtered_noise("imu", imu.times_ns, lambda rows: VectorSamples(rates[rows]), gyro_sigma),
                    ),
                ),
                noise_against_declared(
                    "accelerometer", "m/s^2", accel, accel_sigma, accel_floor,
                    check="imu.noise", stream="imu",
                    features=(
                        *of_timestamps,
                        *filtered_noise("imu", imu.times_ns, lambda rows: VectorSamples(forces[rows]), accel_sigma),
                    ),
                ),
                repeats,
            ),
        )  # fmt: skip


def _floor(times_ns: NDArray[np.int64], values: Float64, rounding: float) -> float:
    """Return the scatter of exact samples by stored digits and timestamps rounded to 1 us, in the values' unit."""
    changes = np.linalg.norm(np.diff(values, axis=0), axis=1) / (np.diff(times_ns) / NS_PER_S)
    # Rounding to 1 us has a standard deviation of 1 / sqrt(12) us; a changing signal turns it into noise.
    return float(np.hypot(np.sqrt(np.mean(np.square(changes))) * TIMESTAMP_SIGMA_S, rounding))
