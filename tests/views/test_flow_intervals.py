"""Motion between two poses of a track, and how its errors follow from those of the poses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fedora_qa.geometry.motion import interpolation_gains
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.window import PoseSamples
from fedora_qa.views import flow_intervals
from fedora_qa.views.flow_intervals import PoseTrack, poses_at

POSITION_BOUNDS_M = np.array([5e-5, 2e-5, 1e-4])
QUATERNION_BOUNDS = np.array([5e-7, 1e-6, 2e-7, 3e-7])


def track() -> PoseTrack:
    """A tumbling flight, 200 Hz, with a camera off the axes and the origin of the body."""
    times_ns = np.arange(40) * 5_000_000
    t = times_ns[:, None] * 1e-9
    positions_m = np.hstack([10 + 3 * t, np.sin(2 * t) - 4, 2 + 0.5 * t**2])
    orientations = Rotation.from_rotvec(np.hstack([0.3 + t, np.sin(3 * t), 0.7 - 2 * t])).as_quat()
    T_body_camera = np.eye(4)
    T_body_camera[:3, :3] = Rotation.from_rotvec([0.4, -1.0, 0.7]).as_matrix()
    T_body_camera[:3, 3] = [0.5, -0.3, 0.2]
    camera = Camera(192, 144, np.diag([100.0, 100.0, 1.0]), T_body_camera)
    return PoseTrack(PoseSamples(times_ns, positions_m, orientations), camera)


def twist_by(rounded: PoseTrack, start_ns: int, end_ns: int) -> np.ndarray:
    """The change of the motion, as a twist, of poses that differ from those of the track."""
    motion, exact = rounded.motion(start_ns, end_ns), track().motion(start_ns, end_ns)
    assert motion is not None
    assert exact is not None
    return motion.twist_from(exact)


def changed(rows: slice, component: int, size: float) -> PoseTrack:
    """The track with one component, of quaternions (0 to 3) and positions (4 to 6), changed in some samples."""
    poses = track().poses
    values = np.hstack([poses.orientations_xyzw, poses.positions_world_m])
    values[rows, component] += size
    return PoseTrack(PoseSamples(poses.times_ns, values[:, 4:], values[:, :4]), track().camera)


def test_twists_of_rounding_are_derivatives_of_the_motion() -> None:
    """Each component of each pose that is changed by its bound changes the motion by its column, or its opposite."""
    start_ns, end_ns = 10 * 5_000_000, 14 * 5_000_000
    twists = track().rounding_twists(start_ns, end_ns, POSITION_BOUNDS_M, QUATERNION_BOUNDS)
    bounds = np.concatenate([QUATERNION_BOUNDS, POSITION_BOUNDS_M])
    for column in range(14):
        row, component = (10, 14)[column // 7], column % 7
        found = twist_by(changed(slice(row, row + 1), component, bounds[component]), start_ns, end_ns)
        sign = np.sign(found @ twists[:, column])
        np.testing.assert_allclose(found, sign * twists[:, column], atol=2e-3 * np.abs(twists[:, column]).max())


@pytest.mark.parametrize("between_ns", [0, 2_500_000])
def test_rounded_poses_stay_within_the_twists(between_ns: int) -> None:
    """Rounding of all samples changes the motion along an axis by the sum of the twists at most, and by much of it."""
    start_ns, end_ns = 10 * 5_000_000 + between_ns, 14 * 5_000_000 + between_ns
    twists = track().rounding_twists(start_ns, end_ns, POSITION_BOUNDS_M, QUATERNION_BOUNDS)
    largest = np.abs(twists).sum(axis=1)
    poses, rng, reached = track().poses, np.random.default_rng(0), np.zeros(6)
    for _ in range(500):
        rounded = PoseSamples(
            poses.times_ns,
            poses.positions_world_m + rng.choice([-1, 1], (40, 3)) * POSITION_BOUNDS_M,
            poses.orientations_xyzw + rng.choice([-1, 1], (40, 4)) * QUATERNION_BOUNDS,
        )
        reached = np.maximum(reached, np.abs(twist_by(PoseTrack(rounded, track().camera), start_ns, end_ns)))
    assert np.all(reached <= 1.01 * largest)
    assert np.all(reached > 0.4 * largest)
    gains = interpolation_gains(poses.times_ns, at_ns=np.array([start_ns, end_ns]))
    assert gains == pytest.approx(np.full(2, 356 / 256 if between_ns else 1.0))


def test_poses_at_the_same_instants_are_interpolated_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of one track; a track with other poses has its own."""
    interpolated = []

    def counted(poses: PoseSamples, at_ns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        interpolated.append(tuple(at_ns))
        return poses_at(poses, at_ns)

    monkeypatch.setattr(flow_intervals, "poses_at", counted)
    of_all = track()
    first = of_all.ends(50_000_000, 70_000_001)
    assert all(np.array_equal(a, b) for a, b in zip(first[1], of_all.ends(50_000_000, 70_000_001)[1], strict=True))
    assert of_all.motion(50_000_000, 70_000_001) is not None
    assert interpolated == [(50_000_000, 70_000_001)]
    poses = of_all.poses
    higher = replace(
        of_all, poses=replace(poses, positions_world_m=poses.positions_world_m + np.array([0.0, 0.0, 1.0]))
    )
    np.testing.assert_allclose(higher.ends(50_000_000, 70_000_001)[1][1] - first[1][1], [0.0, 0.0, 1.0])
    assert len(interpolated) == 2
