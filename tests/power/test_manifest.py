"""A manifest is read as docs/corpus.md describes it, and what is wrong with one is said."""

import json
from pathlib import Path
from typing import Any

import pytest

from fedora_qa.errors import MisuseError
from fedora_qa.power.manifest import Manifest, PlantedFault, read_manifest, require_files

LATE = {"file": "late.h5", "base": "day.h5", "cause": "time_offset", "stream": "events", "magnitude": 2.0, "unit": "ms"}


def write(folder: Path, *items: dict[str, Any], version: int = 1) -> Manifest:
    (folder / "manifest.json").write_text(json.dumps({"corpus_version": version, "items": items}))
    return read_manifest(folder)


def test_the_least_that_a_manifest_can_say(tmp_path: Path) -> None:
    """File, base, cause, stream, magnitude and unit are enough; what is not known beyond them is ignored."""
    clean, late = write(tmp_path, {"file": "day.h5", "scene": "park-day"}, LATE).items
    assert clean.is_clean
    assert (late.kind, late.planted[0].name, late.planted[0].magnitude) == ("single", "events:time_offset", 2.0)


@pytest.mark.parametrize(
    ("faults", "kind"),
    [
        ([{}], "single"),
        ([{"start_s": 0.5, "stop_s": 1.0}], "local"),
        ([{"region": [0, 0, 4, 4]}], "local"),
        ([{}, {}], "composite"),
    ],
)
def test_kinds_of_faults(tmp_path: Path, faults: list[dict[str, Any]], kind: str) -> None:
    """A fault of a part is local, several are composite, whatever folder the file lies in."""
    every = [{"cause": "time_offset", "stream": "rgb", "magnitude": 1.0, "unit": "ms"} | one for one in faults]
    _, item = write(tmp_path, {"file": "day.h5"}, LATE | {"faults": every}).items
    assert item.kind == kind


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"cause": "lateness"}, "the cause 'lateness', which does not exist"),
        ({"stream": None}, "without a stream"),
        ({"base": "night.h5"}, "the base night.h5, which is no clean file"),
        ({"file": "../late.h5"}, "not beneath the manifest's folder"),
        ({"file": "day.h5"}, "the same file twice"),
        ({"magnitude": "much"}, "at items.1.magnitude"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, wrong: dict[str, Any], said: str) -> None:
    """An illegal item is misuse, and the message says which and why."""
    with pytest.raises(MisuseError, match=said):
        write(tmp_path, {"file": "day.h5"}, LATE | wrong)


def test_another_version_is_refused(tmp_path: Path) -> None:
    """A manifest of a later version is not guessed at."""
    with pytest.raises(MisuseError, match="corpus_version"):
        write(tmp_path, {"file": "day.h5"}, version=2)


@pytest.mark.parametrize("text", [None, "{", "[]", '{"corpus_version": 1, "items": []}'])
def test_what_is_no_manifest(tmp_path: Path, text: str | None) -> None:
    """A missing, damaged or empty manifest is misuse."""
    if text is not None:
        (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(MisuseError, match=r"manifest\.json"):
        read_manifest(tmp_path)


def test_files_must_be_there_as_listed(tmp_path: Path) -> None:
    """A missing file, and one of another size, are named before any work."""
    manifest = write(tmp_path, {"file": "day.h5", "bytes": 3}, LATE)
    (tmp_path / "day.h5").write_bytes(b"ab")
    with pytest.raises(MisuseError, match=r"day\.h5, late\.h5 missing or of another size"):
        require_files(tmp_path, manifest)
    (tmp_path / "day.h5").write_bytes(b"abc")
    (tmp_path / "late.h5").write_bytes(b"")
    require_files(tmp_path, manifest)


@pytest.mark.parametrize(
    ("direction_deg", "signed"), [(None, 2.0), (0.0, 2.0), (100.0, 2.0), (170.0, -2.0), (260.0, -2.0), (350.0, 2.0)]
)
def test_a_shift_in_a_direction_has_the_sign_of_its_larger_component(
    direction_deg: float | None, signed: float
) -> None:
    """As sizes of diagnoses have: positive to the right and down, 90 deg being down."""
    fault = PlantedFault("spatial_offset", "flow", 2.0, "px", direction_deg=direction_deg)
    assert fault.signed_magnitude == pytest.approx(signed)
