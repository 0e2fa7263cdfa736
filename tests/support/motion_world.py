"""A body in motion, in closed form, with poses and IMU samples of it; and such streams as a small canonical file.

Three angles and three coordinates are each a sine. Rates and accelerations are written down by hand, rotations are
scipy's: nothing here shares code with the generator or with what is tested.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from fedora_qa.estimators.imu.samples import InertialNoise, InertialSamples

Float64 = NDArray[np.float64]

GRAVITY_M_S2 = 9.81
_AXES = np.eye(3)


@dataclass(frozen=True)
class Motion:
    """Amplitudes, frequencies and phases of yaw, pitch, roll (rad) and x, y, z (m)."""

    amplitudes: tuple[float, ...] = (0.9, 0.15, 0.2, 0.6, 0.5, 0.2)
    frequencies_hz: tuple[float, ...] = (0.8, 1.1, 0.9, 0.5, 0.7, 0.9)
    phases: tuple[float, ...] = (0.3, 1.9, 3.5, 0.7, 2.2, 4.0)

    def orientations(self, times_s: Float64) -> Rotation:
        """Body to world: yaw about Z, then pitch about Y, then roll about X."""
        return Rotation.from_euler("ZYX", self._sines(times_s, 0)[:, :3])

    def positions_m(self, times_s: Float64) -> Float64:
        """Positions (n, 3) in the world."""
        return self._sines(times_s, 0)[:, 3:]

    def angular_velocities(self, times_s: Float64) -> Float64:
        """Body rates (n, 3): each Euler rate along its axis, seen through the rotations that follow it."""
        angles, rates = self._sines(times_s, 0)[:, :3], self._sines(times_s, 1)[:, :3]
        roll = Rotation.from_euler("X", angles[:, 2:])
        pitch_roll = Rotation.from_euler("YX", angles[:, 1:])
        return (
            pitch_roll.inv().apply(np.outer(rates[:, 0], _AXES[2]))
            + roll.inv().apply(np.outer(rates[:, 1], _AXES[1]))
            + np.outer(rates[:, 2], _AXES[0])
        )

    def accelerations_m_s2(self, times_s: Float64) -> Float64:
        """Accelerations (n, 3) in the world."""
        return self._sines(times_s, 2)[:, 3:]

    def specific_forces(self, times_s: Float64, gravity_m_s2: float = GRAVITY_M_S2) -> Float64:
        """Specific force (n, 3) in the body: acceleration and the reaction to gravity."""
        proper = np.add(self.accelerations_m_s2(times_s), [0.0, 0.0, gravity_m_s2])
        return self.orientations(times_s).inv().apply(proper)

    def _sines(self, times_s: Float64, derivative: int) -> Float64:
        omega = 2 * np.pi * np.array(self.frequencies_hz)
        phase = np.outer(times_s, omega) + np.array(self.phases) + derivative * np.pi / 2
        return np.array(self.amplitudes) * omega**derivative * np.sin(phase)


RESTLESS = Motion()
"""Some 5 rad/s and 10 m/s^2: everything can be seen."""

HOVER = Motion(amplitudes=(0.005, 0.003, 0.003, 0.02, 0.02, 0.01))
"""Nearly at rest."""


def sample_motion(
    motion: Motion = RESTLESS,
    noise: InertialNoise | None = None,
    *,
    duration_s: float = 2.0,
    imu_rate_hz: float = 1000.0,
    pose_rate_hz: float = 200.0,
    seed: int = 0,
) -> InertialSamples:
    """Sample both streams, with white noise and bias walks from 0 as declared in ``noise``."""
    noise = noise or InertialNoise(gravity_m_s2=GRAVITY_M_S2)
    random = np.random.default_rng(seed)
    imu_s = np.arange(round(duration_s * imu_rate_hz) + 1) / imu_rate_hz
    pose_s = np.arange(round(duration_s * pose_rate_hz) + 1) / pose_rate_hz

    def disturbed(values: Float64, density: float, walk: float) -> Float64:
        white = density * np.sqrt(imu_rate_hz) * random.standard_normal(values.shape)
        steps = walk / np.sqrt(imu_rate_hz) * random.standard_normal(values.shape)
        return values + white + np.cumsum(steps, axis=0)

    shaken = Rotation.from_rotvec(noise.rotation_sigma_rad * random.standard_normal((len(pose_s), 3)))
    moved = noise.position_sigma_m * random.standard_normal((len(pose_s), 3))
    return InertialSamples(
        imu_times_s=imu_s,
        angular_velocities_body_rad_s=disturbed(motion.angular_velocities(imu_s), noise.gyro_density, noise.gyro_walk),
        specific_forces_body_m_s2=disturbed(motion.specific_forces(imu_s), noise.accel_density, noise.accel_walk),
        pose_times_s=pose_s,
        positions_world_m=motion.positions_m(pose_s) + moved,
        orientations_xyzw=(motion.orientations(pose_s) * shaken).as_quat(),
    )


NOISY = InertialNoise(
    gyro_density=1.7e-4,
    accel_density=2e-3,
    gyro_walk=1.9e-5,
    accel_walk=3e-3,
    position_sigma_m=0.005,
    rotation_sigma_rad=float(np.radians(0.2)),
    gravity_m_s2=GRAVITY_M_S2,
)
"""A good MEMS unit, and poses with 5 mm and 0.2 deg."""

EXACT = InertialNoise(gravity_m_s2=GRAVITY_M_S2)


@dataclass(frozen=True)
class MotionFile:
    """What is to be written: samples and what is declared of them."""

    samples: InertialSamples = field(default_factory=sample_motion)
    declared: InertialNoise = EXACT
    sampling: str = "instant"

    def altered(self, **changes: Any) -> Self:
        """Return the file with other samples, by the names of their fields."""
        return replace(self, samples=replace(self.samples, **changes))

    def write(self, path: Path) -> Path:
        """Write streams and metadata of IMU and pose, nothing else."""
        s, declared = self.samples, self.declared
        with h5py.File(path, "w") as file:
            file.attrs.update({"format": "fedora", "format_version": "1.0"})
            file["path/imu/ts"] = np.rint(s.imu_times_s * 1e6).astype(np.int64)
            file["path/imu/angular_velocity"] = s.angular_velocities_body_rad_s
            file["path/imu/linear_acceleration"] = s.specific_forces_body_m_s2
            file["path/pose/ts"] = np.rint(s.pose_times_s * 1e6).astype(np.int64)
            file["path/pose/position"] = s.positions_world_m
            file["path/pose/orientation"] = s.orientations_xyzw
            file.create_group("metadata/imu").attrs.update({
                "gyro_noise_density": declared.gyro_density, "accel_noise_density": declared.accel_density,
                "gyro_bias_walk": declared.gyro_walk, "accel_bias_walk": declared.accel_walk,
                "gravity": declared.gravity_m_s2, "sampling": self.sampling,
            })  # fmt: skip
            file.create_group("metadata/pose").attrs.update({
                "position_sigma": declared.position_sigma_m, "rotation_sigma": declared.rotation_sigma_rad,
            })  # fmt: skip
        return path
