"""The study of named causes plants what it says, and counts right."""

from dataclasses import replace

from fedora_generator.scene import load_scene
from fedora_qa.causes import CAUSES
from tests.benchmarks.named_causes import SIZE, Named, page, planned_faults

FAULT = Named("park-day", "single", "events", "time_offset", 2.0, "ms", "", True, ("events:time_offset",))


def test_every_cause_is_planted() -> None:
    """All that can be: with noise of IMU, pose and events all but what has no size at all."""
    planned = planned_faults(load_scene("park-noisy").with_size(*SIZE))
    assert {one.faults[0].cause for one in planned} == set(CAUSES) - {"unknown"}
    assert {one.file.split("/")[0] for one in planned} == {"single", "local"}


def test_shares_are_counted() -> None:
    """Found, named, and blamed on another stream are three things."""
    missed = replace(FAULT, found=False, diagnoses=())
    blamed = replace(FAULT, kind="local", notes="half of the time", diagnoses=("rgb:time_offset", "events:time_offset"))
    text = "".join(page([FAULT, missed, blamed]))
    assert "2 of 3 faults are detected (66.7%). 1 of those are named first (50.0%)." in text
    assert "| whole file | 2 | 1 | 1 |" in text
    assert "| part of it | 1 | 1 | 0 |" in text
    assert "| time_offset | 3 | 2 | 1 |" in text
    assert "park-day, events:time_offset 2 ms, half of the time: rgb:time_offset, events:time_offset" in text
    assert "park-day, events:time_offset 2 ms: nothing" in text
