"""What the streams show at one instant, as the evidence keeps it: a moment, or the worst place of a finding."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.record.evidence import BESIDE, MOMENTS, PLACES, named
from fedora_reports.evidence import Evidence

Array = NDArray[Any]

_LEAST_SIDE = 0.06
"""Shares of the picture: a single pixel would be too small a box to see."""


@dataclass(frozen=True, slots=True)
class Instant:
    """Pictures of the streams at one instant; a stream that is not there is None.

    Attributes
    ----------
    time_us
        On the file's own clock.
    rgb
        (h, w, 3) uint8, as stored; ``rgb_known`` tells whether there was a frame.
    depth_m
        (h, w), NaN where there is none.
    flow_px
        (h, w, 2) in px of the stored image over ``flow_interval_us``.
    residual_dn
        (h, w), what the flow leaves between the frames at both ends of its interval; NaN where that is unknown.
    brighter, darker
        (h, w), events within ``events_interval_us``; ``events_known`` tells whether any could be read.
    box
        Left, top, right, bottom of the worst place as shares of the picture.
    worst
        Whether this is the worst place of a finding, and not beside it or anywhere.
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
        """Length of the flow's interval; 1 where it is not known, or not positive."""
        if self.flow_interval_us is None:
            return 1.0
        length_s = float(self.flow_interval_us[1] - self.flow_interval_us[0]) / 1e6
        return length_s if np.isfinite(length_s) and length_s > 0 else 1.0


def moments_of(evidence: Evidence) -> tuple[Instant, ...]:
    """Return the moments along the sequence, in the order in which they are kept."""
    times_us = evidence.numbers(named(MOMENTS, "times_us"), None)
    if times_us is None:
        return ()
    kept = {name: _stack(evidence, name, len(times_us)) for name in _SHAPES}
    return tuple(_instant(float(time_us), {name: _at(kept[name], k) for name in kept})
                 for k, time_us in enumerate(times_us))  # fmt: skip


def places_of(evidence: Evidence, finding: str) -> tuple[Instant, ...]:
    """Return the worst place of a finding and what was kept beside it, in time; nothing where no picture was kept."""
    own = _place(evidence, _box(evidence, finding), finding)
    if own is None:
        return ()
    beside = {name: _place(evidence, own.box, finding, name) for name in BESIDE}
    both = [(step, beside[name]) for name, step in BESIDE.items()]
    return tuple(instant for _, instant in sorted([(0, own), *both], key=lambda pair: pair[0]) if instant is not None)


def _place(evidence: Evidence, box: tuple[float, float, float, float] | None, *path: str) -> Instant | None:
    """Return what is kept at a place, or beside it; None where no picture is."""
    arrays = {name: evidence.numbers(named(PLACES, *path, name), *shape) for name, shape in _SHAPES.items()}
    time_us = evidence.numbers(named(PLACES, *path, "times_us"))
    instant = _instant(None if time_us is None else float(time_us), arrays, box, worst=len(path) == 1)
    pictures = (instant.rgb, instant.depth_m, instant.flow_px, instant.brighter)
    return instant if any(picture is not None for picture in pictures) else None


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


def _stack(evidence: Evidence, name: str, count: int) -> Array | None:
    return evidence.numbers(named(MOMENTS, name), count, *_SHAPES[name])


def _at(stack: Array | None, k: int) -> Array | None:
    return None if stack is None else stack[k]


def _instant(
    time_us: float | None,
    arrays: dict[str, Array | None],
    box: tuple[float, float, float, float] | None = None,
    *,
    worst: bool = False,
) -> Instant:
    rgb, brighter, darker = arrays["rgb"], arrays["brighter"], arrays["darker"]
    if rgb is not None and rgb.dtype != np.uint8:
        rgb = None
    frame_time_us = arrays["rgb_times_us"]
    if brighter is None or darker is None or brighter.shape != darker.shape:
        brighter = darker = None
    return Instant(
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
    return interval_us if interval_us is not None and bool(np.isfinite(interval_us).all()) else None


def _box(evidence: Evidence, finding: str) -> tuple[float, float, float, float] | None:
    """Return the box where it tells something: finite, and not the whole picture."""
    box = evidence.numbers(named(PLACES, finding, "box"), 4)
    if box is None or not np.isfinite(box).all():
        return None
    left, top, right, bottom = (float(edge) for edge in np.clip(box, 0.0, 1.0))
    if (left, top, right, bottom) == (0.0, 0.0, 1.0, 1.0):
        return None
    (left, right), (top, bottom) = _visible(left, right), _visible(top, bottom)
    return left, top, right, bottom


def _visible(start: float, stop: float) -> tuple[float, float]:
    """Widen a side of a box that would be too short to see, within the picture."""
    if stop - start >= _LEAST_SIDE:
        return start, stop
    begin = min(max((start + stop - _LEAST_SIDE) / 2, 0.0), 1.0 - _LEAST_SIDE)
    return begin, begin + _LEAST_SIDE
