"""The view through which a check reads a window of a sequence.

A window owns the items whose timestamps lie in it, and may look beyond its edges for context (halos). It decodes only
what is asked for, and keeps what several checks share.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.layout.canonical import TIMESTAMPS_OF
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.shared_images import Image, SharedImages

T = TypeVar("T")


class RowSource(Protocol):
    """Decodes rows of a dataset into canonical units. Raises ``UnreadableRowsError``."""

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows ``start`` to ``stop`` of the dataset ``key``; timestamps as int64 nanoseconds from the origin."""
        ...

    def event_index(self, time_ns: int) -> int:
        """Return the number of events earlier than ``time_ns`` (of a stream in order)."""
        ...


@dataclass(frozen=True, slots=True)
class Span:
    """A window's place: its number on the grid, its time, and the rows it owns of each stream."""

    index: int
    start_ns: int
    stop_ns: int
    owned: Mapping[str, tuple[int, int]]


USUAL_PIXELS: Final = 220_000
"""Frames of more pixels than 540 x 405 are large: they have more than are needed to detect a fault of a whole field."""

_DEPTHS_AT_HAND: Final = 2
"""Depth frames in metres that a window keeps itself: both ends of an interval."""


@dataclass(frozen=True, slots=True)
class Sampling:
    """How densely a window is to be looked at, as the plan decides.

    Attributes
    ----------
    tile_share
        Share of image tiles that dense checks look at, 0 to 1.
    field_stride
        Every how many-th flow field of a rate is measured against frames.
    """

    tile_share: float = 1.0
    field_stride: int = 1


@dataclass(frozen=True, slots=True)
class Events:
    """Events in the order of time: columns, rows, instants from the origin, polarity (1 brighter, 0 darker)."""

    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    times_ns: NDArray[np.int64]
    p: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.times_ns)


@dataclass(frozen=True, slots=True)
class ImuSamples:
    """IMU samples with advancing timestamps: (M,) ns, (M, 3) rad/s, (M, 3) m/s^2 specific force, body frame."""

    times_ns: NDArray[np.int64]
    angular_velocities_body_rad_s: NDArray[np.float64]
    specific_forces_body_m_s2: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PoseSamples:
    """Poses with advancing timestamps: (P,) ns, (P, 3) m in the world, (P, 4) quaternions x, y, z, w, body to world."""

    times_ns: NDArray[np.int64]
    positions_world_m: NDArray[np.float64]
    orientations_xyzw: NDArray[np.float64]


class Window:
    """One window of a sequence, with lazy access to its streams.

    Types of arrays are named in quotes where it is asked often: to make one takes longer than to find an image.
    """

    def __init__(
        self, span: Span, facts: Facts, source: RowSource, sampling: Sampling, images: SharedImages | None = None
    ) -> None:
        self.span = span
        self.facts = facts
        self.sampling = sampling
        self._source = source
        self._images = images or SharedImages()
        self._shared: dict[Hashable, Any] = {}
        self._turn = 0

    def owned(self, stream: str) -> range:
        """Return the rows of the stream whose timestamps lie in this window."""
        return range(*self.span.owned.get(stream, (0, 0)))

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows of a dataset in canonical units; raises ``UnreadableRowsError``."""
        return self._source.rows(key, start, stop)

    def once(self, key: Hashable, compute: Callable[[], T]) -> T:
        """Return what ``compute`` gives, shared by all checks of this window.

        It is dropped when no later check has ever asked for its kind (the key, or the first entry of a key of several).
        Where one does for the first time, it is computed again, and kept longer in the windows to come.
        """
        last, kind = self._images.last_turns, _kind(key)
        last[kind] = max(last.get(kind, 0), self._turn)
        if key not in self._shared:
            self._shared[key] = compute()
        return cast(T, self._shared[key])

    def take_turn(self, turn: int) -> None:
        """Begin the turn of a check, by its number; drop what only earlier checks ask for."""
        self._turn = turn
        last = self._images.last_turns
        for key in [key for key in self._shared if last[_kind(key)] < turn]:
            del self._shared[key]

    def of_image(self, name: str, row: int, compute: Callable[[], Image]) -> Image:
        """Return what ``compute`` gives for one image, shared by all checks and with neighbouring windows.

        The result must follow from the image and the file alone, never from the window.
        """
        return self._images.get((name, row), compute)

    def rgb(self, frame: int) -> NDArray[np.uint8]:
        """Return a colour frame, (H, W, 3), R, G, B, in DN as stored."""
        return cast("NDArray[np.uint8]", self.rows("path/rgb", frame, frame + 1)[0])

    def depth_m(self, frame: int) -> NDArray[np.float32]:
        """Return a depth frame, (H, W), metres along the optical axis, NaN where invalid.

        It is made in a moment, and goes first where there is little room; but two of them are asked for by turns, many
        times over, so that a window keeps its latest two.
        """
        at_hand: dict[int, NDArray[np.float32]] = self.once("depth at hand", dict)
        metres = at_hand.pop(frame, None)
        if metres is None:
            # ``pop`` and insertion keep the dict in the order of use, so that its first entry is the oldest.
            if len(at_hand) == _DEPTHS_AT_HAND:
                del at_hand[next(iter(at_hand))]
            # Millimetres in the file, metres in geometry; a float32 divisor keeps float32.
            metres = self._images.get(
                ("depth_m", frame),
                lambda: cast(NDArray[np.float32], self.rows("path/depth", frame, frame + 1)[0] / np.float32(MM_PER_M)),
                in_a_moment=True,
            )
        at_hand[frame] = metres
        return metres

    def flow_px(self, stream: str, field: int) -> NDArray[np.float32]:
        """Return a flow field of the stream (``flow/10hz``), (H, W, 2), px over its interval, NaN where invalid."""
        return cast("NDArray[np.float32]", self.rows(f"path/{stream}", field, field + 1)[0])

    def moving(self, stream: str, field: int) -> NDArray[np.bool_] | None:
        """Return which pixels of a flow field move by themselves, (H, W); None where the file does not say."""
        key = f"path/{stream}_moving"
        if key not in self.facts.sizes:
            return None
        return cast("NDArray[np.bool_]", self.rows(key, field, field + 1)[0] > 0)

    def events(self, before_ns: int = 0, after_ns: int = 0) -> Events:
        """Return the window's events, and those up to a margin before its start and after its stop, sorted by time."""
        return self.once(("events", before_ns, after_ns), lambda: self._read_events(before_ns, after_ns))

    def imu(self, margin_ns: int = 0) -> ImuSamples:
        """Return IMU samples from the window's start to its stop, both inclusive, with a margin on both sides."""
        rows = self._rows_within("imu", margin_ns)
        return ImuSamples(
            times_ns=self.facts.clocks["imu"].times_ns[rows],
            angular_velocities_body_rad_s=self._take("path/imu/angular_velocity", rows),
            specific_forces_body_m_s2=self._take("path/imu/linear_acceleration", rows),
        )

    def pose(self, margin_ns: int = 0) -> PoseSamples:
        """Return poses from the window's start to its stop, both inclusive, with a margin on both sides."""
        rows = self._rows_within("pose", margin_ns)
        return PoseSamples(
            times_ns=self.facts.clocks["pose"].times_ns[rows],
            positions_world_m=self._take("path/pose/position", rows),
            orientations_xyzw=self._take("path/pose/orientation", rows),
        )

    def _rows_within(self, stream: str, margin_ns: int) -> NDArray[np.intp]:
        clock = self.facts.clocks[stream]
        times = clock.times_ns
        # Only advancing timestamps: interpolation divides by the step between two samples.
        within = (times >= self.span.start_ns - margin_ns) & (times <= self.span.stop_ns + margin_ns)
        return np.flatnonzero(within & clock.advancing)

    def _take(self, key: str, rows: NDArray[np.intp]) -> NDArray[np.float64]:
        if not len(rows):
            return np.empty((0, 4 if key.endswith("orientation") else 3))
        start, stop = int(rows[0]), int(rows[-1]) + 1
        return self.rows(key, start, stop)[rows - start]

    def _read_events(self, before_ns: int, after_ns: int) -> Events:
        start, stop = self.span.owned.get("events", (0, 0))
        if before_ns:
            # ``event_index`` presumes order; ``min`` and ``max`` keep owned events where the clock is broken.
            start = min(start, self._source.event_index(self.span.start_ns - before_ns))
        if after_ns:
            stop = max(stop, self._source.event_index(self.span.stop_ns + after_ns))
        x, y = (self.rows(f"path/events/{name}", start, stop) for name in "xy")
        times_ns = self.rows(TIMESTAMPS_OF["events"], start, stop)
        p = self.rows("path/events/p", start, stop)
        if len(times_ns) and np.any(np.diff(times_ns) < 0):
            # Stable: events of one timestamp keep their order in the file.
            order = np.argsort(times_ns, kind="stable")
            x, y, times_ns, p = x[order], y[order], times_ns[order], p[order]
        return Events(x, y, times_ns, p)


def _kind(key: Hashable) -> Hashable:
    return key[0] if isinstance(key, tuple) and key else key
