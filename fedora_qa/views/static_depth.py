"""What of a depth frame stands, where objects move by themselves: only that follows from the camera's motion."""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window


def why_not_told_apart(facts: Facts) -> str:
    """Say why what moves by itself cannot be left out; empty where it can, or where nothing does."""
    if facts.declared.flow_model != "scene" or masked_flows(facts):
        return ""
    return "objects move on their own (flow model 'scene'), and no mask says which"


def masked_flows(facts: Facts) -> tuple[str, ...]:
    """Return the flow streams that say which of their pixels move by themselves, the fastest first."""
    masked = (stream for stream in facts.flow_streams if f"path/{stream}_moving" in facts.sizes)
    return tuple(masked)[::-1]


def is_told_apart(window: Window, frame: int) -> bool:
    """Whether it is known what of a depth frame stands, without decoding anything: ``standing_depth_m`` is not None."""
    if window.facts.declared.flow_model != "scene":
        return True
    clocks, time_ns = window.facts.clocks, int(window.facts.clocks["depth"].times_ns[frame])
    return any(bool(np.any(clocks[stream].times_ns == time_ns)) for stream in masked_flows(window.facts))


def standing_depth_m(window: Window, frame: int) -> NDArray[np.float32] | None:
    """Return a depth frame, (H, W) in metres, with NaN where an object moves by itself.

    Which pixels do, the masks of flow say, each at its field's start; None where no such field starts with the frame.
    """
    if window.facts.declared.flow_model != "scene":
        return window.depth_m(frame)
    return window.once(("standing depth", frame), lambda: _standing(window, frame))


def _standing(window: Window, frame: int) -> NDArray[np.float32] | None:
    time_ns = int(window.facts.clocks["depth"].times_ns[frame])
    for stream in masked_flows(window.facts):
        fields = np.flatnonzero(window.facts.clocks[stream].times_ns == time_ns)
        moving = window.moving(stream, int(fields[0])) if len(fields) else None
        if moving is not None:
            return np.where(moving, np.float32(np.nan), window.depth_m(frame))
    return None
