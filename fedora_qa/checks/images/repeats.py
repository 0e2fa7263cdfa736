"""Frames against each other: repeats."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.protocol import Notice, Observation, Statistic, Suspect, WindowCheck
from fedora_qa.estimators.images.digest import digest_of
from fedora_qa.estimators.images.values import is_of_one_code
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.image_motion import (
    View,
    is_elsewhere,
    moved_by_events,
    must_have_changed,
    surely_turned,
    view_of,
)

FEWEST_FRAMES: Final = 2


@dataclass(frozen=True, slots=True)
class FrameDigest:
    """What is kept of a frame.

    Attributes
    ----------
    blank
        All pixels have one value.
    repeats
        It equals the frame before it, bit for bit.
    moved
        Pose or flow say that the camera moved since the frame before; None where they are not there.
    view
        From where it was taken; None where there is no pose.
    """

    frame: int
    digest: bytes
    blank: bool
    repeats: bool
    moved: bool | None
    view: View | None


class ImagesRepeats(WindowCheck[tuple[FrameDigest, ...]]):
    """Is each frame a picture of its own?

    The frames that repeat an earlier one bit for bit although the image must have changed in between.

    Why it matters
    --------------
    A buffer that is written again without being refreshed pairs old frames with new stamps, events and poses. A
    repeated frame is a training pair with flow and without motion.

    How
    ---
    Frames are compared by their digests, each with all before it. A repeat is a fault where something says that the
    image must have changed in between: the fastest flow or the pose, when they move the frame's steep places by more
    than rounding can hide, or events that are as many as while frames do change. A camera that by its pose comes back
    to where it was may see what it saw. Frames of one value throughout are
    for ``images.exposure``.

    Noise model
    -----------
    The count is exact: two frames share a digest by chance with a probability of 5e-20. That the image must have
    changed is asked of the steepest hundredth of its pixels (by a lattice of some 5000), which must change by 2 DN
    where rounding hides 1 DN; of noisy poses six standard deviations are taken off first.

    Cannot see
    ----------
    Frames that repeat but for noise: ``images.order`` and ``event_response.frames``. A camera at rest may repeat its
    frames: not_observable where it does and rests throughout. Where neither flow nor pose nor events tell, repeats are
    noted.

    Sources
    -------
    First principles; FIPS 180-4 (SHA-256); ``fedora_qa/estimators/images/digest.py``.
    """

    name = "images.repeats"
    needs = ("rgb",)

    def measure(self, window: Window) -> tuple[FrameDigest, ...]:
        """Take the digest of every frame that the window owns."""
        seen = []
        for frame in window.owned("rgb"):
            rgb = window.rgb(frame)
            digest = _digest(window, frame)
            repeats = frame > 0 and _digest(window, frame - 1) == digest
            moved = (must_have_changed if repeats else surely_turned)(window, frame) if frame > 0 else None
            blank = is_of_one_code(rgb)
            seen.append(FrameDigest(frame, digest, blank, repeats, moved, view_of(window, frame)))
        return tuple(seen)

    def conclude(self, state: Sequence[tuple[FrameDigest, ...]], facts: Facts) -> Observation:
        """Count repeats between which the image must have changed."""
        frames = sorted((one for seen in state for one in seen), key=lambda one: one.frame)
        coverage = Coverage(len(frames), facts.sizes.get("path/rgb", len(frames)), "frames")
        if sum(not one.blank for one in frames) < FEWEST_FRAMES:
            return Observation(coverage, unobservable=f"fewer than {FEWEST_FRAMES} frames show anything at all")
        repeats = repeated(frames)
        by_events = moved_by_events(facts, {frame for frame, _ in repeats})
        moved = {one.frame: one.moved or bool(by_events[one.frame]) for one in frames}
        views = {one.frame: one.view for one in frames}
        known = "rgb_to_event" in facts.index_maps or any(one.moved is not None for one in frames)
        frozen = [
            (frame, first)
            for frame, first in repeats
            if any(moved.get(i) for i in range(first + 1, frame + 1)) and not _came_back(frame, first, views, facts)
        ]
        if frozen:
            return Observation(coverage, (_count(frozen, facts),))
        if repeats and known and not any(moved.values()):
            at_rest = (
                f"{len(repeats)} frames repeat an earlier one, and the camera rests: no frame must differ from others"
            )
            return Observation(coverage, unobservable=at_rest)
        notices = () if known or not repeats else (_noted(repeats),)
        return Observation(coverage, (no_faults("repeated_frames", "frames", "images.repeats.frames"),), notices)


def repeated(frames: Sequence[FrameDigest]) -> list[tuple[int, int]]:
    """Return each frame that is not blank and equals one before it, with the latest such frame."""
    latest: dict[bytes, int] = {}
    found = []
    for one in frames:
        if not one.blank:
            if one.repeats:
                found.append((one.frame, one.frame - 1))
            elif one.digest in latest:
                found.append((one.frame, latest[one.digest]))
            latest[one.digest] = one.frame
    return found


def _came_back(frame: int, first: int, views: Mapping[int, View | None], facts: Facts) -> bool:
    """Whether by its pose a camera that was away saw the later frame from where it saw the first."""
    view, earlier = views.get(frame), views.get(first)
    return frame - first > 1 and view is not None and earlier is not None and not is_elsewhere(view, earlier, facts)


def _digest(window: Window, frame: int) -> bytes:
    """Return the digest of a frame, taken once for neighbouring windows."""
    return window.of_image("digest", frame, lambda: digest_of(window.rgb(frame))).tobytes()


def _count(frozen: Sequence[tuple[int, int]], facts: Facts) -> Statistic:
    first, original = frozen[0]
    last = frozen[-1][0]
    times_ns = facts.clocks["rgb"].times_ns
    return count_of_faults(
        "repeated_frames",
        len(frozen),
        "frames",
        statement=f"{len(frozen)} frames repeat an earlier one bit for bit while the camera moves; the first is frame "
        f"{first}, which repeats frame {original}.",
        code="images.repeats.frames",
        where=Where(
            stream="rgb",
            start_us=facts.to_file_us(int(times_ns[first])),
            stop_us=facts.to_file_us(int(times_ns[last])),
            index_start=first,
            index_stop=last + 1,
            frame=first,
        ),
        suspects=(
            Suspect("frozen_frames", "rgb", 0.95, float(len(frozen)), "samples", 0.0),
            Suspect("duplicated_samples", "rgb", 0.5, float(len(frozen)), "samples", 0.0),
        ),
    )


def _noted(repeats: Sequence[tuple[int, int]]) -> Notice:
    return Notice(
        "images.repeats.unexplained",
        f"{len(repeats)} frames repeat an earlier one bit for bit, the first is frame {repeats[0][0]}; no pose, flow "
        "or events tell whether the camera moved.",
        Where(stream="rgb", frame=repeats[0][0]),
    )
