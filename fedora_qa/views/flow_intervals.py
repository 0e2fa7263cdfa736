"""Fields of flow of a window: intervals, frames and body poses at their ends, and the camera's motion."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_S
from fedora_qa.geometry.camera import RigidMotion, camera_motion, motion_covariance, motion_derivatives
from fedora_qa.geometry.motion import interpolate_poses, interpolation_gains, noise_of_difference
from fedora_qa.geometry.so3 import cross_matrices, quaternions_from_matrices
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Clock, Facts
from fedora_qa.sequence.window import PoseSamples, Window

Float64 = NDArray[np.float64]
Pose = tuple[Float64, Float64]
"""R_world_body (3, 3) and position in the world (3,) m; NaN where no pose covers the instant."""

_DEPTH_RANGE_M: Final = (0.05, 1000.0)
"""Range of depths in m where none is declared."""

_POSE_MARGIN_NS: Final = NS_PER_S // 10
"""Room for the interpolation's stencil and for the neighbours of the last interval."""

DELAY_NS: Final = NS_PER_S // 1000
"""Step of the central difference of a motion by time, ns."""


@dataclass(frozen=True, slots=True)
class Interval:
    """One field of flow: its stream, row and interval.

    Attributes
    ----------
    stream, row
        ``flow/<rate>hz``, and the row of the field.
    start_ns, end_ns
        Ns from the file's origin.
    """

    stream: str
    row: int
    start_ns: int
    end_ns: int

    @property
    def duration_s(self) -> float:
        """Length of the interval."""
        return self.length_ns / NS_PER_S

    @property
    def length_ns(self) -> int:
        """Length of the interval."""
        return self.end_ns - self.start_ns

    def shifted(self, intervals: int) -> "Interval":
        """Return the interval a number of interval lengths later, under the same row."""
        return self.moved(intervals * self.length_ns)

    def moved(self, by_ns: int) -> "Interval":
        """Return the interval later by a number of nanoseconds, under the same row."""
        return replace(self, start_ns=self.start_ns + by_ns, end_ns=self.end_ns + by_ns)


def owned_intervals(window: Window, stream: str) -> Iterator[Interval]:
    """Yield the intervals of the fields that the window owns.

    Parameters
    ----------
    stream
        ``flow/<rate>hz``.

    Yields
    ------
    Interval
        In the order of the file.
    """
    for row in window.owned(stream):
        yield interval_at(window.facts, stream, row)


def interval_at(facts: Facts, stream: str, row: int) -> Interval:
    """Return the interval of a field by its row; of zero length where the stream has no ends.

    Parameters
    ----------
    facts
        With the clock of the stream.
    stream
        ``flow/<rate>hz``.
    row
        Row of the field.
    """
    clock = facts.clocks[stream]
    ends_ns = clock.times_ns if clock.ends_ns is None else clock.ends_ns
    return Interval(stream, row, int(clock.times_ns[row]), int(ends_ns[row]))


def frame_at(clock: Clock, time_ns: int) -> int | None:
    """Return the frame with exactly this timestamp; None where there is none.

    Parameters
    ----------
    clock
        Of a sampled stream; rows whose timestamps do not advance are left out.
    time_ns
        Ns from the file's origin.

    Returns
    -------
    int or None
        The row.
    """
    near = int(np.searchsorted(clock.times_ns, time_ns))
    if near < len(clock.times_ns) and clock.times_ns[near] == time_ns and clock.advancing[near]:
        return near  # timestamps that advance are unique; among others the search may miss
    rows = np.flatnonzero(clock.advancing)
    first = int(np.searchsorted(clock.times_ns[rows], time_ns))
    if first == len(rows) or clock.times_ns[rows[first]] != time_ns:
        return None
    return int(rows[first])


def depths_plausible(facts: Facts, depths_m: NDArray[np.floating]) -> bool:
    """Whether the median depth lies within twice the range of depths.

    Flow determines only the ratio of depths and positions: plausible depths attribute a wrong scale to the positions.

    Parameters
    ----------
    facts
        With the declared range of depths; 0.05 m to 1000 m where none is declared.
    depths_m
        Any shape, m.

    Returns
    -------
    bool
        True where the median lies between half the nearest and twice the farthest depth.
    """
    nearest_m, farthest_m = facts.declared.depth_range_m or _DEPTH_RANGE_M
    return 0.5 * nearest_m <= float(np.median(depths_m)) <= 2 * farthest_m


def ends_on_frame(facts: Facts, interval: Interval) -> bool:
    """Whether an interval ends on the timestamp of a depth or colour frame, as the format requires.

    Parameters
    ----------
    facts
        With the clocks of both streams.
    interval
        Of a field.
    """
    return any(
        stream in facts.clocks and frame_at(facts.clocks[stream], interval.end_ns) is not None
        for stream in ("depth", "rgb")
    )


@dataclass(frozen=True, slots=True)
class PoseTrack:
    """The poses around a window and the camera that is mounted on the body.

    Attributes
    ----------
    poses
        Poses of the body in the world (ENU), finite.
    camera
        Mounted on the body by ``T_body_camera``.
    """

    poses: PoseSamples
    camera: Camera
    _poses_by_instants: dict[bytes, tuple[Float64, Float64]] = field(
        default_factory=dict, init=False, compare=False, repr=False
    )

    def motion(self, start_ns: int, end_ns: int) -> RigidMotion | None:
        """Return how points move in the camera frame between two instants; None where no pose covers either.

        Parameters
        ----------
        start_ns, end_ns
            Ns from the file's origin.
        """
        return motion_between(*self.ends(start_ns, end_ns), self.camera)

    def motion_into(self, later: "PoseTrack", start_ns: int, end_ns: int) -> RigidMotion | None:
        """Return how points move where this track gives the first pose and another track the second.

        Parameters
        ----------
        later
            Track of the pose at the end.
        start_ns, end_ns
            Ns from the file's origin.

        Returns
        -------
        RigidMotion or None
            In the frame of this track's camera; None where no pose covers an instant.
        """
        return motion_between(self.pose(start_ns), later.pose(end_ns), self.camera)

    def pose(self, time_ns: int) -> Pose:
        """Return R_world_body (3, 3) and position in the world (3,) m at an instant; NaN where no pose covers it."""
        R, positions_m = self.poses_at(np.array([time_ns], dtype=np.int64))
        return R[0], positions_m[0]

    def ends(self, start_ns: int, end_ns: int) -> tuple[Pose, Pose]:
        """Return the poses at two instants.

        Parameters
        ----------
        start_ns, end_ns
            Ns from the file's origin.

        Returns
        -------
        tuple
            Pose at the start and pose at the end; NaN where no pose covers the instant.
        """
        R, positions_m = self.poses_at(np.array([start_ns, end_ns], dtype=np.int64))
        return (R[0], positions_m[0]), (R[1], positions_m[1])

    def poses_at(self, at_ns: NDArray[np.int64]) -> tuple[Float64, Float64]:
        """Return R_world_body (n, 3, 3) and positions (n, 3) m at instants (n,); NaN where no pose covers one.

        They are interpolated once: many conventions are tried at the same instants.
        """
        instants = at_ns.tobytes()
        if instants not in self._poses_by_instants:
            self._poses_by_instants[instants] = poses_at(self.poses, at_ns)
        return self._poses_by_instants[instants]

    def covariance(self, start_ns: int, end_ns: int, position_sigma_m: float, rotation_sigma_rad: float) -> Float64:
        """Return the covariance of the motion's twist under declared pose noise.

        The product of a rotation's noise with the baseline is of second order in the noise; it is added to the noise of
        the position.

        Parameters
        ----------
        start_ns, end_ns
            Ends of the motion, ns from the file's origin.
        position_sigma_m
            Standard deviation of each coordinate of a position, m.
        rotation_sigma_rad
            Standard deviation of a rotation about each axis, rad.

        Returns
        -------
        ndarray of float64
            (6, 6): rotation in rad, translation in m.
        """
        R, positions_m = self.poses_at(np.array([start_ns, end_ns], dtype=np.int64))
        # Poses that are interpolated from the same samples share their noise.
        shared = noise_of_difference(self.poses.times_ns, start_ns=start_ns, end_ns=end_ns)
        position_sigma_m, rotation_sigma_rad = shared * position_sigma_m, shared * rotation_sigma_rad
        baseline_m = float(np.linalg.norm(positions_m[1] - positions_m[0]))
        return motion_covariance(
            R[0], positions_m[0], R[1], positions_m[1], self.camera.T_body_camera,
            position_sigma_m=float(np.hypot(position_sigma_m, rotation_sigma_rad**2 * baseline_m)),
            rotation_sigma_rad=rotation_sigma_rad,
        )  # fmt: skip

    def rounding_twists(
        self, start_ns: int, end_ns: int, position_bounds_m: Float64, quaternion_bounds: Float64
    ) -> Float64:
        """Return the largest effects on the motion of the rounding of each component of both poses.

        A quaternion q that is changed by e turns the body by the vector part of ``2 q^-1 e``, about its own axes: with
        q = (v, w) this is ``2 (w e_v - e_w v - v x e_v)``. The change along q itself is removed when q is normalised.

        Parameters
        ----------
        start_ns, end_ns
            Ends of the motion, ns from the file's origin.
        position_bounds_m, quaternion_bounds
            (3,) and (4,) largest error of each component of a sample, m and without unit.

        Returns
        -------
        ndarray of float64
            (6, 14) twists, rad and m, of independent errors; each has either sign.
        """
        ends_ns = np.array([start_ns, end_ns], dtype=np.int64)
        R, positions_m = self.poses_at(ends_ns)
        by_rotation0, by_rotation1, by_position = motion_derivatives(
            R[0], positions_m[0], R[1], positions_m[1], self.camera.T_body_camera
        )
        gains = interpolation_gains(self.poses.times_ns, at_ns=ends_ns)
        twists = []
        for q, gain, by_rotation in zip(quaternions_from_matrices(R), gains, (by_rotation0, by_rotation1), strict=True):
            turns = 2 * np.hstack((q[3] * np.eye(3) - cross_matrices(q[:3]), -q[:3, None]))
            twists += [gain * by_rotation @ turns * quaternion_bounds, gain * by_position * position_bounds_m]
        return np.hstack(twists)

    def interpolation_twist(self, start_ns: int, end_ns: int) -> Float64:
        """Estimate the error of a motion whose ends lie between pose samples; zero where both ends are samples.

        Interpolation from every second sample multiplies the error by 2^6 (degree 5), so it changes the motion by 63
        times the error. The change is divided by 16 only, since derivatives vary over the stencil.

        Parameters
        ----------
        start_ns, end_ns
            Ends of the motion, ns from the file's origin.

        Returns
        -------
        ndarray of float64
            (6,) bound of the twist, rad and m; infinite where no half of the samples covers the interval.
        """
        exact = self.on_samples(start_ns, end_ns)
        motion = None if exact else self.motion(start_ns, end_ns)
        if motion is None:
            return np.zeros(6)
        changes = []
        for first in (0, 1):
            half = PoseSamples(
                self.poses.times_ns[first::2],
                self.poses.positions_world_m[first::2],
                self.poses.orientations_xyzw[first::2],
            )
            coarse = replace(self, poses=half).motion(start_ns, end_ns)
            if coarse is not None:
                changes.append(np.abs(coarse.twist_from(motion)))
        # An interval that neither half of the samples covers has no error estimate, hence infinity.
        return np.max(changes, axis=0) / 16 if changes else np.full(6, np.inf)

    def on_samples(self, start_ns: int, end_ns: int) -> bool:
        """Whether both instants are timestamps of poses, so that nothing is interpolated.

        Parameters
        ----------
        start_ns, end_ns
            Ns from the file's origin.
        """
        times_ns = self.poses.times_ns
        near = np.searchsorted(times_ns, (start_ns, end_ns))
        return int(near.max()) < len(times_ns) and bool(times_ns[near[0]] == start_ns and times_ns[near[1]] == end_ns)

    def transformed(self, change: Callable[[PoseSamples], PoseSamples]) -> "PoseTrack":
        """Return the track of changed poses."""
        return replace(self, poses=change(self.poses))

    def mounted(self, T_body_camera: Float64) -> "PoseTrack":
        """Return the track with another ``T_body_camera`` (4, 4)."""
        return replace(self, camera=replace(self.camera, T_body_camera=T_body_camera))


def pose_track(window: Window, camera: Camera) -> PoseTrack:
    """Return the poses around the window: they cover the intervals that it owns, and the neighbours of those.

    Parameters
    ----------
    camera
        Mounted on the body.

    Returns
    -------
    PoseTrack
        Finite poses only.
    """
    return PoseTrack(window.derived(_finite_poses), camera)


def _finite_poses(window: Window) -> PoseSamples:
    """Return the finite poses of ``pose_track``."""
    median_ns = max((median_interval_ns(window.facts, stream) for stream in window.facts.flow_streams), default=0)
    # Neighbouring intervals are tried as well: one length for the interval itself, one for the neighbour.
    poses = window.pose(2 * min(median_ns, NS_PER_S) + _POSE_MARGIN_NS)
    finite = np.isfinite(poses.positions_world_m).all(axis=1) & np.isfinite(poses.orientations_xyzw).all(axis=1)
    if finite.all():
        return poses
    return PoseSamples(poses.times_ns[finite], poses.positions_world_m[finite], poses.orientations_xyzw[finite])


def poses_at(poses: PoseSamples, at_ns: NDArray[np.int64]) -> tuple[Float64, Float64]:
    """Return R_world_body (n, 3, 3) and positions (n, 3) m at instants (n,); NaN where no pose covers one."""
    return interpolate_poses(poses.times_ns, poses.positions_world_m, poses.orientations_xyzw, at_ns=at_ns)


def motion_between(before: Pose, after: Pose, camera: Camera) -> RigidMotion | None:
    """Return how points move in a camera between two poses of the body; None where either is NaN.

    Parameters
    ----------
    before, after
        R_world_body (3, 3) and position in the world (3,), m.
    camera
        Mounted on the body by ``T_body_camera``.

    Returns
    -------
    RigidMotion or None
        Of points in the camera frame (Z forward, X right, Y down), from before to after.
    """
    if not all(np.all(np.isfinite(values)) for values in (*before, *after)):
        return None
    return camera_motion(*before, *after, camera.T_body_camera)


def median_interval_ns(facts: Facts, stream: str) -> int:
    """Return the median length of a stream's intervals, ns; 0 where it has none.

    The median is not affected by a few broken intervals.

    Parameters
    ----------
    facts
        With the clock of the stream.
    stream
        ``flow/<rate>hz``.

    Returns
    -------
    int
        Ns, 0 at least.
    """
    clock = facts.clocks[stream]
    if clock.ends_ns is None or not len(clock.times_ns):
        return 0
    return max(int(np.median(clock.ends_ns - clock.times_ns)), 0)


def place(facts: Facts, intervals: tuple[Interval, Interval], frame: int | None = None,
          pixel: tuple[int, int] | None = None, tile: tuple[int, int, int, int] | None = None) -> Where:  # fmt: skip
    """Return where the fields from the first to the last interval (both included) lie in the file.

    Parameters
    ----------
    facts
        Converts times to microseconds of the file.
    intervals
        The first and the last one, of one stream.
    frame
        Row of the frame at the start.
    pixel
        Column and row, px.
    tile
        Left, top, right, bottom, px, half-open.

    Returns
    -------
    Where
        Rows and times from the start of the first interval to the end of the last.
    """
    first, last = intervals
    return Where(
        stream=first.stream,
        start_us=facts.to_file_us(first.start_ns),
        stop_us=facts.to_file_us(last.end_ns),
        index_start=first.row,
        index_stop=last.row + 1,
        frame=frame,
        pixel=pixel,
        tile=tile,
    )


def motion_over(window: Window, interval: Interval) -> RigidMotion | None:
    """Return how points move over an interval in the depth camera; None where no pose covers it.

    Flow lies on the grid of that camera. Poses at all ends of the window's intervals, and ``DELAY_NS`` before and after
    them, are interpolated at once.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the motion.
    interval
        Start and end, ns from the file's origin.

    Returns
    -------
    RigidMotion or None
        Of points in the camera frame (Z forward, X right, Y down).
    """
    return window.derived(_motion_over, interval.start_ns, interval.end_ns)


def _motion_over(window: Window, start_ns: int, end_ns: int) -> RigidMotion | None:
    track = pose_track(window, window.facts.declared.cameras["depth"])
    poses = window.derived(_poses_at_ends)
    before, after = poses.get(start_ns), poses.get(end_ns)
    if before is None or after is None:
        return track.motion(start_ns, end_ns)
    return camera_motion(*before, *after, track.camera.T_body_camera)


def _poses_at_ends(window: Window) -> Mapping[int, Pose]:
    """Return the poses by their instants, those that are finite."""
    intervals = [interval for stream in window.facts.flow_streams for interval in owned_intervals(window, stream)]
    ends_ns = np.array([(interval.start_ns, interval.end_ns) for interval in intervals], dtype=np.int64).ravel()
    # ``tile_templates`` differentiates the motion by central differences, so each end is needed three times.
    instants_ns = np.unique(np.concatenate((ends_ns, ends_ns - DELAY_NS, ends_ns + DELAY_NS)))
    R, positions_m = poses_at(window.derived(_finite_poses), instants_ns)
    finite = np.isfinite(R).all(axis=(1, 2)) & np.isfinite(positions_m).all(axis=1)
    return {int(instants_ns[i]): (R[i], positions_m[i]) for i in np.flatnonzero(finite)}


def pose_of_frame(window: Window, track: PoseTrack, stream: str, frame: int) -> Pose:
    """Return the pose of the body at a frame of a stream.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the poses of its frames.
    track
        Poses of the body.
    stream
        Stream of the frame.
    frame
        Row of the frame in the file.

    Returns
    -------
    R_world_body, position_world_m
        (3, 3) and (3,); NaN where no poses cover the frame.
    """
    # Poses of all frames of the window, and of the one before, are interpolated together: each by itself takes many
    # times as long. They are of the body, and so the same for all cameras.
    owned, times_ns = window.owned(stream), window.facts.clocks[stream].times_ns
    first = max(owned.start - 1, 0)
    if not first <= frame < owned.stop:
        return track.pose(int(times_ns[frame]))
    at_ns = times_ns[first : owned.stop]
    R_world_body, positions_world_m = window.derived(_poses_at, at_ns.tobytes())
    return R_world_body[frame - first], positions_world_m[frame - first]


def _poses_at(window: Window, instants_ns: bytes) -> tuple[Float64, Float64]:
    return poses_at(window.derived(_finite_poses), np.frombuffer(instants_ns, np.int64))
