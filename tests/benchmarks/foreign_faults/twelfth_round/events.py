"""Events that decoders, sensors, merges and declarations spoil."""

from typing import Final

import h5py
import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.foreign.rows import replace_values, update_index_maps
from tests.benchmarks.foreign_faults.kind import Plan
from tests.benchmarks.foreign_faults.paths import CAMERA

FIELDS: Final = ("t", "y", "x", "p")
"""Of an event, in the order by which events are sorted."""

HOT_HZ: Final = (130.0, 1_100.0)
"""Least and greatest rate of a hot pixel."""

Events = dict[str, NDArray[np.int64]]
"""Times, rows, columns and polarities."""


def sensor_shape(file: h5py.File) -> tuple[int, int]:
    """Return rows and columns of the event camera."""
    attributes = file[CAMERA + "events"].attrs
    return int(attributes["height"]), int(attributes["width"])


def read_events(file: h5py.File) -> Events:
    """Return all events of a file."""
    return {name: file[f"path/events/{name}"][...].astype(np.int64) for name in FIELDS}


def write_events(file: h5py.File, *parts: Events) -> None:
    """Store events instead of those of the file, sorted, with the index maps that follow from them."""
    whole = {name: np.concatenate([part[name] for part in parts]) for name in FIELDS}
    order = np.lexsort([whole[name] for name in reversed(FIELDS)])
    for name, values in whole.items():
        key = f"path/events/{name}"
        replace_values(file, key, values[order].astype(file[key].dtype))
    update_index_maps(file)


def _chosen(events: Events, mask: NDArray[np.bool_]) -> Events:
    return {name: values[mask] for name, values in events.items()}


def polarity_exchanged(file: h5py.File, plan: Plan) -> None:
    """Polarity 1 is darker and 0 is brighter."""
    polarity = file["path/events/p"][...]
    replace_values(file, "path/events/p", (1 - polarity).astype(polarity.dtype))


def counted_from_the_other_side(file: h5py.File, plan: Plan) -> None:
    """Columns count from the right or rows count from the bottom, by chance."""
    rows, columns = sensor_shape(file)
    key, extent = (("path/events/x", columns), ("path/events/y", rows))[plan.random.integers(2)]
    places = file[key][...]
    replace_values(file, key, (extent - 1 - places.astype(np.int64)).astype(places.dtype))


def stamped_when_received(file: h5py.File, plan: Plan) -> None:
    """Times of events in the plan's time scatter with a standard deviation of so many ms; events are sorted again."""
    events = read_events(file)
    within = plan.times_us(events["t"])
    scatter_us = np.rint(plan.random.normal(0.0, 1000 * plan.size, len(within))).astype(np.int64)
    scattered_us = np.clip(events["t"] + scatter_us, events["t"][0], events["t"][-1])
    write_events(file, events | {"t": np.where(within, scattered_us, events["t"])})


def threshold_declared(file: h5py.File, plan: Plan) -> None:
    """Both declared thresholds are too large by so many percent."""
    attributes = file["metadata/events"].attrs
    for name in ("threshold_on", "threshold_off"):
        attributes[name] = np.float64(attributes[name] * (1 + plan.size / 100))


def other_model_declared(file: h5py.File, plan: Plan) -> None:
    """The declared model is linear in place of log, or log in place of linear."""
    attributes = file["metadata/events"].attrs
    attributes["model"] = "linear" if attributes["model"] == "log" else "log"


def tile_lost(file: h5py.File, plan: Plan) -> None:
    """In the plan's time a square of so many pixels gives no events; at least one event would lie in it."""
    events = read_events(file)
    within = plan.times_us(events["t"])
    inside = within.copy()
    event = plan.random.choice(np.flatnonzero(within))
    for name, extent in zip("yx", sensor_shape(file), strict=True):
        side = min(int(plan.size), extent)
        first = np.clip(events[name][event] - plan.random.integers(side), 0, extent - side)
        inside &= (events[name] >= first) & (events[name] < first + side)
    write_events(file, _chosen(events, ~inside))


def defective_pixels(file: h5py.File, plan: Plan) -> None:
    """So many pixels fire by themselves, as Poisson processes with rates and polarities of their own."""
    events = read_events(file)
    first_us, last_us = events["t"][0], events["t"][-1]
    rows, columns = sensor_shape(file)
    pixels = plan.random.choice(rows * columns, int(plan.size), replace=False)
    rates_hz = np.exp(plan.random.uniform(*np.log(HOT_HZ), len(pixels)))
    counts = np.maximum(1, plan.random.poisson(rates_hz * (last_us - first_us) / 1e6))
    fired = np.repeat(pixels, counts)
    polarity = np.repeat(plan.random.integers(2, size=len(pixels)), counts)
    times_us = plan.random.integers(first_us, last_us, len(fired), endpoint=True)
    write_events(file, events, {"t": times_us, "y": fired // columns, "x": fired % columns, "p": polarity})


def background_undeclared(file: h5py.File, plan: Plan) -> None:
    """Every pixel fires so many times a second by chance, with either polarity."""
    events = read_events(file)
    first_us, last_us = events["t"][0], events["t"][-1]
    rows, columns = sensor_shape(file)
    count = int(plan.random.poisson(plan.size * rows * columns * (last_us - first_us) / 1e6))
    noise = {
        "t": plan.random.integers(first_us, last_us, count, endpoint=True),
        "y": plan.random.integers(rows, size=count),
        "x": plan.random.integers(columns, size=count),
        "p": plan.random.integers(2, size=count),
    }
    write_events(file, events, noise)


def of_another_flight_for_a_while(file: h5py.File, plan: Plan) -> None:
    """Events of the plan's time are those that another sequence has in the same time after its first frame."""
    own = read_events(file)
    begin_us, end_us = own["t"][0] + np.array([plan.begin, plan.end]) * (own["t"][-1] - own["t"][0])
    with h5py.File(plan.donor) as donor:
        other = read_events(donor)
        other["t"] += file["path/rgb_ts"][0] - donor["path/rgb_ts"][0]
    of_own = (own["t"] < begin_us) | (own["t"] > end_us)
    of_other = (other["t"] >= begin_us) & (other["t"] <= end_us)
    write_events(file, _chosen(own, of_own), _chosen(other, of_other))
