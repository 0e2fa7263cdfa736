"""The static part of a depth frame, where objects move by themselves: only that follows from the camera's motion."""

import numpy as np
from numpy.typing import NDArray

from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window


def why_no_static_depth(facts: Facts) -> str:
    """Return why moving objects cannot be left out; empty where they can, or where no object moves by itself."""
    if facts.declared.flow_model != "scene" or masked_flows(facts):
        return ""
    return "objects move (flow model 'scene'), and no mask marks their pixels"


def masked_flows(facts: Facts) -> tuple[str, ...]:
    """Return the flow streams that have masks of objects that move by themselves, the fastest first."""
    masked = (stream for stream in facts.flow_streams if f"path/{stream}_moving" in facts.sizes)
    return tuple(masked)[::-1]


def has_static_depth(window: Window, frame: int) -> bool:
    """Whether ``static_depth_m`` is not None, without decoding an image; a mask may still be missing.

    Parameters
    ----------
    window
        A window of the sequence.
    frame
        Row of the depth stream.
    """
    if window.facts.declared.flow_model != "scene":
        return True
    clocks, time_ns = window.facts.clocks, int(window.facts.clocks["depth"].times_ns[frame])
    return any(bool(np.any(clocks[stream].times_ns == time_ns)) for stream in masked_flows(window.facts))


def static_depth_m(window: Window, frame: int) -> NDArray[np.float32] | None:
    """Return a depth frame with NaN where an object moves by itself.

    The masks of flow mark these pixels at the start of each field.

    Parameters
    ----------
    window
        A window of the sequence. It keeps the image.
    frame
        Row of the depth stream.

    Returns
    -------
    ndarray of float32 or None
        (H, W) m; None where objects may move by themselves and no masked field starts with the frame.
    """
    if window.facts.declared.flow_model != "scene":
        return window.depth_m(frame)
    return window.derived(_standing_depth_m, frame)


def _standing_depth_m(window: Window, frame: int) -> NDArray[np.float32] | None:
    time_ns = int(window.facts.clocks["depth"].times_ns[frame])
    for stream in masked_flows(window.facts):
        fields = np.flatnonzero(window.facts.clocks[stream].times_ns == time_ns)
        moving = window.moving(stream, int(fields[0])) if len(fields) else None
        if moving is not None:
            return np.where(moving, np.float32(np.nan), window.depth_m(frame))
    return None
