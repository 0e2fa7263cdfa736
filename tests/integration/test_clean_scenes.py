"""Clean sequences of every scene are clean, whole or with any stream left out."""

import shutil
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import h5py
import pytest

from fedora_generator.choices import SCENE_NAMES, STREAMS
from fedora_generator.flights.presets import PRESET_NAMES
from fedora_generator.generate import Request, generate_sequence
from fedora_qa.engine.options import CheckOptions
from fedora_qa.engine.tasks import check_file
from fedora_qa.record.types import FileRecord
from tests.support.all_checks import CHECKS
from tests.support.sequences import CleanSequence, small_scene

SCENES = [name for name in SCENE_NAMES if name not in PRESET_NAMES]

WITHOUT_EVIDENCE = CheckOptions(evidence=None)
"""Pictures for reports follow the results, and alter none."""


def outcomes(record: FileRecord) -> dict[str, str]:
    return {result.check: result.outcome for result in record.results}


def alarms(record: FileRecord) -> list[str]:
    return [f"{r.check}: {r.outcome} {[f.message for f in r.findings]} {r.traceback}" for r in record.results
            if r.outcome in {"failed", "crashed"}]  # fmt: skip


@pytest.fixture(scope="module")
def checked(clean_sequence: CleanSequence) -> Callable[[str], FileRecord]:
    """The record of a clean scene, which is checked once."""
    return cache(lambda scene: check_file(clean_sequence(scene), WITHOUT_EVIDENCE).record)


@pytest.fixture(scope="module")
def whole(checked: Callable[[str], FileRecord]) -> dict[str, str]:
    """The outcome of each check for the park by day with all its streams."""
    return outcomes(checked("park-day"))


@pytest.mark.parametrize("scene", SCENES)
def test_clean_scene_is_clean(scene: str, checked: Callable[[str], FileRecord]) -> None:
    """Day and night, fast and still, with every noise and without: no check fails, and some hold streams together."""
    record = checked(scene)
    assert not alarms(record)
    assert record.verdict == "clean"
    assert record.diagnoses == ()


@pytest.mark.parametrize("scene", PRESET_NAMES)
def test_the_papers_sequences_are_clean(scene: str, tmp_path: Path) -> None:
    """Half a second in the middle of a long flight, as coarse as still says something: no check fails.

    In steps of 2 ms every check has the outcome that it has in those of 1 ms.
    """
    path = tmp_path / "a.h5"
    coarse = replace(small_scene(scene, 180, 136), event_step_us=2000)
    generate_sequence(coarse.starting_at(20.0), path, Request(duration_s=0.5, quality="draft"))
    record = check_file(path, WITHOUT_EVIDENCE).record
    assert not alarms(record)
    assert record.verdict == "clean"


ALSO_LEFT_OUT = {"events": ("metadata/rgb_to_event", "metadata/depth_to_event"), "depth": ("metadata/depth_range",)}
"""Datasets of other names that mean nothing without a stream."""


@pytest.mark.parametrize("stream", STREAMS)
def test_a_stream_left_out_costs_only_what_needs_it(
    stream: str, whole: dict[str, str], small_park_day: Path, tmp_path: Path
) -> None:
    """What needs the stream is not applicable; everything else gives the outcome that it gives for the whole file.

    The file is what the generator writes without the stream: what it leaves out changes nothing else.
    """
    path = Path(shutil.copyfile(small_park_day, tmp_path / "without.h5"))
    owned = [f"metadata/{stream}", f"metadata/cameras/{stream}", f"metadata/{stream}_to_event"]
    owned += [f"path/{stream}", f"path/{stream}_ts", *ALSO_LEFT_OUT.get(stream, ())]
    with h5py.File(path, "r+") as file:
        for name in owned:
            if name in file:
                del file[name]
        assert f"path/{stream}" not in file
    record = check_file(path, WITHOUT_EVIDENCE).record
    assert not alarms(record)
    assert record.verdict == "clean"
    outcome_of = outcomes(record)
    for check in CHECKS:
        expected = "not_applicable" if needs(check.needs, stream) else whole[check.name]
        if (check.name, stream) == ("clocks.resolution", "events"):
            expected = "not_observable"  # what is left are exact clocks, on which any grid may lie
        assert outcome_of[check.name] == expected, check.name


def needs(needed: tuple[str, ...], stream: str) -> bool:
    """Whether a check needs a stream, or an index map that falls away with it."""
    maps = {"rgb": {"rgb_to_event"}, "depth": {"depth_to_event"}, "events": {"rgb_to_event", "depth_to_event"}}
    # Flow lies on the grid of the depth camera, whose declaration goes with the stream; frames have their own.
    grid = stream == "depth" and {"flow", "events"} <= set(needed)
    return grid or bool(set(needed) & ({stream} | maps.get(stream, set())))
