"""An hour of every stream at once: planned in little time, no row twice and none left out."""

import time
from itertools import pairwise
from pathlib import Path

from fedora_qa.layout.canonical import STREAMS
from tests.extremes.large_files import HOUR_US, hour_of_all_streams, planned

LONGEST_S = 20.0
"""Of processor time; half a second when nobody else computes."""


def test_an_hour_of_all_streams_is_planned(tmp_path: Path) -> None:
    """Right: at most 16,384 windows, that together own every row of every stream once."""
    path = hour_of_all_streams(tmp_path / "hour.h5")
    started = time.process_time()
    ready = planned(path)
    assert time.process_time() - started < LONGEST_S
    facts = ready.facts
    assert facts.events is not None
    assert (facts.events.count, facts.events.last_ns) == (HOUR_US // 1000 + 1, 1000 * HOUR_US)
    assert len(ready.spans) <= 1 << 14
    for stream in sorted(facts.streams & set(STREAMS) - {"rgb_to_event", "depth_to_event"}):
        owned = [span.owned[stream] for span in ready.spans if stream in span.owned]
        rows = facts.events.count if stream == "events" else len(facts.clocks[stream].times_ns)
        assert (owned[0][0], owned[-1][1]) == (0, rows), stream
        assert all(before[1] == after[0] for before, after in pairwise(owned)), stream
