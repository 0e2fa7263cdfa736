"""A declared low-pass of the event sensor: correct files do not fail, and lost events are detected."""

import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from fedora_generator.generate import Request, generate_sequence
from fedora_generator.scene import load_scene
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import Result

CONSERVATION = "event_response.conservation"


def write_sequence(path: Path, scene_name: str, bandwidth_hz: float) -> None:
    scene = load_scene(scene_name).with_size(180, 136).starting_at(0.5)
    scene = replace(scene, events=replace(scene.events, bandwidth_hz=bandwidth_hz))
    generate_sequence(scene, path, Request(duration_s=0.5, streams=frozenset({"rgb", "events"}), quality="draft"))


def conservation_of(path: Path) -> Result:
    record = check_file(path, CheckOptions(evidence=None, profile="strict", select=(CONSERVATION,))).record
    (result,) = (result for result in record.results if result.check == CONSERVATION)
    return result


@pytest.mark.parametrize("bandwidth_hz", [20.0, 50.0])
def test_a_turn_that_is_faster_than_the_sensor_has_no_alarm(bandwidth_hz: float, tmp_path: Path) -> None:
    """Texture that turns back within the time constant leaves no events: frames contradict no correct file."""
    write_sequence(tmp_path / "a.h5", "fast-turn", bandwidth_hz)
    assert conservation_of(tmp_path / "a.h5").outcome == "not_observable"


def test_lost_events_are_detected_behind_a_low_pass(tmp_path: Path) -> None:
    """Pixels that have settled bound the sum of events: a clean file passes, and fails without the events of 0.1 s."""
    clean, lossy = tmp_path / "clean.h5", tmp_path / "lossy.h5"
    write_sequence(clean, "park-day", 200.0)
    shutil.copyfile(clean, lossy)
    with h5py.File(lossy, "r+") as file:
        times_us = file["path/events/t"][...]
        kept = (times_us < 200_000) | (times_us >= 300_000)
        for key in [f"path/events/{name}" for name in "xytp"]:
            values = file[key][...][kept]
            del file[key]
            file[key] = values
        frames_us = file["path/rgb_ts"][...]
        file["metadata/rgb_to_event"][...] = np.searchsorted(file["path/events/t"][...], frames_us)
    passed, failed = conservation_of(clean), conservation_of(lossy)
    assert passed.outcome == "passed"
    assert failed.outcome == "failed"
    (share,) = (each for each in passed.measurements if each.name == "violating_pixels")
    assert share.least_detectable is not None
    assert share.least_detectable < 0.01
