"""Single events around the busiest instants: which they are, thinned evenly, and of one picture with the snapshot."""

from dataclasses import replace

import numpy as np

from fedora_qa.evidence.clouds import keep_event_clouds, take_event_cloud
from fedora_qa.evidence.titled_arrays import TitledArrays
from fedora_qa.sequence.declared import Declared
from tests.evidence.memory import SENSOR_HEIGHT, SENSOR_WIDTH, Memory, memory
from tests.support.facts import MS

INSTANT_NS = 500 * MS


def clouds_of(file: Memory, *times_ns: int, most: int = 3, events: int = 4000) -> TitledArrays:
    """What is kept of instants in the third window."""
    taken = [take_event_cloud(file.window(2), time_ns, events) for time_ns in times_ns]
    return keep_event_clouds([cloud for cloud in taken if cloud is not None], file.facts, most)


def test_events_are_those_of_the_file() -> None:
    """All events of 10 ms before and after the instant, with their pixel, time and polarity."""
    file = memory()
    kept = clouds_of(file, INSTANT_NS)
    rows = np.arange(490, 510)  # an event each ms
    for name, key in (("x", "x"), ("y", "y"), ("polarities", "p")):
        np.testing.assert_array_equal(kept.arrays[f"event_clouds/{name}"], file.columns[f"path/events/{key}"][rows])
    np.testing.assert_array_equal(kept.arrays["event_clouds/offsets_us"], (rows - 500) * 1000)
    assert kept.arrays["event_clouds/times_us"] == file.facts.origin_us + 500e3
    intervals_us = kept.arrays["event_clouds/intervals_us"] - file.facts.origin_us
    assert intervals_us.tolist() == [[490e3, 510e3]]
    assert kept.arrays["event_clouds/counts"].tolist() == [20]
    assert kept.arrays["event_clouds/shapes_px"].tolist() == [[SENSOR_HEIGHT, SENSOR_WIDTH]]
    dtypes = {"x": "u2", "y": "u2", "offsets_us": "i2", "polarities": "u1", "instant": "u1"}
    assert {name: kept.arrays[f"event_clouds/{name}"].dtype.str[1:] for name in dtypes} == dtypes
    assert kept.titles.keys() == kept.arrays.keys()


def test_events_are_thinned_evenly() -> None:
    """Of twenty events five, from the first to the last at nearly even steps; all are counted."""
    kept = clouds_of(memory(), INSTANT_NS, events=5).arrays
    assert kept["event_clouds/offsets_us"].tolist() == [-10_000, -5_000, 0, 4_000, 9_000]
    assert kept["event_clouds/counts"].tolist() == [20]


def test_instants_with_most_events_are_kept_in_the_order_of_time() -> None:
    """Without the events from 480 to 495 ms, the instants after them are the busiest; ties keep the earlier."""
    file = memory()
    silent = (file.columns["path/events/t"] >= 480 * MS) & (file.columns["path/events/t"] < 495 * MS)
    file.columns = {key: rows[~silent] if "events" in key else rows for key, rows in file.columns.items()}
    kept = clouds_of(file, 490 * MS, 505 * MS, 520 * MS, 540 * MS, most=2).arrays
    assert (kept["event_clouds/times_us"] - file.facts.origin_us).tolist() == [505e3, 520e3]
    assert kept["event_clouds/instant"].tolist() == [0] * 20 + [1] * 20


def test_events_beside_the_sensor_are_left_out() -> None:
    """An event beyond the declared size is in no cloud; without a declaration the events themselves give the size."""
    file = memory()
    x = file.columns["path/events/x"].copy()
    x[500] = 9
    file.columns = {**file.columns, "path/events/x": x}
    kept = clouds_of(file, INSTANT_NS).arrays
    assert kept["event_clouds/counts"].tolist() == [19]
    assert int(kept["event_clouds/x"].max()) < SENSOR_WIDTH
    file.facts = replace(file.facts, declared=Declared())
    assert clouds_of(file, INSTANT_NS).arrays["event_clouds/shapes_px"].tolist() == [[SENSOR_HEIGHT, 10]]


def test_nothing_to_keep() -> None:
    """Without events, with unreadable ones, and where none is near, there is no cloud."""
    file = memory()
    assert not clouds_of(file, 5000 * MS).arrays
    file.unreadable = {"path/events/x"}
    assert not clouds_of(file, INSTANT_NS).arrays
    file.facts = replace(file.facts, streams=frozenset({"rgb"}))
    assert not clouds_of(file, INSTANT_NS).arrays
