"""Event clouds: single events around an instant in x, y and t, evenly thinned."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fedora_qa.conventions import NS_PER_MS, NS_PER_US
from fedora_qa.errors import UnreadableRowsError
from fedora_qa.evidence.snapshot import EVENTS_NS, events_around, sensor_shape
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.record.evidence import EVENT_CLOUDS, named
from fedora_qa.sequence.facts import Facts
from fedora_qa.sequence.window import Window

_ON_CLOCK: Final = "us on the file's clock"


@dataclass(frozen=True, slots=True)
class EventCloud:
    """Some of the events around an instant, in the order of time.

    Attributes
    ----------
    time_ns
        The instant, ns from the file's origin.
    count
        Number of all events on the sensor within ``EVENTS_NS`` around it.
    shape
        Height and width of the sensor, px.
    x, y
        (n,) columns and rows.
    offsets_us
        (n,) timestamps relative to the instant, us.
    polarities
        (n,) 1 brighter, 0 darker.
    """

    time_ns: int
    count: int
    shape: tuple[int, int]
    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    offsets_us: NDArray[np.int16]
    polarities: NDArray[np.uint8]


def take_event_cloud(window: Window, time_ns: int, most: int) -> EventCloud | None:
    """Take the events of the picture of a snapshot, which the window holds for that picture.

    Parameters
    ----------
    window
        A window of the sequence.
    time_ns
        The instant, ns from the file's origin.
    most
        Largest number of events; of more, evenly many in the order of time.

    Returns
    -------
    EventCloud or None
        None where no event lies on the sensor around the instant, or where events cannot be decoded.
    """
    if "events" not in window.facts.streams:
        return None
    try:
        events = events_around(window, time_ns, EVENTS_NS)
    except UnreadableRowsError:
        return None
    height, width = sensor_shape(window.facts, events)
    within = (events.x >= 0) & (events.x < width) & (events.y >= 0) & (events.y < height)
    on_sensor = np.flatnonzero(within & (events.p >= 0) & (events.p <= 1))
    if not len(on_sensor):
        return None
    chosen = on_sensor[np.linspace(0, len(on_sensor) - 1, min(most, len(on_sensor))).round().astype(np.intp)]
    return EventCloud(
        time_ns=time_ns,
        count=len(on_sensor),
        shape=(height, width),
        x=events.x[chosen].astype(np.uint16),
        y=events.y[chosen].astype(np.uint16),
        # 10 ms on either side are 1e4 us, which fit int16.
        offsets_us=np.rint((events.times_ns[chosen] - time_ns) / NS_PER_US).astype(np.int16),
        polarities=events.p[chosen].astype(np.uint8),
    )


def keep_event_clouds(clouds: Sequence[EventCloud], facts: Facts, most: int) -> TitledArrays:
    """Return the clouds of the instants with most events as arrays of the record.

    Parameters
    ----------
    clouds
        Of all instants, in the order of time.
    facts
        Convert times to the clock of the file.
    most
        Largest number of clouds; of equally many events the earlier instant.

    Returns
    -------
    TitledArrays
        In the order of time; empty where there is no cloud.
    """
    if not clouds:
        return TitledArrays()
    busiest = sorted(range(len(clouds)), key=lambda k: (-clouds[k].count, k))[:most]
    kept = [clouds[k] for k in sorted(busiest)]
    times_us = np.array([facts.to_file_us(cloud.time_ns) for cloud in kept])
    within = f"within {EVENTS_NS / NS_PER_MS:g} ms around the instants"
    numbers = np.repeat(np.arange(len(kept), dtype=np.uint8), [len(cloud.x) for cloud in kept])
    entries: dict[str, tuple[NDArray[Any], str]] = {
        "times_us": (times_us, f"Instants with most events, {_ON_CLOCK}"),
        "intervals_us": (
            times_us[:, None] + np.array([-1, 1]) * EVENTS_NS / 2 / NS_PER_US,
            f"Start and end of the time around each instant, {_ON_CLOCK}",
        ),
        "counts": (np.array([cloud.count for cloud in kept]), f"Number of events {within}"),
        "shapes_px": (np.array([cloud.shape for cloud in kept]), "Height and width of the sensor at each instant, px"),
        "instant": (numbers, "Which of the instants each kept event belongs to, counted from 0"),
        "x": (np.concatenate([cloud.x for cloud in kept]), f"Columns of events {within}, evenly thinned, px"),
        "y": (np.concatenate([cloud.y for cloud in kept]), "Rows of these events, px"),
        "offsets_us": (np.concatenate([cloud.offsets_us for cloud in kept]), "Their times from their instant on, us"),
        "polarities": (
            np.concatenate([cloud.polarities for cloud in kept]),
            "Their polarities: 1 brighter, 0 darker",
        ),
    }
    return TitledArrays.titled({named(EVENT_CLOUDS, name): entry for name, entry in entries.items()})
