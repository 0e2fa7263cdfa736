"""Events of a window on the sensor: as stored, by pixel, their places, and the step of their timestamps."""

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_US, US_PER_S
from fedora_qa.estimators.clocks.grid import crowded_step_ns
from fedora_qa.estimators.events.pixels import PixelEvents, by_pixel
from fedora_qa.record.types import Where
from fedora_qa.sequence.declared import Declared
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Events, Window
from fedora_qa.views.frames import is_large

HALO_NS: Final = 30_000_000
"""Time before and after a window whose events its checks may read: longer than any gap over which a level is known."""

FARTHEST_NEXT_FRAME_NS: Final = 100_000_000
"""A window reads the frame after its last one if that is not farther behind its end."""

GRID: Final = 4
"""Number of tiles of the event camera's image along each side, for local deviations."""


def all_events(window: Window) -> Events:
    """Return the events of a window with a halo on both sides, as stored."""
    return window.derived(_events_with_halo)


def _events_with_halo(window: Window) -> Events:
    after_ns = HALO_NS
    frames = frames_due(window) if "rgb" in window.facts.clocks else []
    if frames:
        last_ns = int(window.facts.clocks["rgb"].times_ns[frames[-1]])
        # Events are counted up to the frame after the window, and levels there need the halo behind it.
        after_ns = max(HALO_NS, last_ns + HALO_NS - window.span.stop_ns)
    return _read_only(window.events(HALO_NS, after_ns))


def _read_only(events: Events) -> Events:
    """Return the events as read-only views. Some stored columns are read-only, and loops are compiled for one kind."""
    views = Events(events.x.view(), events.y.view(), events.times_ns.view(), events.p.view())
    for column in (views.x, views.y, views.times_ns, views.p):
        column.flags.writeable = False
    return views


def sensor_events(window: Window) -> Events:
    """Return those of ``all_events`` that lie on the declared sensor and have a legal polarity."""
    return window.derived(_sensor_events)


def _sensor_events(window: Window) -> Events:
    return _on_sensor(all_events(window), window.facts.declared)


def events_around(window: Window, margin_ns: int) -> Events:
    """Return the events on the sensor within a margin of a window, for a follow-up.

    Parameters
    ----------
    margin_ns
        Time before the start and after the stop of the window, ns.

    Returns
    -------
    Events
        Events on the declared sensor with a polarity of 0 or 1, in the order of the file.
    """
    return _on_sensor(window.events(margin_ns, margin_ns), window.facts.declared)


def corrected_events(window: Window, offset_ns: int) -> Events:
    """Return ``sensor_events`` with a clock offset subtracted from their timestamps.

    Parameters
    ----------
    offset_ns
        Clock offset of the events, ns; positive where timestamps are too late.

    Returns
    -------
    Events
        Events with ``HALO_NS`` on both sides of the window, by their corrected timestamps.
    """
    events = events_around(window, HALO_NS + abs(offset_ns))
    times_ns = events.times_ns - offset_ns
    # The margin was widened by the offset: cut to the halo of ``sensor_events``.
    near = slice(*np.searchsorted(times_ns, [window.span.start_ns - HALO_NS, window.span.stop_ns + HALO_NS]))
    return _read_only(Events(events.x[near], events.y[near], times_ns[near], events.p[near]))


def own(window: Window, events: Events) -> Events:
    """Return the events within a window, without the halo.

    Parameters
    ----------
    events
        In the order of time, ns from the file's origin.

    Returns
    -------
    Events
        Events from the window's start to before its stop.
    """
    start, stop = np.searchsorted(events.times_ns, [window.span.start_ns, window.span.stop_ns])
    return Events(events.x[start:stop], events.y[start:stop], events.times_ns[start:stop], events.p[start:stop])


def pixel_events(window: Window) -> PixelEvents:
    """Return ``sensor_events`` by pixel."""
    return window.derived(_pixel_events)


def _pixel_events(window: Window) -> PixelEvents:
    return sorted_by_pixel(sensor_events(window), window.facts.declared)


def sorted_by_pixel(events: Events, declared: Declared) -> PixelEvents:
    """Return events that lie on the declared sensor, in the order of time, by pixel.

    Parameters
    ----------
    events
        All on the sensor, in the order of time; timestamps in ns from the file's origin.
    declared
        With the size of the event camera.

    Returns
    -------
    PixelEvents
        The events of each pixel in the order of time.
    """
    return by_pixel(events.x, events.y, events.times_ns, events.p, sensor_shape(declared))


def sensor_shape(declared: Declared) -> tuple[int, int]:
    """Return rows and columns of the event camera."""
    camera = declared.cameras["events"]
    return camera.height, camera.width


def tile_around(chosen: NDArray[np.bool_], shape: tuple[int, int]) -> tuple[int, int, int, int]:
    """Return the smallest rectangle around tiles.

    Parameters
    ----------
    chosen
        (GRID^2,) True for the tiles, rows first.
    shape
        Rows and columns of the image.

    Returns
    -------
    tuple
        Left, top, right, bottom, px, half-open.
    """
    rows, columns = np.nonzero(chosen.reshape(GRID, GRID))
    height, width = shape
    left, right = (-(-int(edge) * width // GRID) for edge in (columns.min(), columns.max() + 1))
    top, bottom = (-(-int(edge) * height // GRID) for edge in (rows.min(), rows.max() + 1))
    return left, top, right, bottom


def place_of_segment(facts: Facts, start_ns: int, stop_ns: int) -> tuple[Where, str]:
    """Return a segment of time of the events, ns from the origin, as a place and as the beginning of a sentence."""
    start_us, stop_us = facts.to_file_us(start_ns), facts.to_file_us(stop_ns)
    words = f"From {start_us / US_PER_S:.2f} s to {stop_us / US_PER_S:.2f} s"
    return Where(stream="events", start_us=start_us, stop_us=stop_us), words


def place_of_tiles(facts: Facts, chosen: NDArray[np.bool_]) -> tuple[Where, str]:
    """Return the rectangle around tiles (GRID^2,) of the events as a place and as the beginning of a sentence."""
    tile = tile_around(chosen, sensor_shape(facts.declared))
    words = f"In columns {tile[0]} to {tile[2] - 1}, rows {tile[1]} to {tile[3] - 1}"
    return Where(stream="events", tile=tile), words


def is_large_sensor(window: Window) -> bool:
    """Whether the event camera is so large that checks may sample it; False where the user asks for all pixels."""
    height, width = sensor_shape(window.facts.declared)
    return is_large(height * width, window)


def _on_sensor(events: Events, declared: Declared) -> Events:
    height, width = sensor_shape(declared)
    if events.x.dtype == events.y.dtype == np.uint16 and all_on_sensor(events, (height, width)):
        return events
    on_sensor = (events.x < width) & (events.y < height) & (events.p <= 1)
    # Files may store signed coordinates; unsigned ones cannot be negative and need no test.
    if events.x.dtype != np.uint16 or events.y.dtype != np.uint16:
        on_sensor &= (events.x >= 0) & (events.y >= 0)
    x, y = events.x[on_sensor].astype(np.uint16), events.y[on_sensor].astype(np.uint16)
    return _read_only(Events(x, y, events.times_ns[on_sensor], events.p[on_sensor]))


def all_on_sensor(events: Events, shape: tuple[int, int]) -> bool:
    """Whether all events lie on a sensor, with a polarity of 0 or 1.

    Parameters
    ----------
    events
        With any integer coordinates.
    shape
        Rows and columns of the sensor.
    """
    columns: tuple[tuple[NDArray[Any], int], ...] = ((events.y, shape[0]), (events.x, shape[1]), (events.p, 2))
    return not len(events) or all(column.min() >= 0 and column.max() < end for column, end in columns)


def local_tick_ns(window: Window) -> int:
    """Return the step of the event timestamps in a window, though a few events lie off the grid.

    Where nine events of ten share their timestamp with many others, the tick is the usual distance between such
    timestamps.
    """
    return window.derived(_local_tick_ns)


def _local_tick_ns(window: Window) -> int:
    return max(tick_ns(window.facts), crowded_step_ns(all_events(window).times_ns))


def tick_ns(facts: Facts) -> int:
    """Return the step of the event timestamps: the grid on which all of them lie, a microsecond at least."""
    declared = facts.declared.events
    packet_ns = declared.packet_interval_us * NS_PER_US if declared is not None else 0
    grid_ns = facts.events.grid_ns if facts.events is not None else 0
    # Timestamps in the file are whole microseconds: no tick can be finer.
    return max(NS_PER_US, packet_ns, grid_ns)


def frames_due(window: Window) -> list[int]:
    """Return the frames of a window whose timestamps advance, and the next one if it is near."""
    clock = window.facts.clocks["rgb"]
    if not clock.usable:
        return []
    own_rows = [row for row in window.owned("rgb") if clock.advancing[row]]
    if not own_rows:
        return []
    later = np.flatnonzero(clock.advancing[own_rows[-1] + 1 :])
    if len(later):
        following = own_rows[-1] + 1 + int(later[0])
        if clock.times_ns[following] - window.span.stop_ns <= FARTHEST_NEXT_FRAME_NS:
            own_rows.append(following)
    return own_rows
