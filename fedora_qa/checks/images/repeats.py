"""Frames against each other: repeats."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from fedora_qa.checks.exact import count_of_faults, no_faults
from fedora_qa.checks.protocol import Notice, Observation, Statistic, WindowCheck
from fedora_qa.estimators.images.digest import digest_of
from fedora_qa.estimators.images.values import is_of_one_code
from fedora_qa.record.types import Coverage, Where
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window
from fedora_qa.views.image_motion import (
    Viewpoint,
    is_elsewhere,
    moved_by_events,
    moved_by_pose,
    must_have_changed,
    viewpoint_of,
)

FEWEST_FRAMES: Final = 2


@dataclass(frozen=True, slots=True)
class FrameDigest:
    """A frame's digest, and whether and where the camera had moved.

    Attributes
    ----------
    blank
        All pixels have one value.
    repeats
        It equals the frame before it, bit for bit.
    moved
        Whether by pose or flow the camera moved since the frame before; None where the file has neither.
    viewpoint
        From where it was taken; None where there is no pose.
    """

    frame: int
    digest: bytes
    blank: bool
    repeats: bool
    moved: bool | None
    viewpoint: Viewpoint | None


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
        digests = []
        for frame in window.owned("rgb"):
            rgb = window.rgb(frame)
            digest = _digest(window, frame)
            repeats = frame > 0 and _digest(window, frame - 1) == digest
            # Only a repeat needs proof that the image must have changed; other frames need the motion of the pose.
            moved = (must_have_changed if repeats else moved_by_pose)(window, frame) if frame > 0 else None
            blank = is_of_one_code(rgb)
            digests.append(FrameDigest(frame, digest, blank, repeats, moved, viewpoint_of(window, frame)))
        return tuple(digests)

    def conclude(self, state: Sequence[tuple[FrameDigest, ...]], facts: Facts) -> Observation:
        """Count repeats between which the image must have changed."""
        frames = sorted((digest for digests in state for digest in digests), key=lambda digest: digest.frame)
        coverage = Coverage(len(frames), facts.sizes.get("path/rgb", len(frames)), "frames")
        if sum(not digest.blank for digest in frames) < FEWEST_FRAMES:
            return Observation(coverage, unobservable=f"fewer than {FEWEST_FRAMES} frames show anything at all")
        repeats = repeated(frames)
        by_events = moved_by_events(facts, {frame for frame, _ in repeats})
        moved = {digest.frame: digest.moved or bool(by_events[digest.frame]) for digest in frames}
        viewpoints = {digest.frame: digest.viewpoint for digest in frames}
        motion_measured = "rgb_to_event" in facts.index_maps or any(digest.moved is not None for digest in frames)
        frozen = [
            (frame, first)
            for frame, first in repeats
            if any(moved.get(i) for i in range(first + 1, frame + 1))
            and not _came_back(frame, first, viewpoints, facts)
        ]
        if frozen:
            return Observation(coverage, (_repeated_frames(frozen, facts),))
        if repeats and motion_measured and not any(moved.values()):
            at_rest = (
                f"{len(repeats)} frames repeat an earlier one, and the camera rests: no frame must differ from others"
            )
            return Observation(coverage, unobservable=at_rest)
        notices = () if motion_measured or not repeats else (_unexplained(repeats),)
        return Observation(coverage, (no_faults("repeated_frames", "frames", "images.repeats.frames"),), notices)


def repeated(frames: Sequence[FrameDigest]) -> list[tuple[int, int]]:
    """Return (frame, latest earlier frame that it equals) for each frame that is not blank and repeats one."""
    latest: dict[bytes, int] = {}
    repeats = []
    for digest in frames:
        if not digest.blank:
            if digest.repeats:
                repeats.append((digest.frame, digest.frame - 1))
            elif digest.digest in latest:
                repeats.append((digest.frame, latest[digest.digest]))
            latest[digest.digest] = digest.frame
    return repeats


def _came_back(frame: int, first: int, viewpoints: Mapping[int, Viewpoint | None], facts: Facts) -> bool:
    """Whether by its pose a camera that was away saw the later frame from where it saw the first."""
    later, earlier = viewpoints.get(frame), viewpoints.get(first)
    return frame - first > 1 and later is not None and earlier is not None and not is_elsewhere(later, earlier, facts)


def _digest(window: Window, frame: int) -> bytes:
    """Return the digest of a frame, taken once for neighbouring windows."""
    return window.of_image("digest", frame, lambda: digest_of(window.rgb(frame))).tobytes()


def _repeated_frames(frozen: Sequence[tuple[int, int]], facts: Facts) -> Statistic:
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
    )


def _unexplained(repeats: Sequence[tuple[int, int]]) -> Notice:
    return Notice(
        "images.repeats.unexplained",
        f"{len(repeats)} frames repeat an earlier one bit for bit, the first is frame {repeats[0][0]}; no pose, flow "
        "or events tell whether the camera moved.",
        Where(stream="rgb", frame=repeats[0][0]),
    )
