"""The noise of poses compared with its declaration."""

from collections.abc import Callable, Sequence

from fedora_qa.checks.declared_noise import noise_against_declared, undeclared_noise
from fedora_qa.checks.protocol import Observation, WindowCheck
from fedora_qa.estimators.imu.sampled_curves import OrientationSamples, SampledCurve, VectorSamples
from fedora_qa.estimators.imu.white_noise import noise_level
from fedora_qa.record.types import Coverage
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import PoseSamples, Window
from fedora_qa.views.motion_samples import (
    NOISE_ORDER,
    join_poses,
    owned_poses,
    position_floor_m,
    rotation_floor_rad,
    why_unusable,
)
from fedora_qa.views.sample_defect_detection import filtered_noise, pose_defects, smooth_interpolation
from fedora_qa.views.sample_defects import ExcessNoise, NoiseAtTimes


class PoseNoise(WindowCheck[PoseSamples]):
    """Does the noise of the poses equal the declared noise?

    The standard deviation of white noise of positions (m, axes of the world) and of orientations (rad, axes of the
    body), as a ratio to the declared sigma, or itself where a sigma of 0 is declared. Where no noise is declared, as
    for real trajectories, both are stated and not judged.

    Why it matters
    --------------
    Sensor fusion and evaluation weight these poses by the declared sigma. Flow that was made from noisy poses is wrong
    by pixels: 0.2 deg at a focal length of 1247 px are 4.4 px.

    How
    ---
    Divided differences of order 8 over nine neighbouring poses are scaled to unit noise gain. They vanish for a
    polynomial of degree 7, with even and uneven timestamps, and keep white noise. Differences of rotations are those of
    the vectors Log(q_k^-1 q_j). Sigma is estimated from the 90% quantile of their size, so that a few jumps do not
    change it. Straight lines, frozen poses and timestamps on a coarse grid have the effect of noise; where they are
    detected, they are named first. Where noise is less than declared, that of every second, fourth and eighth pose
    tells whether it is white: a filter, or curves between poses of a lower rate, take that of neighbours.

    Noise model
    -----------
    Gaussian and white. Neighbouring differences are correlated: the variance of their mean square is C(4d, 2d) / C(2d,
    d)^2 times that of independent ones, and the quantile adds a factor of 1.25. The model error bound is the sum of the
    remaining motion (the amount that differences of two higher orders remove), of rounded timestamps (speed times 0.29
    us) and of stored digits.

    Cannot detect
    -------------
    Noise that is not white, except for its highest frequencies. A drift. Noise together with a motion of about 20 Hz.

    Sources
    -------
    J. von Neumann et al., Ann. Math. Statist. 12 (1941) 153 (successive differences); first principles in
    ``fedora_qa/estimators/imu/white_noise.py``; format: position in the world, orientation q * Exp(n).
    """

    name = "pose.noise"
    needs = ("pose",)

    def measure(self, window: Window) -> PoseSamples | None:
        """Keep the window's own poses."""
        return owned_poses(window)

    def conclude(self, state: Sequence[PoseSamples], facts: Facts) -> Observation:
        """Compare both kinds of noise with their declarations, or state them without a declaration."""
        poses = join_poses(state)
        coverage = Coverage(len(poses.times_ns), len(facts.clocks["pose"].times_ns), "poses")
        unusable = why_unusable(facts, "pose")
        position = noise_level(poses.times_ns, VectorSamples(poses.positions_world_m), order=NOISE_ORDER)
        rotation = noise_level(poses.times_ns, OrientationSamples(poses.orientations_xyzw), order=NOISE_ORDER)
        if unusable or position is None or rotation is None:
            return Observation(coverage, unobservable=unusable or "too few consecutive poses to measure noise")
        model = facts.declared.pose
        if model is None:
            notice, inferred = undeclared_noise(
                "pose.noise", "pose", {"position": (position, "m"), "rotation": (rotation, "rad")}
            )
            return Observation(coverage, notices=(notice,), inferred=inferred)
        by_rows: tuple[Callable[[slice], SampledCurve], ...] = (
            lambda rows: VectorSamples(poses.positions_world_m[rows]),
            lambda rows: OrientationSamples(poses.orientations_xyzw[rows]),
        )
        sigmas = model.position_sigma_m, model.rotation_sigma_rad
        filtered = [
            filtered_noise("pose", poses.times_ns, curve_of, sigma)
            for curve_of, sigma in zip(by_rows, sigmas, strict=True)
        ]
        knots = smooth_interpolation(poses) if any(filtered) else ()
        kinds = (
            ("position", "m", position, model.position_sigma_m, position_floor_m(poses)),
            ("rotation", "rad", rotation, model.rotation_sigma_rad, rotation_floor_rad(poses)),
        )
        # Excess noise is the quantity that is measured here, not a further defect; knots alone are noise at times, too.
        no_defects = (ExcessNoise, NoiseAtTimes) if knots else ExcessNoise
        defects = tuple(feature for feature in pose_defects(facts, poses, model) if not isinstance(feature, no_defects))
        return Observation(
            coverage,
            tuple(
                noise_against_declared(*kind, check="pose.noise", stream="pose", features=(*defects, *knots, *of_kind))
                for kind, of_kind in zip(kinds, filtered, strict=True)
            ),
        )
