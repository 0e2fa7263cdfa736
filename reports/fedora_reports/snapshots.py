"""Snapshots: pictures of all streams at one time, along the sequence or at the worst place of a finding."""

from dataclasses import dataclass

import numpy as np

from fedora_qa.record.evidence import AFTER_UNDOING, BEFORE_UNDOING, BESIDE, MOMENTS, PLACES, TRIALS, named
from fedora_reports.evidence import Array, Evidence

_LEAST_SIDE = 0.06
"""Least side of a box as a share of the picture: a box of a single pixel would be invisible."""

_SHAPES: dict[str, tuple[int | None, ...]] = {
    "rgb": (None, None, 3),
    "rgb_times_us": (),
    "depth_m": (None, None),
    "flow_px": (None, None, 2),
    "flow_interval_us": (2,),
    "residual_dn": (None, None),
    "brighter": (None, None),
    "darker": (None, None),
    "events_interval_us": (2,),
}
"""Shapes of the arrays of one snapshot; None: any length but 0."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Pictures of the streams at one time; a missing stream is None.

    Attributes
    ----------
    time_us
        On the file's own clock.
    rgb
        (h, w, 3) uint8, as stored; ``rgb_known`` is False where there was no frame.
    depth_m
        (h, w), NaN where there is none.
    flow_px
        (h, w, 2) in px of the stored image over ``flow_interval_us``.
    residual_dn
        (h, w), the difference of the frames at both ends of the flow's interval that the flow leaves; NaN where it is
        unknown.
    brighter, darker
        (h, w), events within ``events_interval_us``; ``events_known`` is False where none could be read.
    box
        Left, top, right, bottom of the worst place as shares of the picture.
    worst
        True for the worst place of a finding, False for the frames beside it and for snapshots along the sequence.
    """

    time_us: float | None
    rgb: Array | None
    depth_m: Array | None
    flow_px: Array | None
    flow_interval_us: Array | None
    residual_dn: Array | None
    brighter: Array | None
    darker: Array | None
    events_interval_us: Array | None
    rgb_known: bool = True
    events_known: bool = True
    box: tuple[float, float, float, float] | None = None
    worst: bool = False

    @property
    def flow_interval_s(self) -> float:
        """Length of the flow's interval; 1 where it is unknown or not positive."""
        if self.flow_interval_us is None:
            return 1.0
        length_s = float(self.flow_interval_us[1] - self.flow_interval_us[0]) / 1e6
        return length_s if np.isfinite(length_s) and length_s > 0 else 1.0


def snapshots_of(evidence: Evidence) -> tuple[Snapshot, ...]:
    """Return the snapshots along the sequence, in the order of their arrays."""
    times_us = evidence.numbers(named(MOMENTS, "times_us"), None)
    if times_us is None:
        return ()
    stacks = {name: evidence.numbers(named(MOMENTS, name), len(times_us), *shape) for name, shape in _SHAPES.items()}
    snapshots = []
    for k, time_us in enumerate(times_us):
        arrays = {name: None if stack is None else stack[k] for name, stack in stacks.items()}
        snapshots.append(_snapshot(float(time_us), arrays))
    return tuple(snapshots)


def worst_location_of(evidence: Evidence, finding: str) -> tuple[Snapshot, ...]:
    """Return the snapshot at the worst place of a finding with those of the frames beside it, in the order of time.

    Returns
    -------
    tuple of Snapshot
        Empty where no picture of the place was kept.
    """
    box = None
    edges = evidence.numbers(named(PLACES, finding, "box"), 4)
    # A box of the whole picture marks no place in it.
    if edges is not None and np.isfinite(edges).all():
        left, top, right, bottom = (float(edge) for edge in np.clip(edges, 0.0, 1.0))
        if (left, top, right, bottom) != (0.0, 0.0, 1.0, 1.0):
            (left, right), (top, bottom) = _visible(left, right), _visible(top, bottom)
            box = (left, top, right, bottom)
    worst = _snapshot_at(evidence, named(PLACES, finding), box, worst=True)
    if worst is None:
        return ()
    steps = [(0, worst)]
    for name, step in BESIDE.items():
        beside = _snapshot_at(evidence, named(PLACES, finding, name), worst.box)
        if beside is not None:
            steps.append((step, beside))
    return tuple(snapshot for _, snapshot in sorted(steps, key=lambda pair: pair[0]))


def trial_snapshots_of(evidence: Evidence, diagnosis: str) -> tuple[Snapshot, Snapshot] | None:
    """Return the snapshots before and after the fault of a diagnosis was undone; None where they were not kept."""
    before, after = (_snapshot_at(evidence, named(TRIALS, diagnosis, when)) for when in (BEFORE_UNDOING, AFTER_UNDOING))
    return None if before is None or after is None else (before, after)


def _snapshot_at(
    evidence: Evidence, group: str, box: tuple[float, float, float, float] | None = None, *, worst: bool = False
) -> Snapshot | None:
    """Return the snapshot of a group of arrays; None where no picture was kept."""
    arrays = {name: evidence.numbers(named(group, name), *shape) for name, shape in _SHAPES.items()}
    time_us = evidence.numbers(named(group, "times_us"))
    snapshot = _snapshot(None if time_us is None else float(time_us), arrays, box, worst=worst)
    pictures = (snapshot.rgb, snapshot.depth_m, snapshot.flow_px, snapshot.brighter)
    return snapshot if any(picture is not None for picture in pictures) else None


def _snapshot(
    time_us: float | None,
    arrays: dict[str, Array | None],
    box: tuple[float, float, float, float] | None = None,
    *,
    worst: bool = False,
) -> Snapshot:
    rgb, brighter, darker = arrays["rgb"], arrays["brighter"], arrays["darker"]
    if rgb is not None and rgb.dtype != np.uint8:
        rgb = None
    frame_time_us = arrays["rgb_times_us"]
    if brighter is None or darker is None or brighter.shape != darker.shape:
        brighter = darker = None
    return Snapshot(
        time_us=time_us if time_us is not None and np.isfinite(time_us) else None,
        rgb=rgb,
        depth_m=arrays["depth_m"],
        flow_px=arrays["flow_px"],
        flow_interval_us=_interval(arrays["flow_interval_us"]),
        residual_dn=arrays["residual_dn"],
        brighter=brighter,
        darker=darker,
        events_interval_us=_interval(arrays["events_interval_us"]),
        rgb_known=frame_time_us is None or bool(np.isfinite(frame_time_us)),
        events_known=arrays["events_interval_us"] is None or _interval(arrays["events_interval_us"]) is not None,
        box=box,
        worst=worst,
    )


def _interval(interval_us: Array | None) -> Array | None:
    if interval_us is None or not np.isfinite(interval_us).all():
        return None
    # The difference of unsigned or short integers may overflow.
    return interval_us.astype(np.float64)


def _visible(start: float, stop: float) -> tuple[float, float]:
    """Widen a side of a box that is too short to be visible, within the picture."""
    if stop - start >= _LEAST_SIDE:
        return start, stop
    begin = min(max((start + stop - _LEAST_SIDE) / 2, 0.0), 1.0 - _LEAST_SIDE)
    return begin, begin + _LEAST_SIDE
