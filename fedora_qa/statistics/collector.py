"""Collect statistics window by window, beside the checks, in the same pass."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from fedora_qa.causes import in_families
from fedora_qa.conventions import NS_PER_S
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.record.types import Scalar
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.statistics.moments import (
    ValueMoments,
    added,
    readable_samples,
    sampled_depth_m,
    sampled_luma_dn,
    sampled_speeds_px,
)
from fedora_qa.statistics.trajectory import CurveMotion, rotation, translation

Statistics = Mapping[str, Mapping[str, Scalar]]

_DURATION_FROM = ("pose", "rgb", "depth", "imu")
"""The duration of a sequence is that of the first of these streams that it has."""


@dataclass(frozen=True, slots=True)
class WindowStatistics:
    """Statistics of one window. Poses are kept unchanged, because they are smoothed over the whole sequence.

    Attributes
    ----------
    poses
        Number of poses whose timestamp advances; the arrays hold the finite ones of these.
    pose_times_ns
        (n,) ns from the file's origin.
    positions_world_m
        (n, 3) m in the world.
    orientations_xyzw
        (n, 4) quaternions, body to world.
    events, brighter_events
        Number of events, and of those with polarity 1; 0 where they cannot be decoded.
    speeds_px
        Lengths of flow vectors by stream, px.
    depth_m
        Valid depths, m.
    disparity_per_m
        Inverse depths, 1/m.
    luma_dn
        Luma of the stored codes, DN.
    """

    poses: int = 0
    pose_times_ns: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    positions_world_m: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 3)))
    orientations_xyzw: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 4)))
    events: int = 0
    brighter_events: int = 0
    speeds_px: Mapping[str, ValueMoments] = field(default_factory=dict)
    depth_m: ValueMoments = field(default_factory=ValueMoments)
    disparity_per_m: ValueMoments = field(default_factory=ValueMoments)
    luma_dn: ValueMoments = field(default_factory=ValueMoments)


class StatisticsCollector:
    """The paper's sequence table (T, D, v max, w max, mean event rate) and flow table, and more.

    Images, depth and flow are sampled at every fourth column and row, in every frame of the given windows. Small images
    are used whole; large images are sampled less densely unless the effort requires all pixels. Rows that cannot be
    decoded are left out; the check ``integrity.readable`` names them. Of streams outside of ``families`` (``flow`` is
    every rate; None: all) only the timestamps count, and nothing is decoded.
    """

    name = "statistics"

    def __init__(self, families: frozenset[str] | None = None) -> None:
        self._families = families

    def start(self, facts: Facts) -> list[WindowStatistics]:
        """Return the state of no windows."""
        return []

    def update(self, state: list[WindowStatistics], window: Window) -> None:
        """Add the statistics of a window. Windows come in the order of time.

        Parameters
        ----------
        state
            Changed in place.
        window
            Decoded by the plan.
        """
        streams = self._streams(window.facts)
        depths_m = list(readable_samples(window, "depth", sampled_depth_m, families=self._families))
        rows = window.owned("events") if "events" in streams else range(0)
        events = brighter = 0
        if rows:
            with suppress(UnreadableRowsError):
                brighter = int(np.count_nonzero(window.rows("path/events/p", rows.start, rows.stop)))
                events = len(rows)
        speeds_px = {}
        for stream in window.facts.flow_streams:
            speeds = readable_samples(window, stream, sampled_speeds_px, stream, families=self._families)
            speeds_px[stream] = added(ValueMoments.of(speed) for speed in speeds)
        depth_moments = added(ValueMoments.of(depth, positive=True) for depth in depths_m)
        with np.errstate(divide="ignore"):
            # 1 / depth, 1/m, as the paper has it; a depth of 0 gives infinity, which does not count.
            disparities = added(ValueMoments.of(np.float32(1) / depth, positive=True) for depth in depths_m)
        lumas_dn = readable_samples(window, "rgb", sampled_luma_dn, families=self._families)
        state.append(
            replace(
                _poses(window) if "pose" in streams else WindowStatistics(),
                events=events,
                brighter_events=brighter,
                speeds_px=speeds_px,
                depth_m=depth_moments,
                disparity_per_m=disparities,
                luma_dn=added(ValueMoments.of(luma_dn) for luma_dn in lumas_dn),
            )
        )

    def _streams(self, facts: Facts) -> frozenset[str]:
        """Return the streams that are decoded."""
        return frozenset(stream for stream in facts.streams if in_families(stream, self._families))

    def merge(self, state: list[WindowStatistics], later: list[WindowStatistics]) -> list[WindowStatistics]:
        """Return the state of the windows of both."""
        return state + later

    def conclude(self, state: Sequence[WindowStatistics], facts: Facts) -> Statistics:
        """Return the statistics by group and name; units are the ends of the names.

        Distance and speeds are None where not every pose was read, or there are too few.
        """
        groups: dict[str, Mapping[str, Scalar]] = {"sequence": _sequence(state, facts), "motion": _motion(state, facts)}
        streams = self._streams(facts)
        if "events" in streams:
            events = sum(window.events for window in state)
            brighter = sum(window.brighter_events for window in state)
            groups["events"] = {
                "count": facts.events.count if facts.events else None,
                "seen": events,
                "brighter_share": brighter / events if events else None,
                "darker_share": (events - brighter) / events if events else None,
            }
        for stream in (stream for stream in facts.flow_streams if stream in streams):
            speed_px = added(window.speeds_px[stream] for window in state)
            groups[stream] = {
                "mean_px": speed_px.mean,
                "variance_px2": speed_px.variance,
                "max_px": speed_px.greatest if speed_px.count else None,
                "valid_share": speed_px.valid_share,
                "pixels": speed_px.count,
            }
        if "depth" in streams:
            depth_m = added(window.depth_m for window in state)
            groups["depth"] = {
                "min_m": depth_m.least if depth_m.count else None,
                "max_m": depth_m.greatest if depth_m.count else None,
                "mean_m": depth_m.mean,
                "disparity_mean_per_m": added(window.disparity_per_m for window in state).mean,
                "valid_share": depth_m.valid_share,
            }
        if "rgb" in streams:
            groups["rgb"] = {"brightness_mean_dn": added(window.luma_dn for window in state).mean}
        if facts.declared.cameras:
            # The declared size of each camera's images.
            cameras = sorted(facts.declared.cameras.items())
            groups["cameras"] = {
                f"{name}_{side}_px": getattr(camera, side) for name, camera in cameras for side in ("width", "height")
            }
        rates_hz: dict[str, Scalar] = {}
        for stream, clock in sorted(facts.clocks.items()):
            span_ns = int(clock.times_ns.max() - clock.times_ns.min()) if len(clock.times_ns) > 1 else 0
            # n samples span n - 1 periods.
            rates_hz[f"{stream}_hz"] = (len(clock.times_ns) - 1) * NS_PER_S / span_ns if span_ns > 0 else None
        groups["rates"] = rates_hz
        return groups


def _poses(window: Window) -> WindowStatistics:
    """Return the window's own finite poses with advancing timestamps; nothing where they cannot be decoded."""
    clock, rows = window.facts.clocks.get("pose"), window.owned("pose")
    if clock is None or not rows:
        return WindowStatistics()
    try:
        positions = window.rows("path/pose/position", rows.start, rows.stop)
        orientations = window.rows("path/pose/orientation", rows.start, rows.stop)
    except UnreadableRowsError:
        return WindowStatistics()
    advancing = clock.advancing[rows.start : rows.stop]
    lengths = np.linalg.norm(orientations, axis=1)
    usable = advancing & np.all(np.isfinite(positions), axis=1) & np.isfinite(lengths) & (lengths > 0)
    return WindowStatistics(
        poses=int(np.count_nonzero(advancing)),
        pose_times_ns=clock.times_ns[rows.start : rows.stop][usable],
        positions_world_m=positions[usable],
        orientations_xyzw=orientations[usable],
    )


def _sequence(state: Sequence[WindowStatistics], facts: Facts) -> dict[str, Scalar]:
    stream: str | None = None
    duration_s: float | None = None
    for candidate in _DURATION_FROM:
        clock = facts.clocks.get(candidate)
        if clock is not None and clock.usable and len(clock.times_ns) > 1:
            stream, duration_s = candidate, int(clock.times_ns.max() - clock.times_ns.min()) / NS_PER_S
            break
    else:
        if facts.events is not None and facts.events.last_ns > facts.events.first_ns:
            stream, duration_s = "events", (facts.events.last_ns - facts.events.first_ns) / NS_PER_S
    count = facts.events.count if facts.events else None
    # All events of the file by its scan, over its whole duration, whichever windows were decoded.
    rate = count / duration_s if count is not None and duration_s else None
    return {
        "duration_s": duration_s,
        "duration_of": stream,
        "event_rate_mean_per_s": rate,
        "windows": len(state),
    }


def _motion(state: Sequence[WindowStatistics], facts: Facts) -> dict[str, Scalar]:
    poses = sum(window.poses for window in state)
    clock = facts.clocks.get("pose")
    # Where poses are missing the path would be cut short, and distance and speeds would come out too small.
    complete = clock is not None and poses == int(np.count_nonzero(clock.advancing))
    path = turning = None
    if complete and poses:
        times_ns = np.concatenate([window.pose_times_ns for window in state])
        times_s = (times_ns - times_ns[:1]) / NS_PER_S
        path = translation(times_s, np.concatenate([window.positions_world_m for window in state]))
        turning = rotation(times_s, np.concatenate([window.orientations_xyzw for window in state]))
    return {
        **_moved("distance", "m", "speed_max", "m_s", path),
        **_moved("angle", "rad", "angular_speed_max", "rad_s", turning),
        "position_noise_m": path.noise if path else None,
        "rotation_noise_rad": turning.noise if turning else None,
        "position_knot_spacing_s": path.knot_spacing_s if path else None,
        "rotation_knot_spacing_s": turning.knot_spacing_s if turning else None,
        "poses_seen": poses,
    }


def _moved(length: str, unit: str, speed: str, speed_unit: str, motion: CurveMotion | None) -> dict[str, Scalar]:
    estimates = {(length, unit): motion.length, (speed, speed_unit): motion.speed_max} if motion else {}
    values: dict[str, Scalar] = {}
    for name in ((length, unit), (speed, speed_unit)):
        estimate = estimates.get(name)
        values["_".join(name)] = estimate.value if estimate else None
        values[f"{name[0]}_standard_error_{name[1]}"] = estimate.standard_error if estimate else None
    return values
