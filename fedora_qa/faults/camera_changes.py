"""What changes declared cameras, or the flow that was made with them: shared by the faults of cameras.

Flow of a wrong camera is undone by the difference of two flows made from the depth and the poses of the file, with the
wrong and the declared camera, so that noise of the poses cancels to first order.
"""

from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.faults.fault import Fault, InapplicableError, Read, streams_in
from fedora_qa.geometry.camera import camera_motion
from fedora_qa.geometry.motion import STENCIL, interpolate_poses
from fedora_qa.geometry.rigid_flow import rigid_flow
from fedora_qa.sequence.declared import Camera
from fedora_qa.sequence.facts import Clock, Facts
from fedora_qa.sequence.sequence import SequenceRows

Float64 = NDArray[np.float64]
Change = Callable[[Camera], Camera]


def planted(
    facts: Facts, sequence: SequenceRows, stream: str, description: str, wrong: Change, camera: str | None = None
) -> Fault:
    """Return what plants a fault: in declared cameras, or in the flow that was made with them."""
    if stream == "metadata":
        return declared(facts, description, wrong, camera)
    return remade(facts, sequence, stream, description, wrong, sign=1)


def removed(
    facts: Facts,
    sequence: SequenceRows,
    stream: str,
    description: str,
    wrong: Change,
    correct: Change,
    camera: str | None = None,
) -> Fault:
    """Return what undoes a fault: declared cameras are corrected, and flow loses the share of the wrong camera."""
    if stream == "metadata":
        return declared(facts, description, correct, camera)
    return remade(facts, sequence, stream, description, wrong, sign=-1)


def declared(facts: Facts, description: str, change: Change, only: str | None) -> Fault:
    """Return the fault that changes a declared camera, or all of them."""
    cameras = facts.declared.cameras
    if not cameras or (only is not None and only not in cameras):
        raise InapplicableError(f"Expected a declared camera{f' {only}' if only else ''}, got none")
    changed = {name: change(camera) if only in (None, name) else camera for name, camera in cameras.items()}
    return Fault(description, declared=replace(facts.declared, cameras=changed))


def declared_each(
    facts: Facts, description: str, names: Collection[str], change: Callable[[str, Camera], Camera]
) -> Fault:
    """Return the fault that changes some declared cameras, each by its name."""
    cameras = facts.declared.cameras
    if not names or not cameras.keys() >= set(names):
        raise InapplicableError(f"Expected declared cameras {', '.join(names)}, got fewer")
    changed = {name: change(name, camera) if name in names else camera for name, camera in cameras.items()}
    return Fault(description, declared=replace(facts.declared, cameras=changed))


def remade(facts: Facts, sequence: SequenceRows, stream: str, description: str, wrong: Change, *, sign: int) -> Fault:
    """Return the fault that adds to flow the difference between the flow of the wrong camera and of the declared one.

    Fields whose interval does not begin with a depth frame, or is not covered by poses, stay.
    """
    for needed in ("depth", "pose"):
        streams_in(facts, needed)
    camera = facts.declared.cameras.get("depth")
    if camera is None:
        raise InapplicableError("Expected a declared depth camera, got none: its intrinsics are needed")
    rows = {}
    for name in streams_in(facts, stream):

        def alter(read: Read, start: int, stop: int, clock: Clock = facts.clocks[name]) -> NDArray[Any]:
            fields = read(start, stop)
            # Other readers may share the fields that were read.
            altered = fields.copy()
            for place, row in enumerate(range(start, stop)):
                error_px = _camera_error_px(facts, sequence, clock, row, camera, wrong(camera))
                if error_px is not None:
                    altered[place] = fields[place] + sign * error_px
            return altered

        rows[f"path/{name}"] = alter
    return Fault(description, rows)


def _camera_error_px(
    facts: Facts, sequence: SequenceRows, clock: Clock, row: int, camera: Camera, wrong: Camera
) -> Float64 | None:
    """Return flow (H, W, 2) of the wrong camera less that of the declared one, px; None where it cannot be made."""
    assert clock.ends_ns is not None  # flow has intervals
    interval_ns = np.array([clock.times_ns[row], clock.ends_ns[row]])
    frame = int(np.argmax(facts.clocks["depth"].times_ns == interval_ns[0]))
    poses = facts.clocks["pose"]
    if facts.clocks["depth"].times_ns[frame] != interval_ns[0]:
        return None
    pose_rows = np.flatnonzero(poses.advancing)
    places = np.searchsorted(poses.times_ns[pose_rows], interval_ns)
    chosen = pose_rows[max(int(places[0]) - STENCIL, 0) : int(places[1]) + STENCIL + 1]
    if not len(chosen):
        return None
    first, stop = int(chosen[0]), int(chosen[-1]) + 1
    positions_m, q = (sequence.rows(f"path/pose/{name}", first, stop)[chosen - first]
                      for name in ("position", "orientation"))  # fmt: skip
    R, position_m = interpolate_poses(poses.times_ns[chosen], positions_m, q, at_ns=interval_ns)
    if not (np.all(np.isfinite(R)) and np.all(np.isfinite(position_m))):
        return None
    depth_m = sequence.rows("path/depth", frame, frame + 1)[0].astype(np.float64) / MM_PER_M
    height, width = depth_m.shape
    columns, lines = np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)[:, np.newaxis]
    wrong_px, declared_px = (
        rigid_flow(
            each.K,
            camera_motion(R[0], position_m[0], R[1], position_m[1], each.T_body_camera),
            columns,
            lines,
            depth_m,
            each.lens,
        )
        for each in (wrong, camera)
    )
    # A point that lies behind the wrong camera only has no flow there: its value in the file stays.
    error_px: Float64 = np.nan_to_num(wrong_px - declared_px, nan=0.0, posinf=0.0, neginf=0.0)
    return error_px
