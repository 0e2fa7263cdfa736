"""Access of a check to a window of a sequence, and the arrays that neighbouring windows share.

A window owns the items whose timestamps lie in it, and may read items beyond its ends (halos). It decodes only
requested rows, and keeps results that several checks share. The halo of a window lies in its neighbours, so that most
rows are needed by two or more windows. A window leases each array that it requests. The lease ends when a whole window
has passed that did not request the array; of rows that a later window owns, not before that window.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, Concatenate, Final, ParamSpec, Protocol, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import MM_PER_M
from fedora_qa.layout.canonical import timestamps_of
from fedora_qa.sequence.facts import Facts

_UNLIMITED: Final = 1 << 62

P = ParamSpec("P")
T = TypeVar("T")
Image = TypeVar("Image", bound=NDArray[Any])

USUAL_PIXELS: Final = 220_000
"""Number of pixels above which frames are large (540 x 405): they have more pixels than the detection of a fault of a
whole field needs."""

_KEPT_DEPTHS: Final = 2
"""Depth frames in metres that a window keeps itself: both ends of an interval."""


class RowSource(Protocol):
    """Decodes rows of a dataset into canonical units."""

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows of a dataset in canonical units, as ``SequenceRows.rows``."""
        ...

    def event_index(self, time_ns: int) -> int:
        """Return the number of events earlier than ``time_ns`` (of a stream in order)."""
        ...


@dataclass(frozen=True, slots=True)
class Span:
    """Place of a window in the sequence.

    Attributes
    ----------
    index
        Number of the window on the grid.
    start_ns, stop_ns
        Its ends, ns from the file's origin.
    owned
        First row, and row after the last, that the window owns of each stream.
    """

    index: int
    start_ns: int
    stop_ns: int
    owned: Mapping[str, tuple[int, int]]


@dataclass(frozen=True, slots=True)
class Sampling:
    """Density at which a window is measured, by the plan.

    Attributes
    ----------
    tile_share
        Share of image tiles that dense checks measure, 0 to 1.
    features
        Whether dear features of deviations are measured, by which causes are proposed. A trial of a cause needs none.
    """

    tile_share: float = 1.0
    features: bool = True


@dataclass(frozen=True, slots=True)
class Events:
    """Events in the order of time.

    Attributes
    ----------
    x, y
        (n,) columns and rows.
    times_ns
        (n,) timestamps, ns from the file's origin.
    p
        (n,) polarity, 1 brighter, 0 darker.
    """

    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    times_ns: NDArray[np.int64]
    p: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.times_ns)


@dataclass(frozen=True, slots=True)
class ImuSamples:
    """IMU samples with advancing timestamps.

    Attributes
    ----------
    times_ns
        (M,) timestamps, ns from the file's origin.
    angular_velocities_body_rad_s
        (M, 3) rad/s in the body frame.
    specific_forces_body_m_s2
        (M, 3) m/s^2 in the body frame.
    """

    times_ns: NDArray[np.int64]
    angular_velocities_body_rad_s: NDArray[np.float64]
    specific_forces_body_m_s2: NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class PoseSamples:
    """Poses with advancing timestamps.

    Attributes
    ----------
    times_ns
        (P,) timestamps, ns from the file's origin.
    positions_world_m
        (P, 3) positions in the world, m.
    orientations_xyzw
        (P, 4) quaternions x, y, z, w, body to world.
    """

    times_ns: NDArray[np.int64]
    positions_world_m: NDArray[np.float64]
    orientations_xyzw: NDArray[np.float64]


class Leases:
    """Keeps an array until a window has passed in which it was not requested.

    Where the limit of bytes is reached, leases of earlier windows end first, the oldest first. An array that still
    does not fit is not kept, and is made again at a later request: that costs time and changes no result.

    Parameters
    ----------
    limit_bytes
        Most bytes to keep.
    """

    def __init__(self, limit_bytes: int = _UNLIMITED) -> None:
        self.limit_bytes = limit_bytes
        self.kept_bytes = 0
        # Arrays that earlier windows requested and this one has not yet, and those that this one requested. Both are in
        # the order of request.
        self._before: dict[Hashable, Any] = {}
        self._now: dict[Hashable, Any] = {}
        # Bytes of each when it was made: results may keep more later.
        self._sizes: dict[Hashable, int] = {}
        # The latest array that did not fit: a search reads one block many times.
        self._latest: tuple[Hashable, Any] | None = None

    def begin_window(self, is_ahead: Callable[[Hashable], bool] = lambda _: False) -> None:
        """End the leases of arrays that the last window did not request, unless a later window is to request them.

        Parameters
        ----------
        is_ahead
            Whether the array of a key belongs to the window that begins, or to a later one.
        """
        for key in tuple(self._before):
            if not is_ahead(key):
                self._end(key)
        # Those that were requested last are the last to end where bytes are short.
        self._before, self._now = self._before | self._now, {}
        self._latest = None

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the value of a key, an array or an error in its place; ``make`` makes it where it is not kept."""
        kept = self.find(key)
        if kept is not None:
            return cast(T, kept)
        value = make()
        self.keep(key, value)
        return value

    def find(self, key: Hashable) -> Any:
        """Return the value of a key that is kept; None where it is not."""
        if key in self._now:
            return self._now[key]
        if key in self._before:
            value = self._now[key] = self._before.pop(key)
            return value
        return self._latest[1] if self._latest and self._latest[0] == key else None

    def keep(self, key: Hashable, value: object) -> None:
        """Keep the value of a key that is not kept, where it fits."""
        size = _bytes(value)
        while self._before and size <= self.limit_bytes < self.kept_bytes + size:
            self._end(next(iter(self._before)))
        if self.kept_bytes + size <= self.limit_bytes:
            self._now[key], self._sizes[key] = value, size
            self.kept_bytes += size
        else:
            self._latest = key, value

    def forget(self) -> None:
        """End all leases."""
        self._before.clear()
        self._now.clear()
        self._sizes.clear()
        self._latest = None
        self.kept_bytes = 0

    def _end(self, key: Hashable) -> None:
        del self._before[key]
        self.kept_bytes -= self._sizes.pop(key)


def _bytes(value: Any) -> int:
    """Return the bytes of an array, or of all arrays that a result holds."""
    if isinstance(value, np.ndarray):
        return value.nbytes
    if isinstance(value, Mapping):
        return sum(map(_bytes, value.values()))
    if isinstance(value, tuple | list):
        return sum(map(_bytes, value))
    if is_dataclass(value):
        return sum(_bytes(getattr(value, field.name)) for field in fields(value))
    return 0


class Window:
    """One window of a sequence, with lazy access to its streams.

    Types of arrays are quoted in frequent casts: to build such a type takes longer than to find a kept image.
    """

    def __init__(
        self, span: Span, facts: Facts, source: RowSource, sampling: Sampling, leases: Leases | None = None
    ) -> None:
        self.span = span
        self.facts = facts
        self.sampling = sampling
        self._source = source
        self._leases = leases or Leases()
        self._shared: dict[Hashable, Any] = {}
        self._depths_m: dict[int, NDArray[np.float32]] = {}

    def owned(self, stream: str) -> range:
        """Return the rows of the stream whose timestamps lie in this window."""
        return range(*self.span.owned.get(stream, (0, 0)))

    def rows(self, key: str, start: int, stop: int) -> NDArray[Any]:
        """Return rows of a dataset in canonical units, as ``SequenceRows.rows``."""
        return self._source.rows(key, start, stop)

    def derived(self, compute: Callable[Concatenate["Window", P], T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Return a result, computed once and shared by all checks of this window.

        Views of the sequence share it as well, where nothing differs that was read for it (``engine/trials/views.py``).

        Parameters
        ----------
        compute
            A function of a module, which computes it from the window and the arguments alone.
        *args, **kwargs
            Its arguments, which can be hashed.
        """
        key = (compute, *args, *kwargs.items())
        if key not in self._shared:
            self._shared[key] = compute(self, *args, **kwargs)
        return cast(T, self._shared[key])

    def derived_image(
        self,
        compute: Callable[Concatenate["Window", int, P], Image],
        row: int,
        *args: P.args,
        **kwargs: P.kwargs,
    ) -> Image:
        """Return a result of one image, shared as that of ``derived`` and with neighbouring windows.

        Parameters
        ----------
        compute
            A function of a module, which computes it from the image and the file alone, never from the window.
        *args, **kwargs
            Further arguments, which can be hashed.
        """
        key = (compute, *args, *kwargs.items())
        return self.of_image(key, row, lambda: compute(self, row, *args, **kwargs))

    def of_image(self, name: Hashable, row: int, compute: Callable[[], Image]) -> Image:
        """Return a result of one image, as ``derived_image``, which is written into an array of the caller.

        Parameters
        ----------
        name
            Name of the result.
        row
            Row of the image.
        compute
            Computes it from the image and the file alone, and holds nothing that was read before.
        """
        return self._leases.get((name, row), compute)

    def rgb(self, frame: int) -> NDArray[np.uint8]:
        """Return a colour frame, (H, W, 3), R, G, B, in DN as stored."""
        return cast("NDArray[np.uint8]", self.rows("path/rgb", frame, frame + 1)[0])

    def depth_m(self, frame: int) -> NDArray[np.float32]:
        """Return a depth frame (H, W), m along the optical axis, NaN where invalid.

        A depth frame is cheap to compute, and is dropped first when the limit of bytes is reached. But two of them are
        often requested in turn, so a window keeps its latest two.
        """
        kept = self._depths_m
        metres = kept.pop(frame, None)
        if metres is None:
            # ``pop`` and insertion keep the dict in the order of use, so that its first entry is the oldest.
            if len(kept) == _KEPT_DEPTHS:
                del kept[next(iter(kept))]
            metres = self.derived_image(_depth_m, frame)
        kept[frame] = metres
        return metres

    def flow_px(self, stream: str, field: int) -> NDArray[np.float32]:
        """Return a flow field, NaN where invalid: (H, W, 2) px over its interval, u right and v down.

        Parameters
        ----------
        stream
            ``flow/<rate>hz``.
        """
        return cast("NDArray[np.float32]", self.rows(f"path/{stream}", field, field + 1)[0])

    def moving(self, stream: str, field: int) -> NDArray[np.bool_] | None:
        """Return the pixels of a flow field that move by themselves; None where the file has no mask.

        Parameters
        ----------
        stream
            ``flow/<rate>hz``.

        Returns
        -------
        ndarray of bool or None
            (H, W).
        """
        key = f"path/{stream}_moving"
        if key not in self.facts.sizes:
            return None
        return cast("NDArray[np.bool_]", self.rows(key, field, field + 1)[0] > 0)

    def events(self, before_ns: int = 0, after_ns: int = 0) -> Events:
        """Return the window's events, with margins.

        Parameters
        ----------
        before_ns
            Margin before the window's start, ns.
        after_ns
            Margin after the window's stop, ns.

        Returns
        -------
        Events
            In the order of time; events of one timestamp in the order of the file. Those whose timestamp has no place
            in time are left out.
        """
        return self.derived(Window._read_events, before_ns, after_ns)

    def imu(self) -> ImuSamples:
        """Return IMU samples from the window's start to its stop, both inclusive."""
        rows = self._rows_within("imu", 0)
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
            # ``event_index`` presumes order; ``min`` and ``max`` keep owned events where the clock is not usable.
            start = min(start, self._source.event_index(self.span.start_ns - before_ns))
        if after_ns:
            stop = max(stop, self._source.event_index(self.span.stop_ns + after_ns))
        x, y = (self.rows(f"path/events/{name}", start, stop) for name in "xy")
        times_ns = self.rows(timestamps_of("events"), start, stop)
        p = self.rows("path/events/p", start, stop)
        if self.facts.events is not None and self.facts.events.unplaced:
            placed = self.facts.events.placed(times_ns)
            x, y, times_ns, p = x[placed], y[placed], times_ns[placed], p[placed]
        if np.any(times_ns[1:] < times_ns[:-1]):
            # Stable: events of one timestamp keep their order in the file.
            order = np.argsort(times_ns, kind="stable")
            x, y, times_ns, p = x[order], y[order], times_ns[order], p[order]
        return Events(x, y, times_ns, p)


def _depth_m(window: Window, frame: int) -> NDArray[np.float32]:
    # Millimetres in the file, metres in geometry; a float32 divisor keeps float32.
    depth_m: NDArray[np.float32] = window.rows("path/depth", frame, frame + 1)[0] / np.float32(MM_PER_M)
    return depth_m
