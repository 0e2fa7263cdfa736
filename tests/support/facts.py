"""Facts of an imaginary file with exact clocks, to be altered by tests."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fedora_qa.layout.resolve import Layout
from fedora_qa.sequence.declared import Declared, EventModel
from fedora_qa.sequence.facts import Clock, EventScan, Facts, IndexMap

MS = 1_000_000
PERIODS_NS = {"rgb": 20 * MS, "depth": 20 * MS, "imu": MS, "pose": 5 * MS}
FLOW_PERIODS_NS = {"flow/10hz": 100 * MS, "flow/25hz": 40 * MS, "flow/50hz": 20 * MS}


def clock(times_ns: NDArray[Any], interval_ns: int | None = None) -> Clock:
    """A clock with the given stamps, advancing as the scan would find."""
    times = np.asarray(times_ns, dtype=np.int64)
    advancing = np.ones(len(times), bool)
    advancing[1:] = times[1:] > np.maximum.accumulate(times)[:-1]
    return Clock(times, None if interval_ns is None else times + interval_ns, advancing)


def exact_facts(seconds: int = 2) -> Facts:
    """Facts of a clean file in which every stream runs at its nominal rate from 0 on."""
    end = seconds * 1000 * MS
    clocks = {name: clock(np.arange(0, end + 1, period)) for name, period in PERIODS_NS.items()}
    clocks |= {name: clock(np.arange(0, end, period), period) for name, period in FLOW_PERIODS_NS.items()}
    frames = clocks["rgb"].times_ns
    exact_map = IndexMap(frames // 1000, frames // 1000, frames // 1000 + np.arange(len(frames)) % 2)
    return Facts(
        layout=Layout("fedora", {}, frozenset(), {}),
        declared=Declared(events=EventModel("log", 0.2, 0.2)),
        streams=frozenset([*clocks, "events", "rgb_to_event", "depth_to_event"]),
        absent={},
        origin_us=0,
        clocks=clocks,
        events=EventScan(count=end // 1000, first_ns=0, last_ns=end, decreases=0, first_decrease=-1, grid_ns=1000),
        index_maps={"rgb_to_event": exact_map, "depth_to_event": exact_map},
    )


def with_clock(facts: Facts, stream: str, altered: Clock) -> Facts:
    """The same facts with another clock for one stream."""
    return replace(facts, clocks={**facts.clocks, stream: altered})


def with_map(facts: Facts, name: str, stored: NDArray[Any]) -> Facts:
    """The same facts with another stored index map."""
    maps = dict(facts.index_maps)
    maps[name] = replace(maps[name], stored=np.asarray(stored, np.int64))
    return replace(facts, index_maps=maps)
